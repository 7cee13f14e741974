"""Texture synthesis in the space of reflectance functions: a PTM of any size that tiles, from a piece of one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar, cast

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from impostor.errors import SettingsError
from impostor.ptm.mipmaps import light_gram
from impostor.ptm.polynomials import Polynomials
from impostor.ptm.quantise import Ptm

AnyPtm = TypeVar("AnyPtm", Polynomials, Ptm)
AnyTexels = TypeVar("AnyTexels", NDArray[np.float32], NDArray[np.uint8])
TOLERANCE = 0.1  # A patch is drawn from those whose overlap is at most so much worse than the best one's.
OVERLAP = 4  # A patch overlaps the next one by a fourth.
SMALLEST_PATCH = 8
MOST_TEXELS = 4096 * 4096
LOST_VARIANCE = 0.001


def synthesise(
    ptm: AnyPtm,
    size: tuple[int, int],
    patch: int = 48,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> AnyPtm:
    """Quilt a PTM of another size out of patches of one; the result repeats without a seam.

    Parameters
    ----------
    ptm : Polynomials or Ptm
        Of a surface that is much alike everywhere.
    size : tuple of int
        Width and height of the result in texels: at least `patch`, at most `MOST_TEXELS` together.
    patch : int
        Side of a patch, about: larger than what the surface is made of, 8 or more.
    seed : int
        0 or more; the same seed gives the same texture.
    progress : callable, optional
        Called with patches laid and patches in all.

    Returns
    -------
    Polynomials or Ptm
        As the given one; its texels differ from their neighbours as they do in that.

    Raises
    ------
    SettingsError
        The sizes do not go together, or the seed is negative.

    Notes
    -----
    A patch is sought, and cut out, by the distance between reflectance functions: the mean squared difference of
    their RGB over all light directions, so that no light shows a seam that another hides. What is left of a seam is
    spread over its surroundings: coefficients are linear, so that differences between texels can be summed up anew.

    References
    ----------
    HPL-2004-225, "Texture Synthesis"; Hel-Or, Malzbender, Gelb 2003; Efros and Freeman 2001 (image quilting);
    Perez, Gangnet, Blake 2003 (differences summed up, as a Poisson equation).
    """
    if min(ptm.size) < SMALLEST_PATCH:
        found = f"{ptm.size[0]}x{ptm.size[1]} texels"
        raise SettingsError("PTM", f"{found}; expected sides of {SMALLEST_PATCH} or more, to cut patches from")
    polynomials = ptm.polynomials() if isinstance(ptm, Ptm) else ptm
    rows, columns = quilt(reflectance_features(polynomials), size, patch, seed, progress)
    fields = ("coefficients", "color", "chroma")
    texels = {name: getattr(ptm, name) for name in fields if getattr(ptm, name) is not None}
    return replace(ptm, **{name: without_seams(array, rows, columns) for name, array in texels.items()})


def without_seams(texels: AnyTexels, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> AnyTexels:
    """Texels taken from here and there whose differences across the seams are those of their surroundings.

    Parameters
    ----------
    texels : ndarray of shape (H, W, ...), float32 or uint8
    rows, columns : ndarray of shape (height, width), intp
        Where each texel of the result comes from; the result is a torus.

    Returns
    -------
    ndarray of shape (height, width, ...), as `texels`
        Of the mean of what was taken; where there is no seam between two texels, their difference is nearly kept.
    """
    made = np.empty((*rows.shape, *texels.shape[2:]), texels.dtype)
    for plane in np.ndindex(texels.shape[2:]):  # one at a time: its transforms are many times as large as itself
        summed = _plane_without_seams(texels[(..., *plane)], rows, columns)
        made[(..., *plane)] = np.rint(np.clip(summed, 0, 255)) if texels.dtype == np.uint8 else summed
    return cast(AnyTexels, made)


def _plane_without_seams(texels: AnyTexels, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> NDArray[np.float32]:
    taken = texels[rows, columns].astype(np.float32)
    divergence = np.zeros_like(taken)
    for axis, positions in ((0, rows), (1, columns)):
        ahead = _differences(texels, rows, columns, positions, axis)
        divergence += ahead - np.roll(ahead, 1, axis)
    height, width = rows.shape
    response = 2 * np.cos(2 * np.pi * np.fft.fftfreq(height))[:, None] + 2 * np.cos(2 * np.pi * np.fft.rfftfreq(width))
    response -= 4
    response[0, 0] = 1
    spectrum = np.asarray(scipy.fft.rfft2(divergence))
    spectrum /= response.astype(np.float32)
    spectrum[0, 0] = taken.sum()
    return np.asarray(scipy.fft.irfft2(spectrum, (height, width)))


def _differences(
    texels: AnyTexels, rows: NDArray[np.intp], columns: NDArray[np.intp], positions: NDArray[np.intp], axis: int
) -> NDArray[np.float32]:
    """From each texel to the next one along an axis: the mean of what both their patches say of it."""
    last = texels.shape[axis] - 1
    found = []
    for from_next in (False, True):
        at = np.roll(positions, -1, axis) - 1 if from_next else positions
        beyond = np.clip(at, 0, last - 1)
        other = np.roll(columns if axis == 0 else rows, -1, axis) if from_next else columns if axis == 0 else rows
        here, there = ((beyond, other), (beyond + 1, other)) if axis == 0 else ((other, beyond), (other, beyond + 1))
        found.append(texels[there].astype(np.float32) - texels[here])
    return (found[0] + found[1]) / 2


def reflectance_features(polynomials: Polynomials) -> NDArray[np.float32]:
    """Vectors whose squared distance is that of two texels' RGB, in the mean over all light directions.

    Parameters
    ----------
    polynomials : Polynomials

    Returns
    -------
    ndarray of shape (H, W, D), float32
        In as few dimensions, 18 at most, as keep 99.9 percent of the variance.
    """
    coefficients = polynomials.coefficients
    if polynomials.color is not None:
        coefficients = coefficients * polynomials.color[..., None]
    elif polynomials.chroma is not None and polynomials.rgb_from_luma is not None:
        matrix = polynomials.rgb_from_luma
        coefficients = coefficients * matrix[:, 0, None]
        coefficients[..., 5] += polynomials.chroma @ matrix[:, 1:3].T
    height, width = coefficients.shape[:2]
    vectors = (coefficients @ np.linalg.cholesky(light_gram())).reshape(height * width, -1)
    variances, axes = np.linalg.eigh(np.cov(vectors, rowvar=False))
    kept = np.cumsum(variances) > LOST_VARIANCE * variances.sum()
    kept[-1] = True  # of equal texels, too, something is left to look at
    return (vectors @ axes[:, kept]).reshape(height, width, -1).astype(np.float32)


def quilt(
    features: NDArray[np.float32],
    size: tuple[int, int],
    patch: int,
    seed: int,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Where each texel of a quilted texture comes from.

    Parameters
    ----------
    features : ndarray of shape (H, W, D), float32
    size : tuple of int
    patch, seed, progress
        As in `synthesise`.

    Returns
    -------
    rows, columns : ndarray of shape (height, width), intp
        Of `features`.
    """
    if size[0] * size[1] > MOST_TEXELS:
        raise SettingsError(
            "size",
            f"{size[0]}x{size[1]}; expected at most {MOST_TEXELS:,} texels: the result repeats without a seam, so "
            "that a smaller one covers as large a wall",
        )
    across = _places(size[0], patch, features.shape[1], "width")
    down = _places(size[1], patch, features.shape[0], "height")
    if seed < 0:
        raise SettingsError("seed", f"{seed}; expected 0 or more")
    random = np.random.default_rng(seed)
    search = _Search(features, (down.side, across.side))
    source = np.full((size[1], size[0]), -1, np.intp)  # A torus: what a patch has beyond one edge is at the other.
    flat = features.reshape(-1, features.shape[2])
    offsets = np.arange(down.side)[:, None] * features.shape[1] + np.arange(across.side)
    for row_index, top in enumerate(down.starts):
        for column_index, left in enumerate(across.starts):
            rows = (top + np.arange(down.side))[:, None] % size[1]
            columns = (left + np.arange(across.side)) % size[0]
            old = source[rows, columns]
            filled = old >= 0
            row, column = search.draw(flat[old] * filled[..., None], filled, random)
            new = row * features.shape[1] + column + offsets
            error = np.square(flat[old] - flat[new]).sum(axis=-1)
            keep = np.zeros(old.shape, bool)
            for sides, axis, index in ((across, 1, column_index), (down, 0, row_index)):
                before, after = sides.overlaps(index)
                keep |= _cut(error, before, axis) | _cut(error[::-1, ::-1], after, axis)[::-1, ::-1]
            source[rows, columns] = np.where(keep & filled, old, new)
            if progress is not None:
                progress(row_index * len(across.starts) + column_index + 1, len(down.starts) * len(across.starts))
    return np.divmod(source, features.shape[1])


@dataclass(frozen=True)
class _Places:
    """Patches along one axis of the torus: where they start, their side and the texture's length."""

    starts: NDArray[np.intp]
    side: int
    length: int

    def overlaps(self, index: int) -> tuple[int, int]:
        """Texels that a patch shares with the one before it and with the one after it, as far as these are laid."""
        before = self.starts[index - 1] + self.side - self.starts[index] if index else 0
        last = index == len(self.starts) - 1
        return int(before), int(self.starts[index] + self.side - self.length) if last else 0


def _places(length: int, patch: int, available: int, name: str) -> _Places:
    if patch < SMALLEST_PATCH:
        raise SettingsError("patch", f"{patch}; expected {SMALLEST_PATCH} or more")
    if length < patch:
        raise SettingsError("size", f"{name} {length}; expected at least the patch's {patch}")
    overlap = patch // OVERLAP
    count = max(2, round(length / (patch - overlap)))
    side = -(-length // count) + overlap
    if side > available:
        raise SettingsError("patch", f"{side} texels of {name} {available}; expected a smaller patch")
    return _Places(np.arange(count) * length // count, side, length)


class _Search:
    """Finds patches of a source whose overlap fits: the squared distance to all of them at once, by FFT."""

    def __init__(self, features: NDArray[np.float32], side: tuple[int, int]):
        # Distances are of differences: without their mean the features lose no digits to their squares.
        self.mean = features.mean(axis=(0, 1))
        centered = features - self.mean
        self.side, self.shape = side, features.shape[:2]
        self.count = (features.shape[0] - side[0] + 1, features.shape[1] - side[1] + 1)
        self.spectrum = self._transform(centered)
        self.square = self._transform(np.square(centered).sum(axis=-1))

    def draw(
        self, overlap: NDArray[np.float32], filled: NDArray[np.bool_], random: np.random.Generator
    ) -> tuple[int, int]:
        """Row and column of a patch that fits to what is filled (features where it is, 0 elsewhere)."""
        if not filled.any():
            return int(random.integers(self.count[0])), int(random.integers(self.count[1]))
        target = (overlap - self.mean) * filled[..., None]
        product = self.square * self._transform(filled.astype(np.float32)).conj()
        product -= 2 * np.einsum("hwd,hwd->hw", self.spectrum, self._transform(target).conj())
        everywhere = np.asarray(scipy.fft.irfft2(product, self.shape))
        distance = everywhere[: self.count[0], : self.count[1]] + np.square(target).sum()
        best = max(float(distance.min()), 0.0)
        good = np.flatnonzero(distance <= max(best * (1 + TOLERANCE), float(distance.min())))
        row, column = np.unravel_index(random.choice(good), self.count)
        return int(row), int(column)

    def _transform(self, image: NDArray[np.float32]) -> NDArray[np.complex64]:
        return np.asarray(scipy.fft.rfft2(image, self.shape, axes=(0, 1)))


def _cut(error: NDArray[np.float32], overlap: int, axis: int) -> NDArray[np.bool_]:
    """Texels of a patch on the far side of the cheapest path along its overlap with the patch before it."""
    keep = np.zeros(error.shape, bool)
    if overlap == 0:
        return keep
    strip = (error if axis == 1 else error.T)[:, :overlap]
    total = strip.astype(np.float64)
    for row in range(1, len(total)):
        padded = np.pad(total[row - 1], 1, constant_values=np.inf)
        total[row] += np.minimum(np.minimum(padded[:-2], padded[1:-1]), padded[2:])
    path = np.empty(len(total), np.intp)
    path[-1] = total[-1].argmin()
    for row in range(len(total) - 2, -1, -1):
        first = max(path[row + 1] - 1, 0)
        path[row] = first + total[row, first : path[row + 1] + 2].argmin()
    inside = np.arange(overlap) < path[:, None]
    (keep if axis == 1 else keep.T)[:, :overlap] = inside
    return keep
