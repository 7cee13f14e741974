"""Panoramas to cube maps and back, and cube maps of other sizes: no light is lost on the way.

A panorama is equirectangular: its middle column looks along -Z, columns to the right of it toward +X, its top row
toward +Y.

What a panorama's texel and a face's texel have in common is computed, not sampled, so that a sun of one texel keeps
its power and its place. The light in a face's texel is a line integral around it: of the light above each point of its
edges, over the azimuth. Lines of texels are arcs of great circles, along which this has a closed form within each
texel of the panorama. Of 16 wedges (a quarter turn up from the horizon to the pole or down, run through either way)
all have the same lines, which are so worked out once.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from impostor.environment.cube import face_directions, sample, solid_angles
from impostor.errors import SettingsError

SMALLEST, LARGEST_DEFAULT = 8, 1024
_AROUND = 4, 1, 5, 0
"""The side faces as columns of a panorama meet them: +z, -x, -z, +x."""
_ACROSS = {"y": (2, 3), "z": (4, 5)}

Light = NDArray[np.float64]


def faces_from_panorama(panorama: NDArray[np.floating], size: int | None = None) -> NDArray[np.float32]:
    """A panorama as a cube map.

    Parameters
    ----------
    panorama : ndarray, (H, 2 H, 3) float
        Linear radiance.
    size : int, optional
        Side of a face, even; without it the power of two nearest to W / 4, which keeps the texels' size, up to 1024.

    Returns
    -------
    ndarray, (6, size, size, 3) float32
        Mean radiance of every texel, in the order of `cube.FACE_AXES`.

    Raises
    ------
    SettingsError
        The panorama is not twice as wide as high.

    Notes
    -----
    The integral over the sphere is kept but for rounding. A panorama that is coarser than the faces is made finer
    first.
    """
    height, width = panorama.shape[:2]
    if width != 2 * height:
        raise SettingsError("panorama", f"is {width}x{height}; expected twice as wide as high")
    size = default_size(width / 4) if size is None else size
    panorama = _quartered(_enlarged(panorama, max(int(np.ceil(4 * size / width - 0.1)), 1)))
    half, pieces = size // 2, _pieces(size, len(panorama))
    faces = np.empty((6, size, size, 3))
    for strip, (cap, right, left) in zip(_strips(panorama), _quarters(faces), strict=True):
        ahead, back = (np.diff(_gather(way, pieces), axis=0, prepend=0) for way in (strip, strip[:, ::-1]))
        cap[...] = ahead[:half] + back[:half].swapaxes(0, 1)
        right[...], left[...] = ahead[half:], back[half:]
    faces /= solid_angles(size)[..., None]
    return np.maximum(faces, 0).astype(np.float32)  # a difference may fall below zero by a rounding


def panorama_from_faces(faces: NDArray[np.floating], height: int | None = None) -> NDArray[np.float32]:
    """A cube map as a panorama.

    Parameters
    ----------
    faces : ndarray, (6, N, N, 3) float
        Linear radiance in the order of `cube.FACE_AXES`; N is even.
    height : int, optional
        Even; 2 N without it, which keeps the texels' size.

    Returns
    -------
    ndarray, (height, 2 height, 3) float32
        Mean radiance of every texel.
    """
    rows = 2 * faces.shape[1] if height is None else height
    faces = resized_faces(faces, max(round(rows / (2 * faces.shape[1])), 1) * faces.shape[1])
    pieces = _pieces(faces.shape[1], rows)
    panorama = np.empty((rows, 2 * rows, 3))
    for strip, (cap, right, left) in zip(_strips(panorama), _quarters(faces), strict=True):
        ahead, back = np.concatenate([cap, right]), np.concatenate([cap.swapaxes(0, 1), left])
        strip[...] = _scatter(ahead, pieces) + _scatter(back, pieces)[:, ::-1]
    area = -np.diff(_row_edges(rows)) * (np.pi / rows)
    return np.maximum(panorama / area[:, None, None], 0).astype(np.float32)


def resized_faces(faces: NDArray[np.floating], size: int) -> NDArray[np.float32]:
    """A cube map of another size: mean radiance over each texel, but bilinear where it grows by half or more."""
    old = faces.shape[1]
    if size == old:
        return np.asarray(faces, np.float32)
    if size >= 1.5 * old:
        return sample(np.asarray(faces, np.float32), face_directions(size))
    angles = solid_angles(old)[..., None]
    light = _binned(_binned(faces * angles, size, 1), size, 2)
    light /= _binned(_binned(angles, size, 0), size, 1)
    return np.maximum(light, 0).astype(np.float32)


def flipped_faces(faces: NDArray[np.float32], axis: str) -> NDArray[np.float32]:
    """A cube map mirrored in the plane through its middle at right angles to "y" or to "z"."""
    order = list(range(6))
    first, second = _ACROSS[axis]
    order[first], order[second] = second, first
    flipped = faces[order]
    if axis == "y":
        return flipped[:, ::-1]
    flipped[[0, 1, 4, 5]] = flipped[[0, 1, 4, 5], :, ::-1]
    flipped[[2, 3]] = flipped[[2, 3], ::-1]
    return flipped


def panorama_directions(height: int) -> NDArray[np.float64]:
    """Unit vectors through all texel centres, (height, 2 height, 3) float64."""
    down, turn = ((np.arange(count) + 0.5) * (np.pi / height) for count in (height, 2 * height))
    level = np.sin(down)[:, None]
    up = np.broadcast_to(np.cos(down)[:, None], (height, 2 * height))
    return np.stack([-level * np.sin(turn), up, level * np.cos(turn)], axis=-1)


def default_size(side: float) -> int:
    """The power of two nearest to a side in texels, from 8 to 1024."""
    return int(np.clip(2 ** round(np.log2(side)), SMALLEST, LARGEST_DEFAULT))


def _enlarged(panorama: NDArray[np.floating], factor: int) -> NDArray[np.floating]:
    """Finer by a whole factor: smooth, yet every texel keeps its light."""
    if factor == 1:
        return panorama
    heights = -np.diff(_row_edges(len(panorama)))
    finer = -np.diff(_row_edges(len(panorama) * factor)).reshape(-1, factor)
    parts = np.cumsum(finer, axis=1) / heights[:, None]
    padded = np.pad(panorama, ((1, 1), (0, 0), (0, 0)), "edge")
    taller = _refined(padded, np.pad(heights, 1, "edge"), parts)
    padded = np.pad(taller, ((0, 0), (1, 1), (0, 0)), "wrap").swapaxes(0, 1)
    count = panorama.shape[1]
    parts = np.broadcast_to(np.arange(1, factor + 1) / factor, (count, factor))
    return _refined(padded, np.ones(count + 2), parts).swapaxes(0, 1)


def _refined(light: NDArray[np.floating], widths: Light, parts: Light) -> Light:
    """Means over parts of the cells along the first axis, whose first and last cell are only neighbours.

    The sums up to each cell's end are interpolated by cubics that keep growing.

    Parameters
    ----------
    light : ndarray, (K + 2, ...) float
    widths : ndarray, (K + 2,) float64
    parts : ndarray, (K, P) float64
        Where the parts of a cell end, 1 at last.

    References
    ----------
    Fritsch, Butland, "A Method for Constructing Local Monotone Piecewise Cubic Interpolants", 1984.
    """
    aside = (1,) * (light.ndim - 1)
    first, second, wide = light[:-1].astype(np.float64), light[1:].astype(np.float64), widths.reshape(-1, *aside)
    weight, other = 2 * wide[1:] + wide[:-1], wide[1:] + 2 * wide[:-1]
    total = weight * second + other * first
    edges = (weight + other) * first * second / np.where(total > 0, total, 1)  # a harmonic mean
    at = parts.reshape(*parts.shape, *aside)
    mean, start, end = light[1:-1, None], edges[:-1, None], edges[1:, None]
    sums = mean * at**2 * (3 - 2 * at) + start * at * (1 - at) ** 2 - end * at**2 * (1 - at)
    means = np.diff(sums, axis=1, prepend=0) / np.diff(at, axis=1, prepend=0)
    return means.reshape(-1, *light.shape[1:])


def _binned(light: NDArray[np.floating], size: int, axis: int) -> Light:
    """Sums over `size` even parts of an axis; texels on their borders are shared out."""
    light = np.moveaxis(light, axis, 0).astype(np.float64)
    edges = np.arange(size + 1) * (len(light) / size)
    texel = np.minimum(edges.astype(np.intp), len(light) - 1)
    part = (edges - texel).reshape(-1, *[1] * (light.ndim - 1))
    before = np.cumsum(light, axis=0) - light
    return np.moveaxis(np.diff(before[texel] + part * light[texel], axis=0), 0, axis)


def _quartered(panorama: NDArray[np.floating]) -> NDArray[np.floating]:
    """The same light in texels that a quarter turn and the horizon do not cut."""
    return panorama.repeat(2, axis=0).repeat(2, axis=1) if len(panorama) % 2 else panorama


def _row_edges(height: int) -> NDArray[np.float64]:
    """Sines of the elevations between a panorama's rows, 1 to -1."""
    return np.cos(np.arange(height + 1) * (np.pi / height))


def _strips(panorama: NDArray[np.floating]) -> Iterator[NDArray[np.floating]]:
    """Views of a panorama's quarter turns, (H / 2, H / 2, 3): rows from a pole to the horizon; the upper ones first."""
    half = len(panorama) // 2
    for hemisphere in (panorama[:half], panorama[half:][::-1]):
        for quarter in range(4):
            yield hemisphere[:, quarter * half : (quarter + 1) * half]


def _quarters(faces: NDArray[np.floating]) -> Iterator[tuple[NDArray[np.floating], ...]]:
    """Views of what each of `_strips` meets, (N / 2, N / 2, 3): of a cap, and of the two sides below it.

    Rows and columns of the cap run outward, along the strip's first axis and along its last. Rows of a side run from
    the cap to the horizon, columns from its axis.
    """
    half = faces.shape[1] // 2
    sides = [faces[face, :, ::-1] for face in _AROUND]
    for cap, step in ((faces[2], 1), (faces[3, ::-1], -1)):
        for quarter in range(4):
            first, following = sides[quarter][::step], sides[(quarter + 1) % 4][::step]
            yield np.rot90(cap, quarter)[half:, half - 1 :: -1], first[:half, half:], following[:half, half - 1 :: -1]


class _Pieces(NamedTuple):
    """Lines of a quarter's texels, cut at all edges of texels.

    Lines 1 to N / 2 are those of the cap, outward, at right angles to the axis; lines to N those of the side, downward
    to the horizon.
    """

    edge: NDArray[np.intp]
    """Which edge of a texel: that of column j on line i is (i - 1) N / 2 + j."""
    texel: NDArray[np.intp]
    """Which texel of the strip."""
    turn: NDArray[np.float64]
    """Its length as an angle about +Y."""
    area: NDArray[np.float64]
    """Between it and the row's upper edge, steradians."""
    rows: int
    lines: int


def _pieces(size: int, height: int) -> _Pieces:
    """Cut the lines of faces of some size by a panorama of some height."""
    half, rows = size // 2, height // 2
    line = np.arange(1, size + 1)[:, None]
    out, up = np.minimum(line, half), np.minimum(size - line, half)  # the line is there times `half` from the middle
    row_edges = np.tan(np.pi / 2 - np.arange(rows + 1) * (np.pi / height))
    cosines = row_edges * (out / np.maximum(up, 1e-9))
    cuts = [np.broadcast_to(np.arange(rows + 1) * (np.pi / 2 / rows), (size, rows + 1))]
    cuts += [np.arccos(np.clip(cosines, 0, 1)), np.arctan2(np.arange(half + 1), out)]
    ends = np.where(line <= half, np.arctan2(half, out), np.pi / 4)
    angles = np.sort(np.minimum(np.concatenate(cuts, axis=1), ends), axis=1)
    # The sine of the elevation, up cos / sqrt(out² + up² cos²), summed over the angle.
    summed = np.arcsin(np.sin(angles) * (up / np.hypot(out, up)))
    turn = np.diff(angles, axis=1)
    kept = turn > 0
    middle = (angles[:, 1:] + angles[:, :-1])[kept] / 2
    out, up, line = (np.broadcast_to(values, kept.shape)[kept] for values in (out, up, line))
    down = np.arctan2(out, up * np.cos(middle)) * (height / np.pi)
    row = np.minimum(down.astype(np.intp), rows - 1)
    column = np.minimum((middle * (2 * rows / np.pi)).astype(np.intp), rows - 1)
    along = np.minimum((np.tan(middle) * out).astype(np.intp), half - 1)
    area = _row_edges(height)[row] * turn[kept] - np.diff(summed, axis=1)[kept]
    return _Pieces((line - 1) * half + along, row * rows + column, turn[kept], area, rows, size)


def _gather(strip: NDArray[np.floating], pieces: _Pieces) -> Light:
    """The light between each edge and the pole, (N, N / 2, 3), where `strip` is the radiance."""
    rows, lines = pieces.rows, pieces.lines
    heights = -np.diff(_row_edges(2 * rows))[:rows, None]
    sums = []
    for radiance in np.moveaxis(strip.astype(np.float64), -1, 0):
        above = np.cumsum(radiance * heights, axis=0) - radiance * heights
        light = above.ravel()[pieces.texel] * pieces.turn + radiance.ravel()[pieces.texel] * pieces.area
        sums.append(np.bincount(pieces.edge, light, lines * lines // 2).reshape(lines, -1))
    return np.stack(sums, axis=-1)


def _scatter(quarter: NDArray[np.floating], pieces: _Pieces) -> Light:
    """The light in each texel of a strip, where `quarter` (N, N / 2, 3) is the radiance: the transpose of `_gather`."""
    rows = pieces.rows
    heights = -np.diff(_row_edges(2 * rows))[:rows, None]
    step = -np.diff(quarter.astype(np.float64), axis=0, append=0)  # a line bounds the texel before and the one after
    sums = []
    for weights in np.moveaxis(step, -1, 0):
        weight = weights.ravel()[pieces.edge]
        within, under = (
            np.bincount(pieces.texel, weight * by, rows * rows).reshape(rows, rows) for by in (pieces.area, pieces.turn)
        )
        below = np.cumsum(under[::-1], axis=0)[::-1] - under
        sums.append(within + below * heights)
    return np.stack(sums, axis=-1)
