"""Where rays end in a room, against a search for the wall by halving; points on walls and beyond them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from impostor.environment import Environment, Reflection, Room
from impostor.environment.room import WALL
from impostor.errors import SettingsError

EMPTY = Environment("empty", np.zeros((6, 8, 8, 3)))
PIXEL = np.pi / 2 / 1024


@st.composite
def rooms(draw, shapes=("sphere", "box")):
    """Of any size, place and turn, captured anywhere inside, stretched or not."""
    size = draw(st.tuples(*[st.floats(0.1, 100)] * 3))
    position = draw(st.tuples(*[st.floats(-50, 50)] * 3))
    room = Room.box(EMPTY, size, position, draw(st.floats(-7, 7)))
    captured = np.array(draw(st.tuples(*[st.floats(-1, 1)] * 3))) * draw(st.sampled_from([0, 0.5, 0.99])) / np.sqrt(3)
    return replace(
        room, shape=draw(st.sampled_from(shapes)), captured_at=tuple(captured), stretched=draw(st.booleans())
    )


directions = arrays(np.float64, (8, 3), elements=st.sampled_from([-1, 0, 1]) | st.floats(-1, 1)).map(
    lambda all: np.where(np.linalg.norm(all, axis=1, keepdims=True) > 1e-3, all, [0, 0, -1])
)


def points_inside(room, places):
    """Of the world, for places from -1 to 1 along the axes of a room."""
    if room.shape == "sphere":
        places = places / np.maximum(np.linalg.norm(places, axis=-1, keepdims=True), 1)
    return places @ room.world_from_room[:3, :3].T + room.world_from_room[:3, 3]


def inside(room, points):
    """By the equation of the wall, in the world: no part of the room's own mathematics."""
    axes, middle = room.world_from_room[:3, :3], room.world_from_room[:3, 3]
    along = (points - middle) @ axes / np.square(axes).sum(axis=0)
    return (np.square(along).sum(axis=-1) if room.shape == "sphere" else np.abs(along).max(axis=-1)) <= 1


def searched(room, points, toward):
    """Where rays from inside leave a room: the last place inside, found by halving."""
    toward = toward / np.linalg.norm(toward, axis=-1, keepdims=True)
    near = np.zeros(len(points))
    far = np.full(len(points), 4 * np.linalg.norm(room.world_from_room[:3, :3]))
    for _ in range(80):
        middle = (near + far) / 2
        within = inside(room, points + middle[:, None] * toward)
        near, far = np.where(within, middle, near), np.where(within, far, middle)
    return points + near[:, None] * toward


def seen_toward(room, walls):
    """The environment's direction in which its camera saw points of the wall."""
    camera = room.world_from_room[:3, :3] @ room.captured_at + room.world_from_room[:3, 3]
    axes = room.world_from_room[:3, :3]
    lengths = np.linalg.norm(axes, axis=0)
    return (walls - camera) @ (axes / lengths) / (lengths if room.stretched else 1)


def angle(first, second):
    return np.arctan2(np.linalg.norm(np.cross(first, second), axis=-1), (first * second).sum(axis=-1))


@given(rooms(), arrays(np.float64, (8, 3), elements=st.sampled_from([0, 0.999]) | st.floats(-0.999, 0.999)), directions)
@settings(max_examples=300)
def test_a_ray_from_anywhere_inside_ends_where_a_search_finds_the_wall(room, places, toward):
    """Within a tenth of a pixel of faces of 1024."""
    points = points_inside(room, places * 0.999)
    found, within = room.directions_toward(points, toward)
    assert within.all()
    assert angle(found, seen_toward(room, searched(room, points, toward))).max() < 0.1 * PIXEL


@given(rooms(), arrays(np.float64, (8, 3), elements=st.sampled_from([-1, 0, 1]) | st.floats(-2, 2)), directions)
@settings(max_examples=300)
def test_directions_are_finite_wherever_the_point_is(room, places, toward):
    """On walls, edges and corners, and outside: a number, and a direction that a look-up can take."""
    points = places @ room.world_from_room[:3, :3].T + room.world_from_room[:3, 3]
    found, within = room.directions_toward(points, toward)
    assert np.isfinite(found).all()
    assert np.linalg.norm(found, axis=-1).min() > 0
    size = np.linalg.norm(places, axis=-1) if room.shape == "sphere" else np.abs(places).max(axis=-1)
    assert np.array_equal(within[np.abs(size - 1) > 2 * WALL], size[np.abs(size - 1) > 2 * WALL] < 1)
    assert np.array_equal(within, room.contains(points))


@pytest.mark.parametrize("shape", ["sphere", "box"])
def test_a_point_on_the_wall_is_inside_and_sees_the_other_side(shape):
    room = replace(Room.box(EMPTY, (4, 3, 6), (1, 1.5, -2), 0.7), shape=shape)
    axes, middle = room.world_from_room[:3, :3], room.world_from_room[:3, 3]
    for axis in range(3):
        for side in (-1, 1):
            point = middle + side * axes[:, axis]
            found, within = room.directions_toward(point, -side * axes[:, axis])
            assert within
            assert angle(found, -side * np.eye(3)[axis]) < 1e-9
            outward, within = room.directions_toward(point, side * axes[:, axis])
            assert within
            assert angle(outward, side * np.eye(3)[axis]) < 1e-9


def test_a_mirror_on_the_wall_shows_the_corner_it_faces():
    """A box of 2 x 2 x 2 from the middle of its floor, half way up: the edge between wall and ceiling."""
    room = Room.box(EMPTY, (2, 2, 2))
    found, within = room.directions_toward([0, -1, 0], [1, 2, 0])
    assert within
    assert np.allclose(found, [1, 1, 0])


def test_what_a_camera_on_the_wall_touches_has_a_direction():
    room = replace(Room.box(EMPTY, (2, 2, 2)), captured_at=(0, -1, 0))
    found, within = room.directions_toward([0, 0, 0], [0, -3, 0])
    assert within
    assert np.allclose(found, [0, -1, 0])


def test_far_surroundings_are_turned_and_the_same_everywhere():
    room = Room.far(EMPTY, yaw=np.pi / 2)
    found, within = room.directions_toward(np.full((5, 3), 1e6), [1, 0, 0])
    assert within.shape == (5,)
    assert within.all()
    assert np.allclose(found, [[0, 0, 1]] * 5)
    assert room.contains([[0, 0, 0], [1e9, 0, 0]]).all()


def test_a_stretched_environment_shows_a_wall_for_each_face():
    """From the middle of a long room the corner of the cube map is the corner of the room."""
    room = replace(Room.box(EMPTY, (2, 2, 10)), stretched=True)
    found, _ = room.directions_toward([0, 0, 0], [1, 1, 5])
    assert np.allclose(found / found[0], 1)
    captured, _ = replace(room, stretched=False).directions_toward([0, 0, 0], [1, 1, 5])
    assert np.allclose(captured / captured[0], [1, 1, 5])


def test_reflections_outside_are_false_in_any_batch_shape():
    room = Room.sphere(EMPTY, 2, (0, 1, 0))
    found, within = room.directions_toward([[[0, 1, 0]], [[0, 4, 0]]], np.eye(3))
    assert found.shape == (2, 3, 3)
    assert within.tolist() == [[True] * 3, [False] * 3]


def test_rooms_that_light_alike_have_equal_keys():
    first, second = (Room.box(EMPTY, (1, 2, 3), yaw=0.5) for _ in range(2))
    assert first.key == second.key
    assert first.key != replace(first, exposure=2).key
    assert first.key != replace(first, environment=Environment("other", np.zeros((6, 8, 8, 3)))).key


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"shape": "cone"}, "shape 'cone'; expected one of far, sphere, box"),
        ({"world_from_room": np.diag([1, 1, np.nan, 1])}, "world_from_room with a number that is not finite"),
        ({"world_from_room": 2 * np.eye(4)}, "not affine; expected"),
        ({"world_from_room": np.diag([1, 0, 1, 1])}, "no inverse"),
        ({"world_from_room": np.diag([1, 1, -1, 1])}, "mirrors"),
        ({"world_from_room": np.eye(4) + np.eye(4, k=1) * [0, 1, 0, 0]}, "not at right angles"),
        ({"exposure": -1}, "exposure -1; expected a number of at least 0"),
        ({"exposure": np.inf}, "exposure inf"),
        ({"exposure": "2"}, "exposure is a str; expected a number of at least 0"),
        ({"exposure": None}, "exposure is a NoneType; expected"),
        ({"captured_at": (0, 1.5, 0)}, "expected a point inside"),
        ({"captured_at": (0, np.nan, 0)}, "captured_at with a number that is not finite"),
        ({"captured_at": "a"}, "captured_at is a str; expected numbers"),
        ({"outside": (1, 0)}, r"outside of shape \(2,\); expected \(3,\)"),
        ({"outside": "red"}, "outside is a str; expected numbers"),
        ({"outside": (1, -1, 0)}, "none negative"),
    ],
)
def test_a_room_that_cannot_be_is_refused(changes, message):
    with pytest.raises(SettingsError, match=message):
        replace(Room.box(EMPTY, (2, 2, 2)), **changes)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (
            lambda: Room.far("study.exr"),
            "environment: a str; expected an Environment, as impostor.load_environment gives",
        ),
        (lambda: Room.far(EMPTY, yaw="x"), "room: yaw is a str; expected a finite number"),
        (lambda: Room.far(EMPTY, exposure="2"), "room: exposure is a str; expected a number of at least 0"),
        (lambda: Room.box(EMPTY, (4, 3)), "room: size of shape (2,); expected (3,)"),
        (lambda: Room.box(EMPTY, "abc"), "room: size is a str; expected numbers of shape (3,)"),
        (lambda: Room.box(EMPTY, (4, 3, 4), position=(0, 1)), "room: position of shape (2,); expected (3,)"),
        (lambda: Room.sphere(EMPTY, "x"), "room: radius is a str; expected a number above 0"),
        (lambda: Room.sphere(EMPTY, 0), "room: radius 0; expected a number above 0"),
    ],
)
def test_what_no_room_can_be_made_of_is_said(made, message):
    with pytest.raises(SettingsError) as caught:
        made()
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"least": "a"}, "reflection: least is a str; expected a number from 0 to 1"),
        ({"exponent": 65}, "reflection: exponent 65; expected a number from 0 to 64"),
        ({"roughness": np.nan}, "reflection: roughness nan; expected a number from 0 to 1"),
    ],
)
def test_a_reflection_that_cannot_be_is_refused(changes, message):
    with pytest.raises(SettingsError) as caught:
        Reflection(**changes)
    assert str(caught.value) == message
