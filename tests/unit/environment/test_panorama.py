"""Panoramas to cube maps and back: every texel's light arrives, where it came from."""

import numpy as np
import pytest

from impostor.environment import panorama as pictures
from impostor.environment.cube import face_directions, faces_of, solid_angles
from impostor.environment.environment import Environment
from impostor.environment.panorama import (
    default_size,
    faces_from_panorama,
    flipped_faces,
    panorama_directions,
    panorama_from_faces,
    resized_faces,
)
from impostor.errors import SettingsError

RNG = np.random.default_rng(5)


def areas(height):
    """Solid angle of every texel of a panorama, (height, 2 height)."""
    rows = -np.diff(np.cos(np.arange(height + 1) * np.pi / height)) * np.pi / height
    return np.repeat(rows[:, None], 2 * height, axis=1)


def light_of_faces(faces):
    return (faces.astype(float) * solid_angles(faces.shape[1])[..., None]).sum(axis=(0, 1, 2))


def light_of_panorama(panorama):
    return (panorama.astype(float) * areas(len(panorama))[..., None]).sum(axis=(0, 1))


def bright(height, row, column, radiance=50000.0):
    panorama = np.zeros((height, 2 * height, 3), np.float32)
    panorama[row, column] = radiance
    return panorama


def test_the_middle_looks_along_minus_z_with_plus_x_to_its_right():
    toward = panorama_directions(64)
    assert toward[31:33, 63:65].mean(axis=(0, 1)) == pytest.approx([0, 0, -1], abs=1e-2)
    assert toward[31:33, 95:97].mean(axis=(0, 1)) == pytest.approx([1, 0, 0], abs=1e-2)
    assert toward[0].mean(axis=0) == pytest.approx([0, 1, 0], abs=1e-2)
    assert np.linalg.norm(toward, axis=-1) == pytest.approx(1)


def test_each_face_shows_what_lies_in_its_directions():
    faces = faces_from_panorama(1 + panorama_directions(128))
    assert faces.shape == (6, 64, 64, 3) and faces.dtype == np.float32
    assert np.abs(faces - 1 - face_directions(64)).max() < 0.01


def test_and_the_way_back():
    panorama = panorama_from_faces(1 + face_directions(64))
    assert panorama.shape == (128, 256, 3) and panorama.dtype == np.float32
    assert np.abs(panorama - 1 - panorama_directions(128)).max() < 0.03


@pytest.mark.parametrize(("height", "size"), [(128, 64), (96, 64), (125, 32), (9, 8), (33, 64), (200, 16)])
def test_even_light_stays_even_and_none_is_lost(height, size):
    assert np.ptp(faces_from_panorama(np.full((height, 2 * height, 3), 0.7), size)) < 1e-6
    panorama = RNG.random((height, 2 * height, 3)) ** 8 * 1000
    assert light_of_faces(faces_from_panorama(panorama, size)) == pytest.approx(light_of_panorama(panorama), rel=1e-6)


@pytest.mark.parametrize("size", [16, 64])
def test_nor_on_the_way_back(size):
    assert np.ptp(panorama_from_faces(np.full((6, size, size, 3), 0.7))) < 1e-6
    faces = RNG.random((6, size, size, 3)) ** 8 * 1000
    assert light_of_panorama(panorama_from_faces(faces)) == pytest.approx(light_of_faces(faces), rel=1e-6)


@pytest.mark.parametrize("height", [64, 96])
@pytest.mark.parametrize(
    ("row", "column"), [(0, 0), (-1, 7), (1, 40), (20, 127), (31, 16), (32, 64), (45, 0), (62, 33)]
)
def test_a_sun_of_one_texel_keeps_its_power_and_its_place(height, row, column):
    panorama = bright(height, row, column)
    faces = faces_from_panorama(panorama)
    assert light_of_faces(faces) == pytest.approx(light_of_panorama(panorama), rel=1e-5)
    middle = (face_directions(faces.shape[1]) * faces).sum(axis=(0, 1, 2))
    away = np.arccos(np.clip(middle @ panorama_directions(height)[row, column] / np.linalg.norm(middle), -1, 1))
    assert away < np.pi / height
    assert faces.min() >= 0


def test_a_texel_of_a_face_is_the_mean_of_what_it_covers():
    panorama, finer = RNG.random((16, 32, 3)), 24
    toward, weights = panorama_directions(16 * finer), areas(16 * finer)
    number, places = faces_of(toward)
    column, row = np.minimum((places * 4 + 4).astype(int), 7).transpose(2, 0, 1)
    texel = ((number * 8 + row) * 8 + column).ravel()
    light = (panorama.repeat(finer, 0).repeat(finer, 1) * weights[..., None]).reshape(-1, 3)
    sums = np.stack([np.bincount(texel, channel) for channel in light.T], axis=-1)
    sampled = sums / np.bincount(texel, weights.ravel())[:, None]
    assert faces_from_panorama(panorama, 8).reshape(-1, 3) == pytest.approx(sampled, abs=0.02)


def test_light_does_not_turn_negative_beside_a_sun():
    panorama = np.maximum(bright(96, 30, 77), 1e-3)
    assert faces_from_panorama(panorama, 64).min() > 0
    assert panorama_from_faces(faces_from_panorama(panorama, 64)).min() > 0


@pytest.mark.parametrize(("width", "size"), [(1024, 256), (768, 256), (2000, 512), (16, 8), (16384, 1024)])
def test_faces_have_the_panoramas_resolution(width, size):
    assert default_size(width / 4) == size


def test_another_shape_is_refused_by_name():
    with pytest.raises(SettingsError, match="panorama: is 100x60; expected twice as wide as high"):
        faces_from_panorama(np.ones((60, 100, 3)))


@pytest.mark.parametrize(("old", "new"), [(48, 32), (40, 64), (16, 64), (64, 64), (33, 32)])
def test_faces_of_another_size_show_the_same(old, new):
    assert np.abs(resized_faces(1 + face_directions(old), new) - 1 - face_directions(new)).max() < 0.04
    noise = RNG.random((6, old, old, 3))
    assert light_of_faces(resized_faces(noise, new)) == pytest.approx(light_of_faces(noise), rel=1e-3)


@pytest.mark.parametrize(("axis", "sign"), [("y", (1, -1, 1)), ("z", (1, 1, -1))])
def test_a_flip_shows_what_was_on_the_other_side(axis, sign):
    faces = RNG.random((6, 8, 8, 3), dtype=np.float32)
    toward = RNG.normal(size=(200, 3))
    flipped = Environment("flipped", flipped_faces(faces, axis))
    assert flipped.radiance(toward) == pytest.approx(Environment("as it was", faces).radiance(toward * sign), abs=1e-5)
    assert np.array_equal(flipped_faces(flipped.faces, axis), faces)


def test_the_two_ways_are_each_others_transpose():
    size, height = 8, 12
    pieces = pictures._pieces(size, height)
    strip, quarter = RNG.random((height // 2, height // 2, 3)), RNG.random((size, size // 2, 3))
    there = np.diff(pictures._gather(strip, pieces), axis=0, prepend=0)
    assert (there * quarter).sum() == pytest.approx((strip * pictures._scatter(quarter, pieces)).sum())
