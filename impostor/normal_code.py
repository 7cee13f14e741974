"""Normal codes: one byte a pixel that names one of the paper's 225 normals, and 255 for background.

The unit disc of (x, y) is cut by a 17 x 17 grid of radius 17/2 cells. The cells (i, j), both in -8..8, whose centre
lies in the disc are the 225 normals: x = i / 8.5, y = j / 8.5, z = sqrt(1 - x^2 - y^2). Codes 0..224 go row by row:
j runs -8..8, and inside one j, i runs upward, so code 0 is the leftmost cell of the lowest row, code 112 is (0, 0, 1)
and code 224 - c is code c mirrored through the axis. Codes 225..254 are never written and decode as background.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.errors import SettingsError

BACKGROUND = 255
RADIUS = 8.5  # cells, the paper's 17 / 2
CODE_COUNT = 225
UNIT_TOLERANCE = 0.02  # how far a normal's length may be from 1 before it is refused

DIFFUSED = np.array([1.0, 1.0, 0.9], np.float32)  # share of the error in x, y, z that goes on: see dither
ERROR_LIMIT = np.float32(1 / RADIUS)  # per component, of the error that one pixel passes on: see dither
VIEWS_AT_ONCE = 16  # views that share one wavefront: their working set stays in the processor's cache
BINS = 32  # per cell, of the table of nearest directions; even, so that bins end where cells end
REACH = 9  # cells from the centre to the edge cell of the look-up tables: one past the grid


def _cells() -> NDArray[np.int8]:
    j, i = np.mgrid[-8:9, -8:9]
    return np.stack([i, j], axis=-1)[i**2 + j**2 <= RADIUS**2].astype(np.int8)


def _normals(cells: NDArray[np.int8]) -> NDArray[np.float32]:
    xy = cells / RADIUS
    normals = np.zeros((256, 3), np.float32)
    normals[: len(cells)] = np.column_stack([xy, np.sqrt(1 - (xy**2).sum(axis=1))])
    return normals


def _code_grid(cells: NDArray[np.int8]) -> NDArray[np.uint8]:
    """Code of cell (i, j) at [j + REACH, i + REACH]; BACKGROUND where the grid has none."""
    grid = np.full((2 * REACH + 1, 2 * REACH + 1), BACKGROUND, np.uint8)
    i, j = cells.T.astype(int) + REACH
    grid[j, i] = np.arange(len(cells))
    return grid


def _rim_codes(grid: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Codes with a missing neighbour: only they can be nearest to a point outside their own square."""
    empty = grid == BACKGROUND
    beside_empty = sum(np.roll(empty, shift, axis) for axis in (0, 1) for shift in (-1, 1)) > 0
    return grid[beside_empty & ~empty]


CODE_TO_CELL = _cells()
BYTE_TO_NORMAL = _normals(CODE_TO_CELL)
_GRID = _code_grid(CODE_TO_CELL)
_RIM = _rim_codes(_GRID)
_COMPONENTS = np.ascontiguousarray(BYTE_TO_NORMAL.T)
for _table in (CODE_TO_CELL, BYTE_TO_NORMAL, _GRID, _RIM, _COMPONENTS):
    _table.setflags(write=False)


def encode(normals: ArrayLike, mask: ArrayLike | None = None) -> NDArray[np.uint8]:
    """Code of the nearest of the 225 normals, each pixel on its own.

    Parameters
    ----------
    normals : array_like, (..., 3) float
        View-space unit normals. One that faces away (z < 0) is taken as the nearest one that does not.
    mask : array_like, (...) bool, optional
        True where there is a normal; other pixels become BACKGROUND. Default: everywhere.

    Returns
    -------
    ndarray, (...) uint8
        0..224, or BACKGROUND.

    Raises
    ------
    SettingsError
        For a wrong shape or type, or a normal under the mask that is not of unit length.

    Notes
    -----
    Nearest by distance in (x, y), exactly. That distance is at most 0.71 cells (0.083) where the point's own cell is
    kept and 0.97 cells (0.114) at the rim, because [1, 0, 0] and its neighbours are not representable.

    References
    ----------
    Dinh, Metoyer, Turk, "Real-Time Lighting Changes for Image-Based Rendering", the 225 normals.
    """
    normals, mask = _checked(normals, mask, ndim=None)
    covered = _facing(normals[mask])[..., :2] * RADIUS
    nearest = np.rint(covered).astype(np.int8)
    codes = _GRID[nearest[:, 1] + REACH, nearest[:, 0] + REACH]
    outside = codes == BACKGROUND
    codes[outside] = _nearest_at_rim(covered[outside])
    out = np.full(mask.shape, BACKGROUND, np.uint8)
    out[mask] = codes
    return out


def decode(codes: ArrayLike) -> NDArray[np.float32]:
    """View-space unit normals of codes.

    Parameters
    ----------
    codes : array_like, (...) uint8

    Returns
    -------
    ndarray, (..., 3) float32
        Zero for BACKGROUND.

    Raises
    ------
    SettingsError
        For codes that are not uint8.
    """
    codes = np.asarray(codes)
    if codes.dtype != np.uint8:
        raise SettingsError("codes", f"dtype is {codes.dtype}; expected uint8")
    return BYTE_TO_NORMAL[codes]


def palette() -> NDArray[np.uint8]:
    """The normals as colours of an ordinary normal map, for the palette of a picture of codes.

    Returns
    -------
    ndarray, (256, 3) uint8
        127.5 + 127.5 n, rounded, for codes 0..224; black for the rest, so that the silhouette stands out.
    """
    colors = np.rint(127.5 + 127.5 * BYTE_TO_NORMAL).astype(np.uint8)
    colors[CODE_COUNT:] = 0
    return colors


def dither(normals: ArrayLike, mask: ArrayLike) -> NDArray[np.uint8]:
    """Codes whose local mean follows the normals, by Floyd-Steinberg error diffusion.

    Parameters
    ----------
    normals : array_like, (V, H, W, 3) float
        View-space unit normals of each view, row 0 at the top. Read under the mask only.
    mask : array_like, (V, H, W) bool
        The silhouette: True where there is a normal.

    Returns
    -------
    ndarray, (V, H, W) uint8
        0..224 under the mask, BACKGROUND elsewhere.

    Raises
    ------
    SettingsError
        For a wrong shape or type, or a normal under the mask that is not of unit length.

    Notes
    -----
    Pixels with equal x + 2y do not depend on each other, so W + 2H vector steps cover an image; views share them.

    Weights 7, 3, 5, 1 go to the right, lower left, lower and lower right neighbour; those outside the silhouette get
    none and the others share theirs, so no error crosses it. Four things differ from the plain method, which keeps the
    mean of x and y and so always darkens (z is concave in them), and which piles up error without bound where a normal
    lies beyond the grid's rim: the error of z is diffused too, by nine tenths; the code is the nearest by angle to the
    corrected normal; each component of a passed error is limited to one cell; shares are given to covered pixels only.

    Shading error after a Gaussian of 3 pixels, over that of `encode`, lit 256-pixel sphere, three lights: plain 0.31 to
    0.38 inside 0.8 of the radius and 0.41 to 0.62 on the whole disc; limit alone (1 cell) 0.31 to 0.38 and 0.42 to
    0.61; target clamped into the grid's hull 0.32 to 0.38 and 0.45 to 0.87; this method 0.29 to 0.37 and 0.40 to 0.50.

    References
    ----------
    Floyd, Steinberg, "An Adaptive Algorithm for Spatial Grey Scale"; Dinh, Metoyer, Turk, "Dithering".
    """
    normals, mask = _checked(normals, mask, ndim=4)
    codes = np.full(mask.shape, BACKGROUND, np.uint8)
    for first in range(0, len(mask), VIEWS_AT_ONCE):
        views = slice(first, first + VIEWS_AT_ONCE)
        rows = _covered_range(mask[views], axis=1)
        columns = _covered_range(mask[views], axis=2)
        if rows.start < rows.stop:
            tile = (views, rows, columns)
            codes[tile] = _diffuse(normals[tile], mask[tile])
    return codes


def mip_codes(
    normals: ArrayLike, coverage: ArrayLike, level_count: int, mask: ArrayLike | None = None
) -> list[NDArray[np.uint8]]:
    """Dithered codes of every mip level.

    Parameters
    ----------
    normals : array_like, (V, H, W, 3) float
        View-space unit normals, valid where `coverage` > 0 and under `mask`.
    coverage : array_like, (V, H, W) float
        Share of each texel that the object covers, 0..1.
    level_count : int
        Levels wanted, level 0 included.
    mask : array_like, (V, H, W) bool, optional
        Where level 0 has codes; holds every texel with coverage. Default: coverage > 0.

    Returns
    -------
    list of ndarray, (V, ceil(H / 2^k), ceil(W / 2^k)) uint8
        Level k is dithered from the normalised mean, weighted by coverage, of the exact normals over 2^k x 2^k texels,
        wherever any of them has coverage. Blocks that reach past an odd edge count what is inside the image.

    Raises
    ------
    SettingsError
        For a wrong shape, type or number of levels, or a mask that leaves out a covered texel.

    Notes
    -----
    OpenGL rounds the size of a level down: its sizes are these only where 2^(level_count - 1) divides H and W.
    """
    coverage = _checked_coverage(coverage)
    mask = coverage > 0 if mask is None else np.asarray(mask)
    normals, mask = _checked(normals, mask, ndim=4)
    if coverage.shape != mask.shape:
        raise SettingsError("coverage", f"shape is {coverage.shape}; expected {mask.shape} as in normals")
    if np.any((coverage > 0) & ~mask):
        raise SettingsError("mask", "a texel with coverage is outside; expected every texel with coverage inside")
    most = 1 + int(max(*mask.shape[1:], 1) - 1).bit_length()
    if not 1 <= level_count <= most:
        raise SettingsError("level_count", f"{level_count}; expected 1..{most} for {mask.shape[2]}x{mask.shape[1]}")
    levels = [dither(normals, mask)]
    weighted = np.where(mask[..., None], normals, 0) * coverage[..., None]
    for _ in range(1, level_count):
        weighted, coverage = _sum_blocks(weighted), _sum_blocks(coverage)
        mean = weighted / np.maximum(coverage, np.finfo(coverage.dtype).tiny)[..., None]
        levels.append(dither(_unit(mean), coverage > 0))
    return levels


def _checked(normals: ArrayLike, mask: ArrayLike | None, ndim: int | None) -> tuple[NDArray, NDArray[np.bool_]]:
    normals = np.asarray(normals)
    shape = "(..., 3)" if ndim is None else "(V, H, W, 3)"
    if normals.ndim < 1 or normals.shape[-1] != 3 or ndim not in (None, normals.ndim):
        raise SettingsError("normals", f"shape is {normals.shape}; expected {shape}")
    if not np.issubdtype(normals.dtype, np.floating):
        raise SettingsError("normals", f"dtype is {normals.dtype}; expected a floating-point one")
    mask = np.ones(normals.shape[:-1], bool) if mask is None else np.asarray(mask)
    if mask.shape != normals.shape[:-1]:
        raise SettingsError("mask", f"shape is {mask.shape}; expected {normals.shape[:-1]} as in normals")
    if mask.dtype != np.bool_:
        raise SettingsError("mask", f"dtype is {mask.dtype}; expected bool")
    squared = np.einsum("...c,...c->...", normals, normals)
    low, high = (1 - UNIT_TOLERANCE) ** 2, (1 + UNIT_TOLERANCE) ** 2
    wrong = mask & ~((squared >= low) & (squared <= high))
    if wrong.any():
        place = tuple(int(k) for k in np.argwhere(wrong)[0])
        length = float(np.sqrt(squared[place]))
        raise SettingsError("normals", f"length at {place} is {length:.4g}; expected 1 within {UNIT_TOLERANCE}")
    return normals, mask


def _checked_coverage(coverage: ArrayLike) -> NDArray[np.floating]:
    coverage = np.asarray(coverage)
    if not np.issubdtype(coverage.dtype, np.floating):
        raise SettingsError("coverage", f"dtype is {coverage.dtype}; expected a floating-point one")
    wrong = ~((coverage >= 0) & (coverage <= 1))
    if wrong.any():
        raise SettingsError("coverage", f"holds {float(coverage[wrong][0]):.4g}; expected 0..1")
    return coverage


def _facing(normals: NDArray) -> NDArray:
    """The normals, those that face away moved to the nearest direction that does not."""
    away = normals[..., 2] < 0
    if not away.any():
        return normals
    moved = normals.copy()
    moved[away] = _unit(normals[away] * [1, 1, 0]).astype(normals.dtype)
    return moved


def _unit(vectors: NDArray) -> NDArray:
    """Vectors of length 1; (0, 0, 1) for those of no length."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > 1e-6, vectors / np.maximum(length, 1e-6), np.array([0, 0, 1], vectors.dtype))


def _nearest_at_rim(points: NDArray) -> NDArray[np.uint8]:
    """Codes nearest to (n, 2) points, in cells, that lie in no kept cell."""
    cells = CODE_TO_CELL[_RIM].astype(points.dtype)
    codes = np.empty(len(points), np.uint8)
    for first in range(0, len(points), 65536):  # bounds the memory of the distances
        part = slice(first, first + 65536)
        distance = ((points[part, None] - cells) ** 2).sum(axis=-1)
        codes[part] = _RIM[distance.argmin(axis=1)]
    return codes


def _sum_blocks(image: NDArray) -> NDArray:
    """Sums over 2 x 2 texels of a (V, H, W, ...) stack; an odd last row or column stands alone."""
    height, width = image.shape[1:3]
    edge = [(0, 0)] * image.ndim
    edge[1], edge[2] = (0, height % 2), (0, width % 2)
    image = np.pad(image, edge)
    rows = image[:, 0::2] + image[:, 1::2]
    return rows[:, :, 0::2] + rows[:, :, 1::2]


def _covered_range(mask: NDArray[np.bool_], axis: int) -> slice:
    covered = np.flatnonzero(mask.any(axis=tuple({0, 1, 2} - {axis})))
    return slice(int(covered[0]), int(covered[-1]) + 1) if covered.size else slice(0, 0)


def _direction_codes() -> NDArray[np.uint8]:
    """Code nearest by angle to each bin of (x, y), over a square of 2 REACH + 1 cells; flat, row by row."""
    side = (2 * REACH + 1) * BINS
    steps = ((np.arange(side) + 0.5) / BINS - (REACH + 0.5)) / RADIUS
    codes = np.empty((side, side), np.uint8)
    normals = BYTE_TO_NORMAL[:CODE_COUNT]
    for row, y in enumerate(steps):
        z = np.sqrt(np.maximum(1 - steps**2 - y**2, 0))
        codes[row] = (np.column_stack([steps, np.full(side, y), z]) @ normals.T).argmax(axis=1)
    return codes.ravel()


_NEAREST_DIRECTION = _direction_codes()
_NEAREST_DIRECTION.setflags(write=False)


def _skew(image: NDArray, dtype: type[np.generic]) -> NDArray:
    """A (C, V, H, W) stack laid out as [x + 2y, C, y, V], so that pixels processed together are neighbours."""
    channels, views, height, width = image.shape
    out = np.empty((width + 2 * (height - 1), channels, height, views), dtype)
    for y in range(height):
        out[2 * y : 2 * y + width, :, y] = image[:, :, y].transpose(2, 0, 1)
    return out


def _unskew(skewed: NDArray, width: int) -> NDArray:
    """The (V, H, W) stack of a one-channel skewed image [x + 2y, y, V]."""
    height, views = skewed.shape[1:]
    out = np.empty((views, height, width), skewed.dtype)
    for y in range(height):
        out[:, y] = skewed[2 * y : 2 * y + width, y].T
    return out


def _wavefront(height: int, width: int) -> Iterator[tuple[int, int, int]]:
    """Each x + 2y in turn with its range of rows."""
    for step in range(width + 2 * (height - 1)):
        yield step, max(0, (step - width + 2) // 2), min(height, step // 2 + 1)


def _share_gain(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """What scales a pixel's error so that its covered neighbours share all of it; 0 where it has none."""
    covered = np.pad(mask, ((0, 0), (0, 1), (1, 1))).astype(np.uint8)
    here, below = covered[:, :-1], covered[:, 1:]
    weight = 7 * here[:, :, 2:] + 3 * below[:, :, :-2] + 5 * below[:, :, 1:-1] + below[:, :, 2:]
    gain = np.zeros(17, np.float32)
    gain[1:] = 1 / np.arange(1, 17)
    return gain[weight * mask]


def _diffuse(normals: NDArray, mask: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Dither the views of one wavefront; arguments as in `dither`."""
    views, height, width = mask.shape
    width += 1  # an uncovered column on the right, where the errors of finished rows become zero
    edge = ((0, 0), (0, 0), (0, 1))
    covered = np.where(mask[..., None], normals, np.float32(0)).astype(np.float32, copy=False)
    wanted = _skew(np.pad(np.moveaxis(_facing(covered), -1, 0), ((0, 0), *edge)), np.float32)
    gain = _skew(np.pad(_share_gain(mask), edge)[None], np.float32)[:, 0]
    codes = np.empty(gain.shape, np.uint8)
    errors = np.zeros((4, 3, height + 1, views), np.float32)  # of the last steps; row 0 is above the image
    for step, top, end in _wavefront(height, width):
        last, second, third = (errors[(step - back) % 4] for back in (1, 2, 3))
        target = 3 * last[:, top:end] + 5 * second[:, top:end]
        target += third[:, top:end]
        target += 7 * last[:, top + 1 : end + 1]
        target += wanted[step, :, top:end]
        chosen = _nearest_direction(target)
        codes[step, top:end] = chosen
        target -= _COMPONENTS.take(chosen, axis=1, mode="clip")
        target *= DIFFUSED[:, None, None]
        np.clip(target, -ERROR_LIMIT, ERROR_LIMIT, out=target)
        np.multiply(target, gain[step, top:end], out=errors[step % 4, :, top + 1 : end + 1])
    return np.where(mask, _unskew(codes, width)[..., :-1], np.uint8(BACKGROUND))


def _nearest_direction(vectors: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Codes nearest by angle, to 1 / BINS of a cell, of (3, ...) vectors of any length."""
    squared = np.einsum("c...,c...->...", vectors, vectors)
    scale = np.float32(RADIUS * BINS) / np.sqrt(squared + np.float32(1e-12))
    column, row = (vectors[:2] * scale + np.float32((REACH + 0.5) * BINS)).astype(np.int32)
    return _NEAREST_DIRECTION.take(row * np.int32((2 * REACH + 1) * BINS) + column, mode="clip")
