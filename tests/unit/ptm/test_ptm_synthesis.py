"""A quilted PTM tiles, and looks like the given one."""

from dataclasses import replace

import numpy as np
import pytest

from impostor.errors import SettingsError
from impostor.ptm import Polynomials, Ptm, quantise, relight
from impostor.ptm.synthesis import reflectance_features, synthesise, without_seams
from tests.ptms import matt_bumps, random_polynomials


def steps(features, axis):
    """Squared distance from each texel to the one before it, around the edge."""
    return np.square(features - np.roll(features, 1, axis)).sum(axis=-1)


@pytest.fixture(scope="module")
def bumps():
    return quantise(matt_bumps((140, 120))[1])


@pytest.mark.parametrize("size", [(130, 97), (48, 48), (200, 60)])
def test_a_quilt_has_the_size_and_the_tones_of_its_source(bumps, size):
    quilted = synthesise(bumps, size, patch=32)
    assert isinstance(quilted, Ptm) and quilted.size == size
    for light in ([0, 0, 1], [0.6, 0.3, 0.74]):
        source, found = (relight(ptm.polynomials(), light) for ptm in (bumps, quilted))
        assert found.mean() == pytest.approx(source.mean(), abs=0.05)
        assert found.std() == pytest.approx(source.std(), rel=0.3)


def test_no_step_of_a_quilt_is_larger_than_in_its_source():
    """Smooth bumps in one colour: a seam would show as the one sharp line."""
    _, polynomials = matt_bumps((140, 120))
    plain = replace(polynomials, color=np.full_like(polynomials.color, 0.7))
    source, found = (reflectance_features(ptm) for ptm in (plain, synthesise(plain, (120, 90), patch=32, seed=1)))
    for axis in (0, 1):
        natural = np.square(np.diff(source, axis=axis)).sum(axis=-1)
        assert steps(found, axis).max() < 1.5 * natural.max()


def test_what_has_no_seam_stays_as_it_is():
    """A torus, turned by a third."""
    y, x = np.mgrid[:24, :36]
    texels = np.stack([np.sin(2 * np.pi * y / 12), np.cos(2 * np.pi * x / 18), 0 * x], axis=-1).astype(np.float32)
    rows, columns = (y[:12, :18] + 4, x[:12, :18] + 6)
    np.testing.assert_allclose(without_seams(texels, rows, columns), texels[4:16, 6:24], atol=1e-5)


def test_no_seam_is_worse_where_it_repeats_than_inside(bumps):
    polynomials = bumps.polynomials()
    flat = np.full_like(polynomials.color, 0.7)
    plain = type(polynomials)(polynomials.coefficients, flat)
    features = reflectance_features(synthesise(plain, (120, 90), patch=32, seed=1))
    source = reflectance_features(plain)
    shuffled = np.random.default_rng(0).permutation(features.reshape(-1, features.shape[-1])).reshape(features.shape)
    for axis in (0, 1):
        edge = np.take(steps(features, axis), 0, axis)
        chance = steps(shuffled, axis).mean()
        natural = np.diff(source, axis=axis)
        assert edge.mean() < 0.1 * chance
        assert steps(features, axis).mean() < 3 * np.square(natural).sum(axis=-1).mean()


def test_a_patch_is_chosen_for_every_light_at_once():
    """Where two texels look alike from above but not from the side, their distance shows it."""
    one, other = np.zeros((2, 1, 1, 1, 6), np.float32)
    one[..., 3], other[..., 3] = 0.5, -0.5
    pair = np.concatenate([one, other], axis=1)
    ptm = type(random_polynomials())(pair, np.ones((1, 2, 3), np.float32))
    assert np.abs(relight(ptm, [0, 0, 1])[0, 0] - relight(ptm, [0, 0, 1])[0, 1]).max() == 0
    features = reflectance_features(ptm)
    # Three channels of a mean of u² over the disc, which is a fourth.
    assert np.square(features[0, 0] - features[0, 1]).sum() == pytest.approx(0.75, rel=1e-4)


@pytest.mark.parametrize("format", ["RGB", "LRGB", "LUM"])
def test_a_seed_gives_one_texture_in_every_format(format):
    ptm = random_polynomials(format, (40, 40))
    one, again, other = (synthesise(ptm, (50, 30), patch=16, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.coefficients, again.coefficients)
    assert not np.array_equal(one.coefficients, other.coefficients)
    assert one.format == format and one.size == (50, 30)


@pytest.mark.parametrize(("size", "patch"), [((30, 60), 32), ((60, 60), 4), ((300, 300), 130)])
def test_sizes_that_do_not_go_together_are_refused(bumps, size, patch):
    with pytest.raises(SettingsError, match="expected"):
        synthesise(bumps, size, patch=patch)


@pytest.mark.parametrize("size", [(1, 1), (40, 1), (7, 40)])
def test_too_small_a_ptm_to_cut_patches_from_is_refused(size):
    with pytest.raises(SettingsError, match=f"{size[0]}x{size[1]} texels; expected sides of 8"):
        synthesise(random_polynomials(size=size), (40, 40), patch=8)


@pytest.mark.parametrize("value", [0.0, 0.5])
def test_equal_texels_make_a_texture_of_equal_texels(value):
    ptm = quantise(Polynomials(np.full((16, 16, 3, 6), value, np.float32)))
    made = synthesise(ptm, (40, 30), patch=8)
    assert (made.coefficients == ptm.coefficients[0, 0]).all()
