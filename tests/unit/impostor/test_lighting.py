"""The colormap: every normal's colour under any lights."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impostor.errors import SettingsError
from impostor.lighting import DirectionalLight, Gloss, colormap
from impostor.normal_code import BYTE_TO_NORMAL
from impostor.srgb import linear_from_srgb, srgb_from_linear
from impostor.views import basis_facing, direction

BASIS = basis_facing(direction(0.8, 0.4))
SUN = DirectionalLight((1, 2, 3), (1.0, 0.9, 0.7))
SKY = [DirectionalLight(tuple(direction(i * 1.7, 0.1 + 0.01 * i)), (0.01, 0.02, 0.03)) for i in range(40)]


def entry(normal, basis, lights, ambient, gloss):
    """Equation 1 for one normal, written out."""
    world = basis.T @ normal
    diffuse, specular = np.array(ambient, float), np.zeros(3)
    for light in lights:
        toward, color = np.array(light.toward), np.array(light.color)
        facing = world @ toward
        if facing <= 0:
            continue
        diffuse = diffuse + color * facing
        half = toward + basis[2]
        along = max(world @ half / np.linalg.norm(half), 0)
        specular = specular + gloss.strength * color * along**gloss.shininess
    return diffuse, specular


@pytest.mark.parametrize("lights", [[], [SUN], [SUN, *SKY]], ids=["none", "one", "many"])
@pytest.mark.parametrize("gloss", [Gloss(), Gloss(0.6, 20.0)], ids=["matt", "glossy"])
def test_every_entry_is_equation_1(lights, gloss):
    ambient = (0.1, 0.2, 0.3)
    found = colormap(BASIS, lights, ambient, gloss)
    for code in range(225):
        diffuse, specular = entry(BYTE_TO_NORMAL[code].astype(float), BASIS, lights, ambient, gloss)
        np.testing.assert_allclose(found.diffuse[code], diffuse, atol=1e-6)
        np.testing.assert_allclose(found.specular[code], specular, atol=1e-6)


def test_what_is_no_normal_is_black_even_in_ambient_light():
    found = colormap(BASIS, [SUN], 1.0, Gloss(1.0))
    assert not found.diffuse[225:].any()
    assert not found.specular[225:].any()


def test_a_surface_that_faces_a_white_light_is_as_bright_as_the_light():
    light = DirectionalLight(tuple(BASIS[2]))
    np.testing.assert_allclose(colormap(BASIS, [light]).diffuse[112], [1, 1, 1], atol=1e-6)


def test_ambient_light_reaches_normals_that_no_light_does():
    behind = DirectionalLight(tuple(-BASIS[2]))
    assert (colormap(BASIS, [behind], 0.25).diffuse[112] == 0.25).all()


def test_lights_add_up():
    one, other = colormap(BASIS, [SUN]), colormap(BASIS, SKY[:3])
    both = colormap(BASIS, [SUN, *SKY[:3]])
    np.testing.assert_allclose(both.diffuse, one.diffuse + other.diffuse, atol=1e-6)


def test_many_bases_at_once():
    bases = basis_facing(direction(np.arange(6.0).reshape(2, 3), 0.2))
    together = colormap(bases, [SUN], 0.1, Gloss(0.5))
    assert together.diffuse.shape == together.specular.shape == (2, 3, 256, 3)
    assert together.diffuse.dtype == np.float32
    np.testing.assert_allclose(together.specular[1, 2], colormap(bases[1, 2], [SUN], 0.1, Gloss(0.5)).specular)


def test_the_highlight_is_where_the_light_is_mirrored_to_the_viewer():
    """A light as far to the right of a normal as the viewer is to its left."""
    code = 130
    normal = BYTE_TO_NORMAL[code].astype(float)
    mirrored = 2 * normal[2] * normal - np.array([0, 0, 1.0])
    light = DirectionalLight(tuple(BASIS.T @ mirrored))
    found = colormap(BASIS, [light], gloss=Gloss(0.7, 400.0))
    assert found.specular[:, 0].argmax() == code
    assert found.specular[code, 0] == pytest.approx(0.7, abs=1e-5)


@pytest.mark.parametrize(
    ("azimuth_deg", "elevation_deg", "toward"), [(0, 0, (0, 0, 1)), (90, 0, (1, 0, 0)), (0, 90, (0, 1, 0))]
)
def test_a_light_by_its_angles(azimuth_deg, elevation_deg, toward):
    light = DirectionalLight.from_angles(azimuth_deg, elevation_deg, (0.5, 0.25, 0))
    np.testing.assert_allclose(light.toward, toward, atol=1e-12)
    assert light.color == (0.5, 0.25, 0)


def test_a_lights_direction_is_made_unit_and_lights_compare_by_value():
    assert DirectionalLight((0, 0, 9)) == DirectionalLight((0, 0, 1))
    assert hash(DirectionalLight((0, 0, 9))) == hash(DirectionalLight((0, 0, 1)))
    assert DirectionalLight((0, 0, 1), (1, 1, 0.5)) != DirectionalLight((0, 0, 1))


@pytest.mark.parametrize(
    ("toward", "color"),
    [
        ((0, 0, 0), (1, 1, 1)),
        ((0, np.nan, 1), (1, 1, 1)),
        ((0, np.inf, 1), (1, 1, 1)),
        ((0, 1), (1, 1, 1)),
        ((0, 0, 1), (1, -0.1, 1)),
        ((0, 0, 1), (1, np.nan, 1)),
        ((0, 0, 1), (1, 1)),
    ],
)
def test_impossible_lights_are_refused(toward, color):
    with pytest.raises(SettingsError, match=r"^light: .*; expected three finite numbers"):
        DirectionalLight(toward, color)


@pytest.mark.parametrize(
    ("strength", "shininess"), [(-0.1, 10), (0.5, 0), (0.5, -1), (np.nan, 10), (0.5, np.inf), (np.inf, 1)]
)
def test_impossible_gloss_is_refused(strength, shininess):
    with pytest.raises(SettingsError, match="^gloss: strength"):
        Gloss(strength, shininess)


@settings(deadline=None)
@given(st.floats(0, 1))
def test_the_srgb_curve_and_its_inverse(value):
    assert linear_from_srgb(srgb_from_linear(value)) == pytest.approx(value, abs=1e-6)


def test_the_srgb_curve_clips_and_keeps_its_type():
    assert srgb_from_linear([-1.0, 0.0, 1.0, 7.0]).tolist() == pytest.approx([0, 0, 1, 1])
    assert srgb_from_linear(np.float32([0.5])).dtype == np.float32
    assert srgb_from_linear(0.2140411) == pytest.approx(0.5, abs=1e-6)
