"""Normals, albedo, highlights and diffuse gain."""

import numpy as np
import pytest

from impostor.errors import SettingsError
from impostor.ptm import Polynomials, evaluate, relight
from impostor.ptm.normals import albedo, brightest_light, diffuse_gain, normals, relight_specular
from impostor.ptm.polynomials import channels
from tests.ptms import matt_bumps, random_polynomials


def disc(count=160):
    """Light directions all over the unit disc, and closely along its rim."""
    u, v = np.meshgrid(np.linspace(-1, 1, count), np.linspace(-1, 1, count))
    inside = u * u + v * v <= 1
    rim = np.linspace(0, 2 * np.pi, 2000)
    return np.concatenate([u[inside], np.cos(rim)]), np.concatenate([v[inside], np.sin(rim)])


def test_normals_of_a_matt_surface_are_its_own():
    truth, ptm = matt_bumps()
    np.testing.assert_allclose(normals(ptm), truth, atol=2e-3)


def test_normals_are_unit_and_face_the_camera_whatever_the_polynomial():
    found = normals(random_polynomials("RGB", (30, 20)))
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), 1, atol=1e-6)
    assert found[..., 2].min() >= 0 and found.dtype == np.float32


def test_no_light_is_brighter_than_the_brightest():
    """Maxima inside, stationary points outside the disc, saddles and minima alike."""
    ptm = random_polynomials("LRGB", (25, 20), seed=4)
    light = brightest_light(ptm)
    best = channels(ptm, light[..., 0], light[..., 1])[..., 0]
    highest = np.full(best.shape, -np.inf)
    for u, v in zip(*disc(), strict=True):
        highest = np.maximum(highest, channels(ptm, u, v)[..., 0])
    assert (highest - best).max() < 1e-3
    assert np.hypot(light[..., 0], light[..., 1]).max() <= 1 + 1e-9


@pytest.mark.parametrize(
    ("coefficients", "expected"),
    [
        ([0, 0, 0, 0, 0, 0.5], (0, 0)),  # no light is brighter than another
        ([-1, 0, 0, 0.6, 0, 0], (0.3, 0)),  # a ridge: the most upright of its lights
        ([0, 0, 0, 3, 4, 0], (0.6, 0.8)),  # a slope: on the horizon
        ([-1, -1, 0, 4, 0, 0], (1, 0)),  # a maximum past the horizon
        ([1, -1, 0, 0.1, 0, 0], (1, 0)),  # a saddle
    ],
)
def test_landmarks(coefficients, expected):
    ptm = Polynomials(np.array(coefficients, np.float32).reshape(1, 1, 1, 6), np.ones((1, 1, 3), np.float32))
    np.testing.assert_allclose(brightest_light(ptm)[0, 0], expected, atol=1e-3)


def test_albedo_is_what_the_brightest_light_shows():
    _, ptm = matt_bumps()
    np.testing.assert_allclose(albedo(ptm), ptm.color, atol=2e-3)
    assert (albedo(ptm) >= evaluate(ptm, 0.5, 0.5) - 1e-3).all()


def test_a_highlight_stands_where_the_normal_halves_light_and_view():
    truth, ptm = matt_bumps()
    plain = relight(ptm, [0.5, 0, 1])
    added = (relight_specular(ptm, truth.astype(np.float32), [0.5, 0, 1], specular=0.3, exponent=200) - plain).max(-1)
    half = np.array([0.5, 0, 1]) / np.sqrt(1.25) + [0, 0, 1]
    closeness = truth @ (half / np.linalg.norm(half))
    assert added.min() >= 0
    assert added[closeness < 0.95].max(initial=0) < 1e-3
    bright = (closeness > 0.999) & (plain.max(axis=-1) < 0.7)
    assert bright.any() and added[bright].min() > 0.2


def test_no_highlight_from_below_and_no_negative_exponent():
    truth, ptm = matt_bumps()
    assert relight_specular(ptm, truth.astype(np.float32), [0.3, 0, -1]).max() == 0
    with pytest.raises(SettingsError, match="exponent"):
        relight_specular(ptm, truth.astype(np.float32), [0, 0, 1], exponent=-1)


@pytest.mark.parametrize("format", ["RGB", "LRGB", "LUM"])
def test_diffuse_gain_keeps_value_and_slope_at_the_normal_and_multiplies_curvature(format):
    ptm = random_polynomials(format)
    stronger = diffuse_gain(ptm, 2.5)
    u, v = np.moveaxis(brightest_light(ptm), -1, 0)
    np.testing.assert_allclose(channels(stronger, u, v), channels(ptm, u, v), atol=1e-5)
    step = 0.25
    for du, dv in ((step, 0), (0, step)):
        pairs = [(channels(p, u + du, v + dv), channels(p, u - du, v - dv), channels(p, u, v)) for p in (ptm, stronger)]
        (up, down, middle), (up2, down2, middle2) = pairs
        np.testing.assert_allclose(up2 - down2, up - down, atol=1e-5)
        np.testing.assert_allclose(up2 + down2 - 2 * middle2, 2.5 * (up + down - 2 * middle), atol=1e-5)


def test_diffuse_gain_keeps_a_matt_surfaces_normals_and_shows_them_more():
    truth, ptm = matt_bumps()
    stronger = diffuse_gain(ptm, 3)
    np.testing.assert_allclose(normals(stronger), truth, atol=5e-3)
    assert channels(stronger, 0.6, 0).std() > 1.2 * channels(ptm, 0.6, 0).std()
