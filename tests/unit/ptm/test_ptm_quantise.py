"""Rounding to 8 bits."""

from dataclasses import replace

import numpy as np
import pytest

from impostor.errors import SettingsError
from impostor.ptm import Polynomials, evaluate, quantise
from tests.ptms import matt_bumps, random_polynomials, random_ptm

LIGHTS = [(0, 0), (0.7, 0), (-0.5, 0.5), (0, -0.8)]


def psnr(one, other):
    errors = [evaluate(one, *light) - evaluate(other, *light) for light in LIGHTS]
    return -10 * np.log10(np.mean(np.square(errors)))


def test_a_byte_is_what_the_format_says():
    ptm = random_ptm("RGB")
    value = (ptm.coefficients[3, 2, 1, 4].astype(float) - ptm.bias[4]) * ptm.scale[4]
    assert ptm.polynomials().coefficients[3, 2, 1, 4] == pytest.approx(value / 255, rel=1e-6)


@pytest.mark.parametrize("format", ["RGB", "LRGB", "LUM"])
def test_a_coefficient_is_off_by_half_a_step(format):
    ptm = random_polynomials(format, (40, 30))
    rounded = quantise(ptm)
    error = np.abs(rounded.polynomials().coefficients - ptm.coefficients) * 255 / rounded.scale
    inside = (rounded.coefficients > 0) & (rounded.coefficients < 255)
    assert error[inside].max() <= 0.5 + 1e-3
    assert error.max() <= 1 + 1e-3


def test_eight_bits_look_like_floats():
    assert psnr(quantise(matt_bumps()[1]).polynomials(), matt_bumps()[1]) > 52


def test_zero_stays_zero():
    ptm = random_polynomials()
    ptm.coefficients[2, 3] = 0
    assert (quantise(ptm).polynomials().coefficients[2, 3] == 0).all()


def test_a_plane_of_one_value_keeps_it():
    for value in (0, 0.75, -0.5):
        ptm = replace(random_polynomials(), coefficients=np.full((5, 7, 1, 6), value, np.float32))
        rounded = quantise(ptm)
        np.testing.assert_allclose(rounded.polynomials().coefficients, value, rtol=1e-6)
        assert (rounded.scale == 1).all() == (value == 0)


def test_the_scale_is_one_that_seven_digits_print():
    scale = quantise(random_polynomials()).scale
    assert [float(f"{value:.7g}") for value in scale] == scale.tolist()


def test_color_past_white_moves_into_the_luminance():
    ptm = random_polynomials()
    bright = replace(ptm, color=ptm.color * 3, coefficients=ptm.coefficients / 3)
    assert psnr(quantise(bright).polynomials(), ptm) > 40


def test_chroma_past_its_bounds_moves_into_the_matrix():
    ptm = random_polynomials("LUM")
    wide = replace(
        ptm, chroma=ptm.chroma * 4 - 2, rgb_from_luma=ptm.rgb_from_luma @ np.diag([1, 0.25, 0.25, 1]).astype(float)
    )
    assert psnr(quantise(wide).polynomials(), wide) > 40


def test_a_second_rounding_changes_nothing():
    once = quantise(random_polynomials("RGB", (20, 20)))
    again = quantise(once.polynomials(), once.scale, once.bias)
    np.testing.assert_array_equal(once.coefficients, again.coefficients)


def test_what_no_file_can_hold_is_refused():
    ptm = random_polynomials()
    with pytest.raises(SettingsError, match="scale"):
        quantise(replace(ptm, coefficients=ptm.coefficients * np.float32(1e33)))
    for name, values in (("scale", -1.0), ("bias", 256)):
        with pytest.raises(SettingsError, match=name):
            replace(random_ptm(), **{name: np.full(6, values)})
    with pytest.raises(SettingsError, match="uint8"):
        replace(random_ptm(), color=np.zeros((5, 7, 3)))


def test_curve_and_parameters_are_kept():
    rounded = quantise(random_polynomials(curve="linear", parameters="view"))
    assert isinstance(rounded.polynomials(), Polynomials)
    assert (rounded.polynomials().curve, rounded.polynomials().parameters) == ("linear", "view")
