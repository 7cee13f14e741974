"""The measures of how far an impostor is from its mesh, and the cameras they are taken from."""

import json

import numpy as np
import pytest
from flip_evaluator import evaluate

from bake.fan import bake_fan
from impostor.errors import SettingsError
from impostor.lighting import DirectionalLight
from impostor.views import direction
from runtime.compare import (
    HIGHEST_PSNR,
    Comparison,
    Pair,
    as_json,
    between_cameras,
    between_directions,
    errors,
    over_background,
    side_by_side,
)
from tests.solids import BLUE, Box, Sphere, solid_fan, solid_model

SOLIDS = (Sphere((0, 1, 0)), Box((-0.4, 0, 0.5), (1.2, 0.7, 1.2), BLUE))
FAN = solid_fan(*SOLIDS, views=16, elevation_deg=15, size=64)
MODEL = solid_model(*SOLIDS)


def square(value=200, alpha=255, side=32, size=64):
    """A picture with a premultiplied square of one grey in its middle."""
    pixels = np.zeros((size, size, 4), np.uint8)
    low = (size - side) // 2
    pixels[low : low + side, low : low + side] = (value, value, value, alpha)
    return pixels


def test_equal_pictures_have_no_error():
    assert errors(Pair(square(), square())) == (HIGHEST_PSNR, pytest.approx(1), pytest.approx(0, abs=1e-6), 1)


def test_nothing_equals_nothing():
    empty = np.zeros((16, 16, 4), np.uint8)
    assert errors(Pair(empty, empty)) == (HIGHEST_PSNR, 1, 0, 1)


@pytest.mark.parametrize("step", [1, 10, 100])
def test_a_known_error_has_the_known_psnr(step):
    psnr, ssim, flip, iou = errors(Pair(square(150), square(150 - step)))
    assert psnr == pytest.approx(20 * np.log10(255 / step), abs=0.01)
    assert (ssim < 1, flip > 0, iou) == (True, True, 1)


def test_only_the_objects_pixels_count():
    """The same error on a picture with four times as much background."""
    small, large = (errors(Pair(square(150, size=size), square(140, size=size))) for size in (48, 96))
    assert large[0] == pytest.approx(small[0])
    assert large[2] == pytest.approx(small[2], rel=0.02)


def test_what_only_the_impostor_touches_counts():
    halo = square(150, side=40)
    halo[16:48, 16:48] = square(150)[16:48, 16:48]
    psnr, *_, iou = errors(Pair(square(150), halo))
    assert psnr < 30
    assert iou == pytest.approx(32**2 / 40**2)


def test_worse_is_worse_by_every_measure():
    noise = np.random.default_rng(0).normal(0, 1, (64, 64, 1))
    found = []
    for size in (4, 12, 36):
        noisy = square(128).astype(float)
        noisy[..., :3] += size * noise * (noisy[..., 3:] > 0)
        found.append(errors(Pair(square(128), np.clip(noisy, 0, 255).astype(np.uint8))))
    psnr, ssim, flip, _ = zip(*found, strict=True)
    assert psnr[0] > psnr[1] > psnr[2]
    assert ssim[0] > ssim[1] > ssim[2]
    assert flip[0] < flip[1] < flip[2]


def test_edges_are_seen_over_a_background():
    """Premultiplied: half covered is half the colour and half the background."""
    pixels = np.array([[[100, 50, 0, 128], [0, 0, 0, 0], [255, 255, 255, 255]]], np.uint8)
    half = np.array([100, 50, 0]) / 255 + np.array([0.4, 0.5, 0.6]) * (1 - 128 / 255)
    np.testing.assert_allclose(over_background(pixels)[0], [half, (0.4, 0.5, 0.6), (1, 1, 1)], atol=1e-6)


@pytest.mark.parametrize("views", [1, 7, 96])
@pytest.mark.parametrize("count", [1, 8, 13])
def test_cameras_stand_between_views_and_go_around(views, count):
    fan = solid_fan(Sphere(), views=views, size=8)
    azimuths = np.array(between_cameras(fan, count))
    assert len(np.unique(azimuths.round(9))) == count
    gap = azimuths / (2 * np.pi / views) % 1
    assert ((gap > 0.01) & (gap < 0.99)).all()
    assert ((azimuths >= 0) & (azimuths < 2 * np.pi)).all()
    if views >= count > 1:
        assert np.diff(np.sort(azimuths)).max() < 2 * 2 * np.pi / count


@pytest.fixture
def comparison(ctx):
    comparison = Comparison(ctx, FAN, MODEL, lights=[DirectionalLight.from_angles(40, 45, (0.7, 0.7, 0.7))])
    yield comparison
    comparison.release()


def test_at_a_view_the_impostor_is_the_mesh(comparison):
    psnr, _, _, iou = errors(comparison.pair(2 * np.pi * 3 / 16, np.radians(15)))
    assert psnr > 26
    assert iou > 0.97


def test_rows_grow_worse_away_from_the_ring(comparison):
    calls = []
    found = list(comparison.rows([0, 30], cameras=3, progress=lambda done, total: calls.append((done, total))))
    (near, pair), (far, _) = found
    assert calls == [(done, 6) for done in range(1, 7)]
    assert (near.method, near.offset_deg, far.offset_deg) == ("nearest", 0, 30)
    assert near.psnr_db > far.psnr_db
    assert near.iou > far.iou > 0.5
    assert pair.mesh.shape == pair.impostor.shape == (64, 64, 4)


@pytest.mark.parametrize("offset", [80, -106, np.nan])
def test_offsets_beyond_the_pole_are_refused(comparison, offset):
    with pytest.raises(SettingsError) as caught:
        next(comparison.rows([0, offset], cameras=1))
    assert (caught.value.where, "expected -105 to 75" in caught.value.problem) == ("offsets_deg", True)


def test_offsets_count_from_the_fans_own_elevation(comparison):
    _, pair = next(comparison.rows([0], cameras=1))
    expected = comparison.pair(between_cameras(FAN, 1)[0], np.radians(15))
    np.testing.assert_array_equal(pair.mesh, expected.mesh)


def test_rows_as_json(comparison):
    rows = [row for row, _ in comparison.rows([0, 5], cameras=1)]
    read = json.loads(json.dumps(as_json(rows), allow_nan=False))
    assert [set(row) for row in read["rows"]] == [{"method", "offset_deg", "psnr_db", "ssim", "flip", "iou"}] * 2


def test_side_by_side_shows_the_difference_around_grey():
    pixels = side_by_side([Pair(square(100), square(110)), Pair(square(100), square(100))])
    assert pixels.shape == (128, 192, 3)
    assert pixels[32, [32, 96, 160]].tolist() == [[100] * 3, [110] * 3, [168] * 3]
    assert pixels[96, 160].tolist() == [128] * 3


def test_flip_is_the_error_map_of_its_authors():
    """A whole picture of object pixels: its mean FLIP is the one that the library states."""
    random = np.random.default_rng(1)
    pictures = random.integers(0, 256, (2, 48, 48, 4), np.uint8)
    pictures[..., 3] = 255
    stated = evaluate(*(over_background(picture) for picture in pictures), "LDR")[1]
    assert errors(Pair(*pictures))[2] == pytest.approx(stated, rel=1e-4)


@pytest.mark.parametrize("layout", ["hemisphere", "sphere"])
def test_cameras_stand_between_the_views_of_every_layout(layout):
    fan = bake_fan(MODEL, views=24, layout=layout, size=16)
    directions = between_directions(fan, 6)
    cosines = np.array([direction(*angles) @ fan.views.basis[:, 2].T for angles in directions]).max(axis=1)
    gap = np.sqrt(4 * np.pi / 24)
    assert (cosines < 1 - 1e-4).all()
    assert (cosines > np.cos(gap)).all()


def test_a_perspective_fan_is_compared_from_its_own_distance(ctx):
    fan = bake_fan(MODEL, views=32, size=64, distance=6.0)
    comparison = Comparison(ctx, fan, MODEL)
    (row, _), *_ = comparison.rows([0], 4)
    comparison.release()
    assert row.iou > 0.95
