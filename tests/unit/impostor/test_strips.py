"""Strips of small silhouettes, vertex by vertex."""

import numpy as np
import pytest

from impostor.strips import silhouette_strips


def mask(*rows):
    return np.array([[cell == "#" for cell in row] for row in rows])


def area(strips):
    """Pixels covered; triangles turned clockwise count as negative."""
    a, b, c = strips.positions[strips.triangles()].transpose(1, 0, 2)
    return -((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum() / 2


def corners(strips, quad=0):
    """Column, row of a quad's corners in pixels, whole numbers at pixel centres."""
    return (strips.positions[strips.quads[quad]] - 0.5).tolist()


@pytest.mark.parametrize(("width", "height"), [(2, 2), (7, 3), (40, 64)])
def test_a_rectangle_is_half_a_pixel_smaller_and_costs_a_quad_a_column(width, height):
    silhouette = np.zeros((64, 64), bool)
    silhouette[:height, 3 : 3 + width] = True
    strips = silhouette_strips(silhouette)
    assert len(strips.quads) == width - 1
    assert len(strips.pixels) == 2 * width
    assert area(strips) == (width - 1) * (height - 1)
    assert not strips.offsets.any()


def test_a_quad_names_left_top_left_bottom_right_bottom_right_top():
    strips = silhouette_strips(mask("#.", "##", ".#", ".#"))
    assert corners(strips) == [[0, 0], [0, 1], [1, 3], [1, 1]]


def test_a_tip_is_a_triangle():
    strips = silhouette_strips(mask("#.", "##", "#."))
    assert len(strips.triangles()) == 1
    assert area(strips) == 1


@pytest.mark.parametrize("size", [8, 256])
def test_a_hole_stays_open(size):
    silhouette = np.ones((size, size), bool)
    silhouette[2:5, 3:6] = False
    # A square of three pixels opens to its neighbours' centres: four by four, less two corners at each of two ends.
    assert area(silhouette_strips(silhouette)) == (size - 1) ** 2 - (4 * 4 - 2 * 2)


def test_a_hole_of_one_pixel_is_a_diamond():
    assert area(silhouette_strips(mask("###", "#.#", "###"))) == 2


def test_runs_that_touch_by_a_corner_join():
    strips = silhouette_strips(mask("#.", "#.", ".#", ".#"))
    assert corners(strips) == [[0, 0], [0, 1], [1, 3], [1, 2]]


def test_the_strip_beside_a_fork_takes_its_apex_as_a_vertex():
    strips = silhouette_strips(mask("###", "##.", "##.", "###"))
    edges = {tuple(quad[[3, 2]]) for quad in strips.quads} | {tuple(quad[[0, 1]]) for quad in strips.quads}
    apex = next(k for k, pixel in enumerate(strips.pixels.tolist()) if pixel == [1, 1])
    top, bottom = (strips.pixels.tolist().index([1, row]) for row in (0, 3))
    assert {(top, apex), (apex, bottom)} <= edges
    assert (top, bottom) not in edges


@pytest.mark.parametrize("height", [4, 9, 30])
def test_a_post_between_two_bars_stays_one_pixel_wide(height):
    silhouette = np.zeros((height + 2, 5), bool)
    silhouette[[0, -1]] = True
    silhouette[:, 2] = True
    strips = silhouette_strips(silhouette)
    a, b, c = strips.positions[strips.triangles()].transpose(1, 0, 2)
    for row in np.arange(2.5, height, 0.5):
        width = 0.0
        for start, end in ((a, b), (b, c), (c, a)):
            crosses = (start[:, 1] < row) != (end[:, 1] < row)
            x = start[:, 0] + (row - start[:, 1]) / np.where(crosses, end[:, 1] - start[:, 1], 1) * (end - start)[:, 0]
            width += np.where(crosses, np.sign(end[:, 1] - start[:, 1]) * x, 0).sum()
        assert abs(width) == pytest.approx(1, abs=1.01 / (height - 1))


@pytest.mark.parametrize(
    ("silhouette", "expected"),
    [
        (mask("...", ".#.", "..."), 1),
        (mask(".#.", ".#.", ".#."), 2),
        (mask("...", "###", "..."), 2),
        (mask("#..", ".#.", "..#"), 2),
    ],
    ids=["dot", "post", "line", "diagonal"],
)
def test_one_pixel_thin_is_one_pixel_wide(silhouette, expected):
    strips = silhouette_strips(silhouette)
    assert area(strips) == expected
    assert silhouette[strips.pixels[:, 1], strips.pixels[:, 0]].all()


def test_every_vertex_has_a_covered_pixel_to_take_its_depth_from():
    silhouette = np.random.default_rng(0).random((64, 64)) < 0.4
    strips = silhouette_strips(silhouette)
    assert silhouette[strips.pixels[:, 1], strips.pixels[:, 0]].all()
    assert strips.pixels.dtype == strips.quads.dtype == np.int32
    assert set(np.unique(strips.quads)) <= set(range(len(strips.pixels)))


@pytest.mark.parametrize("shape", [(0, 0), (1, 1), (8, 8)])
def test_an_empty_silhouette_has_no_strips(shape):
    strips = silhouette_strips(np.zeros(shape, bool))
    assert strips.pixels.shape == (0, 2)
    assert strips.quads.shape == (0, 4)
    assert strips.triangles().shape == (0, 3)


def test_quads_grow_with_columns_not_with_pixels():
    y, x = np.mgrid[:256, :256]
    disc = (x - 128) ** 2 + (y - 128) ** 2 < 100**2
    assert len(silhouette_strips(disc).quads) < disc.any(axis=0).sum()
