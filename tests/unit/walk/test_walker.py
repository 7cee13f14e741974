"""Someone who walks: where keys and mouse bring the eye."""

import numpy as np
import pytest

from runtime.walk.walker import SPRINT, Walker

AHEAD = {"forward": (0, 0, 1), "back": (0, 0, -1), "left": (1, 0, 0), "right": (-1, 0, 0)}


def seen_at(walker, point):
    """Where in the picture, x and y in -1..1, a point before the eye is seen."""
    clip_from_view, view_from_world = walker.camera(60, 1.0, 0.1, 1000).matrices
    x, y, _, w = clip_from_view @ view_from_world @ np.append(point, 1.0)
    assert w > 0, "behind the eye"
    return x / w, y / w


@pytest.mark.parametrize("way", AHEAD)
def test_a_second_of_walking_toward_plus_z(way):
    walker = Walker(np.array([1.0, 1.7, 2.0]), speed=3)
    walker.step({way}, 1.0)
    np.testing.assert_allclose(walker.eye, np.array([1, 1.7, 2]) + 3 * np.array(AHEAD[way]), atol=1e-12)


def test_right_is_where_the_right_of_the_picture_is():
    walker = Walker(np.zeros(3), yaw=0.7, pitch=0.2, flying=True)
    before = seen_at(walker, (20 * walker.sight))
    point = 20 * walker.sight
    walker.step({"right"}, 1.0)
    assert seen_at(walker, point)[0] < before[0] - 0.1


def test_the_mouse_turns_toward_its_movement():
    walker = Walker(np.zeros(3))
    point = 10 * walker.sight
    walker.turn(0.2, 0.1)
    x, y = seen_at(walker, point)
    assert x < -0.1 and y < -0.05


def test_diagonals_are_no_faster_and_opposites_cancel():
    walker = Walker(np.zeros(3), speed=2)
    walker.step({"forward", "right"}, 0.5)
    assert np.linalg.norm(walker.eye) == pytest.approx(1.0)
    walker.step({"forward", "back", "turn left", "turn right"}, 0.5)
    assert np.linalg.norm(walker.eye) == pytest.approx(1.0)
    assert walker.yaw == 0


def test_many_short_steps_are_as_far_as_a_long_one():
    short, long = Walker(np.zeros(3)), Walker(np.zeros(3))
    for _ in range(10):
        short.step({"forward", "sprint"}, 0.1)
    long.step({"forward", "sprint"}, 1.0)
    np.testing.assert_allclose(short.eye, long.eye, atol=1e-9)
    assert np.linalg.norm(long.eye) == pytest.approx(SPRINT * Walker.speed)


def test_who_walks_looks_up_and_stays_level_and_who_flies_does_not():
    walker = Walker(np.array([0, 1.7, 0]), pitch=0.8, ground_height=lambda x, z: 0.0)
    walker.step({"forward"}, 1.0)
    assert walker.eye[1] == pytest.approx(1.7)
    assert walker.eye[2] == pytest.approx(walker.speed)
    walker.flying = True
    walker.step({"forward"}, 1.0)
    assert walker.eye[1] > 3


def test_walking_follows_a_slope():
    walker = Walker(np.array([0, 1.7, 0]), ground_height=lambda x, z: z / 2, speed=1)
    for _ in range(300):
        walker.step({"forward"}, 1 / 30)
    assert walker.eye[1] == pytest.approx(walker.eye[2] / 2 + 1.7, abs=0.1)
    walker.step((), 2.0)
    assert walker.eye[1] == pytest.approx(walker.eye[2] / 2 + 1.7, abs=1e-3)


def test_flight_stays_above_the_ground():
    walker = Walker(np.array([0, 5, 0]), pitch=-1.2, flying=True, ground_height=lambda x, z: 2.0)
    walker.step({"forward", "down"}, 60.0)
    assert 2 < walker.eye[1] < 2.5


@pytest.mark.parametrize(
    ("eye", "target"), [((3, 2, 1), (-4, 5, 6)), ((0, 0, 0), (0, -5, 0.1)), ((1, 1, 1), (1, 1, 0))]
)
def test_looking_at_a_point_shows_it_in_the_middle(eye, target):
    walker = Walker(np.zeros(3))
    walker.look_at(eye, target)
    np.testing.assert_allclose(seen_at(walker, np.array(target, float)), (0, 0), atol=0.05)


def test_nobody_looks_over_the_zenith():
    walker = Walker(np.zeros(3))
    walker.look_at((0, 0, 0), (0, 5, 0))
    walker.turn(0.0, 1.0)
    assert np.isfinite(walker.camera(60, 1, 0.1, 10).view_from_world).all()
    assert seen_at(walker, 5 * walker.sight) == pytest.approx((0, 0), abs=1e-9)


def test_the_callers_array_is_left_alone():
    eye = np.array([0, 9.0, 0])
    Walker(eye, ground_height=lambda x, z: 0.0).step({"forward"}, 1.0)
    assert eye.tolist() == [0, 9, 0]
