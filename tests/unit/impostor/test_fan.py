"""What always holds of a fan."""

from dataclasses import replace

import numpy as np
import pytest

from impostor.errors import SettingsError
from tests.solids import GREEN, RED, Box, Sphere, card_fan, solid_fan

FAN = solid_fan(Sphere(), views=3, size=16)


def test_a_fan_knows_its_size():
    assert FAN.size == 16
    assert FAN.covered_texels == np.count_nonzero(FAN.color[..., 3])


def test_one_colour_is_a_uniform_albedo_and_two_are_not():
    assert solid_fan(Sphere(color=(10, 20, 30)), views=3, size=16).uniform_albedo.tolist() == [10, 20, 30]
    two = solid_fan(Sphere(color=RED), Box((-1, 1, -1), (1, 2, 1), GREEN), views=3, size=16)
    assert two.uniform_albedo is None


def test_colours_of_texels_that_are_not_covered_do_not_count():
    pixels = np.full((8, 8, 4), 255, np.uint8)
    pixels[:4] = (3, 200, 7, 0)
    assert card_fan(pixels).uniform_albedo.tolist() == [255, 255, 255]


def test_a_fan_without_anything_in_it_has_no_albedo():
    assert card_fan(np.zeros((8, 8, 4))).uniform_albedo is None


def test_covered_rectangles_hold_what_is_covered_and_no_more():
    pixels = np.zeros((8, 8, 4), np.uint8)
    pixels[2:5, 3:4, 3] = 1
    assert card_fan(pixels).covered_rectangles.tolist() == [[3, 2, 4, 5]]
    left, top, right, bottom = card_fan(np.zeros((8, 8, 4))).covered_rectangles[0]
    assert left >= right or top >= bottom


@pytest.mark.parametrize(
    ("layer", "wrong", "message"),
    [
        ("color", FAN.color[:2], "layer 'color' is (2, 16, 16, 4) uint8; expected (3, 16, 16, 4) uint8"),
        ("depth", FAN.depth.astype(np.int32), "layer 'depth' is (3, 16, 16) int32; expected (3, 16, 16) uint16"),
        ("silhouette", FAN.silhouette[:, :9], "layer 'silhouette' is (3, 9, 16) bool"),
        ("normal", FAN.normal[1:], "layer 'normal level 0' is (3, 8, 8) uint8; expected (3, 16, 16) uint8"),
        ("normal", (), "no normal layer; expected at least level 0"),
    ],
)
def test_layers_that_do_not_belong_together_are_refused(layer, wrong, message):
    with pytest.raises(SettingsError) as caught:
        replace(FAN, **{layer: wrong})
    assert str(caught.value).startswith(f"solids: {message}")
