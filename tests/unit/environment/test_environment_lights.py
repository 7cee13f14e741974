"""Lights found in an environment: where two known discs are, and the brightest place of real panoramas."""

from dataclasses import replace

import numpy as np
import pytest

from impostor.environment import Environment, Room
from impostor.environment.bright_lights import AREA, LUMINANCE, bright_lights, brightest_direction
from impostor.environment.cube import face_directions, solid_angles
from impostor.errors import SettingsError
from impostor.files.environment_file import read_environment
from impostor.lighting import DirectionalLight
from tests.data import DATA, needs_data

PANORAMAS = ("blender_forest.exr", "blender_studio.exr", "blender_sunset.exr", "royal_esplanade_1k.hdr")
PANORAMAS += ("spiaggia_di_mondello_1k.hdr", "studio_small_09_1k.hdr", "venice_sunset_1k.hdr")
BACKGROUND = np.array([0.3, 0.4, 0.5])
LAMP, WINDOW = np.array([50.0, 40.0, 30.0]), np.array([5.0, 6.0, 8.0])
TOWARD_LAMP, TOWARD_WINDOW = np.array([1, 0.7, 0.3]), np.array([-1, 0.5, -0.9])


def unit(vector):
    return np.asarray(vector) / np.linalg.norm(vector)


def angle(first, second):
    return np.arctan2(np.linalg.norm(np.cross(first, second)), np.dot(first, second))


def with_discs(*discs, size=128, samples=4):
    """An environment of even discs (direction, angular radius, radiance)."""
    faces = []
    for directions in face_directions(size * samples):
        light = np.broadcast_to(BACKGROUND, directions.shape).copy()
        for toward, radius, radiance in discs:
            light[directions @ unit(toward) > np.cos(radius)] = radiance
        faces.append(light.reshape(size, samples, size, samples, 3).mean(axis=(1, 3)))
    return Environment("discs", np.stack(faces))


@pytest.mark.parametrize(("lamp", "window"), [(1.5, 12), (4, 4), (8, 25)])
def test_two_discs_are_found_as_they_are(lamp, window):
    lamp, window = np.radians([lamp, window])
    environment = with_discs((TOWARD_LAMP, lamp, LAMP), (TOWARD_WINDOW, window, WINDOW))
    lights = bright_lights(environment, 5)
    assert len(lights) == 2
    expected = [
        (TOWARD_LAMP, lamp, (LAMP - BACKGROUND) * np.sin(lamp) ** 2),
        (TOWARD_WINDOW, window, (WINDOW - BACKGROUND) * np.sin(window) ** 2),
    ]
    expected.sort(key=lambda disc: -disc[2] @ LUMINANCE)
    for light, (toward, radius, color) in zip(lights, expected, strict=True):
        assert angle(light.toward, toward) < np.radians(0.1)
        assert np.allclose(light.color, color, rtol=0.02)
        assert light.softness == pytest.approx(radius, rel=0.1)


def test_the_colour_is_what_a_white_surface_shows():
    """The diffuse light with the disc, less that without."""
    disc = TOWARD_LAMP, np.radians(5), LAMP
    (light,) = bright_lights(with_discs(disc), 1)
    assert isinstance(light, DirectionalLight)
    directions = face_directions(32)
    beyond = with_discs(disc).diffuse - with_discs().diffuse
    assert np.abs(beyond - np.maximum(directions @ light.toward, 0)[..., None] * light.color).max() < 0.01


def test_only_as_many_as_asked_for_and_the_brightest_first():
    environment = with_discs((TOWARD_LAMP, 0.1, LAMP), (TOWARD_WINDOW, 0.1, WINDOW))
    (brightest,) = bright_lights(environment, 1)
    assert [brightest] == bright_lights(environment, 2)[:1]
    assert angle(brightest.toward, TOWARD_LAMP) < 0.01


@pytest.mark.parametrize("size", [8, 64])
@pytest.mark.parametrize("radiance", [0.0, 1.0])
def test_even_surroundings_have_no_lights(size, radiance):
    assert bright_lights(Environment("even", np.full((6, size, size, 3), radiance)), 3) == []


def test_a_room_turns_and_exposes_its_lights():
    environment = with_discs((TOWARD_LAMP, 0.1, LAMP))
    (plain,) = bright_lights(environment, 1)
    (turned,) = bright_lights(Room.far(environment, yaw=np.pi / 2, exposure=3), 1)
    x, y, z = plain.toward
    assert np.allclose(turned.toward, (z, y, -x))
    assert np.allclose(turned.color, np.multiply(plain.color, 3))
    assert turned.softness == plain.softness


def test_a_stretched_room_stretches_the_way_to_its_lights():
    room = Room.box(with_discs((TOWARD_LAMP, 0.1, LAMP)), (2, 4, 6))
    assert angle(bright_lights(room, 1)[0].toward, TOWARD_LAMP) < 1e-3
    stretched = replace(room, stretched=True)
    assert angle(bright_lights(stretched, 1)[0].toward, TOWARD_LAMP * [1, 2, 3]) < 1e-2


def test_a_coarse_map_has_its_brightest_texel():
    faces = np.ones((6, 8, 8, 3))
    faces[2, 3, 4] = 30
    (light,) = bright_lights(Environment("coarse", faces), 3)
    assert angle(light.toward, face_directions(8)[2, 3, 4]) < 1e-6
    assert np.allclose(light.color, 29 * solid_angles(8)[3, 4] / np.pi, rtol=1e-3)


@pytest.mark.parametrize("count", [0, -1])
def test_no_lights_cannot_be_asked_for(count):
    with pytest.raises(SettingsError, match=f"bright lights: {count} lights; expected at least 1"):
        bright_lights(with_discs(size=8), count)


@needs_data
@pytest.mark.parametrize("name", PANORAMAS)
def test_the_brightest_direction_of_a_panorama_is_within_half_a_degree(name):
    """Of the place that a climb over all texels finds from anywhere near the top."""
    environment = read_environment(DATA / "env" / name, 64)
    toward = face_directions(64).reshape(-1, 3)
    light = (environment.faces @ LUMINANCE * solid_angles(64)).ravel()

    def blurred(directions):
        return np.exp((directions @ toward.T - 1) / AREA**2) @ light

    coarse = face_directions(16).reshape(-1, 3)
    brightest = coarse[np.argsort(-blurred(coarse))[:5]]
    for _ in range(40):
        near = np.exp((brightest @ toward.T - 1) / AREA**2) * light
        brightest = near @ toward
        brightest /= np.linalg.norm(brightest, axis=-1, keepdims=True)
    best = brightest[blurred(brightest).argmax()]
    assert angle(brightest_direction(environment), best) < np.radians(0.5)


@needs_data
@pytest.mark.parametrize("name", PANORAMAS)
def test_lights_never_hold_more_than_the_panorama(name):
    environment = read_environment(DATA / "env" / name, 128)
    lights = bright_lights(environment, 16)
    held = (environment.faces * solid_angles(128)[..., None]).sum(axis=(0, 1, 2)) / np.pi
    assert np.all(np.sum([light.color for light in lights], axis=0) < held)
    brightness = [LUMINANCE @ light.color for light in lights]
    assert brightness == sorted(brightness, reverse=True)
    # The sun, the lamp or the window of each of these holds a part that shadows should show.
    assert brightness[0] > 0.02 * held @ LUMINANCE
