"""The light on matt surfaces: against the sum over every texel of real panoramas."""

import numpy as np
import pytest

from impostor.environment import Environment
from impostor.environment.cube import face_directions, sample, solid_angles
from impostor.environment.harmonics import diffuse_harmonics, harmonic_diffuse
from impostor.files.environment_file import read_environment
from impostor.files.radiance_file import read_radiance
from tests.data import DATA, needs_data

# Root mean square of what nine harmonics are off by, parts of the mean: measured, and a little more.
PANORAMAS = {
    "blender_forest.exr": 0.032,
    "blender_studio.exr": 0.083,
    "blender_sunset.exr": 0.018,
    "royal_esplanade_1k.hdr": 0.058,
    "spiaggia_di_mondello_1k.hdr": 0.077,
    "studio_small_09_1k.hdr": 0.042,
    "venice_sunset_1k.hdr": 0.018,
}


def directions_of(count):
    """Spread evenly over the sphere, on a spiral."""
    y, turn = 1 - (2 * np.arange(count) + 1) / count, np.arange(count) * np.pi * (3 - np.sqrt(5))
    level = np.sqrt(1 - y**2)
    return np.stack([level * np.sin(turn), y, level * np.cos(turn)], axis=-1)


def diffuse_of_panorama(texels, normals):
    """Cosine-weighted means of a panorama by its own texels; its middle column looks along -Z."""
    height, width = texels.shape[:2]
    elevation = (0.5 - (np.arange(height) + 0.5) / height) * np.pi
    azimuth = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    elevation, azimuth = np.meshgrid(elevation, azimuth, indexing="ij")
    level = np.cos(elevation)
    toward = np.stack([level * np.sin(azimuth), np.sin(elevation), -level * np.cos(azimuth)], axis=-1).reshape(-1, 3)
    light = (texels * (level * (2 * np.pi / width) * 2 * np.sin(np.pi / height / 2))[..., None]).reshape(-1, 3)
    some = np.array_split(normals, max(len(normals) // 10, 1))
    return np.concatenate([np.maximum(each @ toward.T, 0) @ light for each in some]) / np.pi


def rms(found, expected):
    return np.sqrt(np.mean((found - expected) ** 2)) / expected.mean()


@needs_data
@pytest.mark.parametrize("name", PANORAMAS)
def test_the_diffuse_light_of_a_panorama_is_within_1_percent(name):
    """In any direction, by the look-up that shaders make, and nine harmonics within what they promise."""
    texels, normals = read_radiance(DATA / "env" / name), directions_of(100)
    environment = read_environment(DATA / "env" / name)
    expected = diffuse_of_panorama(texels, normals)
    assert rms(sample(environment.diffuse, normals), expected) < 0.003
    assert rms(harmonic_diffuse(diffuse_harmonics(environment), normals), expected) < PANORAMAS[name]


def test_a_sun_of_one_texel_lights_like_a_light():
    faces = np.zeros((6, 128, 128, 3), np.float32)
    faces[4, 40, 100] = np.pi / solid_angles(128)[40, 100]
    sun, normals = face_directions(128)[4, 40, 100], directions_of(2000)
    found = sample(Environment("sun", faces).diffuse, normals)[:, 0]
    assert np.abs(found - np.maximum(normals @ sun, 0)).max() < 0.015
    assert np.sqrt(np.mean((found - np.maximum(normals @ sun, 0)) ** 2)) < 0.002


@pytest.mark.parametrize("size", [8, 32, 256])
def test_the_diffuse_cube_is_small_whatever_the_map(size):
    diffuse = Environment("even", np.ones((6, size, size, 3))).diffuse
    assert diffuse.shape == (6, 32, 32, 3)
    assert diffuse.dtype == np.float32


def test_nine_harmonics_are_exact_where_they_suffice():
    """Light that changes as a plane: 2 + x - y / 2 arrives as 2 + 2/3 (x - y / 2)."""
    slope = np.array([1, -0.5, 0])
    faces = (2 + face_directions(64) @ slope)[..., None] * [1, 2, 3]
    normals = directions_of(50)
    found = harmonic_diffuse(diffuse_harmonics(Environment("plane", faces)), normals)
    assert np.allclose(found, (2 + 2 / 3 * normals @ slope)[:, None] * [1, 2, 3], atol=1e-3)


def test_harmonics_of_second_degree_fall_to_a_quarter():
    x, y, z = np.moveaxis(face_directions(64), -1, 0)
    for faces in (x * y, y * z, x * z, x**2 - y**2, 3 * z**2 - 1):
        environment = Environment("wave", np.repeat(faces[..., None] + 2, 3, axis=-1))
        normals = face_directions(4).reshape(-1, 3)
        found = harmonic_diffuse(diffuse_harmonics(environment), normals)
        expected = 2 + (sample(faces[..., None], normals)) / 4
        assert np.allclose(found, expected, atol=2e-3)
