"""Cube maps taken from a scene: the room that shows one looks as the scene did, and is not mirrored."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from impostor.environment import Environment, Room
from impostor.errors import SettingsError
from impostor.model import Material, Model
from runtime.gl.offscreen import Offscreen
from runtime.rooms.capture import capture_environment
from runtime.viewing.cameras import Camera
from tests.pictures import apart
from tests.rooms import EMPTY
from tests.solids import BLUE, Box, solid_model

COLORS = [(250, 40, 30), (20, 200, 60), (60, 70, 240), (240, 230, 40), (220, 60, 230), (40, 220, 230)]


def walls(room):
    """A box room as a mesh, each wall in a colour of its own, in stripes."""
    positions, triangles, colors = [], [], []
    for axis in range(3):
        for side in (-1, 1):
            for stripe in range(4):
                low, high = stripe / 2 - 1, stripe / 2 - 0.5
                corners = np.array([[low, -1, -side], [high, -1, -side], [high, 1, -side], [low, 1, -side]], float)
                triangles.append(np.array([[0, 1, 2], [0, 2, 3]])[:, ::side] + 4 * len(positions))
                positions.append(np.roll(corners, axis + 1, axis=1))
                color = np.array(COLORS[2 * axis + (side > 0)]) * (1 if stripe % 2 else 0.7)
                colors.append(np.tile([*color, 255], (4, 1)))
    local = np.concatenate(positions)
    world = local @ room.world_from_room[:3, :3].T + room.world_from_room[:3, 3]
    return Model.from_arrays(
        world, np.concatenate(triangles), colors=np.concatenate(colors).astype(np.uint8), material=Material()
    )


@pytest.fixture
def scene(renderer):
    """A striped room with a blue box in it, to the right of who looks along -z."""
    room = replace(Room.box(EMPTY, (4, 3, 6), (1, 0.5, -1), 0.4), captured_at=(0.3, 0.1, 0.2))
    renderer.lights, renderer.ambient = [], 1.0
    renderer.add_mesh(walls(room))
    renderer.add_mesh(solid_model(Box((2.2, 0.2, -2.5), (2.6, 0.8, -2.1), BLUE)))
    return room


def at(room, point):
    """World space from room space."""
    return np.asarray(room.world_from_room)[:3, :3] @ point + np.asarray(room.world_from_room)[:3, 3]


@pytest.mark.parametrize(
    "target", [(1, 0, 0), (-1, 0.2, 0.3), (0.1, 1, 0.1), (0.3, -1, 0.2), (0, 0, 1), (0.4, 0.3, -1)]
)
def test_a_room_shows_from_its_point_what_the_scene_did(ctx, renderer, screen, scene, target):
    eye = at(scene, scene.captured_at)
    taken = capture_environment(
        ctx, renderer.draw_meshes, eye, 256, environment_from_world=scene.environment_from_world
    )
    matrices = Camera.perspective(eye, eye + target, 60, 1, 0.05, 50).matrices
    picture = Offscreen(ctx, 128, 128)
    try:
        picture.clear()
        renderer.draw_meshes(*matrices)
        expected = picture.color()
        renderer.rooms = [replace(scene, environment=taken)]
        picture.clear()
        renderer.draw_rooms(*matrices)
        found = picture.color()
    finally:
        picture.release()
    lowest, highest = minimum_filter(expected, (9, 9, 1)), maximum_filter(expected, (9, 9, 1))
    plain = apart(lowest, highest) == 0
    plain[[0, 1, 2, 3, -4, -3, -2, -1]] = plain[:, [0, 1, 2, 3, -4, -3, -2, -1]] = False  # an edge may lie outside
    assert 0.5 < plain.mean() < 1
    assert apart(found, expected)[plain].max() <= 2
    assert (found[..., 3] == 255).all()


def test_what_is_on_the_right_is_seen_on_the_right(ctx, renderer, screen, scene):
    eye = at(scene, scene.captured_at)
    taken = capture_environment(ctx, renderer.draw_meshes, eye, 64, environment_from_world=scene.environment_from_world)
    blue = np.array([0, 0, 1.0])
    middle = np.array([2.4, 0.5, -2.3])
    assert taken.radiance(scene.environment_from_world @ (middle - eye)) == pytest.approx(blue, abs=0.01)
    # The wall behind is blue, too, but not without red.
    mirrored = (middle - eye) * (-1, 1, 1)
    assert taken.radiance(scene.environment_from_world @ mirrored)[0] > 0.005


def test_the_caller_s_framebuffer_stays_bound(ctx, renderer, screen, scene):
    screen.framebuffer.use()
    screen.clear((1, 1, 1, 1))
    capture_environment(ctx, renderer.draw_meshes, (1, 0.5, -1), 32)
    assert (screen.color() == 255).all()
    renderer.draw_meshes(*Camera.perspective((1, 0.5, -1), (1, 0.5, -3), 60, 1, 0.05, 50).matrices)
    assert not (screen.color()[..., :3] == 255).all()


def test_light_is_linear_and_nothing_is_black(ctx):
    def grey(clip_from_view, view_from_world):
        ctx.fbo.clear(188 / 255, 188 / 255, 188 / 255, 1)

    assert capture_environment(ctx, grey, (0, 0, 0), 8).faces == pytest.approx(0.5, abs=0.005)
    assert not capture_environment(ctx, lambda *_: None, (0, 0, 0), 8).faces.any()


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"near": 0.0}, "near 0 m"), ({"near": 2.0, "far": 1.0}, "near 2 m, far 1 m"),
        ({"size": 48}, "size 48; expected"),
        ({"size": "a"}, "size 'a'; expected a power of two from 8 to 4096"),
        ({"size": 8.0}, "size 8.0"), ({"size": 0}, "size 0"),
        ({"environment_from_world": np.diag([1, 1, -1])}, "no rotation"), ({"position": (0, 0)}, "position of shape"),
    ],
    ids=["near", "range", "size", "text", "float", "none", "mirrored", "position"],
)  # fmt: skip
def test_what_cannot_be_captured_is_refused_before_drawing(ctx, screen, options, problem):
    with pytest.raises(SettingsError, match=problem):
        capture_environment(ctx, lambda *_: pytest.fail("drawn"), **{"position": (0, 0, 0), "size": 8, **options})


def test_a_captured_environment_is_one(ctx, screen):
    assert isinstance(capture_environment(ctx, lambda *_: None, (0, 0, 0), 8), Environment)
