"""Which rooms light a point: shares that sum to 1 and never jump."""

from dataclasses import replace

import numpy as np
import pytest

from impostor.environment import Environment, Room
from impostor.environment.blending import EDGE, diffuse_weights, mirrored_room
from impostor.errors import SettingsError

EMPTY = Environment("empty", np.zeros((6, 8, 8, 3)))
HALL = Room.box(EMPTY, (8, 4, 6), (0, 2, 0))
ANNEX = Room.box(EMPTY, (6, 3, 5), (5, 1.5, 0.5), yaw=0.3)
DOME = Room.sphere(EMPTY, 3, (-4, 1, 1))
SKY, NIGHT = Room.far(EMPTY), Room.far(EMPTY, exposure=0.1)
SETS = {
    "one": [HALL],
    "overlapping": [HALL, ANNEX, DOME],
    "outdoors": [SKY, HALL, DOME],
    "two skies": [SKY, HALL, NIGHT],
    "only skies": [SKY, NIGHT],
    "ellipsoid": [replace(HALL, shape="sphere"), ANNEX],
}


def points(count=4000):
    return np.random.default_rng(9).uniform((-9, -2, -6), (10, 6, 6), (count, 3))


@pytest.mark.parametrize("rooms", SETS.values(), ids=SETS)
def test_shares_sum_to_1_and_none_is_negative(rooms):
    weights = diffuse_weights(rooms, points())
    assert weights.shape == (4000, len(rooms))
    assert np.allclose(weights.sum(axis=-1), 1)
    assert weights.min() >= 0


def test_the_light_changes_smoothly_along_a_walk_out_of_the_door():
    """From the dome through hall and annex into the open, no step over a millimetre is large."""
    walk = np.linspace((-6, 1.2, 0.7), (12, 1.2, 0.7), 18001)
    weights = diffuse_weights([HALL, ANNEX, DOME, SKY], walk)
    assert np.abs(np.diff(weights, axis=0)).max() < 0.01
    assert weights[0].argmax() == 2
    assert weights[-1].tolist() == [0, 0, 0, 1]
    # Nor does the slope jump: no crease where a fade begins.
    assert np.abs(np.diff(weights, 2, axis=0)).max() < 1e-4


def test_inside_the_room_lights_alone_down_to_the_floor():
    inside = [0, 0, 0] + points(500) % 1 * [4, 4, 3]
    assert np.array_equal(diffuse_weights([SKY, HALL], inside), [[0, 1]] * 500)


def test_outside_the_wall_the_sky_takes_over():
    behind_it, away = (4 * (1 + EDGE / 2), 2, 0), (4 * (1 + EDGE), 2, 0)
    weights = diffuse_weights([SKY, HALL], [behind_it, away])
    assert np.allclose(weights, [[0.5, 0.5], [1, 0]])


def test_skies_share_evenly():
    assert np.allclose(diffuse_weights([SKY, HALL, NIGHT], (0, 50, 0)), [0.5, 0, 0.5])


@pytest.mark.parametrize("shape", ["box", "sphere"])
def test_where_no_room_is_the_nearest_lights_alone(shape):
    """By metres and not by sizes of the room: two metres from the small one, three from the large."""
    large, small = (replace(Room.box(EMPTY, (size,) * 3, (x, 0, 0)), shape=shape) for x, size in ((-13, 20), (2.5, 1)))
    assert diffuse_weights([large, small], (0, 0, 0)).tolist() == [0, 1]
    assert mirrored_room([large, small], (0, 0, 0)) == 1
    assert diffuse_weights([large, small], (-1, 0, 0)).tolist() == [1, 0]


def test_a_point_mirrors_the_first_room_it_is_in():
    there = [(0, 2, 0), (3.5, 1.5, 0.5), (7, 1, 0), (0, 50, 0)]
    assert mirrored_room([SKY, HALL, ANNEX], there).tolist() == [1, 1, 2, 0]
    assert mirrored_room([ANNEX, NIGHT, HALL, SKY], there).tolist() == [2, 0, 0, 1]
    assert mirrored_room([ANNEX, HALL], there).tolist() == [1, 0, 0, 1]


def test_no_room_is_refused():
    for choose in (diffuse_weights, mirrored_room):
        with pytest.raises(SettingsError, match="rooms: none; expected at least one"):
            choose([], (0, 0, 0))
