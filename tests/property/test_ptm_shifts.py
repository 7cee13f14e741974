"""The 1998 report's integers stay within their bound of the floats."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impostor.errors import SettingsError
from impostor.ptm import Polynomials, evaluate
from impostor.ptm.polynomials import channels
from impostor.ptm.shifts import UNIT, shift_quantise, whole_light
from tests.ptms import matt_bumps

light = st.integers(-UNIT, UNIT)


@st.composite
def polynomials(draw):
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    sizes = 10.0 ** np.array([draw(st.integers(-4, 1)) for _ in range(6)])
    coefficients = random.uniform(-1, 1, (3, 4, 1, 6)) * sizes
    return Polynomials(coefficients.astype(np.float32), np.ones((3, 4, 3), np.float32))


@given(polynomials(), light, light)
def test_integers_are_within_the_bound_of_the_floats(ptm, u, v):
    shifted = shift_quantise(ptm)
    exact = channels(ptm, u / UNIT, v / UNIT).astype(np.float64) * 255
    found = shifted.evaluate(u, v)
    assert found.dtype == np.int32
    rounding = 1e-4 * np.abs(ptm.coefficients).sum() * 255
    assert np.abs(found - exact).max() <= shifted.bound(u, v) + rounding


@given(polynomials())
def test_shifts_are_as_large_as_the_bytes_allow(ptm):
    shifted = shift_quantise(ptm)
    for order, shift in zip((slice(0, 3), slice(3, 5), slice(5, 6)), shifted.shifts, strict=True):
        largest = np.abs(shifted.coefficients[..., order].astype(int) - 127).max()
        assert largest >= 62 or shift == 30


@given(st.floats(-1, 1), st.floats(-1, 1))
def test_a_light_in_whole_numbers_is_off_by_half_of_one(lu, lv):
    u, v = whole_light(lu, lv)
    assert abs(u / UNIT - lu) <= 0.5 / UNIT + 1e-9 and abs(v / UNIT - lv) <= 0.5 / UNIT + 1e-9


def test_in_floats_it_is_the_same_surface():
    _, ptm = matt_bumps()
    same = shift_quantise(ptm).polynomials(ptm)
    assert np.abs(evaluate(same, 0.4, -0.5) - evaluate(ptm, 0.4, -0.5)).max() < 0.02


def test_light_out_of_range_is_refused():
    shifted = shift_quantise(matt_bumps()[1])
    with pytest.raises(SettingsError, match="light"):
        shifted.evaluate(128, 0)
