"""Bounds of shadows on the screen: nothing of a shadow may lie outside of them."""

import numpy as np
import pytest

from impostor.lighting import DirectionalLight
from impostor.shadow_projection import Ground, along_light
from runtime.shadows.bounds import CELL, box_corners, covered_cells, in_view, shadow_hulls
from tests.pictures import filling, looking

WIDTH, HEIGHT = 200, 120
VIEWERS = {
    "above": looking((2, 6, 9), fov_deg=50),
    "low": looking((0, 0.5, 3), fov_deg=70),
    "flat": filling(3.0, 0.4, 0.3),
}


def shadow_points(low, high, light, ground):
    """Where points of a filled box cast to."""
    inside = np.random.default_rng(1).uniform(low, high, (4000, 3))
    return along_light(np.concatenate([inside, box_corners(low, high)]), light.toward, ground)


@pytest.mark.parametrize("viewer", VIEWERS)
@pytest.mark.parametrize("bottom", [-1.0, 0.0, 2.0])
@pytest.mark.parametrize("elevation_deg", [10, 45, 80])
@pytest.mark.parametrize("normal", [(0, 1, 0), (0.2, 1, -0.1)])
def test_cells_hold_every_pixel_of_a_shadow(viewer, bottom, elevation_deg, normal):
    light, ground = DirectionalLight.from_angles(70, elevation_deg), Ground(normal, 0.0)
    low, high = np.array([-1.0, bottom, -0.5]), np.array([0.5, bottom + 2, 1.0])
    clip_from_world = VIEWERS[viewer][0] @ VIEWERS[viewer][1]
    hulls = shadow_hulls(box_corners(low, high)[None], clip_from_world[None], light, ground)
    points = shadow_points(low, high, light, ground)
    clip = points @ clip_from_world[:, :3].T + clip_from_world[:, 3]
    shown = (np.abs(clip[:, :3]) < clip[:, 3:]).all(axis=1)
    assert in_view(hulls)[0] or not shown.any()
    cells = {tuple(cell) for cell in covered_cells(hulls, WIDTH, HEIGHT)}
    pixels = (clip[shown, :2] / clip[shown, 3:] + 1) / 2 * (WIDTH, HEIGHT)
    assert {tuple(cell) for cell in (pixels // CELL).astype(int)} <= cells


def test_what_casts_outside_of_the_picture_is_left_out():
    light, ground = DirectionalLight.from_angles(90, 45), Ground((0, 1, 0), 0.0)
    corners = box_corners(np.zeros(3), np.ones(3)) + np.array([[[x, 0.0, 0.0]] for x in (-40, 0, 4.5, 40)])
    clip_from_world = np.linalg.multi_dot(filling(4.0, 0.0, 1.0))
    hulls = shadow_hulls(corners, np.broadcast_to(clip_from_world, (4, 4, 4)), light, ground)
    # The third stands outside of the picture, and its shadow in it.
    assert in_view(hulls).tolist() == [False, True, True, False]


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
def test_a_shadow_that_numbers_cannot_hold_may_be_anywhere(number):
    hulls = np.zeros((2, 8, 4)) + (0, 0, 0, 1)
    hulls[1, 3, 0] = number
    with np.errstate(all="raise"):
        assert len(covered_cells(hulls, WIDTH, HEIGHT)) == -(-WIDTH // CELL) * -(-HEIGHT // CELL)


def test_a_small_shadow_takes_few_cells():
    light, ground = DirectionalLight.from_angles(0, 60), Ground((0, 1, 0), 0.0)
    clip_from_world = np.linalg.multi_dot(filling(10.0, 0.0, 1.0))
    corners = box_corners(np.full(3, -0.2), np.full(3, 0.2))[None] + (0, 0.2, 0)
    cells = covered_cells(shadow_hulls(corners, clip_from_world[None], light, ground), 640, 640)
    assert 1 <= len(cells) <= 4
    assert np.abs((cells + 0.5) * CELL - 320).max() < 2 * CELL


def test_a_shadow_that_reaches_behind_the_eye_may_be_anywhere():
    light, ground = DirectionalLight.from_angles(180, 5), Ground((0, 1, 0), 0.0)
    clip_from_world = np.linalg.multi_dot(looking((0, 1, 3)))
    hulls = shadow_hulls(box_corners(-np.ones(3), np.ones(3))[None], clip_from_world[None], light, ground)
    assert len(covered_cells(hulls, WIDTH, HEIGHT)) == -(-WIDTH // CELL) * -(-HEIGHT // CELL)
