"""The clear sky: as much light as the sun's day says, where the standard has it, and no jump as the sun goes."""

from dataclasses import replace

import numpy as np
import pytest

from impostor.environment import Environment
from impostor.environment.bright_lights import LUMINANCE, bright_lights
from impostor.environment.cube import sample
from impostor.errors import SettingsError
from impostor.scene import Scene, SceneCamera, SceneRoom, Sun
from impostor.sky import clear_sky, sky_of
from impostor.sun import lighting_at, sky_color, sun_at
from impostor.views import direction
from runtime.walk.sun_control import SunControl

BLUE, YELLOW = (0.2, 0.4, 0.7), (1.0, 0.9, 0.7)
UP = (0.0, 1.0, 0.0)
CAMERA = SceneCamera((0, 0, 1), (0, 0, 0))
SKY = SceneRoom(None, sky=True)


def luminance(sky, azimuth_deg, elevation_deg):
    return float(sky.radiance(direction(np.radians(azimuth_deg), np.radians(elevation_deg))) @ LUMINANCE)


@pytest.mark.parametrize("elevation_deg", [-8, 0, 3, 40, 90])
def test_what_faces_up_gets_the_light_that_was_asked_for(elevation_deg):
    sky = clear_sky(np.radians(elevation_deg), BLUE, YELLOW, ground=(0, 0, 0))
    assert sample(sky.diffuse, UP) @ LUMINANCE == pytest.approx(float(LUMINANCE @ BLUE), rel=0.01)
    np.testing.assert_allclose(sample(sky.diffuse, (0, -1, 0)), 0, atol=0.01)


def test_the_ground_shines_with_what_falls_on_it():
    sky = clear_sky(np.radians(30), BLUE, YELLOW, ground=(0.5, 0.2, 0.1))
    expected = np.multiply((0.5, 0.2, 0.1), np.add(BLUE, np.multiply(YELLOW, 0.5)))
    np.testing.assert_allclose(sky.radiance((0.3, -1, 0.2)), expected, rtol=1e-5)


@pytest.mark.parametrize(("haze", "c", "e"), [(0, 10, 0.45), (1, 16, 0.30)])
def test_brightness_is_the_standards(haze, c, e):
    """CIE S 011/E:2003: gradation times indicatrix, of grey skies whose colour does not matter."""
    sun = np.radians(35)
    sky = clear_sky(sun, (0.4, 0.4, 0.4), (1, 1, 1), haze=haze)

    def relative(azimuth_deg, elevation_deg):
        toward = direction(np.radians(azimuth_deg), np.radians(elevation_deg))
        away = np.arccos(toward @ direction(0, sun))
        return (1 - np.exp(-0.32 / toward[1])) * (
            1 + c * (np.exp(-3 * away) - np.exp(-3 * np.pi / 2)) + e * np.cos(away) ** 2
        )

    for place in ((0, 60), (90, 20), (180, 45), (-45, 10)):
        found, expected = luminance(sky, *place) / luminance(sky, 0, 90), relative(*place) / relative(0, 90)
        assert found == pytest.approx(expected, rel=0.02), place


def test_it_is_brightest_around_the_sun_blue_above_and_pale_below():
    sky = clear_sky(np.radians(20), (0.32, 0.44, 0.55), YELLOW)
    assert luminance(sky, 0, 20) > 3 * luminance(sky, 180, 20)
    overhead, horizon = (sky.radiance(direction(np.pi, np.radians(each))) for each in (90, 4))
    assert overhead[2] / overhead[0] > 2.5 and horizon[2] / horizon[0] < 2.2


def test_the_sun_itself_is_not_in_it():
    assert bright_lights(clear_sky(np.radians(20), BLUE, YELLOW), 4) == []


@pytest.mark.parametrize(
    "wrong", [{"elevation": np.nan}, {"sky": (1, 2)}, {"sun": (-1, 0, 0)}, {"haze": 2}, {"ground": "green"}]
)
def test_what_is_wrong_is_refused_in_one_line(wrong):
    with pytest.raises(SettingsError) as caught:
        clear_sky(**({"elevation": 0.3, "sky": BLUE, "sun": YELLOW} | wrong))
    assert next(iter(wrong)) in str(caught.value) and "\n" not in str(caught.value)


def test_a_mix_of_two_is_convolved_as_it_would_be_by_itself():
    first, second = (clear_sky(np.radians(each), BLUE, YELLOW) for each in (10, 14))
    mixed = Environment.between("mixed", first, second, 0.25)
    alone = Environment("alone", mixed.faces)
    np.testing.assert_allclose(mixed.diffuse, alone.diffuse, atol=1e-4)
    for found, expected in zip(mixed.levels, alone.levels, strict=True):
        np.testing.assert_allclose(found, expected, atol=0.002)
    assert not mixed.sources


class TestOfAScene:
    scene = Scene("a.toml", CAMERA, sun=Sun(time_of_day=9), rooms=(SKY,), ambient=(0.1, 0.1, 0.1))

    def at(self, hours):
        return replace(self.scene, sun=replace(self.scene.sun, time_of_day=hours))

    def test_it_has_the_light_of_the_day_instead_of_the_ambient(self):
        now = sun_at(self.scene.sun, 9)
        found, expected = sample(sky_of(self.scene).diffuse, UP), now.ambient
        assert found @ LUMINANCE == pytest.approx(float(LUMINANCE @ expected), rel=0.02)
        np.testing.assert_allclose(found, expected, rtol=0.3)
        assert lighting_at(self.scene).ambient == (0.1, 0.1, 0.1)
        assert lighting_at(self.scene).lights == (now.light,)

    def test_nothing_jumps_at_dawn(self):
        found = np.array([sample(sky_of(self.at(hours)).diffuse, UP) for hours in np.linspace(3.5, 5.5, 61)])
        assert np.abs(np.diff(found, axis=0)).max() < 0.02
        assert found[-1].max() > 5 * found[0].max()

    def test_it_turns_with_the_sun_and_stays_the_same_object_for_a_while(self):
        control = SunControl(self.scene)
        before = control.sky
        for hours in (0.0, 3.0, 6.0):
            (yaw,) = self.yaws_after(control, hours)
            toward = control.lighting.lights[0].toward
            assert np.cos(yaw - np.arctan2(toward[0], toward[2])) == pytest.approx(1, abs=1e-9)
        assert control.sky is not before
        assert SunControl(self.at(9.0001)).sky is before

    def yaws_after(self, control, hours):
        control.turn_clock(hours)
        return control.room_yaws

    def test_without_a_sun_or_a_room_there_is_none(self):
        assert sky_of(replace(self.scene, sun=None)) is None
        assert SunControl(replace(self.scene, rooms=())).sky is None


def test_the_sky_has_a_colour_at_every_hour():
    assert (sky_color(np.radians(-40)) > 0).all() and sky_color(np.radians(60))[2] > 0.5
