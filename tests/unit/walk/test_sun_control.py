"""The sun of a walk: it goes on with the time of day, and where it is dragged."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from impostor.lighting import DirectionalLight
from impostor.scene import Scene, SceneCamera, SceneRoom, Sun
from runtime.walk.sun_control import USUAL_RATE, SunControl

CAMERA = SceneCamera((0, 1, 5), (0, 1, 0))
SUNNY = Scene(Path("s.toml"), CAMERA, sun=Sun(time_of_day=9.0))
LAMPLIT = Scene(Path("s.toml"), CAMERA, lights=(DirectionalLight((0, 1, 1)), DirectionalLight((1, 0, 0))))


def angles(control):
    """Azimuth and elevation of the last light."""
    x, y, z = control.lighting.lights[-1].toward
    return np.arctan2(x, z), np.arcsin(y)


def test_time_goes_on_where_the_scene_says_so_or_someone_else():
    still, running = SunControl(SUNNY), SunControl(replace(SUNNY, sun=Sun(9.0, hours_per_second=2.0)))
    for control in (still, running):
        control.step(0.5)
    assert angles(still) == angles(SunControl(SUNNY))
    later = SunControl(replace(SUNNY, sun=Sun(10.0)))
    assert angles(running) == pytest.approx(angles(later))
    still.running = True
    still.step(1 / USUAL_RATE)
    assert angles(still) == pytest.approx(angles(later))
    assert still.words.startswith("10:00")


@pytest.mark.parametrize("hours", [9.0, 15.0])
def test_dragged_up_the_sun_rises_and_dragged_down_it_sets(hours):
    control = SunControl(replace(SUNNY, sun=Sun(hours)))
    _, before = angles(control)
    control.drag(0.0, 0.1)
    assert angles(control)[1] > before + 0.02
    control.drag(0.0, -0.2)
    assert angles(control)[1] < before - 0.02
    control.drag(0.0, 100.0)
    assert angles(control)[1] == pytest.approx(angles(SunControl(replace(SUNNY, sun=Sun(12.0))))[1], abs=1e-3)


def test_dragged_to_the_right_the_sun_goes_to_the_right_of_who_looks_at_it():
    control = SunControl(SUNNY)
    azimuth, elevation = angles(control)
    control.drag(0.3, 0.0)
    assert angles(control) == pytest.approx((azimuth - 0.3, elevation))


def test_without_a_sun_the_first_light_is_dragged():
    control = SunControl(LAMPLIT)
    control.drag(0.2, 0.1)
    first, second = control.lighting.lights
    assert np.arctan2(first.toward[0], first.toward[2]) == pytest.approx(-0.2)
    assert np.arcsin(first.toward[1]) == pytest.approx(np.pi / 4 + 0.1)
    assert second == LAMPLIT.lights[1]
    assert not control.has_time


def test_a_changed_scene_keeps_the_time_unless_its_light_is_another():
    control = SunControl(SUNNY)
    control.turn_clock(3.0)
    control.change(replace(SUNNY, ambient=(1.0, 1.0, 1.0)), frozenset({"ambient"}))
    assert control.words.startswith("12:00")
    control.change(replace(SUNNY, sun=Sun(17.0)), frozenset({"sun"}))
    assert control.words.startswith("17:00")


def test_rooms_turn_with_time_and_far_ones_are_dragged_with_the_sun():
    far, box = SceneRoom(Path("a.hdr"), turn=0.5), SceneRoom(Path("b.hdr"), "box", yaw=0.1)
    control = SunControl(replace(SUNNY, rooms=(far, box)))
    assert control.running and control.has_time
    control.step(2.0)
    control.drag(0.3, 0.0)
    assert control.room_yaws == pytest.approx((0.7, 0.1))
    control.change(replace(SUNNY, rooms=(box,)), frozenset({"rooms"}))
    assert control.room_yaws == (0.1,) and not control.running
