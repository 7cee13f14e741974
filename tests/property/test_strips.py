"""Strips rasterised again are their silhouette, without overlaps and without cracks."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import ndimage
from skimage import measure

from impostor.strips import silhouette_strips

SAMPLES = 4  # per pixel and axis


@st.composite
def silhouettes(draw):
    """Noise of any density, blobs with holes, and posts with bars; many reach the border."""
    shape = draw(st.tuples(st.integers(1, 14), st.integers(1, 14)))
    kind = draw(st.sampled_from(["cells", "noise", "blobs", "bars"]))
    if kind == "cells":
        return draw(arrays(bool, shape))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    if kind == "noise":
        return rng.random(shape) < rng.random()
    if kind == "blobs":
        smooth = ndimage.gaussian_filter(rng.random(shape), rng.uniform(0.5, 2))
        return smooth > np.quantile(smooth, rng.uniform(0.1, 0.9))
    mask = np.zeros(shape, bool)
    for _ in range(rng.integers(1, 5)):
        line = mask[rng.integers(shape[0])] if rng.random() < 0.5 else mask[:, rng.integers(shape[1])]
        line[slice(*np.sort(rng.integers(0, len(line) + 1, 2)))] = True
    return mask


def edge_sides(corners, points):
    """(3, T, P) float: on which side of each triangle's edges points lie; the triangle's own side is positive."""
    start, end = corners.transpose(1, 0, 2), np.roll(corners, -1, axis=1).transpose(1, 0, 2)
    along, to = (end - start)[:, :, None], points - start[:, :, None]
    return along[..., 1] * to[..., 0] - along[..., 0] * to[..., 1]


def lattice(shape, samples):
    """Points (P, 2) of x, y that divide every pixel, with pixel centres and corners among them, 1 pixel beyond all."""
    y, x = (np.arange(-samples, (side + 1) * samples + 1) / samples for side in shape)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


@settings(max_examples=150, deadline=None)
@given(silhouettes())
def test_strips_cover_their_silhouette_but_for_half_a_pixel(silhouette):
    strips = silhouette_strips(silhouette)
    corners = strips.positions[strips.triangles()]
    points = lattice(silhouette.shape, SAMPLES)
    sides = edge_sides(corners, points)
    covered = (sides >= 0).all(axis=0).any(axis=0)

    row, column = np.nonzero(silhouette)
    centers = np.stack([column, row], axis=-1) + 0.5
    at_center = np.abs(points % 1 - 0.5).max(axis=1) < 1e-9
    distance = np.abs(points[:, None] - centers).max(axis=2)
    on_object = (distance < 1e-9).any(axis=1)
    np.testing.assert_array_equal(covered[at_center], on_object[at_center])

    near = (distance <= 1).any(axis=1)
    assert not (covered & ~near).any(), "outside the silhouette dilated by half a pixel"

    around = np.ones(len(points), bool)
    padded = np.pad(silhouette, 3)
    for dy in (-0.5, 0.5):
        for dx in (-0.5, 0.5):
            for nudge in (-1e-6, 1e-6):
                x, y = np.floor(points + np.array([dx, dy]) + nudge).astype(int).T + 3
                around &= padded[y, x]
    assert not (around & ~covered).any(), "inside the silhouette eroded by half a pixel"


@settings(max_examples=150, deadline=None)
@given(silhouettes())
def test_strips_do_not_overlap(silhouette):
    strips = silhouette_strips(silhouette)
    points = lattice(silhouette.shape, SAMPLES) + np.array([0.0123, 0.00456])
    sides = edge_sides(strips.positions[strips.triangles()], points)
    assert (sides > 1e-9).all(axis=0).sum(axis=0).max(initial=0) <= 1


@settings(max_examples=150, deadline=None)
@given(silhouettes())
def test_no_vertex_lies_inside_an_edge(silhouette):
    strips = silhouette_strips(silhouette)
    positions, quads = strips.positions, strips.quads
    assert len(np.unique(positions, axis=0)) == len(positions), "a vertex is shared, not repeated"
    edges = np.concatenate([quads[:, [k, (k + 1) % 4]] for k in range(4)])
    start, end = positions[edges[:, 0]][:, None], positions[edges[:, 1]][:, None]
    along, to = end - start, positions - start
    length = (along**2).sum(axis=2)
    cross = along[..., 0] * to[..., 1] - along[..., 1] * to[..., 0]
    place = (along * to).sum(axis=2)
    assert not ((cross == 0) & (place > 0) & (place < length)).any()


@settings(max_examples=150, deadline=None)
@given(silhouettes())
def test_nothing_vanishes(silhouette):
    """Every connected part of a silhouette, however thin, keeps a share of its area."""
    strips = silhouette_strips(silhouette)
    labels = np.asarray(measure.label(silhouette, connectivity=2))
    count = int(labels.max())
    triangles = strips.triangles()
    a, b, c = strips.positions[triangles].transpose(1, 0, 2)
    area = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / -2
    assert (area > 0).all()
    part = labels[strips.pixels[triangles[:, 0], 1], strips.pixels[triangles[:, 0], 0]]
    kept = np.bincount(part, area, minlength=count + 1)[1:]
    pixels = np.bincount(labels.ravel(), minlength=count + 1)[1:]
    # The least is an L of three pixels: half a pixel of three.
    assert (kept >= pixels / 6 - 1e-9).all()
