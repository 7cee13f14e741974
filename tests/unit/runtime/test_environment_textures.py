"""Environments and rooms on the GPU: what the shaders find there is what NumPy finds."""

import re

import numpy as np
import pytest

from impostor.environment import Environment, Room
from impostor.environment.blending import diffuse_weights, mirrored_room
from impostor.environment.cube import sample
from impostor.errors import GpuError, SettingsError
from runtime.gl.programs import SHADERS
from runtime.gl.state import preserved_state
from runtime.rooms import environments
from runtime.rooms.environments import EnvironmentAtlas, RoomTable, check_rooms

RANDOM = np.random.default_rng(3)
HALF = 2.0**-11  # largest relative error of a 16-bit number
VERTEX = """#version 330
in vec2 corner;
void main() { gl_Position = vec4(corner, 0.0, 1.0); }"""
FRAGMENT = """#version 330
#include "environment.glsl"
#include "rooms.glsl"
uniform sampler2D inputs;
out vec4 found;
void main() {
    vec4 a = texelFetch(inputs, ivec2(gl_FragCoord.x, 0), 0), b = texelFetch(inputs, ivec2(gl_FragCoord.x, 1), 0);
    %s
    if (a.x > 1e30) found = textureLod(environments, a.xy, 0.0);  // or a body without light would have no texture
}"""


def random_environment(size=32, seed=0):
    return Environment("random", np.random.default_rng(seed).uniform(0, 5, (6, size, size, 3)))


def random_directions(count):
    """All over the sphere, and on the axes, edges and corners of the cube."""
    return np.concatenate([RANDOM.normal(size=(count, 3)), special_directions()])


def special_directions():
    grid = np.stack(np.meshgrid(*[[-1.0, 0, 1]] * 3), axis=-1).reshape(-1, 3)
    return grid[np.abs(grid).sum(axis=1) > 0]


@pytest.fixture
def run(ctx, screen):
    """Evaluate GLSL that gives `found` from `a` and `b`, (N, 4) each, among some rooms."""

    def evaluated(body, rooms, a, b=(0, 0, 0, 0)):
        rows = np.stack(np.broadcast_arrays(np.atleast_2d(a), np.atleast_2d(b))).astype(np.float32)
        count = rows.shape[1]
        source = re.sub(r'#include "(.*)"', lambda match: (SHADERS / "include" / match[1]).read_text(), FRAGMENT % body)
        program = ctx.program(vertex_shader=VERTEX, fragment_shader=source)
        corners = ctx.buffer(np.array([-1, -1, 1, -1, -1, 1, 1, 1], np.float32))
        array = ctx.vertex_array(program, [(corners, "2f", "corner")])
        inputs, target = ctx.texture((count, 2), 4, rows.tobytes(), dtype="f4"), ctx.texture((count, 1), 4, dtype="f4")
        framebuffer, table = ctx.framebuffer([target]), RoomTable(ctx)
        with preserved_state(ctx):
            table.update(rooms)
            table.bind(program, 3)
            inputs.use(0)
            program["inputs"] = 0
            framebuffer.use()
            array.render(5)
        found = np.frombuffer(target.read(), np.float32).reshape(count, 4).copy()
        for resource in (framebuffer, array, corners, inputs, target, program, table):
            resource.release()
        return found

    return evaluated


def four(vectors, last=0.0):
    """(N, 3) with a fourth column."""
    return np.column_stack([vectors, np.broadcast_to(last, len(vectors))])


@pytest.mark.parametrize("size", [8, 16, 64])
def test_light_around_a_direction_is_the_environments(run, size):
    environment = random_environment(size)
    directions = random_directions(4000)
    roughness = RANDOM.choice([0, 0, 1, *RANDOM.uniform(0, 1, 20), *np.arange(4) / 3], len(directions))
    body = "found.rgb = light_around(room_at(0).environment, a.xyz, a.w, 0.0);"
    found = run(body, [Room.far(environment)], four(directions, roughness))[:, :3]
    expected = environment.mirrored(directions, roughness)
    # Directions on the cube's edges and corners may be found on either face: there, too, the light is the same.
    assert np.abs(found - expected).max() < 5 * HALF + 1e-3


def test_diffuse_light_around_a_normal_is_the_environments(run):
    environment = random_environment(8)
    normals = random_directions(2000)
    body = "found.rgb = diffuse_in(room_at(0), a.xyz);"
    room = Room.far(environment, yaw=0.7, exposure=2.0)
    found = run(body, [room], four(normals))[:, :3]
    expected = 2 * sample(environment.diffuse, normals @ room.environment_from_world.T)
    assert np.abs(found - expected).max() < 10 * HALF


ROOMS = {
    "far": Room.far(random_environment(8), yaw=2.0),
    "sphere": Room.sphere(random_environment(8), 3.0, (1, 2, -1), 0.5),
    "box": Room.box(random_environment(8), (4, 3, 6), (1, 2, -1), 0.5),
    "off-centre box": Room(
        random_environment(8), "box", Room.box(random_environment(8), (4, 3, 6), (9, -2, 1), 1.5).world_from_room,
        captured_at=(0.4, -0.7, 0.2),
    ),
    "stretched box": Room(random_environment(8), "box", np.diag([2, 1, 3, 1.0]), stretched=True),
    "ellipsoid": Room(random_environment(8), "sphere", np.diag([2, 1, 3, 1.0]), captured_at=(0, 0.9, 0)),
}  # fmt: skip


def points_around(room, count, reach=1.0):
    """Points in world space that lie inside a room, or out to `reach` times its size."""
    inside = RANDOM.uniform(-1, 1, (count, 3))
    if room.shape == "sphere":
        inside *= RANDOM.uniform(0, 1, (count, 1)) / np.linalg.norm(inside, axis=1, keepdims=True)
    return reach * inside @ room.world_from_room[:3, :3].T + room.world_from_room[:3, 3]


@pytest.mark.parametrize("name", ROOMS)
def test_directions_toward_the_walls_are_the_rooms(run, name):
    room = ROOMS[name]
    directions = random_directions(3000)
    points = points_around(room, len(directions))
    body = "bool inside; found.xyz = direction_toward(room_at(0), a.xyz, b.xyz, inside); found.w = inside ? 1.0 : 0.0;"
    found = run(body, [room], four(points), four(directions))
    expected, inside = room.directions_toward(points, directions)
    assert inside.all()
    assert found[:, 3].all()
    found, expected = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in (found[:, :3], expected))
    # Where a wall is touched at the very place the environment was captured from, a small step is a large angle.
    clear = np.linalg.norm(room.directions_toward(points, directions)[0], axis=1) > 0.05
    assert clear.mean() > 0.95
    assert np.abs(found - expected)[clear].max() < 1e-4


@pytest.mark.parametrize("name", ["sphere", "box", "ellipsoid"])
def test_points_outside_are_known_and_points_on_the_wall_are_inside(run, name):
    room = ROOMS[name]
    points = points_around(room, 4000, 1.5)
    body = "bool inside; found.xyz = direction_toward(room_at(0), a.xyz, b.xyz, inside); found.w = inside ? 1.0 : 0.0;"
    found = run(body, [room], four(points), (1, 0, 0, 0))
    local = points @ room.room_from_world[:3, :3].T + room.room_from_world[:3, 3]
    depth = np.linalg.norm(local, axis=1) if room.shape == "sphere" else np.abs(local).max(axis=1)
    near = np.abs(depth - 1) < 3e-4
    assert np.isfinite(found).all()
    np.testing.assert_array_equal(found[~near, 3], room.contains(points)[~near])
    on_wall = (local / depth[:, None]) @ room.world_from_room[:3, :3].T + room.world_from_room[:3, 3]
    assert run(body, [room], four(on_wall), (1, 0, 0, 0))[:, 3].all()


TINY = random_environment(8)
SEVERAL = {
    "two boxes": [Room.box(TINY, (4, 4, 4), (-1.9, 0, 0)), Room.box(TINY, (4, 4, 4), (1.9, 0, 0))],
    "box, sphere, sky": [Room.box(TINY, (4, 3, 2), yaw=0.4), Room.sphere(TINY, 1.5, (2, 0, 0)), Room.far(TINY)],
    "two skies and two rooms": [
        Room.far(TINY), Room.sphere(TINY, 2, (2, 0, 0)), Room.far(TINY), Room.box(TINY, (3, 2, 2), (-1, 0, 0)),
    ],
    "four": [Room.sphere(TINY, 1.5, (x, 0, z)) for x in (-1, 1) for z in (-1, 1)],
}  # fmt: skip


@pytest.mark.parametrize("name", SEVERAL)
def test_rooms_share_a_point_as_in_numpy(run, name):
    rooms = SEVERAL[name]
    points = RANDOM.uniform(-5, 5, (5000, 3))
    declare = "vec4 weights, mirrored; choose_rooms(a.xyz, weights, mirrored); "
    weights = run(declare + "found = weights;", rooms, four(points))
    expected = diffuse_weights(rooms, points)
    np.testing.assert_allclose(weights[:, : len(rooms)], expected, atol=2e-5)
    assert not weights[:, len(rooms) :].any()
    chosen = run(declare + "found = mirrored;", rooms, four(points))
    assert (chosen.sum(axis=1) == 1).all()
    assert (chosen.argmax(axis=1) == mirrored_room(rooms, points)).mean() > 0.999
    assert len(np.unique(chosen.argmax(axis=1))) >= min(len(rooms), 3) - 1


@pytest.mark.parametrize("name", SEVERAL)
def test_what_a_room_has_alone_no_other_lights(ctx, name):
    """Nowhere in the sphere, its surface included."""
    rooms, table = SEVERAL[name], RoomTable(ctx)
    table.update(rooms)
    centers, radii = RANDOM.uniform(-4, 4, (3000, 3)), RANDOM.uniform(0.01, 0.6, 3000)
    alone = table.alone_around(centers, radii)
    table.release()
    offsets = RANDOM.normal(size=(20, 3000, 3))
    points = centers + offsets * (radii[:, None] / np.linalg.norm(offsets, axis=-1, keepdims=True))
    claimed = alone >= 0
    assert 0.02 < claimed.mean() < 0.95
    number = alone[claimed]
    for place in points[:, claimed]:
        weights = diffuse_weights(rooms, place)
        np.testing.assert_allclose(np.take_along_axis(weights, number[:, None], -1), 1, atol=1e-9)
        np.testing.assert_array_equal(mirrored_room(rooms, place), number)


def test_every_room_shows_its_own_environment(run):
    """Of several sizes in one texture, nothing of one is found in another."""
    rooms = [
        Room.far(Environment("plain", np.full((6, size, size, 3), color)), exposure=exposure)
        for size, color, exposure in ((8, (1, 0, 0), 1), (64, (0, 1, 0), 2), (16, (0, 0, 1), 3), (32, (1, 1, 0), 1))
    ]
    directions = random_directions(500)
    for number, expected in enumerate([(1, 0, 0), (0, 2, 0), (0, 0, 3), (1, 1, 0)]):
        for body in (
            f"found.rgb = diffuse_in(room_at({number}), a.xyz);",
            f"found.rgb = mirrored_in(room_at({number}), vec3(0), a.xyz, a.w, 1.0);",
        ):
            found = run(body, rooms, four(directions, RANDOM.uniform(0, 1, len(directions))))
            np.testing.assert_allclose(found[:, :3], np.tile(expected, (len(directions), 1)), atol=2e-3)


def test_what_is_seen_from_far_away_is_the_mean_of_what_is_there(run):
    """A footprint as large as a face finds what is left of it at 8 x 8 texels."""
    environment = random_environment(64)
    directions = random_directions(500)
    found = run(
        "found.rgb = light_around(room_at(0).environment, a.xyz, 0.0, 2.0);", [Room.far(environment)], four(directions)
    )
    halved = Environment("halved", environment.faces.reshape(6, 8, 8, 8, 8, 3).mean(axis=(2, 4)))
    np.testing.assert_allclose(found[:, :3], halved.radiance(directions), atol=5e-3)


def test_light_that_16_bits_do_not_hold_is_as_bright_as_they_do(run):
    environment = Environment("sun", np.full((6, 8, 8, 3), 1e6))
    found = run(
        "found.rgb = light_around(room_at(0).environment, a.xyz, 0.0, 0.0);", [Room.far(environment)], (0, 1, 0, 0)
    )
    np.testing.assert_array_equal(found[0, :3], environments.BRIGHTEST)


def test_a_table_changes_with_its_rooms_and_keeps_its_texture_while_it_can(ctx):
    table = RoomTable(ctx)
    first, second = random_environment(8), random_environment(16)
    table.update([Room.far(first), Room.far(second)])
    atlas, version = table._atlas, table.version
    table.update([Room.far(first), Room.far(second)])
    assert table.version == version
    table.update([Room.far(second, yaw=1.0)])
    assert table.version > version
    assert table._atlas is atlas
    table.update([Room.far(random_environment(8))])
    assert table._atlas is not atlas
    table.update([])
    assert len(table) == 0
    table.release()


def test_an_environment_that_is_too_large_is_refused(ctx, monkeypatch):
    monkeypatch.setitem(ctx.info, "GL_MAX_TEXTURE_SIZE", 150)
    with pytest.raises(GpuError, match="faces of 64 texels need a texture of .* at most 150x150"):
        EnvironmentAtlas(ctx, [random_environment(64)])


@pytest.mark.parametrize(
    ("rooms", "problem"),
    [(5, "a int; expected a list of Room"), ([1], "number 0 is a int"), ([Room.far(TINY)] * 5, "at most 4")],
    ids=["number", "no room", "five"],
)  # fmt: skip
def test_what_are_no_rooms_is_refused(rooms, problem):
    with pytest.raises(SettingsError, match=problem):
        check_rooms(rooms)
