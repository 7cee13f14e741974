"""Environment: the light that arrives at one place from all directions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment.cube import padded, sample_padded
from impostor.environment.diffuse import diffuse_faces
from impostor.environment.prefilter import prefiltered
from impostor.errors import SettingsError

MIN_FACE, MAX_FACE = 8, 4096
FACE_SIZES = f"a power of two from {MIN_FACE} to {MAX_FACE}"


def is_face_size(size: object) -> bool:
    """Whether faces may have that side, in texels: FACE_SIZES."""
    return isinstance(size, int | np.integer) and MIN_FACE <= int(size) <= MAX_FACE and not int(size) & (int(size) - 1)


@dataclass(frozen=True, eq=False)
class Environment:
    """The light that arrives at one place from all directions.

    Parameters
    ----------
    name : str
        Where it comes from; errors and displays show it.
    faces : ndarray, (6, N, N, 3) float32
        Linear radiance in the order and handedness of `cube.FACE_AXES`; N is a power of two. Made read-only.
    sources : bool
        Whether to look for bright lights in it; a sky whose sun is a light of its own has none to find.

    Raises
    ------
    SettingsError
        Another shape, or a texel that is negative or not finite.
    """

    name: str
    faces: NDArray[np.float32]
    sources: bool = True

    def __post_init__(self):
        faces = np.array(self.faces, np.float32, order="C")
        size = faces.shape[1] if faces.ndim == 4 else 0
        if faces.shape != (6, size, size, 3) or not is_face_size(size):
            raise SettingsError(self.name, f"faces of shape {faces.shape}; expected (6, N, N, 3), N {FACE_SIZES}")
        if not np.isfinite(faces).all() or faces.min() < 0:
            raise SettingsError(self.name, "radiance that is negative or not finite; expected numbers of at least 0")
        faces.flags.writeable = False
        object.__setattr__(self, "faces", faces)

    @classmethod
    def between(cls, name: str, first: Environment, second: Environment, share: float) -> Environment:
        """A mix of two environments of one size, `share` of it the second.

        It is convolved already: a convolution of a mix is the mix of convolutions.
        """
        made = cls(name, _mix(first.faces, second.faces, share), first.sources or second.sources)
        # Where a cached property keeps what it has worked out.
        made.__dict__["diffuse"] = _mix(first.diffuse, second.diffuse, share)
        levels = zip(first.levels[1:], second.levels[1:], strict=True)
        made.__dict__["levels"] = made.faces, *(_mix(*each, share) for each in levels)
        return made

    @property
    def size(self) -> int:
        """Side of a face in texels."""
        return self.faces.shape[1]

    def radiance(self, directions: ArrayLike) -> NDArray[np.float32]:
        """Light from some directions (..., 3) of any length, (..., 3) float32; bilinear."""
        return sample_padded(self._padded, directions)

    @cached_property
    def diffuse(self) -> NDArray[np.float32]:
        """Cosine-weighted mean radiance around every normal: irradiance / pi, (6, 32, 32, 3) float32."""
        return diffuse_faces(self.faces)

    @cached_property
    def levels(self) -> tuple[NDArray[np.float32], ...]:
        """What surfaces of roughness k / (K - 1) mirror, each (6, n_k, n_k, 3) float32, n_k = size >> k down to 8."""
        return prefiltered(self.faces)

    def mirrored(self, directions: ArrayLike, roughness: ArrayLike) -> NDArray[np.float32]:
        """Radiance as surfaces of some roughness mirror it: bilinear in `levels`, linear between them.

        Parameters
        ----------
        directions : array_like, (..., 3) float
            Of any length but 0.
        roughness : array_like, (...) float
            0 to 1.

        Returns
        -------
        ndarray, (..., 3) float32
        """
        roughness = np.clip(np.asarray(roughness, np.float32), 0, 1)[..., None]
        if not roughness.any():
            return self.radiance(
                np.broadcast_to(directions, np.broadcast_shapes(np.shape(directions), roughness.shape))
            )
        height = roughness * (len(self.levels) - 1)
        out = np.float32(0)
        for number, faces in enumerate(self._padded_levels):
            weight = np.maximum(1 - np.abs(height - number), 0)
            if weight.any():
                out = out + weight * sample_padded(faces, directions)
        return np.asarray(out)

    @cached_property
    def _padded(self) -> NDArray[np.float32]:
        return padded(self.faces)

    @cached_property
    def _padded_levels(self) -> tuple[NDArray[np.float32], ...]:
        return self._padded, *(padded(level) for level in self.levels[1:])


def _mix(first: NDArray[np.float32], second: NDArray[np.float32], share: float) -> NDArray[np.float32]:
    return (first * (1 - share) + second * share).astype(np.float32)
