"""Filtered coefficients give filtered pictures."""

from dataclasses import replace

import numpy as np
import pytest

from impostor.ptm import Polynomials
from impostor.ptm.mipmaps import halve, light_gram, mip_maps
from impostor.ptm.polynomials import basis, channels, picture
from tests.ptms import matt_bumps, random_polynomials

LIGHTS = [(0, 0), (0.7, 0), (-0.5, 0.5), (0, -0.8)]


def unclamped(ptm, light):
    return picture(ptm, channels(ptm, *light))


def error(one, pictures):
    return np.sqrt(
        np.mean([np.square(unclamped(one, light) - shown) for light, shown in zip(LIGHTS, pictures, strict=True)])
    )


def covered_mean(image, size):
    """Mean of what each texel of a smaller size covers, by counting texels cut in pieces."""
    height, width = image.shape[:2]
    pieces = image.repeat(size[1], axis=0).repeat(size[0], axis=1)
    return pieces.reshape(size[1], height, size[0], width, -1).mean(axis=(1, 3))


@pytest.mark.parametrize("size", [(8, 8), (7, 5), (9, 4), (1, 6), (3, 1), (13, 11)])
def test_each_texel_is_the_mean_of_what_it_covers(size):
    image = np.random.default_rng(0).random((size[1], size[0], 2), np.float32)
    smaller = max(size[0] // 2, 1), max(size[1] // 2, 1)
    np.testing.assert_allclose(halve(image), covered_mean(image, smaller), atol=5e-6)


@pytest.mark.parametrize("format", ["RGB", "LUM"])
def test_rgb_and_lum_filter_exactly_down_to_one_texel(format):
    ptm = random_polynomials(format, (13, 7))
    levels = mip_maps(ptm)
    assert [level.size for level in levels] == [(13, 7), (6, 3), (3, 1), (1, 1)]
    for light in LIGHTS:
        whole = unclamped(ptm, light).mean(axis=(0, 1))
        np.testing.assert_allclose(unclamped(levels[-1], light)[0, 0], whole, atol=1e-5)


def test_lrgb_filters_better_than_luminance_and_color_apart():
    _, bumps = matt_bumps()
    random = np.random.default_rng(0)
    depth = random.uniform(0.1, 1, (*bumps.color.shape[:2], 1, 1)).astype(np.float32)
    fine = replace(bumps, coefficients=bumps.coefficients * depth, color=random.random(bumps.color.shape, np.float32))
    products = Polynomials(fine.coefficients * fine.color[..., None])
    levels = zip(mip_maps(fine)[1:4], mip_maps(products)[1:4], strict=True)
    luminance, color = fine.coefficients, fine.color
    for level, exact in levels:
        luminance, color = halve(luminance), halve(color)
        pictures = [unclamped(exact, light) for light in LIGHTS]
        assert error(level, pictures) < 0.5 * error(Polynomials(luminance, color), pictures)


def test_lrgb_of_one_color_filters_exactly():
    _, bumps = matt_bumps()
    plain = replace(bumps, color=np.broadcast_to(np.float32([0.9, 0.5, 0]), bumps.color.shape))
    for level in mip_maps(plain)[1:]:
        np.testing.assert_allclose(level.color, np.broadcast_to([0.9, 0.5, 0], level.color.shape), atol=1e-4)
    for light in LIGHTS:
        whole = unclamped(plain, light).mean(axis=(0, 1))
        np.testing.assert_allclose(unclamped(mip_maps(plain)[-1], light)[0, 0], whole, atol=1e-4)


def test_black_stays_black_and_finite():
    black = Polynomials(np.zeros((6, 6, 1, 6), np.float32), np.zeros((6, 6, 3), np.float32))
    assert all(unclamped(level, (0.3, 0.3)).max() == 0 for level in mip_maps(black))


def test_the_gram_matrix_is_the_mean_over_the_disc():
    u, v = np.meshgrid(np.linspace(-1, 1, 801), np.linspace(-1, 1, 801))
    terms = basis(u, v)[u * u + v * v <= 1]
    np.testing.assert_allclose(light_gram(), terms.T @ terms / len(terms), atol=1e-3)
