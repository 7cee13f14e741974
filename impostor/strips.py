"""Silhouette to quadrilateral strips: the polygons whose projection is an object's shadow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Strips:
    """One silhouette as quadrilaterals between neighbouring pixel columns.

    Quadrilaterals share vertices and never overlap. Covered pixel centres lie inside or on the border, all others
    outside: holes stay holes, and the outline is half a pixel smaller than the silhouette's.

    Parameters
    ----------
    pixels : ndarray, (N, 2) int32
        Column and row of the silhouette pixel that each vertex belongs to, for its depth.
    offsets : ndarray, (N, 2) float32
        From that pixel's centre to the vertex, in pixels, right and down: 0, or half a pixel where the silhouette is
        one pixel thin.
    quads : ndarray, (M, 4) int32
        Left-top, left-bottom, right-bottom, right-top vertex; a triangle names one twice.

    References
    ----------
    Dinh, Metoyer, Turk, "Shadows", figures 6 and 7.
    """

    pixels: NDArray[np.int32]
    offsets: NDArray[np.float32]
    quads: NDArray[np.int32]

    @property
    def positions(self) -> NDArray[np.float64]:
        """(N, 2) float64: where the vertices are, in pixels right of and below the tile's top left corner."""
        return np.add(self.pixels + 0.5, self.offsets, dtype=np.float64)

    def triangles(self) -> NDArray[np.int32]:
        """Two triangles for each quadrilateral, without those of no area.

        Returns
        -------
        ndarray, (K, 3) int32
            Counter-clockwise as seen by the silhouette's camera.
        """
        corners = np.concatenate([self.quads[:, [0, 1, 2]], self.quads[:, [0, 2, 3]]], axis=1).reshape(-1, 3)
        distinct = np.all(corners != np.roll(corners, 1, axis=1), axis=1)
        return corners[distinct]


def silhouette_strips(silhouette: NDArray[np.bool_]) -> Strips:
    """Cut a silhouette into strips with vertices at pixel centres.

    Parameters
    ----------
    silhouette : ndarray, (H, W) bool
        True on the object; row 0 at the top.

    Returns
    -------
    Strips
        Empty for an empty silhouette.

    Notes
    -----
    A 2x2 block whose rows differ is where a run of covered pixels starts or ends in one of its two columns, so the
    runs' first and last pixels are the vertices. Runs of neighbouring columns that touch, by a side or by a corner,
    make one strip each. Where a run touches two runs beyond a gap, the gap narrows to an apex on the run. The apex
    is at the gap's top on its left end and at its bottom on its right end: the two sides of a post one pixel wide
    then lean the same way and it stays one pixel wide. The strips on the apex's other side take it as a vertex too,
    because once vertices have moved by their own depths, a vertex in the middle of an edge opens a crack.

    What has no area between pixel centres keeps the size of its pixels: a run one pixel high in a horizontal or
    diagonal line spans the pixel's height, a run that touches no other spans its width.

    References
    ----------
    Dinh, Metoyer, Turk, "Shadows", figures 6 and 7.
    """
    column, top, bottom = _runs(silhouette)
    left, right = _touching_runs(column, top, bottom, stride=len(silhouette) + 1)
    # Half pixels from here on, whole numbers, so that equal vertices compare equal.
    rows = _strip_rows(2 * top, 2 * bottom, left, right)
    alone = np.bincount(np.concatenate([left, right]), minlength=len(column)) == 0
    flat = (rows[0] == rows[1]) & (rows[2] == rows[3])
    thin = alone.copy()
    thin[left[flat]] = thin[right[flat]] = True
    thin &= top == bottom
    upper, lower = 2 * top - thin, 2 * bottom + thin

    lone = np.flatnonzero(alone)
    runs = np.concatenate([[left, left, right, right], [lone] * 4], axis=1)
    rows = np.concatenate(
        [_strip_rows(upper, lower, left, right), [upper[lone], lower[lone], lower[lone], upper[lone]]], axis=1
    )
    columns = 2 * column[runs]
    columns[:2, len(left) :] -= 1
    columns[2:, len(left) :] += 1

    stride = 2 * len(silhouette) + 1
    _, first, vertex = np.unique((columns + 1) * stride + rows + 1, return_index=True, return_inverse=True)
    run, column_of, row_of = runs.ravel()[first], columns.ravel()[first], rows.ravel()[first]
    pixels = np.stack([column[run], np.clip(row_of // 2, top[run], bottom[run])], axis=-1)
    offsets = np.stack([column_of, row_of], axis=-1) / 2 - pixels
    return Strips(pixels.astype(np.int32), offsets.astype(np.float32), _split_quads(vertex.reshape(4, -1)))


def _runs(silhouette: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Column, first row and last row of every vertical run of covered pixels, by column and then by row."""
    height, width = silhouette.shape
    padded = np.zeros((width, height + 2), bool)
    padded[:, 1:-1] = silhouette.T
    column, row = np.nonzero(padded[:, 1:] != padded[:, :-1])
    return column[0::2], row[0::2], row[1::2] - 1


def _touching_runs(
    column: NDArray[np.intp], top: NDArray[np.intp], bottom: NDArray[np.intp], stride: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs of runs in neighbouring columns that share a side or a corner of a pixel, by left and then right run."""
    start, end = column * stride + top, column * stride + bottom + 1
    first = np.searchsorted(end, start + stride, side="left")
    count = np.searchsorted(start, end + stride, side="right") - first
    left = np.repeat(np.arange(len(column)), count)
    right = np.arange(len(left)) - np.repeat(np.cumsum(count) - count - first, count)
    return left, right


def _strip_rows(
    upper: NDArray[np.intp], lower: NDArray[np.intp], left: NDArray[np.intp], right: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Rows (4, M) of left-top, left-bottom, right-bottom, right-top of the strip between each pair of runs.

    Pairs never cross, so strips that share a run follow one another: the run is divided at the gap's apex.
    All rows are in half pixels; `upper` and `lower` may be half a pixel outside their run's centres, apexes may not.
    """
    rows = np.stack([upper[left], lower[left], lower[right], upper[right]])
    above, below = slice(None, -1), slice(1, None)
    fork = left[below] == left[above]
    apex = np.clip(2 * (lower[right[above]] // 2 + 1), upper[left[above]], lower[left[above]])
    rows[1, above][fork] = rows[0, below][fork] = apex[fork]
    merge = right[below] == right[above]
    apex = np.clip(2 * ((upper[left[below]] + 1) // 2 - 1), upper[right[above]], lower[right[above]])
    rows[2, above][merge] = rows[3, below][merge] = apex[merge]
    return rows


def _split_quads(corners: NDArray[np.intp]) -> NDArray[np.int32]:
    """Divide strips (4, M) at every vertex that lies on their left or right edge: (K, 4) int32.

    Vertices are numbered down their columns, so those on an edge are the numbers between its ends.
    """
    on_left, on_right = corners[1] - corners[0], corners[2] - corners[3]
    count = np.maximum(on_left, on_right)
    strip = np.repeat(np.arange(corners.shape[1]), count)
    step = np.arange(len(strip)) - np.repeat(np.cumsum(count) - count, count)
    upper_left, lower_left = (corners[0, strip] + np.minimum(step + k, on_left[strip]) for k in (0, 1))
    upper_right, lower_right = (corners[3, strip] + np.minimum(step + k, on_right[strip]) for k in (0, 1))
    return np.stack([upper_left, lower_left, lower_right, upper_right], axis=-1).astype(np.int32)
