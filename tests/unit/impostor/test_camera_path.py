"""A flight passes every key, without a jerk."""

import numpy as np
import pytest

from impostor.camera_path import camera_at
from impostor.scene import CameraPath

TIMES = np.array([1.0, 2.0, 2.5, 7.0, 8.0])
EYES = np.array([[0, 1, 5], [3, 2, 1], [4, 2, 0], [4, 9, -20], [0, 0, -21.0]])
PATH = CameraPath(TIMES, EYES, EYES[::-1] * 0.5 + (0, 0, 60))


def positions(path, times):
    return np.array([camera_at(path, time) for time in times])


def test_every_key_is_passed_exactly():
    seen = positions(PATH, TIMES)
    np.testing.assert_array_equal(seen[:, 0], PATH.eyes)
    np.testing.assert_array_equal(seen[:, 1], PATH.targets)


@pytest.mark.parametrize(("time", "key"), [(-5, 0), (0.999, 0), (8.001, -1), (1e9, -1)])
def test_it_waits_before_the_first_key_and_stays_after_the_last(time, key):
    viewpoint = camera_at(PATH, time)
    assert viewpoint.eye == tuple(PATH.eyes[key]) and viewpoint.target == tuple(PATH.targets[key])


@pytest.mark.parametrize("key", [1, 2, 3])
def test_position_and_speed_are_steady_at_a_key(key):
    step = 1e-5
    before, at, after = positions(PATH, TIMES[key] + np.array([-step, 0, step]))
    np.testing.assert_allclose((at - before) / step, (after - at) / step, atol=0.01)
    assert np.abs(after - at).max() > 0.1 * step


def test_even_keys_on_a_line_give_an_even_flight():
    steps = np.array([0.0, 1.0, 3.0, 4.0])
    path = CameraPath(steps, steps[:, None] * (1, 2, 3), steps[:, None] * (1, 2, 3) + 1)
    times = np.linspace(0, 4, 41)
    np.testing.assert_allclose(positions(path, times)[:, 0], times[:, None] * (1, 2, 3), atol=1e-12)


def test_a_parabola_is_kept_between_inner_keys():
    """Tangents are those of the parabola through three keys, whatever their times."""
    times = np.array([0.0, 1.0, 2.5, 3.0, 4.5])
    eyes = np.stack([times, times**2, 0 * times], axis=-1)
    between = np.linspace(1, 3, 21)
    seen = positions(CameraPath(times, eyes, eyes + (0, 0, -1)), between)[:, 0]
    np.testing.assert_allclose(seen[:, 1], between**2, atol=1e-12)


def test_two_keys_make_a_straight_flight():
    path = CameraPath(TIMES[:2], EYES[:2], EYES[:2] + 1)
    assert camera_at(path, 1.25).eye == pytest.approx((0.75, 1.25, 4))


def test_a_target_that_meets_the_eye_leaves_a_direction_to_look_in():
    path = CameraPath(np.array([0.0, 1.0]), np.array([[-1.0, 0, 0], [1, 0, 0]]), np.array([[1.0, 0, 0], [-1, 0, 0]]))
    viewpoint = camera_at(path, 0.5)
    assert viewpoint.target == pytest.approx((2, 0, 0)) and viewpoint.eye == pytest.approx((0, 0, 0))
