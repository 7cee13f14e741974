"""From samples to texels: colour, coverage, normal and depth of a tile, and what lies just past its silhouette."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from impostor.srgb import linear_from_srgb, srgb_from_linear
from impostor.views import View

CLIFF_TEXELS = 2.0  # samples further than this behind the nearest one of their texel belong to another surface
OFFSETS_UP_TO = 12  # texels; past this the distance transform is faster than trying every offset


LINEAR_FROM_SRGB = linear_from_srgb(np.arange(256) / 255).astype(np.float32)
# 16 bits of linear light: the darkest sRGB step is 20 of them, so that a colour comes back as it was.
SRGB_FROM_LINEAR = np.rint(srgb_from_linear(np.arange(65536) / 65535) * 255).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class CapturedView:
    """One view's samples, K x K of them to a texel; row 0 at the top.

    Parameters
    ----------
    view : View
    color : ndarray, (K * S, K * S, 4) uint8
        Albedo, sRGB; alpha is 255 where a surface was hit and 0 elsewhere.
    surface : ndarray, (K * S, K * S, 4) uint16
        View-space normal x, y, z (0 to 65535 for -1 to 1) and depth (0 to 65535 across the view's depth range, larger
        is nearer to the camera). 0 where nothing was hit.
    """

    view: View
    color: NDArray[np.uint8]
    surface: NDArray[np.uint16]


@dataclass(frozen=True, eq=False)
class TileLayers:
    """The layers of one tile, or of a stack of them along leading axes.

    Parameters
    ----------
    color : ndarray, (..., S, S, 4) uint8
        Albedo, sRGB; alpha is coverage, 0 to 255.
    coverage : ndarray, (..., S, S) float32
        Fraction of the texel's samples that hit a surface.
    normal : ndarray, (..., S, S, 3) float32
        View space, unit length, z >= 0; zero where there is no surface.
    depth : ndarray, (..., S, S) float32
        0 to 1 across the view's depth range, larger is nearer to the camera; 0 where there is no surface.
    """

    color: NDArray[np.uint8]
    coverage: NDArray[np.float32]
    normal: NDArray[np.float32]
    depth: NDArray[np.float32]


def resolve(captured: CapturedView, samples: int) -> TileLayers:
    """The layers of a tile from its samples.

    Parameters
    ----------
    captured : CapturedView
    samples : int
        K, the samples along a texel's side.

    Returns
    -------
    TileLayers

    Notes
    -----
    Colour is the mean of the covered samples in linear light. Normal and depth are means over the samples of the
    nearest surface only: across a depth cliff a mean depth lies on neither surface, where a ray marched through the
    depth layer would find a wall that does not exist.
    """
    size = captured.color.shape[0] // samples
    shape = (size, size)
    layers = TileLayers(
        np.zeros((*shape, 4), np.uint8),
        np.zeros(shape, np.float32),
        np.zeros((*shape, 3), np.float32),
        np.zeros(shape, np.float32),
    )
    box = _covered_box(captured.color[..., 3], samples)
    if box is None:
        return layers
    inside = tuple(slice(side.start * samples, side.stop * samples) for side in box)
    steps = [(slice(row, None, samples), slice(column, None, samples)) for row, column in np.ndindex(samples, samples)]
    color = [captured.color[inside][step] for step in steps]
    surface = [captured.surface[inside][step] for step in steps]

    covered = [sample[..., 3] != 0 for sample in color]
    count = np.asarray(np.sum(covered, axis=0, dtype=np.float32))
    coverage = np.divide(count, samples * samples, dtype=np.float32)
    layers.coverage[box] = coverage
    layers.color[box] = _mean_color(color, count, coverage)
    low, high = captured.view.depth_range
    cliff = CLIFF_TEXELS * 2 * captured.view.radius / size / (high - low)
    layers.normal[box], layers.depth[box] = _nearest_surface(surface, covered, cliff)
    return layers


def _covered_box(alpha: NDArray[np.uint8], samples: int) -> tuple[slice, slice] | None:
    """Rows and columns of texels that hold every covered sample."""
    box = []
    for axis in (1, 0):
        hits = np.flatnonzero(alpha.any(axis=axis))
        if len(hits) == 0:
            return None
        box.append(slice(int(hits[0]) // samples, int(hits[-1]) // samples + 1))
    return box[0], box[1]


def _mean_color(color: list[NDArray[np.uint8]], count: NDArray[np.float32], coverage: NDArray[np.float32]):
    # Uncovered samples are black, so the sum over all is the sum over the covered ones.
    total = LINEAR_FROM_SRGB[color[0][..., :3]]
    for sample in color[1:]:
        total += LINEAR_FROM_SRGB[sample[..., :3]]
    total *= (65535 / np.maximum(count, 1))[..., None]
    mean = np.empty((*count.shape, 4), np.uint8)
    mean[..., :3] = SRGB_FROM_LINEAR[np.rint(total).astype(np.uint16)]
    mean[..., 3] = np.rint(coverage * 255)
    return mean


def _nearest_surface(surface: list[NDArray[np.uint16]], covered: list[NDArray[np.bool_]], cliff: float):
    """Mean normal and depth over the samples within `cliff` (a depth difference) of the texel's nearest one."""
    nearest = surface[0][..., 3]
    for sample in surface[1:]:
        nearest = np.maximum(nearest, sample[..., 3])
    step = np.uint16(min(round(cliff * 65535), 65535))
    threshold = np.maximum(nearest, step) - step
    total = np.zeros((*nearest.shape, 4), np.uint32)
    count = np.zeros(nearest.shape, np.float32)
    for sample, hit in zip(surface, covered, strict=True):
        use = hit & (sample[..., 3] >= threshold)
        total += sample * use[..., None]
        count += use
    mean = total * (1 / np.maximum(count, 1) / 65535)[..., None].astype(np.float32)
    normal = mean[..., :3] * 2 - 1
    length = np.sqrt(np.einsum("...i,...i->...", normal, normal))
    normal *= ((count > 0) / np.maximum(length, 1e-6))[..., None]
    return normal, mean[..., 3]


def dilate(layers: TileLayers, texels: int) -> tuple[TileLayers, NDArray[np.bool_]]:
    """Colour, normal and depth continued past the silhouette, from the nearest covered texel.

    Parameters
    ----------
    layers : TileLayers
        One tile, or a stack of them.
    texels : int
        How far to continue, as a Euclidean distance between texel centres.

    Returns
    -------
    layers : TileLayers
        New arrays; alpha and coverage are what they were, 0 in the filled region.
    filled : ndarray, (..., S, S) bool
        Where there was no surface, and now is a continued one.

    Notes
    -----
    The distance is exact; between equally near texels the choice is arbitrary but always the same.
    """
    shape = layers.coverage.shape
    covered = (layers.coverage > 0).reshape(-1, *shape[-2:])
    target, source = _nearest_covered(covered, texels)
    color, normal, depth = layers.color.copy(), layers.normal.copy(), layers.depth.copy()
    flat_color = color.reshape(-1, 4)
    flat_color[target, :3] = flat_color[source, :3]
    for array in (normal.reshape(-1, 3), depth.reshape(-1)):
        array[target] = array[source]
    filled = np.zeros(shape, bool)
    filled.reshape(-1)[target] = True
    return TileLayers(color, layers.coverage, normal, depth), filled


def _nearest_covered(covered: NDArray[np.bool_], texels: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Flat indices of uncovered texels within reach of coverage, and of the covered texel nearest to each."""
    if texels > OFFSETS_UP_TO:
        return _by_distance_transform(covered, texels)
    count, height, width = covered.shape
    wide = width + 2 * texels
    padded = np.zeros((count, height + 2 * texels, wide), bool)
    padded[:, texels : texels + height, texels : texels + width] = covered
    reach = np.asarray(ndimage.maximum_filter(covered, (1, 2 * texels + 1, 2 * texels + 1), mode="constant"), bool)
    target = np.flatnonzero(reach & ~covered)
    view, rest = np.divmod(target, height * width)
    row, column = np.divmod(rest, width)
    place = (view * padded.shape[1] + row + texels) * wide + column + texels
    source = np.full(len(target), -1)
    left = np.arange(len(target))
    for down, right in _offsets(texels):
        hit = padded.reshape(-1)[place[left] + (down * wide + right)]
        found = left[hit]
        source[found] = target[found] + (down * width + right)
        left = left[~hit]
        if len(left) == 0:
            break
    return target[source >= 0], source[source >= 0]


def _offsets(texels: int) -> list[tuple[int, int]]:
    """Steps (down, right) no longer than `texels`, the shortest first."""
    steps = np.mgrid[-texels : texels + 1, -texels : texels + 1].reshape(2, -1).T
    square = (steps**2).sum(axis=1)
    steps = steps[np.argsort(square, kind="stable")]
    return [(int(down), int(right)) for down, right in steps if 0 < down**2 + right**2 <= texels**2]


def _by_distance_transform(covered: NDArray[np.bool_], texels: int) -> tuple[NDArray[Any], NDArray[Any]]:
    _, height, width = covered.shape
    targets, sources = [np.empty(0, np.intp)], [np.empty(0, np.intp)]
    for index in np.flatnonzero(covered.any(axis=(1, 2))):
        found: Any = ndimage.distance_transform_edt(~covered[index], return_indices=True)
        distance, (row, column) = found
        target = np.flatnonzero((distance > 0) & (distance <= texels))
        targets.append(target + index * height * width)
        sources.append((row * width + column).reshape(-1)[target] + index * height * width)
    return np.concatenate(targets), np.concatenate(sources)
