"""Environment: the light that arrives at one place from all directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment.cube import sample
from impostor.errors import SettingsError

MIN_FACE, MAX_FACE = 8, 4096


@dataclass(frozen=True, eq=False)
class Environment:
    """The light that arrives at one place from all directions.

    Parameters
    ----------
    name : str
        Where it comes from; errors and displays show it.
    faces : ndarray, (6, N, N, 3) float32
        Linear radiance in the order and handedness of `cube.FACE_AXES`; N is a power of two. Made read-only.

    Raises
    ------
    SettingsError
        Another shape, or a texel that is negative or not finite.
    """

    name: str
    faces: NDArray[np.float32]

    def __post_init__(self):
        faces = np.ascontiguousarray(self.faces, np.float32)
        size = faces.shape[1] if faces.ndim == 4 else 0
        if faces.shape != (6, size, size, 3) or not MIN_FACE <= size <= MAX_FACE or size & (size - 1):
            wanted = f"(6, N, N, 3), N a power of two from {MIN_FACE} to {MAX_FACE}"
            raise SettingsError(self.name, f"faces of shape {faces.shape}; expected {wanted}")
        if not np.isfinite(faces).all() or faces.min() < 0:
            raise SettingsError(self.name, "radiance that is negative or not finite; expected numbers of at least 0")
        faces.flags.writeable = False
        object.__setattr__(self, "faces", faces)

    @property
    def size(self) -> int:
        """Side of a face in texels."""
        return self.faces.shape[1]

    def radiance(self, directions: ArrayLike) -> NDArray[np.float32]:
        """Light from some directions (..., 3) of any length, (..., 3) float32; bilinear."""
        return sample(self.faces, directions)
