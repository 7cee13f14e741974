"""Rooms in pictures: what a mirror and the background show is what rays meet that are cast one a pixel."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import (
    binary_closing,
    binary_dilation,
    binary_erosion,
    binary_opening,
    distance_transform_edt,
    map_coordinates,
)

from impostor.environment import Environment, Reflection, Room
from impostor.environment.cube import face_directions
from impostor.errors import SettingsError
from impostor.model import Material, Model
from impostor.srgb import linear_from_srgb, srgb_from_linear
from runtime.gl.offscreen import Offscreen
from tests.pictures import apart, filling, looking
from tests.rooms import BRIGHT, DARK, EMPTY, meet, painted, turned_box, turned_sphere, windows
from tests.solids import RED, Box, Sphere, solid_model

SIZE, FINE = 192, 4  # pixels along a picture's side, rays along a pixel's
BLACK = Material(base_color=(0.0, 0.0, 0.0, 1.0))
MIRROR = Reflection(strength=1.0, least=1.0)
PLACES = {  # of the mirror and of the eye, room space
    "middle": ((0, 0, 0), (0.5, 0.3, 0.5)),
    "corner": ((-0.5, -0.5, 0.4), (0.5, 0.5, -0.4)),
    "at a window": ((0.7, -0.2, 0.1), (-0.1, 0.1, 0.6)),
}


@cache
def windowed(shape):
    """A room of sharp-edged windows that was captured off its middle."""
    captured = (0.35, -0.3, 0.25)
    return painted(turned_box(captured) if shape == "box" else turned_sphere(captured), samples=2)


def in_world(room, point):
    """World space from room space."""
    return np.asarray(room.world_from_room)[:3, :3] @ point + np.asarray(room.world_from_room)[:3, 3]


def sight(matrices, size):
    """Origins and unit directions (size, size, 3) of the lines of sight through the middles of pixels."""
    world_from_clip = np.linalg.inv(matrices[0] @ matrices[1])
    across = (np.arange(size) + 0.5) / size * 2 - 1
    x, y = np.meshgrid(across, -across)
    ends = [np.stack([x, y, 0 * x + z, 0 * x + 1], axis=-1) @ world_from_clip.T for z in (-1, 1)]
    near, far = (end[..., :3] / end[..., 3:] for end in ends)
    return near, (far - near) / np.linalg.norm(far - near, axis=-1, keepdims=True)


class Ball:
    """A mirror ball, as a mesh and as a formula."""

    def __init__(self, middle, _eye):
        self.middle, self.radius = middle, 0.35
        positions, normals, faces = Sphere(tuple(middle), self.radius).triangles(200)
        self.model = Model.from_arrays(positions, faces, normals, material=BLACK)

    def hit(self, origin, toward):
        reach, normal = Sphere(tuple(self.middle), self.radius).hit(origin, toward)
        return reach, normal, np.isfinite(reach)


class Pane:
    """A flat mirror that leans away from the eye."""

    def __init__(self, middle, eye):
        normal = (eye - middle) / np.linalg.norm(eye - middle) + (0.25, 0.1, -0.2)
        self.middle, self.normal = middle, normal / np.linalg.norm(normal)
        right = np.cross((0, 1, 0), self.normal)
        right /= np.linalg.norm(right)
        self.axes = 0.6 * np.stack([right, np.cross(self.normal, right)])
        corners = middle + np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ self.axes
        normals = np.tile(self.normal, (4, 1))
        self.model = Model.from_arrays(corners, [[0, 1, 2], [0, 2, 3]], normals, material=BLACK)

    def hit(self, origin, toward):
        reach = (self.middle - origin) @ self.normal / (toward @ self.normal)
        met = origin + reach[..., None] * toward - self.middle
        seen = (np.abs(met @ self.axes.T) < 0.36).all(axis=-1) & (reach > 0)
        return reach, np.broadcast_to(self.normal, toward.shape), seen


MIRRORS = {"ball": Ball, "pane": Pane}


def cast_mirror(room, mirror, matrices, size):
    """What a mirror shows of the windows, (size, size), and where it is seen and inside the room."""
    origin, toward = sight(matrices, size)
    reach, normal, seen = mirror.hit(origin, toward)
    met = origin + np.where(seen, reach, 0)[..., None] * toward
    seen = seen & room.contains(met)
    away = toward - 2 * (toward * normal).sum(axis=-1, keepdims=True) * normal
    met = np.where(seen[..., None], met, in_world(room, (0, 0, 0)))
    return windows(meet(room, met, away)) > 0.5, seen


def disc(radius):
    y, x = np.ogrid[-radius : radius + 1, -radius : radius + 1]
    return x * x + y * y <= radius * radius


def border(mask):
    """Pixels on both sides of where a mask changes."""
    found = np.zeros_like(mask)
    for axis in (0, 1):
        changes = np.diff(mask.astype(np.int8), axis=axis) != 0
        found |= np.insert(changes, 0, False, axis=axis) | np.insert(changes, changes.shape[axis], False, axis=axis)
    return found


def edge_errors(picture, expected, seen):
    """How many pixels edges of the windows lie away from where they ought to.

    Of every expected edge, unless what it belongs to is too thin to be seen, to the nearest one in the picture, and
    the other way round; `expected` and `seen` are finer than the picture by FINE.
    """
    light = (linear_from_srgb(picture[..., 0] / 255) - DARK) / (BRIGHT - DARK)
    at = (np.arange(len(expected)) + 0.5) / FINE - 0.5
    found = map_coordinates(light, np.meshgrid(at, at, indexing="ij"), order=1, mode="nearest") > 0.5
    thick = binary_closing(binary_opening(expected, disc(FINE + 2)), disc(FINE + 2))
    thin = binary_dilation(thick != expected, disc(2 * FINE))
    inner, outer = binary_erosion(seen, disc(2 * FINE)), binary_erosion(seen, disc(FINE // 2))
    edges, found_edges = border(expected), border(found)
    missing = distance_transform_edt(~(found_edges & outer))[edges & inner & ~thin]
    extra = distance_transform_edt(~edges)[found_edges & inner]
    return np.concatenate([missing, extra]) / FINE


@pytest.fixture
def picture(ctx):
    picture = Offscreen(ctx, SIZE, SIZE)
    picture.clear()
    yield picture
    picture.release()


@pytest.fixture
def dark(renderer):
    """A renderer in which nothing but rooms gives light."""
    renderer.lights, renderer.ambient = [], 0
    return renderer


def mirrored_errors(renderer, picture, room, cast_in, place, mirror):
    """The edges' errors in a mirror of a room, against a ray cast in another."""
    middle, eye = (in_world(cast_in, point) for point in PLACES[place])
    renderer.rooms, mirror = [room], MIRRORS[mirror](middle, eye)
    matrices = looking(eye, middle, 40, 0.02, 40)
    renderer.add_mesh(mirror.model, reflection=MIRROR)
    renderer.draw_meshes(*matrices)
    errors = edge_errors(picture.color(), *cast_mirror(cast_in, mirror, matrices, SIZE * FINE))
    assert len(errors) > 400
    return errors


@pytest.mark.parametrize("mirror", MIRRORS)
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("shape", ["box", "sphere"])
def test_reflections_are_within_a_pixel_of_a_ray_cast(dark, picture, shape, place, mirror):
    room = windowed(shape)
    assert mirrored_errors(dark, picture, room, room, place, mirror).max() < 1


@pytest.mark.parametrize("shape", ["box", "sphere"])
def test_reflections_that_are_not_local_would_not_be(dark, picture, shape):
    """Or the test above would pass for want of looking."""
    room = windowed(shape)
    far = Room.far(room.environment, yaw=0.5)
    assert mirrored_errors(dark, picture, far, room, "at a window", "pane").max() > 8


@pytest.mark.parametrize("shape", ["box", "sphere"])
@pytest.mark.parametrize("least", [0.04, 1.0])
def test_what_sticks_out_of_the_room_is_red(dark, picture, shape, least):
    room = windowed(shape)
    middle, eye = in_world(room, (0.95, 0, 0)), in_world(room, (1.1, 0.3, 0.9))
    ball = Ball(middle, eye)
    matrices = looking(eye, middle, 40, 0.02, 40)
    dark.rooms = [room]
    dark.add_mesh(ball.model, reflection=replace(MIRROR, least=least))
    dark.draw_meshes(*matrices)
    pixels = picture.color()
    origin, toward = sight(matrices, SIZE)
    reach, _, seen = ball.hit(origin, toward)
    inside = room.contains(origin + np.where(seen, reach, 0)[..., None] * toward)
    seen = binary_erosion(seen, iterations=2)
    out, within = (binary_erosion(part, iterations=2) & seen for part in (~inside, inside))
    assert min(out.sum(), within.sum()) > 300
    assert (pixels[out] == (255, 0, 0, 255)).all()
    grey = pixels[within]
    assert (grey[:, 0] == grey[:, 1]).all()


@pytest.mark.parametrize(
    "eye", [(0, 0, 0), (0.4, -0.5, 0.3), (0.995, 0.1, -0.2)], ids=["middle", "beside", "at the wall"]
)
@pytest.mark.parametrize("shape", ["box", "sphere"])
def test_the_background_is_within_a_pixel_of_a_ray_cast(dark, picture, shape, eye):
    """Also where the wall is nearer than the near plane, and farther than the far one."""
    room = windowed(shape)
    eye = in_world(room, np.array(eye) * (0.9 if shape == "sphere" else 1))
    dark.rooms = [room]
    everywhere = np.ones((SIZE * FINE,) * 2, bool)
    count = 0
    for toward in ((1, 0.1, -0.2), (-1, -0.3, 0.2), (0.2, 0.3, 1)):
        matrices = looking(eye, eye + toward, 70, 0.5, 3.0)
        picture.clear()
        dark.draw_rooms(*matrices)
        pixels = picture.color()
        assert (pixels[..., 3] == 255).all()
        origin, along = sight(matrices, SIZE * FINE)
        expected = windows(meet(room, np.broadcast_to(eye, origin.shape), along)) > 0.5
        errors = edge_errors(pixels, expected, everywhere)
        count += len(errors)
        assert len(errors) == 0 or errors.max() < 1
    assert count > 400


def smooth_environment(size=64):
    """Another light from every direction, that changes slowly."""
    return Environment("smooth", 0.3 + 0.2 * face_directions(size))


def smooth_light(directions):
    return 0.3 + 0.2 * directions / np.linalg.norm(directions, axis=-1, keepdims=True)


@pytest.mark.parametrize("yaw", [0.0, 1.2])
@pytest.mark.parametrize("matrices", [looking((1, 2, 3), (0, 2, -1), 60), filling(azimuth=0.4, elevation=0.3)])
def test_a_far_room_is_the_sky(dark, screen, matrices, yaw):
    room = Room.far(smooth_environment(), yaw, exposure=1.5)
    dark.rooms = [room]
    dark.draw_rooms(*matrices)
    _, toward = sight(matrices, 64)
    expected = srgb_from_linear(1.5 * smooth_light(toward @ room.environment_from_world.T)) * 255
    assert np.abs(screen.color()[..., :3] - expected).max() < 1.5
    assert (screen.depth() == 1).all()


def test_the_sky_of_several_is_the_first(dark, screen):
    plain = [Room.far(Environment("plain", np.full((6, 8, 8, 3), light))) for light in (0.2, 0.8)]
    dark.rooms = [Room.box(EMPTY, (1, 1, 1), (0, 0, 50)), *plain]
    dark.draw_rooms(*looking((0, 0, 5)))
    np.testing.assert_allclose(screen.color()[..., 0], srgb_from_linear(0.2) * 255, atol=1)


@pytest.mark.parametrize("first", ["rooms", "meshes"])
@pytest.mark.parametrize("room", [Room.far(smooth_environment()), Room.box(smooth_environment(), (8, 8, 8))])
def test_a_background_is_behind_what_is_in_it(dark, screen, room, first):
    dark.rooms = [room]
    dark.add_mesh(solid_model(Box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5), RED)))
    matrices = looking((0, 0, 3))
    alone = screen
    dark.draw_meshes(*matrices, output="albedo")
    red = alone.color()[..., 3] > 0
    screen.clear()
    calls = [lambda: dark.draw_rooms(*matrices), lambda: dark.draw_meshes(*matrices, output="albedo")]
    for call in calls if first == "rooms" else calls[::-1]:
        call()
    pixels = screen.color()
    assert 0.05 < red.mean() < 0.5
    assert (pixels[red] == (255, 0, 0, 255)).all()
    assert not (pixels[~red][:, 0] == 255).any()
    assert (pixels[..., 3] == 255).all()


@pytest.mark.parametrize("shape", ["box", "sphere"])
def test_walls_have_depth(dark, screen, shape):
    """So that meshes and fans reach through them."""
    room = windowed(shape)
    eye = in_world(room, (0.1, 0.2, -0.3))
    matrices = looking(eye, eye + (0.4, -0.1, 1), 60, 0.2, 20)
    dark.rooms = [room]
    dark.draw_rooms(*matrices)
    _, toward = sight(matrices, 64)
    walls = meet(room, np.broadcast_to(eye, toward.shape), toward)
    world = walls @ room.world_from_room[:3, :3].T + room.world_from_room[:3, 3]
    clip = np.concatenate([world, np.ones((64, 64, 1))], axis=-1) @ (matrices[0] @ matrices[1]).T
    np.testing.assert_allclose(screen.depth(), clip[..., 2] / clip[..., 3] / 2 + 0.5, atol=2e-6)


def test_a_room_is_seen_from_inside_only(dark, screen):
    """From outside, its walls toward the viewer are not there."""
    dark.rooms = [Room.box(smooth_environment(), (2, 2, 2))]
    dark.draw_rooms(*looking((0, 0, 8), fov_deg=30))
    pixels = screen.color()
    expected = srgb_from_linear(smooth_light(np.array([0.0, 0, -1]))) * 255
    assert np.abs(pixels[31:33, 31:33, :3] - expected).max() < 4
    assert not pixels[2, 2].any()


def shape_walls(shape, origin, toward):
    """Where lines of sight leave a shape that stands in the middle of the world, and whether they meet it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        slabs = np.maximum((1 - origin) / toward, (-1 - origin) / toward)
        if shape == "plane":
            reach = (-1 - origin[..., 2]) / toward[..., 2]
        elif shape == "box":
            reach = slabs.min(axis=-1)
        else:
            flat = np.array([1, 0, 1]) if shape == "cylinder" else np.ones(3)
            a, b, c = ((toward**2 * flat).sum(-1), (toward * origin * flat).sum(-1), (origin**2 * flat).sum(-1) - 1)
            reach = (-b + np.sqrt(np.maximum(b * b - a * c, 0))) / a
            reach = np.where(b * b < a * c, np.inf, np.minimum(reach, slabs[..., 1]) if shape == "cylinder" else reach)
        met = origin + reach[..., None] * toward
    with np.errstate(invalid="ignore"):
        return met, np.isfinite(reach) & (reach > 0) & (np.abs(met) <= 1 + 1e-9).all(axis=-1)


@pytest.mark.parametrize("matrices", [looking((0.3, 0.2, 0.5), (0.1, -0.1, -1), 75), looking((2, 2.5, 4), fov_deg=35)])
@pytest.mark.parametrize("shape", ["box", "sphere", "cylinder", "plane"])
def test_a_room_on_something_simple(dark, screen, shape, matrices):
    """What a point shows is the environment toward it, from where that was captured."""
    room = Room(smooth_environment(), "box", captured_at=(0.1, 0.2, -0.1))
    dark.rooms = [Room.far(EMPTY), room]
    dark.draw_room_on(*matrices, room, shape)
    pixels = screen.color()
    walls, seen = shape_walls(shape, *sight(matrices, 64))
    expected = srgb_from_linear(smooth_light(np.where(seen[..., None], walls - room.captured_at, 1))) * 255
    inner, outer = binary_erosion(seen, border_value=1), binary_dilation(seen)
    assert inner.mean() > 0.05
    assert np.abs(pixels[..., :3] - expected)[inner].max() < 2
    assert not pixels[~outer].any()


def test_what_a_room_is_shown_on_may_stand_elsewhere(dark, screen):
    room = Room.far(smooth_environment())
    dark.rooms = [room]
    place = np.diag([0.5, 0.5, 1, 1.0])
    place[:3, 3] = 0, 0, 1
    dark.draw_room_on(*filling(), room, "plane", place)
    covered = screen.color()[..., 3] > 0
    assert covered[16:48, 16:48].all()
    assert covered.sum() == 32 * 32


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ((Room.far(EMPTY), "box"), "not among the renderer's rooms"),
        ((None, "cone"), "shown on 'cone'; expected one of box, sphere, cylinder, plane"),
        ((None, "box", np.zeros((4, 4))), "world_from_shape has no inverse"),
        ((None, "box", np.eye(3)), "world_from_shape of shape"),
    ],
    ids=["room", "shape", "singular", "3x3"],
)
def test_what_cannot_be_shown_is_refused(dark, screen, arguments, problem):
    dark.rooms = [Room.far(EMPTY)]
    with pytest.raises(SettingsError, match=problem):
        dark.draw_room_on(*filling(), arguments[0] or dark.rooms[0], *arguments[1:])


def test_no_rooms_draw_nothing(dark, screen):
    dark.draw_rooms(*filling())
    assert not screen.color().any()


def test_rooms_may_change_in_place(dark, screen):
    """The next draw shows what a list has become; what it must not become is refused."""
    dark.rooms = rooms = [Room.far(smooth_environment())]
    dark.draw_rooms(*filling())
    before = screen.color()
    rooms[0] = Room.far(smooth_environment(), yaw=2.0)
    dark.draw_rooms(*filling())
    assert apart(screen.color(), before).min() > 5
    with pytest.raises(SettingsError, match="rooms: a Room; expected a list of Room"):
        dark.draw_rooms(*filling(), rooms[0])
    rooms.append("sky")
    with pytest.raises(SettingsError, match="number 1 is a str"):
        dark.draw_rooms(*filling())
