"""The sun stands where it does on Earth, is red when low, off at night, and never jumps."""

import numpy as np
import pytest

from impostor.lighting import DirectionalLight
from impostor.scene import Scene, SceneCamera, Sun
from impostor.sun import hours_at, lighting_at, sun_at
from impostor.views import direction

EQUINOX = 81
CAMERA = SceneCamera((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))


def sun(latitude_deg=45.0, **settings):
    return Sun(latitude=np.radians(latitude_deg), **settings)


@pytest.mark.parametrize(
    ("latitude_deg", "day", "elevation_deg"),
    [(0, EQUINOX, 90), (52, 172, 90 - 52 + 23.44), (52, 355, 90 - 52 - 23.44), (-30, 172, 90 - 30 - 23.44)],
)
def test_height_at_noon(latitude_deg, day, elevation_deg):
    elevation = sun_at(sun(latitude_deg, day_of_year=day), 12).elevation
    assert np.degrees(elevation) == pytest.approx(elevation_deg, abs=0.5)


def test_it_rises_in_the_east_stands_south_at_noon_and_sets_in_the_west():
    """North is -Z unless said otherwise, so that east is +X and south +Z."""
    day = sun(45, day_of_year=EQUINOX)
    for hours, toward in ((6, (1, 0, 0)), (18, (-1, 0, 0))):
        daylight = sun_at(day, hours)
        np.testing.assert_allclose(direction(daylight.azimuth, daylight.elevation), toward, atol=0.01)
    noon = sun_at(day, 12)
    np.testing.assert_allclose(noon.light.toward, (0, np.sqrt(0.5), np.sqrt(0.5)), atol=0.01)


def test_it_stands_north_at_noon_south_of_the_equator():
    assert sun_at(sun(-45, day_of_year=EQUINOX), 12).light.toward[2] < -0.7


def test_north_may_lie_anywhere():
    turned = sun_at(sun(45, day_of_year=EQUINOX, north=np.radians(90)), 12)
    np.testing.assert_allclose(turned.light.toward, (-np.sqrt(0.5), np.sqrt(0.5), 0), atol=0.01)


def test_the_light_shines_from_where_the_sun_stands():
    for hours in (5, 9, 13.3, 19):
        daylight = sun_at(sun(), hours)
        np.testing.assert_allclose(daylight.light.toward, direction(daylight.azimuth, daylight.elevation), atol=1e-9)


def test_length_of_the_day():
    hours = np.linspace(0, 24, 24 * 60, endpoint=False)
    lit = [np.mean([sun_at(sun(48, day_of_year=day), each).light is not None for each in hours]) for day in (172, 355)]
    # 48 degrees north: cos H = -tan(48) tan(23.44), 15.84 h and 8.16 h.
    np.testing.assert_allclose(np.multiply(lit, 24), [15.84, 8.16], atol=0.1)


def test_the_pole_has_no_night_in_summer_and_no_day_in_winter():
    hours = np.linspace(0, 24, 48)
    assert all(sun_at(sun(90), each).light is not None for each in hours)
    assert all(sun_at(sun(-90), each).light is None for each in hours)


def test_it_is_white_in_the_zenith_and_red_when_low():
    overhead = sun_at(sun(0, day_of_year=EQUINOX), 12).light.color
    np.testing.assert_allclose(overhead, 1, atol=0.01)
    low = np.array(sun_at(sun(0, day_of_year=EQUINOX), 6.35).light.color)
    assert low[0] > 1.5 * low[1] > 2.5 * low[2] > 0


def test_its_color_multiplies():
    plain, tinted = (sun_at(sun(color=color), 10).light.color for color in ((1, 1, 1), (2.0, 0.5, 0)))
    np.testing.assert_allclose(tinted, np.multiply(plain, (2, 0.5, 0)))


def test_the_sky_is_blue_by_day_and_dark_by_night():
    noon, night = sun_at(sun(), 12).sky, sun_at(sun(), 0).sky
    assert noon[2] > 1.5 * noon[0]
    assert max(night) < 0.05 < max(noon)


def test_nothing_jumps_all_day_long():
    hours = np.linspace(0, 24, 24 * 3600 // 5 + 1)
    days = [sun_at(sun(), each) for each in hours]
    light = np.array([(0, 0, 0) if day.light is None else day.light.color for day in days])
    for values in (light, np.array([day.sky for day in days]), np.array([day.ambient for day in days])):
        assert np.abs(np.diff(values, axis=0)).max() < 0.01
        assert values.max() > 0.2


def test_a_scene_without_sun_keeps_its_own_light():
    light = DirectionalLight.from_angles(10, 20)
    lighting = lighting_at(Scene("a.toml", CAMERA, (light,), ambient=(0.1, 0.2, 0.3)), 5)
    assert lighting.lights == (light,)
    assert lighting.ambient == (0.1, 0.2, 0.3)
    assert lighting.background == (0, 0, 0)


def test_the_sun_adds_to_a_scenes_light_and_goes_with_time():
    light, day = DirectionalLight.from_angles(10, 20), sun(time_of_day=22, hours_per_second=2)
    scene = Scene("a.toml", CAMERA, (light,), day, ambient=(0.1, 0.1, 0.1))
    night, morning = lighting_at(scene, 0), lighting_at(scene, 5)
    assert night.lights == (light,)
    assert morning.lights == (light, sun_at(day, 8).light)
    assert morning.background == sun_at(day, 8).sky
    assert np.all(np.greater(morning.ambient, night.ambient)) and min(night.ambient) > 0.1
    assert hours_at(day, 5) == 8


def test_a_background_of_its_own_stays():
    scene = Scene("a.toml", CAMERA, sun=sun(), background=(0.2, 0, 0))
    assert lighting_at(scene, 0).background == (0.2, 0, 0)
