"""What rough surfaces mirror: against sums over all texels, and what must hold whatever the map."""

import numpy as np
import pytest

from impostor.environment import Environment
from impostor.environment.cube import face_directions, faces_of, sample, solid_angles
from impostor.errors import SettingsError

SUN = np.array([0.2, 0.5, 0.8]) / np.linalg.norm([0.2, 0.5, 0.8])


def with_sun(size, background=0.0, power=1.0):
    """Even surroundings and one texel that shines with some irradiance."""
    faces = np.full((6, size, size, 3), background, np.float32)
    (face,), (place,) = faces_of(SUN[None])
    column, row = ((place + 1) * size / 2).astype(int)
    faces[face, row, column] = power / solid_angles(size)[row, column]
    return Environment("sun", faces), face_directions(size)[face, row, column]


@pytest.fixture(scope="module")
def outdoors():
    """A sky brighter than the ground, noise, and a sun of one texel a hundred thousand times as bright."""
    height = face_directions(64)[..., 1:2]
    noise = np.random.default_rng(3).uniform(0.5, 1, (6, 64, 64, 3))
    sun, _ = with_sun(64, power=2.0)
    return Environment("outdoors", noise * np.where(height > 0, 1, 0.2) * [0.6, 0.8, 1] + sun.faces)


def mean_under(lobe, environment, directions):
    """Weighted means over all texels of lobes around directions, by their cosines."""
    toward, angles = (
        face_directions(environment.size).reshape(-1, 3),
        np.tile(solid_angles(environment.size), (6, 1, 1)),
    )
    weights = lobe(directions @ toward.T) * angles.ravel()
    return weights @ environment.faces.reshape(-1, 3) / weights.sum(axis=1, keepdims=True)


def ggx_lobe(alpha):
    """Walter's distribution of the half vector, times the cosine to the light, written from the definition."""

    def lobe(cosine):
        half = np.sqrt((1 + np.clip(cosine, -1, 1)) / 2)
        distribution = alpha**2 / (np.pi * (half**2 * (alpha**2 - 1) + 1) ** 2)
        return distribution * np.maximum(cosine, 0)

    return lobe


@pytest.mark.parametrize("level", [1, 2, 3])
def test_a_level_is_the_mean_under_its_lobe(level, outdoors):
    faces = outdoors.levels[level]
    directions = face_directions(faces.shape[1]).reshape(-1, 3)
    nearest = np.argsort(-directions @ SUN)[:20]
    places = np.concatenate([nearest, np.random.default_rng(4).choice(len(directions), 200)])
    expected = mean_under(ggx_lobe((level / 3) ** 2), outdoors, directions[places])
    found = faces.reshape(-1, 3)[places]
    assert np.abs(found / expected - 1).max() < 0.01
    assert np.sqrt(np.mean((found / expected - 1) ** 2)) < 0.002


def test_sizes_halve_down_to_8_and_level_0_is_the_map(outdoors):
    assert [level.shape for level in outdoors.levels] == [(6, size, size, 3) for size in (64, 32, 16, 8)]
    assert all(level.dtype == np.float32 for level in outdoors.levels)
    assert outdoors.levels[0] is outdoors.faces


@pytest.mark.parametrize("size", [8, 16, 128])
def test_even_surroundings_stay_even(size):
    environment = Environment("even", np.full((6, size, size, 3), (0.25, 3.5, 7), np.float32))
    for faces in (*environment.levels, environment.diffuse):
        assert np.abs(faces / [0.25, 3.5, 7] - 1).max() < 1e-4


def test_light_is_neither_made_nor_lost(outdoors):
    def power(faces):
        return (faces * solid_angles(faces.shape[1])[..., None]).sum(axis=(0, 1, 2))

    for level, bound in zip(outdoors.levels[1:], (0.002, 0.002, 0.01), strict=True):
        assert np.abs(power(level) / power(outdoors.faces) - 1).max() < bound


def test_a_small_sun_becomes_a_smooth_round_spot():
    environment, sun = with_sun(128)
    level = environment.levels[1]
    around = np.linspace(0, 2 * np.pi, 64, endpoint=False)[:, None]
    across = np.cross(sun, [0, 1, 0]) / np.linalg.norm(np.cross(sun, [0, 1, 0]))
    ring = np.cos(around) * across + np.sin(around) * np.cross(sun, across)
    profile = []
    for degrees in np.arange(0, 60, 1.0):
        seen = sample(level, np.cos(np.radians(degrees)) * sun + np.sin(np.radians(degrees)) * ring)[:, 0]
        profile.append(seen.mean())
        assert np.ptp(seen) < 0.1 * seen.mean() + 1e-4 * profile[0]
    assert np.all(np.diff(profile) < 0)
    assert profile[10] < profile[0] / 4


def test_no_sun_makes_light_anywhere_darker_than_the_darkest():
    environment, _ = with_sun(64, background=0.01, power=100.0)
    assert min(level.min() for level in (*environment.levels, environment.diffuse)) >= np.float32(0.01)


def test_a_look_at_some_roughness_is_between_levels(outdoors):
    directions = np.random.default_rng(5).normal(size=(50, 3))
    between = outdoors.mirrored(directions, 0.5)
    looks = [sample(outdoors.levels[level], directions) for level in (1, 2)]
    assert np.allclose(between, (looks[0] + looks[1]) / 2, rtol=1e-5)
    assert np.array_equal(outdoors.mirrored(directions, 0), outdoors.radiance(directions))
    assert np.allclose(outdoors.mirrored(directions, 1), sample(outdoors.levels[-1], directions))


def test_every_direction_may_have_its_own_roughness(outdoors):
    directions = np.random.default_rng(6).normal(size=(7, 1, 3))
    roughness = np.linspace(0, 1, 5)
    together = outdoors.mirrored(directions, roughness)
    assert together.shape == (7, 5, 3)
    for place, each in enumerate(roughness):
        assert np.allclose(together[:, place], outdoors.mirrored(directions[:, 0], each), rtol=1e-5)


def test_the_roughest_mirror_shows_the_diffuse_light(outdoors):
    """GGX of alpha 1, head-on, is the cosine."""
    toward = face_directions(8).reshape(-1, 3)
    mirrored, diffuse = outdoors.mirrored(toward, 1), sample(outdoors.diffuse, toward)
    assert np.abs(mirrored - diffuse).max() < 0.01 * diffuse.mean()


@pytest.mark.parametrize("shape", [(6, 8, 8), (6, 12, 12, 3), (6, 4, 4, 3), (5, 8, 8, 3), (6, 8, 16, 3)])
def test_faces_of_another_shape_are_refused(shape):
    with pytest.raises(SettingsError, match=r"hall: faces of shape .*; expected \(6, N, N, 3\)"):
        Environment("hall", np.ones(shape))


@pytest.mark.parametrize("wrong", [-1e-3, np.nan, np.inf])
def test_light_that_cannot_be_is_refused(wrong):
    faces = np.ones((6, 8, 8, 3))
    faces[2, 3, 4, 1] = wrong
    with pytest.raises(SettingsError, match="hall: radiance that is negative or not finite"):
        Environment("hall", faces)
