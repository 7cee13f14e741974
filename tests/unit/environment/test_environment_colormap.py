"""A fan's colormap in its surroundings: the light of the right side, in the right entries."""

import numpy as np
import pytest

from impostor.environment import Environment, Reflection, Room
from impostor.environment.colormap import FINEST, SHARPEST, environment_colormap, mirrored_faces, surface_points
from impostor.environment.cube import face_directions, sample
from impostor.lighting import Colormap, DirectionalLight, colormap
from impostor.normal_code import BYTE_TO_NORMAL
from impostor.views import basis_facing, direction
from tests.solids import Sphere, solid_fan

NORMALS = BYTE_TO_NORMAL[:225].astype(float)
MIDDLE = 112
EVEN = Environment("even", np.full((6, 8, 8, 3), (0.2, 0.4, 0.8), np.float32))
DIRECTIONS = Environment("directions", (1 + face_directions(16)).astype(np.float32))
BASES = basis_facing(direction([0.0, 1.3, -2.4], 0.26))
MIRROR = Reflection(strength=1, least=1, roughness=SHARPEST)


def test_even_light_lights_every_normal_alike():
    found = environment_colormap(BASES, np.zeros(3), [Room.far(EVEN, exposure=2)])
    np.testing.assert_allclose(found.diffuse[:, :225], np.broadcast_to((0.4, 0.8, 1.6), (3, 225, 3)), rtol=1e-5)
    assert not found.diffuse[:, 225:].any()
    assert not found.specular.any()


def test_light_comes_from_where_it_shines():
    """Of light that grows toward an axis, diffuse light keeps two thirds of the growth."""
    found = environment_colormap(BASES, np.zeros(3), [Room.far(DIRECTIONS)]).diffuse[:, :225]
    np.testing.assert_allclose(found, 1 + 2 / 3 * NORMALS @ BASES, atol=0.01)


def test_a_yaw_turns_the_surroundings():
    yaw = 0.8
    found = environment_colormap(BASES, np.zeros(3), [Room.far(DIRECTIONS, yaw)]).diffuse[0, :225, 2]
    brightest = NORMALS[found.argmax()] @ BASES[0]
    assert brightest @ direction(yaw, 0.0) > 0.95


def test_a_mirror_shows_what_lies_in_the_mirrored_direction():
    found = environment_colormap(BASES, np.zeros(3), [Room.far(DIRECTIONS)], MIRROR).specular[:, :225]
    for basis, entries in zip(BASES, found, strict=True):
        normals, back = NORMALS @ basis, basis[2]
        away = 2 * (normals @ back)[:, None] * normals - back
        np.testing.assert_allclose(entries, DIRECTIONS.mirrored(away, SHARPEST), atol=1e-6)


def test_a_dielectric_mirrors_little_head_on_and_all_at_its_rim():
    found = environment_colormap(BASES[0], np.zeros(3), [Room.far(EVEN)], Reflection(1, 0.04, 5)).specular
    np.testing.assert_allclose(found[MIDDLE], np.multiply(0.04, (0.2, 0.4, 0.8)), rtol=1e-5)
    rim = np.abs(NORMALS[:, 2]).argmin()
    assert found[rim, 2] > 0.3
    assert not found[225:].any()


def test_a_metal_colours_what_it_mirrors_and_has_no_light_of_its_own():
    lit = colormap(BASES, [DirectionalLight((0, 0, 1))], 0.5)
    found = environment_colormap(BASES, np.zeros(3), [Room.far(EVEN)], Reflection(1, 1, metal=1), lit=lit)
    np.testing.assert_allclose(found.diffuse[:, :225], np.broadcast_to((0.2, 0.4, 0.8), (3, 225, 3)), rtol=1e-5)
    assert not found.specular.any()


def test_lights_are_added_and_without_rooms_left_alone():
    lit = colormap(BASES, [DirectionalLight((0, 0, 1))], 0.5)
    alone = environment_colormap(BASES, np.zeros(3), [], MIRROR, lit=lit)
    np.testing.assert_array_equal(alone.diffuse, lit.diffuse)
    both = environment_colormap(BASES, np.zeros(3), [Room.far(EVEN)], lit=lit)
    without = environment_colormap(BASES, np.zeros(3), [Room.far(EVEN)])
    np.testing.assert_allclose(both.diffuse, lit.diffuse + without.diffuse, rtol=1e-6)


class TestBox:
    room = Room.box(DIRECTIONS, (8.0, 4.0, 8.0))

    def test_what_is_mirrored_depends_on_the_place(self):
        """Head-on a fan seen from +Z mirrors the wall at +z, of which each place has another point opposite."""
        left, right = (environment_colormap(BASES[0], (x, 0, 0), [self.room], MIRROR).specular[MIDDLE] for x in (-3, 3))
        assert left[0] < 0.6
        assert right[0] > 1.4
        np.testing.assert_allclose(left[2], right[2], atol=0.02)

    def test_points_of_the_surface_count(self):
        points = np.zeros((225, 3))
        points[MIDDLE] = 2, 0, 0
        found = environment_colormap(np.eye(3), (1, 0, 0), [self.room], MIRROR, points).specular[MIDDLE]
        expected = environment_colormap(np.eye(3), (3, 0, 0), [self.room], MIRROR).specular[MIDDLE]
        np.testing.assert_allclose(found, expected, atol=1e-6)

    @pytest.mark.parametrize("room", [room, Room.sphere(DIRECTIONS, 4.0)], ids=["box", "sphere"])
    def test_a_surface_that_reaches_through_a_wall_mirrors_the_wall(self, room):
        points = 3 * NORMALS
        found = environment_colormap(np.eye(3), (2, 0, 2), [room], MIRROR, points).specular[:225]
        assert not (found == room.outside).all(axis=-1).any()

    def test_outside_there_is_the_colour_for_that(self):
        found = environment_colormap(np.eye(3), (20, 0, 0), [self.room], Reflection()).specular[:225]
        np.testing.assert_array_equal(found, np.broadcast_to((1, 0, 0), (225, 3)))

    def test_many_places_at_once_are_those_of_one(self):
        places = np.array([(-3, 0, 0), (0, 1, 0), (3, 0, 2.0)])
        rooms = [self.room, Room.far(EVEN), Room.sphere(DIRECTIONS, 2, (3, 0, 2))]
        many = environment_colormap(BASES, places, rooms, Reflection())
        for basis, place, *entries in zip(BASES, places, *many, strict=True):
            one = environment_colormap(basis, place, rooms, Reflection())
            np.testing.assert_allclose(Colormap(*entries).diffuse, one.diffuse, atol=1e-6)
            np.testing.assert_allclose(Colormap(*entries).specular, one.specular, atol=1e-6)


class TestMirroredFaces:
    random = np.random.default_rng(4)
    waves = Environment("waves", (2 + np.sin(9 * face_directions(64))).astype(np.float32))

    @pytest.mark.parametrize("roughness", [0.0, SHARPEST, 0.25, 1 / 3, 0.8, 1.0])
    def test_one_look_up_is_what_two_levels_mix(self, roughness):
        toward = self.random.normal(size=(2000, 3))
        found = sample(mirrored_faces(self.waves, roughness), toward)
        np.testing.assert_allclose(found, self.waves.mirrored(toward, max(roughness, SHARPEST)), atol=0.01)

    def test_they_are_no_finer_than_codes_can_show(self):
        fine = Environment("fine", self.random.random((6, 2 * FINEST, 2 * FINEST, 3), np.float32))
        faces = mirrored_faces(fine, 0.0)
        assert faces.shape[1] == FINEST
        np.testing.assert_allclose(faces.mean(), fine.faces.mean(), rtol=0.01)
        entries = environment_colormap(np.eye(3), np.zeros(3), [Room.far(fine)], MIRROR).specular[:225]
        away = 2 * NORMALS[:, 2:] * NORMALS - (0, 0, 1)
        np.testing.assert_allclose(entries, sample(faces, away), atol=1e-6)


@pytest.mark.parametrize("distance", [np.inf, 6.0])
def test_on_a_ball_the_surface_lies_along_its_normals(distance):
    fan = solid_fan(Sphere(radius=2.0), size=64, distance=distance)
    facing = NORMALS[:, 2] > 0.6
    found = surface_points(fan)[:, facing] + (fan.views.center[:, None] @ fan.views.basis.swapaxes(1, 2))
    np.testing.assert_allclose(found, np.broadcast_to(2 * NORMALS[facing], found.shape), atol=0.16)
