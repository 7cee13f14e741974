"""Vector quantisation: small, close, and the same every time."""

from dataclasses import replace

import numpy as np
import pytest

from impostor.errors import SettingsError
from impostor.ptm import Polynomials, evaluate
from impostor.ptm.codebook import make_codebook
from tests.ptms import matt_bumps, random_polynomials


def psnr(one, other):
    errors = [evaluate(one, *light) - evaluate(other, *light) for light in [(0, 0), (0.7, 0), (-0.5, 0.5)]]
    return -10 * np.log10(np.mean(np.square(errors)))


def test_three_bytes_a_texel_look_like_nine():
    _, bumps = matt_bumps((160, 128))
    smooth = replace(bumps, color=np.broadcast_to(np.float32([0.8, 0.6, 0.4]), bumps.color.shape))
    book = make_codebook(smooth)
    assert book.codes.shape == (128, 160, 3) and book.codes.dtype == np.uint8
    assert psnr(book.polynomials(), smooth) > 38


def test_more_entries_are_closer():
    _, bumps = matt_bumps((80, 64))
    quality = [psnr(make_codebook(bumps, entries).polynomials(), bumps) for entries in (4, 32, 512)]
    assert quality[0] + 5 < quality[1] < quality[2] - 5
    assert make_codebook(bumps, 512).codes.dtype == np.uint16


@pytest.mark.parametrize("format", ["RGB", "LRGB", "LUM"])
def test_as_many_entries_as_texels_lose_nothing(format):
    ptm = random_polynomials(format, (6, 4), curve="linear")
    same = make_codebook(ptm).polynomials()
    np.testing.assert_allclose(same.coefficients, ptm.coefficients, atol=1e-5)
    np.testing.assert_allclose(evaluate(same, 0.3, -0.4), evaluate(ptm, 0.3, -0.4), atol=1e-5)
    assert same.curve == "linear"


def test_a_seed_gives_one_codebook():
    _, bumps = matt_bumps()
    one, again = make_codebook(bumps, 16, seed=3), make_codebook(bumps, 16, seed=3)
    np.testing.assert_array_equal(one.codes, again.codes)
    for table, other in zip(one.tables, again.tables, strict=True):
        np.testing.assert_array_equal(table, other)


def test_black_is_no_special_case():
    black = Polynomials(np.zeros((4, 4, 1, 6), np.float32), np.zeros((4, 4, 3), np.float32))
    assert evaluate(make_codebook(black).polynomials(), 0.5, 0.5).max() == 0


@pytest.mark.parametrize("entries", [0, 65537])
def test_a_table_that_no_code_can_name_is_refused(entries):
    with pytest.raises(SettingsError, match="entries"):
        make_codebook(random_polynomials(), entries)
