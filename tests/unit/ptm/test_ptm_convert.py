"""One kind of PTM as another."""

import numpy as np
import pytest

from impostor.errors import SettingsError
from impostor.ptm import evaluate
from impostor.ptm.convert import converted
from tests.ptms import matt_bumps, random_polynomials

LIGHTS = [(0.0, 0.0), (0.5, -0.3), (-0.7, 0.6)]


def farthest(one, other):
    return max(np.abs(evaluate(one, *light) - evaluate(other, *light)).max() for light in LIGHTS)


@pytest.mark.parametrize("kind", ["LRGB", "LUM"])
def test_to_rgb_nothing_is_lost(kind):
    polynomials = random_polynomials(kind)
    rgb = converted(polynomials, "RGB")
    assert rgb.format == "RGB"
    assert farthest(rgb, polynomials) < 1e-5


def test_what_has_one_hue_a_texel_comes_back_from_rgb():
    _, polynomials = matt_bumps()
    there = converted(converted(polynomials, "RGB"), "LRGB")
    assert there.format == "LRGB"
    assert there.color.max() <= 1
    assert farthest(there, polynomials) < 1e-4


def test_a_gray_ptm_comes_back_from_luma():
    polynomials = random_polynomials("RGB")
    polynomials.coefficients[:] = polynomials.coefficients[:, :, :1]
    there = converted(polynomials, "LUM")
    assert there.format == "LUM"
    np.testing.assert_allclose(there.chroma, 128 / 255, atol=1e-5)
    assert farthest(there, polynomials) < 1e-5


def test_luma_is_jfifs_and_chroma_the_mean_one():
    """A red that gets brighter toward the right: its luma is 0.299 of it, under every light."""
    polynomials = random_polynomials("RGB", size=(1, 1))
    polynomials.coefficients[:] = 0
    polynomials.coefficients[0, 0, 0] = (0, 0, 0, 0.4, 0, 0.5)
    there = converted(polynomials, "LUM")
    np.testing.assert_allclose(there.coefficients[0, 0, 0], 0.299 * polynomials.coefficients[0, 0, 0], atol=1e-6)
    np.testing.assert_allclose(there.chroma[0, 0, 0], 0.5 * 0.701 / 1.402 + 128 / 255, atol=1e-4)


def test_what_it_is_already_stays_as_it_is():
    polynomials = random_polynomials("LUM", curve="linear", parameters="view")
    assert converted(polynomials, "LUM") is polynomials
    assert converted(polynomials, "LRGB").curve == "linear"
    assert converted(polynomials, "RGB").parameters == "view"


def test_another_kind_is_refused():
    with pytest.raises(SettingsError, match="expected one of RGB, LRGB, LUM"):
        converted(random_polynomials(), "HSH")
