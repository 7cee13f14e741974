"""Lights from a mirror ball: of a drawn one to a fraction of a degree, of a photographed one to its known answer."""

import numpy as np
import pytest
from PIL import Image

from bake.chrome_ball import Circle, circle_of_mask, light_of_highlight, lights_of_ball, read_mask
from impostor.errors import SettingsError
from tests.data import DATA, needs_data

CHROME = DATA / "rti" / "uw_psm"
BALL = Circle(70.3, 58.6, 45.0)
SHAPE = (120, 150)


def drawn_ball(light):
    """A mirror ball under one small lamp: brightness (H, W)."""
    row, column = np.indices(SHAPE)
    x, y = (column - BALL.x) / BALL.radius, (BALL.y - row) / BALL.radius
    z = np.sqrt(np.clip(1 - x * x - y * y, 0, 1))
    mirrored = np.stack([2 * z * x, 2 * z * y, 2 * z * z - 1], axis=-1)
    return np.clip(mirrored @ light, 0, 1) ** 300 * (x * x + y * y < 1) + 0.02


@pytest.mark.parametrize("light", [(0, 0, 1), (0.5, 0, 0.866), (0, 0.7, 0.714), (-0.6, -0.3, 0.742), (0.8, 0.5, 0.33)])
def test_drawn_light_is_found(light):
    light = np.array(light) / np.linalg.norm(light)
    found = light_of_highlight(drawn_ball(light), BALL)
    assert np.linalg.norm(found) == pytest.approx(1)
    assert np.degrees(np.arccos(np.clip(found @ light, -1, 1))) < 1.5


def test_mask_gives_the_circle():
    row, column = np.indices(SHAPE)
    found = circle_of_mask(np.hypot(column - BALL.x, row - BALL.y) < BALL.radius)
    assert (found.x, found.y, found.radius) == pytest.approx((BALL.x, BALL.y, BALL.radius), abs=0.1)


@pytest.mark.parametrize("rows", [slice(0, 0), slice(10, 30)])
def test_a_mask_that_is_no_ball_is_refused(rows):
    mask = np.zeros(SHAPE, bool)
    mask[rows, 10:100] = True
    with pytest.raises(SettingsError, match="mask"):
        circle_of_mask(mask)


@pytest.mark.parametrize("picture", [np.full(SHAPE, 0.01), np.full(SHAPE, 0.9)])
def test_a_ball_without_a_highlight_is_refused(picture):
    with pytest.raises(SettingsError, match="highlight"):
        light_of_highlight(picture, BALL)


@pytest.mark.parametrize("radius", [-45, 0, 2, 1e9])
def test_a_ball_that_no_picture_can_hold_is_refused(tmp_path, radius):
    Image.fromarray((drawn_ball((0, 0, 1)).clip(0, 1) * 255).astype(np.uint8)).save(tmp_path / "ball.png")
    with pytest.raises(SettingsError, match="radius"):
        lights_of_ball([tmp_path / "ball.png"], Circle(BALL.x, BALL.y, radius))


@needs_data
def test_photographed_ball_against_its_known_lights():
    circle = circle_of_mask(read_mask(CHROME / "chrome" / "chrome.mask.tga"))
    found = lights_of_ball([CHROME / "chrome" / f"chrome.{number}.tga" for number in range(12)], circle)
    known = np.array([line.split() for line in (CHROME / "lights.txt").read_text().splitlines()[1:13]], float)
    errors = np.degrees(np.arccos(np.clip((found * known).sum(axis=1), -1, 1)))
    assert errors.mean() < 3.5
    assert np.median(errors) < 2.5
