"""Samples to texels, and texels past the silhouette: no GL."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bake.resolve import OFFSETS_UP_TO, CapturedView, TileLayers, dilate, resolve
from impostor.views import View

SIZE, SAMPLES = 8, 2
FACING = (32768, 32768, 65535)


def captured(depth_range=(-1.0, 1.0), samples=SAMPLES):
    side = SIZE * samples
    view = View(np.eye(3), np.zeros(3), radius=1.0, depth_range=depth_range)
    return CapturedView(view, np.zeros((side, side, 4), np.uint8), np.zeros((side, side, 4), np.uint16))


def hit(capture, where, color=(255, 255, 255), normal=FACING, depth=30000):
    capture.color[where] = (*color, 255)
    capture.surface[where] = (*normal, depth)


def tile(covered, seed=0):
    rng = np.random.default_rng(seed)
    covered = np.asarray(covered, bool)
    color = rng.integers(0, 256, (*covered.shape, 4), dtype=np.uint8) * covered[..., None]
    color[..., 3] = covered * 255
    normal = rng.standard_normal((*covered.shape, 3)).astype(np.float32) * covered[..., None]
    depth = rng.random(covered.shape, np.float32) * covered
    return TileLayers(color, covered.astype(np.float32), normal, depth)


def test_nothing_hit_gives_an_empty_tile():
    layers = resolve(captured(), SAMPLES)
    assert not any(array.any() for array in (layers.color, layers.coverage, layers.normal, layers.depth))


@pytest.mark.parametrize("samples", [1, 2, 4])
def test_a_covered_texel_lands_in_its_own_row_and_column(samples):
    capture = captured(samples=samples)
    hit(capture, np.s_[2 * samples : 3 * samples, 5 * samples : 6 * samples], (10, 20, 30), depth=16384)
    layers = resolve(capture, samples)
    assert np.argwhere(layers.coverage).tolist() == [[2, 5]]
    assert layers.color[2, 5].tolist() == [10, 20, 30, 255]
    assert layers.coverage[2, 5] == 1
    assert layers.depth[2, 5] == pytest.approx(0.25, abs=1e-4)
    assert layers.normal[2, 5] == pytest.approx([0, 0, 1], abs=1e-4)


def test_every_srgb_value_survives():
    capture = captured(samples=1)
    for start in range(0, 256, 64):
        values = np.arange(start, start + 64).reshape(8, 8)
        capture.color[..., :3], capture.color[..., 3] = values[..., None], 255
        assert np.array_equal(resolve(capture, 1).color[..., 0], values)


def test_color_is_averaged_in_linear_light_over_the_covered_samples_only():
    capture = captured()
    hit(capture, (0, 0), (255, 255, 255))
    hit(capture, (1, 1), (0, 0, 0))
    layers = resolve(capture, SAMPLES)
    assert layers.color[0, 0].tolist() == [188, 188, 188, 128]
    assert layers.coverage[0, 0] == 0.5


def test_normals_of_one_surface_are_averaged_to_unit_length():
    capture = captured()
    hit(capture, np.s_[0, :2], normal=(65535, 32768, 32768))
    hit(capture, np.s_[1, :2], normal=(32768, 65535, 32768))
    layers = resolve(capture, SAMPLES)
    assert layers.normal[0, 0] == pytest.approx([0.5**0.5, 0.5**0.5, 0], abs=1e-3)


def test_across_a_cliff_depth_and_normal_are_those_of_the_nearest_surface():
    capture = captured()
    hit(capture, np.s_[:2, 0], (255, 0, 0), (65535, 32768, 32768), depth=60000)
    hit(capture, np.s_[:2, 1], (0, 0, 255), FACING, depth=10000)
    layers = resolve(capture, SAMPLES)
    assert layers.depth[0, 0] * 65535 == pytest.approx(60000, abs=1)
    assert layers.normal[0, 0] == pytest.approx([1, 0, 0], abs=1e-3)
    assert layers.color[0, 0].tolist() == [188, 0, 188, 255]


def test_on_a_slope_depth_is_the_mean():
    texel = 65535 / SIZE
    capture = captured()
    hit(capture, np.s_[:2, 0], depth=20000)
    hit(capture, np.s_[:2, 1], depth=20000 + int(texel))
    assert resolve(capture, SAMPLES).depth[0, 0] * 65535 == pytest.approx(20000 + texel / 2, abs=1)


def nearest_distances(covered):
    rows, columns = np.indices(covered.shape)
    points = np.argwhere(covered)
    square = (rows[..., None] - points[:, 0]) ** 2 + (columns[..., None] - points[:, 1]) ** 2
    return np.sqrt(square.min(axis=-1))


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, OFFSETS_UP_TO + 3), st.floats(0.002, 0.4))
def test_dilation_takes_the_nearest_covered_texel_and_stops_where_asked(seed, texels, density):
    rng = np.random.default_rng(seed)
    covered = rng.random((20, 20)) < density
    covered[tuple(rng.integers(0, 20, 2))] = True
    before = tile(covered, seed)
    after, filled = dilate(before, texels)
    distance = nearest_distances(covered)
    assert np.array_equal(filled, ~covered & (distance <= texels))
    points = np.argwhere(covered)
    for row, column in np.argwhere(filled):
        source = points[np.isclose(np.hypot(*(points - (row, column)).T), distance[row, column])]
        same = [after.depth[row, column] == before.depth[tuple(p)] for p in source]
        chosen = tuple(source[same.index(True)])
        assert np.array_equal(after.normal[row, column], before.normal[chosen])
        assert np.array_equal(after.color[row, column, :3], before.color[chosen][:3])


def test_dilation_leaves_alpha_and_the_covered_texels_alone():
    covered = np.eye(9, dtype=bool)
    before = tile(covered)
    kept = [array.copy() for array in (before.color, before.normal, before.depth)]
    after, filled = dilate(before, 3)
    assert filled.any()
    assert np.array_equal(after.color[..., 3], before.color[..., 3])
    assert np.array_equal(after.coverage, before.coverage)
    for name, old in zip(("color", "normal", "depth"), kept, strict=True):
        assert np.array_equal(getattr(after, name)[covered], old[covered])
        assert np.array_equal(getattr(before, name), old)


@pytest.mark.parametrize("texels", [4, OFFSETS_UP_TO + 2])
def test_dilation_of_a_stack_is_that_of_its_tiles(texels):
    covered = np.zeros((3, 16, 16), bool)
    covered[0, 15, 15] = covered[2, 0, 3] = True
    stack = tile(covered)
    after, filled = dilate(stack, texels)
    for index in range(3):
        one = TileLayers(stack.color[index], stack.coverage[index], stack.normal[index], stack.depth[index])
        alone, alone_filled = dilate(one, texels)
        assert np.array_equal(after.color[index], alone.color)
        assert np.array_equal(filled[index], alone_filled)
    assert not filled[1].any()
