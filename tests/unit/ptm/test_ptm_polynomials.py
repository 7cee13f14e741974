"""The biquadratic: its value, its color, and light from below."""

from dataclasses import replace

import numpy as np
import pytest

from impostor.errors import SettingsError
from impostor.ptm import Polynomials, evaluate, relight
from impostor.ptm.polynomials import DROP_OFF, channels, drop_off
from impostor.srgb import linear_from_srgb
from tests.ptms import random_polynomials


def one_texel(coefficients, **others):
    return Polynomials(np.array(coefficients, np.float32).reshape(1, 1, -1, 6), **others)


def test_the_coefficients_are_of_u2_v2_uv_u_v_1():
    white = np.ones((1, 1, 3), np.float32)
    for term, value in enumerate([0.25, 0.04, 0.1, 0.5, 0.2, 1]):
        ptm = one_texel(np.eye(6)[term], color=white)
        np.testing.assert_allclose(evaluate(ptm, 0.5, 0.2), np.full((1, 1, 3), value), rtol=1e-6)


def test_luminance_may_pass_white_before_the_color_dims_it():
    ptm = one_texel([0, 0, 0, 0, 0, 2], color=np.array([[[0.25, 0.5, 1]]], np.float32))
    np.testing.assert_allclose(evaluate(ptm, 0, 0), [[[0.5, 1, 1]]])


def test_a_picture_is_never_below_black():
    ptm = one_texel([0, 0, 0, 1, 0, 0], color=np.ones((1, 1, 3), np.float32))
    assert evaluate(ptm, -1, 0).max() == 0


def test_luma_without_chroma_is_gray_and_chroma_red_reddens():
    lum = random_polynomials("LUM", (2, 1))
    neutral = replace(
        lum,
        coefficients=np.array([0, 0, 0, 0, 0, 0.5], np.float32) * np.ones((1, 2, 1, 1), np.float32),
        chroma=np.array([[[128, 128], [255, 128]]], np.float32) / 255,
    )
    gray, red = evaluate(neutral, 0.3, 0.3)[0]
    np.testing.assert_allclose(gray, 0.5, atol=1e-6)
    assert red[0] == 1 and red[1] < 0.5 and red[2] == pytest.approx(0.5)


@pytest.mark.parametrize("format", ["RGB", "LRGB", "LUM"])
def test_a_light_for_every_texel_is_the_same_as_texel_by_texel(format):
    ptm = random_polynomials(format, (4, 3))
    u, v = np.random.default_rng(1).uniform(-0.7, 0.7, (2, 3, 4))
    pictures = evaluate(ptm, u, v)
    assert pictures.shape == (3, 4, 3) and pictures.dtype == np.float32
    for row, column in np.ndindex(3, 4):
        alone = evaluate(ptm, u[row, column], v[row, column])[row, column]
        np.testing.assert_allclose(pictures[row, column], alone, atol=1e-6)


def test_a_direction_need_not_be_of_length_one():
    ptm = random_polynomials()
    np.testing.assert_allclose(relight(ptm, [3, 0, 4]), evaluate(ptm, 0.6, 0), atol=1e-6)


def test_light_fades_below_the_surface_and_does_not_come_back():
    ptm = one_texel([0, 0, 0, 0, 0, 1], color=np.ones((1, 1, 3), np.float32))
    angles = np.linspace(0.2, -np.pi / 2, 200)
    values = np.array([relight(ptm, [np.cos(a), 0, np.sin(a)])[0, 0, 0] for a in angles])
    assert (np.diff(values) <= 0).all()
    assert (values[angles >= 0] == 1).all() and (values[np.sin(angles) <= -DROP_OFF] == 0).all()
    half = relight(ptm, [np.sqrt(1 - DROP_OFF**2 / 4), 0, -DROP_OFF / 2])[0, 0, 0]
    assert linear_from_srgb(half) == pytest.approx(0.5, abs=1e-3)
    linear = relight(replace(ptm, curve="linear"), [np.sqrt(1 - DROP_OFF**2 / 4), 0, -DROP_OFF / 2])
    assert linear[0, 0, 0] == pytest.approx(0.5, abs=1e-3)


def test_light_below_the_surface_is_not_mistaken_for_light_above():
    ptm = one_texel([0, 0, 0, 1, 0, 0], color=np.ones((1, 1, 3), np.float32), curve="linear")
    low = np.array([0.5, 0, -0.02])
    expected = drop_off(low[2] / np.linalg.norm(low))
    assert relight(ptm, low)[0, 0, 0] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("direction", [[0, 0, 0], [np.nan, 0, 1], [np.inf, 0, 1]])
def test_no_direction_is_refused(direction):
    with pytest.raises(SettingsError, match="direction"):
        relight(random_polynomials(), direction)


def test_a_series_has_no_light():
    series = random_polynomials(parameters="series")
    assert channels(series, 0.5, 0).shape == (5, 7, 1)
    with pytest.raises(SettingsError, match="series"):
        relight(series, [0, 0, 1])


@pytest.mark.parametrize(
    "change",
    [
        {"coefficients": np.zeros((2, 2, 2, 6), np.float32)},
        {"coefficients": np.zeros((0, 2, 1, 6), np.float32)},
        {"coefficients": np.full((5, 7, 1, 6), np.nan, np.float32)},
        {"color": np.zeros((5, 6, 3), np.float32)},
        {"color": None},
        {"chroma": np.zeros((5, 7, 2), np.float32), "rgb_from_luma": np.zeros((3, 4))},
    ],
)
def test_arrays_that_make_no_ptm_are_refused(change):
    with pytest.raises(SettingsError, match="PTM"):
        replace(random_polynomials(), **change)
