"""A room as a few lights: none of its light lost, and lit as the room lights."""

import numpy as np
import pytest

from impostor.environment import Environment, Room
from impostor.environment.cube import face_directions, solid_angles
from impostor.environment.light_cut import LUMINANCE, in_world, light_cut
from impostor.errors import SettingsError


def sky(size=128):
    """A blue gradient, a warm ground, and a small sun at azimuth 60 and elevation 30 degrees."""
    directions = face_directions(size)
    faces = np.where(directions[..., 1:2] > 0, (0.2, 0.4, 0.9), (0.2, 0.15, 0.1)) * (1.2 + directions[..., 1:2])
    sun = np.array([np.sin(np.radians(60)), np.tan(np.radians(30)), np.cos(np.radians(60))])
    faces[directions @ (sun / np.linalg.norm(sun)) > np.cos(0.03)] = 20_000
    return Environment("sky", faces.astype(np.float32))


@pytest.mark.parametrize("count", [1, 7, 32])
def test_no_light_is_lost(count):
    environment = sky()
    lights = light_cut(environment, count)
    whole = (environment.faces * solid_angles(128)[..., None]).sum(axis=(0, 1, 2)) / np.pi
    assert len(lights) == count
    np.testing.assert_allclose(np.sum([light.color for light in lights], axis=0), whole, rtol=1e-5)


def test_surfaces_are_lit_as_by_the_whole_room():
    environment, normals = sky(), np.random.default_rng(3).normal(size=(200, 3))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    power = (environment.faces * solid_angles(128)[..., None]).reshape(-1, 3) / np.pi
    whole = np.maximum(normals @ face_directions(128).reshape(-1, 3).T, 0) @ power
    lights = light_cut(environment, 64)
    shown = sum(np.maximum(normals @ light.toward, 0)[:, None] * light.color for light in lights)
    assert np.sqrt(np.square(shown - whole).mean()) < 0.02 * whole.mean()


def test_the_sun_turns_with_its_room_and_comes_first():
    environment = sky()
    still = light_cut(environment, 16)
    brightest = in_world(still, Room.far(environment, yaw=np.radians(20), exposure=2), 0.25)[0]
    azimuth, elevation = np.arctan2(brightest.toward[0], brightest.toward[2]), np.arcsin(brightest.toward[1])
    assert np.degrees([azimuth, elevation]) == pytest.approx([80, 30], abs=2)
    assert brightest.color == pytest.approx(np.multiply(still[0].color, 0.5))


def test_darkness_gives_no_light_and_one_texel_one():
    faces = np.zeros((6, 8, 8, 3), np.float32)
    assert light_cut(Environment("dark", faces), 4) == []
    faces[0, 3, 4] = 5
    (light,) = light_cut(Environment("one texel", faces), 4)
    assert light.toward == pytest.approx(tuple(face_directions(8)[0, 3, 4]), abs=1e-9)
    assert LUMINANCE @ light.color == pytest.approx(5 * solid_angles(8)[3, 4] / np.pi)


def test_no_lights_is_refused():
    with pytest.raises(SettingsError, match="0 lights"):
        light_cut(sky(8), 0)
