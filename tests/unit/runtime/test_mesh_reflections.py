"""Polygon meshes in rooms: diffuse light, mirroring and bumps, worked out by hand."""

from functools import partial

import numpy as np
import pytest

from impostor.environment import Environment, Reflection, Room
from impostor.environment.blending import diffuse_weights, mirrored_room
from impostor.environment.cube import face_directions, sample
from impostor.errors import SettingsError
from impostor.lighting import DirectionalLight, Gloss
from impostor.model import Material, Model
from impostor.srgb import linear_from_srgb, srgb_from_linear
from impostor.views import rotation_about_y
from runtime.fans.lod import LevelOfDetail
from runtime.gl.state import preserved_state
from runtime.meshes.bump import Bump
from runtime.meshes.copies import MeshCopies
from runtime.viewing.viewer import Viewer
from tests.pictures import filling, mesh_picture, placed
from tests.solids import Box, Sphere, solid_fan, solid_model

CORNERS = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
FACES = np.array([[0, 1, 2], [0, 2, 3]])
UVS = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], float)  # v runs down
WHITE_LIGHT = DirectionalLight((0, 0, 1), (0.2, 0.1, 0.3))


def card(albedo=(0.0, 0.0, 0.0), uvs=None, colors=None):
    """A square that fills `filling()`'s picture, facing +Z."""
    normals = np.tile((0.0, 0, 1), (4, 1))
    return Model.from_arrays(CORNERS, FACES, normals, colors, uvs, Material(base_color=(*albedo, 1.0)))


def plain(*light):
    """The same light from everywhere."""
    return Environment("plain", np.full((6, 8, 8, 3), light))


def uneven(size=64):
    """Smooth, and another light from every direction."""
    x, y, z = np.moveaxis(face_directions(size), -1, 0)
    return Environment("uneven", np.stack([0.4 + 0.3 * x * y, 0.4 + 0.2 * y + 0.1 * z, 0.4 + 0.3 * z * x], axis=-1))


@pytest.fixture
def draw(renderer, screen):
    return partial(mesh_picture, renderer, screen)


def shown(linear):
    """As a pixel shows it."""
    return srgb_from_linear(np.asarray(linear)) * 255


@pytest.mark.parametrize("azimuth", [0.0, 0.7, 1.3])
@pytest.mark.parametrize(
    "reflection",
    [
        Reflection(), Reflection(0.9, 0.1, 4.0), Reflection(0.8, 0.05, 3.3, roughness=0.4), Reflection(0.7, 0.2, 0.0),
        Reflection(1.0, 0.6, 5.0, metal=1.0), Reflection(1.0, 0.3, 4.0, 0.2, metal=0.4),
    ],
    ids=["glass", "exponent 4", "exponent 3.3", "exponent 0", "metal", "half"],
)  # fmt: skip
def test_the_shading_model(renderer, draw, reflection, azimuth):
    albedo, around, ambient = np.array([0.5, 0.25, 0.8]), np.array([0.3, 0.4, 0.2]), np.array([0.05, 0.1, 0.0])
    renderer.lights, renderer.ambient = [WHITE_LIGHT], ambient
    renderer.rooms = [Room.far(plain(*around / 2), exposure=2.0)]
    gloss = Gloss(0.3, 20.0)
    half = np.cos(azimuth / 2) ** 20
    mirrored = reflection.fresnel(np.cos(azimuth)) * around
    diffuse = ambient + np.array(WHITE_LIGHT.color) + around
    metal = reflection.metal
    expected = albedo * ((1 - metal) * diffuse + metal * mirrored) + (1 - metal) * mirrored
    expected = expected + 0.3 * half * np.array(WHITE_LIGHT.color)
    found = draw(card(tuple(albedo)), filling(azimuth=azimuth), gloss=gloss, reflection=reflection)
    np.testing.assert_allclose(found[32, 32, :3], shown(expected), atol=1.1)


def test_without_a_reflection_rooms_give_diffuse_light_only(renderer, draw):
    renderer.lights, renderer.ambient = [], 0
    room = Room.far(uneven(), yaw=0.6, exposure=1.2)
    renderer.rooms = [room]
    for azimuth, elevation in ((0.0, 0.0), (1.0, 0.5), (2.5, -0.8)):
        turned = rotation_about_y(azimuth)
        place = placed(yaw=azimuth)
        found = draw(card((1.0, 1.0, 1.0)), filling(azimuth=azimuth, elevation=elevation), place=place)
        normal = room.environment_from_world @ turned @ (0, 0, 1)
        np.testing.assert_allclose(found[32, 32, :3], shown(1.2 * sample(room.environment.diffuse, normal)), atol=1.1)


def test_without_rooms_nothing_is_mirrored(renderer, draw):
    model = solid_model(Sphere(radius=0.8))
    expected = draw(model, gloss=Gloss(0.5))
    np.testing.assert_array_equal(draw(model, gloss=Gloss(0.5), reflection=Reflection(metal=1.0)), expected)


@pytest.mark.parametrize("output", ["albedo", "normal"])
def test_albedo_and_normals_are_the_same_in_a_room(renderer, draw, output):
    model = solid_model(Sphere(radius=0.8))
    expected = draw(model, output=output)
    renderer.rooms = [Room.far(uneven()), Room.box(uneven(), (3, 3, 3))]
    np.testing.assert_array_equal(draw(model, output=output, reflection=Reflection()), expected)


@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.35, 1.0])
def test_a_rough_mirror_shows_prefiltered_light(renderer, draw, roughness):
    """Every pixel of a ball, where neighbours look to nearly the same place."""
    renderer.lights, renderer.ambient = [], 0
    environment = uneven(32)
    renderer.rooms = [Room.far(environment)]
    positions, normals, faces = Sphere().triangles(128)
    ball = Model.from_arrays(positions, faces, normals, material=Material(base_color=(0.0, 0.0, 0.0, 1.0)))
    found = draw(ball, reflection=Reflection(least=1.0, roughness=roughness))
    across = (np.arange(64) + 0.5) / 32 - 1
    x, y = np.meshgrid(across, -across)
    near = np.hypot(x, y) < 0.7
    normal = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))], axis=-1)[near]
    toward = 2 * normal[:, 2:] * normal - (0, 0, 1)
    np.testing.assert_allclose(found[near][:, :3], shown(environment.mirrored(toward, roughness)), atol=2.5)


def test_a_small_mirror_ball_does_not_flicker(renderer, draw):
    """Where a pixel looks at many texels, it shows their mean, wherever the ball is."""
    renderer.lights, renderer.ambient = [], 0
    checker = np.indices((6, 256, 256)).sum(axis=0) % 2
    renderer.rooms = [Room.far(Environment("checker", np.repeat(checker[..., None], 3, axis=-1)))]
    ball = solid_model(Sphere(radius=0.3, color=(0, 0, 0)))
    for shift in (0.0, 0.004, 0.011, 0.02):
        pixels = draw(ball, place=placed((shift, shift / 2, 0)), reflection=Reflection(least=1.0))
        light = linear_from_srgb(pixels[26:38, 26:38, 0] / 255)
        assert np.abs(light - 0.5).max() < 0.02


PROBES = {
    "two boxes": [
        Room.box(plain(0.8, 0.1, 0.1), (1.3, 4, 4), (-0.5, 0, 0)),
        Room.box(plain(0.1, 0.8, 0.1), (1.3, 4, 4), (0.6, 0, 0)),
    ],
    "three and a sky": [
        Room.far(plain(0.5, 0.5, 0.5)),
        Room.sphere(plain(0.8, 0.1, 0.1), 0.6, (-0.5, 0.3, 0)),
        Room.box(plain(0.1, 0.8, 0.1), (1, 1, 1), (0.5, 0.4, 0), 0.3),
        Room.sphere(plain(0.1, 0.1, 0.8), 0.5, (0.2, -0.5, 0)),
    ],
}  # fmt: skip


def pixel_points():
    """Where the pixels of `filling()`'s picture are on a card, (64, 64, 3)."""
    across = (np.arange(64) + 0.5) / 32 - 1
    x, y = np.meshgrid(across, -across)
    return np.stack([x, y, 0 * x], axis=-1)


@pytest.mark.parametrize("name", PROBES)
def test_diffuse_light_is_blended_between_rooms(renderer, draw, name):
    renderer.lights, renderer.ambient = [], 0
    rooms = renderer.rooms = PROBES[name]
    found = draw(card((1.0, 1.0, 1.0)))[..., :3]
    colors = np.array([room.environment.faces[0, 0, 0] for room in rooms])
    np.testing.assert_allclose(found, shown(diffuse_weights(rooms, pixel_points()) @ colors), atol=1.1)
    assert len(np.unique(found.reshape(-1, 3), axis=0)) > 5


@pytest.mark.parametrize("name", PROBES)
def test_a_pixel_mirrors_the_room_it_is_in(renderer, draw, name):
    renderer.lights, renderer.ambient = [], 0
    rooms = renderer.rooms = PROBES[name]
    found = draw(card(), reflection=Reflection(least=1.0))[..., :3]
    points = pixel_points()
    chosen = mirrored_room(rooms, points)
    colors = np.array([room.environment.faces[0, 0, 0] for room in rooms])
    inside = np.take_along_axis(np.stack([room.contains(points) for room in rooms], -1), chosen[..., None], -1)
    expected = np.where(inside, colors[chosen], (1, 0, 0))
    np.testing.assert_allclose(found, shown(expected), atol=1.1)


@pytest.mark.parametrize("name", PROBES)
def test_copies_in_one_room_are_drawn_as_if_there_were_others(renderer, screen, monkeypatch, name):
    """What a room has alone takes a cheaper program; the picture is the same."""
    renderer.rooms, model = PROBES[name], solid_model(Sphere(radius=0.07))
    for position in np.random.default_rng(0).uniform(-0.9, 0.9, (60, 3)):
        renderer.add_mesh(model, placed(position), reflection=Reflection())
    renderer.draw_meshes(*filling())
    found = screen.color()
    alone = renderer._room_table.alone_around
    kinds = []
    monkeypatch.setattr(
        renderer._room_table,
        "alone_around",
        lambda *sphere: kinds.append(alone(*sphere)) or np.full(len(sphere[1]), -1),
    )
    screen.clear()
    renderer.draw_meshes(*filling())
    assert len(np.unique(kinds[0])) == len(PROBES[name]) + 1
    assert np.abs(found.astype(int) - screen.color()).max() <= 1


def test_copies_keep_their_own_reflection(renderer, screen):
    renderer.lights, renderer.ambient = [], 0
    renderer.rooms = [Room.far(plain(0.5, 0.5, 0.5))]
    model = card()
    strengths = [None, 0.2, 0.8]
    for number, strength in enumerate(strengths):
        reflection = None if strength is None else Reflection(least=strength)
        renderer.add_mesh(model, placed((0.6 * number - 0.6, 0, 0), scale=0.2), reflection=reflection)
    renderer.draw_meshes(*filling())
    row = screen.color()[32, [13, 32, 51], 0]
    np.testing.assert_allclose(row, shown([0, 0.1, 0.4]), atol=1.1)


def test_a_reflection_may_be_changed_in_place(renderer, screen):
    renderer.rooms = [Room.far(plain(0.5, 0.5, 0.5))]
    mesh = renderer.add_mesh(card())
    renderer.draw_meshes(*filling())
    before = screen.color()
    mesh.reflection = Reflection(least=0.5)
    screen.clear()
    renderer.draw_meshes(*filling())
    assert (screen.color()[..., 0] > before[..., 0]).all()


@pytest.mark.parametrize("rooms", [[Room.far(plain(0.4, 0.4, 0.4))], PROBES["two boxes"]], ids=["one", "two"])
def test_a_crossfade_leaves_the_fan_its_pixels(renderer, screen, rooms):
    renderer.rooms = rooms
    group = renderer.add_mesh(card(), reflection=Reflection())
    copies = MeshCopies(group.buffers, Gloss(), np.eye(4)[None], np.array([[0.25, 1]], np.float32), Reflection())
    with preserved_state(renderer._ctx) as state:
        viewer = Viewer.from_matrices(*filling(), state.viewport)
        renderer._update_lights("lit")
        renderer._mesh_pass.draw_copies(state, [copies], viewer, renderer._table, renderer._room_table)
    assert (screen.color()[..., 3] > 0).mean() == pytest.approx(0.75, abs=0.02)


def test_a_copy_near_the_camera_mirrors_what_its_fan_does(renderer, screen):
    """Drawn as a mesh, it is as bright as an equal mesh that was placed as one."""
    box = Box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    renderer.rooms, reflection = [Room.box(uneven(), (4, 4, 4))], Reflection(least=0.6)
    renderer.add(
        solid_fan(box, views=4, size=64), model=solid_model(box), level_of_detail=LevelOfDetail(mesh_above_px=0),
        reflection=reflection,
    )  # fmt: skip
    renderer.draw(*filling(azimuth=0.3))
    found = screen.color()
    screen.clear()
    renderer.add_mesh(solid_model(box), reflection=reflection)
    renderer.draw_meshes(*filling(azimuth=0.3))
    assert found.any()
    np.testing.assert_array_equal(found, screen.color())


def leaning(red, green, **options):
    """A bump picture of one slope."""
    return Bump(np.full((4, 4, 3), (red, green, 255), np.uint8), **options)


class TestBumps:
    @pytest.mark.parametrize("rooms", [(), [Room.far(plain(0, 0, 0))]], ids=["no room", "a room"])
    @pytest.mark.parametrize(
        ("bump", "slope"),
        [
            (leaning(128, 128), (0, 0)),
            (leaning(192, 128), (0.502, 0)),
            (leaning(128, 192, bumpiness=1.0), (0, 0.251)),
            (leaning(64, 160, bumpiness=-2.0), (0.502, -0.251)),
        ],
        ids=["flat", "right", "up", "hollow"],
    )  # fmt: skip
    def test_red_leans_to_the_right_and_green_up(self, renderer, draw, rooms, bump, slope):
        renderer.rooms = rooms
        found = draw(card(uvs=UVS), output="normal", bump=bump)[32, 32, :3]
        expected = np.array([*slope, 1]) / np.linalg.norm([*slope, 1])
        np.testing.assert_allclose(found, (expected / 2 + 0.5) * 255, atol=1)

    def test_bumps_turn_with_the_mesh_and_are_not_mirrored_with_the_picture(self, renderer, draw):
        bump = leaning(192, 128)
        turned = draw(card(uvs=UVS), output="normal", bump=bump, place=placed(yaw=0.5))[32, 32, :3] / 127.5 - 1
        np.testing.assert_allclose(turned, rotation_about_y(0.5) @ np.array([0.449, 0, 0.894]), atol=0.01)
        mirrored = draw(card(uvs=UVS * (-1, 1)), output="normal", bump=bump)[32, 32, :3] / 127.5 - 1
        np.testing.assert_allclose(mirrored, (-0.449, 0, 0.894), atol=0.01)
        up = draw(card(uvs=UVS * (-1, 1)), output="normal", bump=leaning(128, 192))[32, 32, :3] / 127.5 - 1
        np.testing.assert_allclose(up, (0, 0.449, 0.894), atol=0.01)

    def test_light_falls_on_the_bumps(self, renderer, draw):
        renderer.lights, renderer.ambient = [DirectionalLight((1, 0, 0))], 0
        found = draw(card((1.0, 1.0, 1.0), UVS), bump=leaning(192, 128))
        np.testing.assert_allclose(found[32, 32, 0], shown(0.449), atol=1.5)

    @pytest.mark.parametrize("plain_fresnel", [False, True])
    def test_reflections_follow_the_bumps(self, renderer, draw, plain_fresnel):
        renderer.lights, renderer.ambient = [], 0
        environment, reflection = uneven(), Reflection(least=0.1, exponent=1.0)
        renderer.rooms = [Room.far(environment)]
        bump = leaning(192, 100, plain_fresnel=plain_fresnel)
        found = draw(card(uvs=UVS), bump=bump, reflection=reflection)[32, 32, :3]
        normal = np.array([2 * 64 / 255, -2 * 28 / 255, 1])
        normal /= np.linalg.norm(normal)
        part = reflection.fresnel(1.0 if plain_fresnel else normal[2])
        light = environment.radiance(2 * normal[2] * normal - (0, 0, 1))
        np.testing.assert_allclose(found, shown(part * light), atol=1.5)

    def test_vertex_colours_stay(self, draw):
        colors = np.array([[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 0, 255]], np.uint8)
        model = card((1.0, 1.0, 1.0), UVS, colors)
        expected = draw(model, output="albedo")
        np.testing.assert_array_equal(draw(model, output="albedo", bump=leaning(128, 128)), expected)

    def test_meshes_share_what_has_the_same_bumps(self, renderer):
        model, bump = card(uvs=UVS), leaning(128, 128)
        first, second, smooth = (renderer.add_mesh(model, bump=each) for each in (bump, bump, None))
        assert first.buffers is second.buffers
        assert first.buffers is not smooth.buffers

    @pytest.mark.parametrize(
        ("picture", "bumpiness", "problem"),
        [
            (np.zeros((4, 4, 4), np.uint8), 1, r"\(4, 4, 4\) uint8; expected \(H, W, 3\) uint8"),
            (np.zeros((4, 4, 3)), 1, "float64"), ([[0, 0, 0]], 1, "a list"),
            (np.zeros((4, 4, 3), np.uint8), np.nan, "bumpiness nan"),
            (np.zeros((4, 4, 3), np.uint8), "a", "bumpiness is a str; expected a finite number"),
        ],
        ids=["alpha", "float", "list", "nan", "text"],
    )  # fmt: skip
    def test_what_are_no_bumps_is_refused(self, picture, bumpiness, problem):
        with pytest.raises(SettingsError, match=problem):
            Bump(picture, bumpiness)

    def test_bumps_need_texture_coordinates(self, renderer):
        with pytest.raises(SettingsError, match="mesh: no texture coordinates; expected a mesh with them"):
            renderer.add_mesh(card(), bump=leaning(128, 128))

    def test_what_is_no_reflection_is_refused(self, renderer):
        with pytest.raises(SettingsError, match="reflection: a float; expected a Reflection"):
            renderer.add_mesh(card(), reflection=0.5)

    def test_what_becomes_no_reflection_is_refused(self, renderer, screen):
        mesh = renderer.add_mesh(card())
        mesh.reflection = 3
        with pytest.raises(SettingsError, match="reflection: a int; expected a Reflection"):
            renderer.draw_meshes(*filling())
        instances = renderer.add(solid_fan(Sphere(), views=6, size=32))
        with pytest.raises(SettingsError, match="reflection: a str; expected a Reflection"):
            instances.reflection = "x"
        assert instances.reflection is None
