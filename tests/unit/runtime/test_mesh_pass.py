"""Polygon meshes: what a fan is compared with, so each colour is worked out here by hand."""

import dataclasses

import moderngl
import numpy as np
import pytest

from impostor.lighting import DirectionalLight, Gloss
from impostor.model import Material, Model
from impostor.srgb import srgb_from_linear
from impostor.views import direction
from tests.pictures import assert_parts_are_the_whole, filling, looking, placed
from tests.solids import BLUE, GREEN, RED, WHITE, Box, Sphere, corner_card, solid_model

CORNERS = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
FACES = np.array([[0, 1, 2], [0, 2, 3]])
UVS = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], float)  # v runs down


def card(normals=(0, 0, 1), faces=FACES, **material):
    """A square that fills `filling()`'s picture, facing +Z."""
    textured = material.get("texture") is not None
    return Model.from_arrays(
        CORNERS, faces, np.tile(normals, (4, 1)).astype(float),
        uvs=UVS if textured else None, material=Material(**{"base_color": (1.0, 1.0, 1.0, 1.0), **material}),
    )  # fmt: skip


@pytest.fixture
def draw(renderer, screen):
    def drawn(*models, output="lit", matrices=None):
        meshes = [renderer.add_mesh(model) for model in models]
        screen.clear()
        renderer.draw_meshes(*(matrices or filling()), output=output)
        for mesh in meshes:
            renderer.remove(mesh)
        return screen.color()

    return drawn


def test_light_times_albedo_on_the_srgb_curve(renderer, draw):
    renderer.lights = [DirectionalLight.from_angles(0, 60, (0.8, 0.4, 0.0)), DirectionalLight.from_angles(180, 0)]
    renderer.ambient = (0.1, 0.0, 0.3)
    expected = np.array([0.5, 0.25, 1.0]) * (np.array([0.1, 0, 0.3]) + 0.5 * np.array([0.8, 0.4, 0]))
    pixels = draw(card(base_color=(0.5, 0.25, 1.0, 1.0)))
    np.testing.assert_allclose(pixels[32, 32, :3], srgb_from_linear(expected) * 255, atol=1)
    assert (pixels == pixels[0, 0]).all()


def test_light_uses_the_smooth_normal(renderer, draw):
    renderer.lights, renderer.ambient = [DirectionalLight((1, 0, 1))], 0
    pixels = draw(card(normals=(0.6, 0, 0.8)))
    np.testing.assert_allclose(pixels[5, 5, 0], srgb_from_linear(1.4 / np.sqrt(2)) * 255, atol=1)


@pytest.mark.parametrize("orthographic", [True, False])
def test_the_highlight_is_where_half_way_meets_the_normal(renderer, draw, orthographic):
    """Blinn-Phong at every pixel of a card, from the position of the eye."""
    light, gloss, eye = direction(0.6, 0.3), Gloss(0.8, 40.0), np.array([0, 0, 3.0])
    renderer.lights, renderer.ambient = [DirectionalLight(tuple(light))], 0
    matrices = filling() if orthographic else looking(eye, fov_deg=2 * np.degrees(np.arctan(1 / 3)))
    renderer.add_mesh(card(base_color=(0, 0, 0, 1)), gloss=gloss)
    pixels = draw(matrices=matrices)
    across = (np.arange(64) + 0.5) / 32 - 1
    x, y = np.meshgrid(across, -across)
    toward = np.stack([0 * x, 0 * x, 0 * x + 1] if orthographic else [-x, -y, 0 * x + 3], axis=-1)
    half = light + toward / np.linalg.norm(toward, axis=-1, keepdims=True)
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    expected = srgb_from_linear(0.8 * half[..., 2] ** 40) * 255
    assert expected.max() > 50
    assert np.abs(pixels[..., 0] - expected).max() < 2


def test_a_texture_is_upright_and_not_mirrored(draw):
    pixels = draw(card(texture=corner_card(64)), output="albedo")
    for row, column, color in ((2, 2, RED), (2, 61, GREEN), (61, 2, BLUE), (61, 61, WHITE)):
        assert pixels[row, column].tolist() == [*color, 255]


def test_texture_factor_and_vertex_colour_multiply_in_linear_light(draw):
    texture = np.full((4, 4, 4), (188, 188, 188, 255), np.uint8)
    model = Model.from_arrays(
        CORNERS, FACES, np.tile((0.0, 0, 1), (4, 1)), np.full((4, 4), (255, 188, 0, 255), np.uint8), UVS,
        Material(base_color=(0.5, 1, 1, 1), texture=texture),
    )  # fmt: skip
    half = float(((188 / 255 + 0.055) / 1.055) ** 2.4)
    expected = srgb_from_linear(np.array([half * 0.5, half * half, 0])) * 255
    np.testing.assert_allclose(draw(model, output="albedo")[20, 20, :3], expected, atol=1)


def test_a_fine_texture_far_away_is_its_mean_light(draw):
    texture = np.full((256, 256, 4), 255, np.uint8)
    texture[(np.indices((256, 256)).sum(axis=0) % 2) == 0, :3] = 0
    pixels = draw(card(texture=texture), output="albedo")[..., 0].astype(int)
    assert np.abs(pixels - 188).max() < 4


def test_a_mask_cuts_at_its_threshold(draw):
    texture = np.full((64, 64, 4), 255, np.uint8)
    texture[..., 3] = np.arange(64) * 4
    pixels = draw(card(texture=texture, alpha_mode="MASK", alpha_cutoff=0.25), output="albedo")
    assert not pixels[:, :14].any()
    assert (pixels[:, 18:] == 255).all()


@pytest.mark.parametrize("alpha", [0.0, 0.25, 0.5, 1.0])
def test_blending_covers_its_share_of_the_pixels(draw, alpha):
    pixels = draw(card(base_color=(1, 1, 1, alpha), alpha_mode="BLEND"), output="albedo")
    assert (pixels[..., 3] == 255).mean() == pytest.approx(alpha, abs=1 / 32)


def test_alpha_of_what_is_opaque_does_not_count(draw):
    assert (draw(card(base_color=(1, 1, 1, 0.1)), output="albedo") == 255).all()


@pytest.mark.parametrize("double_sided", [True, False])
def test_the_back_of_a_surface(renderer, draw, double_sided):
    """Lit like a front when the material has two sides, else not there."""
    renderer.lights, renderer.ambient = [DirectionalLight((0, 0, -1))], 0
    pixels = draw(card(double_sided=double_sided), matrices=filling(azimuth=np.pi))
    assert (pixels == (255 if double_sided else 0)).all()


def test_normals_are_the_viewers(draw):
    side = draw(card(), output="normal", matrices=filling(azimuth=0.5))[32, 32]
    expected = (np.array([np.sin(-0.5), 0, np.cos(0.5)]) / 2 + 0.5) * 255
    np.testing.assert_allclose(side[:3], expected, atol=1)


def test_the_nearest_surface_is_seen(draw):
    far, near = Box((-1, -1, -1), (1, 1, -0.5), RED), Box((-0.5, -0.5, 0), (0.5, 0.5, 0.5), BLUE)
    for models in ((far, near), (near, far)):
        pixels = draw(*(solid_model(each) for each in models), output="albedo")
        assert pixels[32, 32].tolist() == [*BLUE, 255]
        assert pixels[5, 5].tolist() == [*RED, 255]


def test_a_mesh_may_be_moved_in_place(renderer, screen):
    model = solid_model(Box((-0.25, -0.25, 0), (0.25, 0.25, 0.1), RED))
    meshes = [renderer.add_mesh(model), renderer.add_mesh(model, placed((0.5, 0.5, 0), scale=0.5))]
    assert meshes[0].buffers is meshes[1].buffers
    meshes[0].world_from_model[:3, 3] = -0.5, -0.5, 0
    screen.clear()
    renderer.draw_meshes(*filling(), output="albedo")
    red = screen.color()[..., 0] == 255
    assert red[48, 16]
    assert red[16, 48]
    assert not red[32, 32]
    assert red.sum() == 16 * 16 + 8 * 8


def test_turning_a_mesh_turns_its_light(renderer, draw, screen):
    """The lit side stays on the light's side."""
    renderer.lights, renderer.ambient = [DirectionalLight((1, 0, 0))], 0
    model = solid_model(Sphere())
    pictures = []
    for yaw in (0.0, 1.0, 2.5):
        mesh = renderer.add_mesh(model, placed(yaw=yaw, scale=0.8))
        screen.clear()
        renderer.draw_meshes(*filling())
        pictures.append(screen.color())
        renderer.remove(mesh)
    assert pictures[0][32, 50, 0] > 150 > 20 > pictures[0][32, 14, 0]
    for picture in pictures[1:]:
        # The facets turn, the light does not.
        assert np.abs(picture[16:48, 16:48].astype(int) - pictures[0][16:48, 16:48]).max() < 6


class TestManyCopies:
    BOX = solid_model(Box((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1), RED))

    @pytest.fixture
    def draw_calls(self, monkeypatch):
        """Instances of every draw call since the last look."""
        calls, rendered = [], moderngl.VertexArray.render

        def spied(array, *arguments, **options):
            calls.append(options["instances"])
            return rendered(array, *arguments, **options)

        monkeypatch.setattr(moderngl.VertexArray, "render", spied)
        return calls

    def test_a_thousand_copies_are_one_draw_call_a_primitive(self, renderer, screen, draw_calls):
        parts = dataclasses.replace(
            self.BOX, primitives=self.BOX.primitives + solid_model(Box((0, 0, 0), (0.2, 0.2, 0.2), BLUE)).primitives
        )
        for position in np.random.default_rng(0).uniform(-0.7, 0.7, (1000, 3)):
            renderer.add_mesh(parts, placed(position))
        renderer.draw_meshes(*filling())
        assert draw_calls == [1000, 1000]

    def test_copies_of_different_gloss_keep_their_own(self, renderer, draw, screen, draw_calls):
        gloss = Gloss(1.0, 5.0)
        positions = [(-0.5, 0, 0), (0.5, 0, 0), (0, 0.5, 0)]
        alone = []
        for position, shiny in zip(positions, (False, True, False), strict=True):
            mesh = renderer.add_mesh(self.BOX, placed(position), gloss if shiny else None)
            screen.clear()
            renderer.draw_meshes(*filling())
            alone.append(screen.color().astype(int))
            renderer.remove(mesh)
        for position, shiny in zip(positions, (False, True, False), strict=True):
            renderer.add_mesh(self.BOX, placed(position), gloss if shiny else None)
        draw_calls.clear()
        np.testing.assert_array_equal(draw(), sum(alone))
        assert draw_calls == [2, 1]

    def test_copies_beside_the_picture_are_not_drawn(self, renderer, screen, draw_calls):
        for position in ((0, 0, 0), (50, 0, 0), (0, -50, 0), (0, 0, 60)):
            renderer.add_mesh(self.BOX, placed(position))
        renderer.draw_meshes(*looking((0, 0, 20)))
        assert draw_calls == [1]

    @pytest.mark.parametrize("matrices", [filling(1.5, 0.1, 1.2), looking((1, 2, 1.5)), looking((0.5, 0.2, 1.2))])
    def test_no_part_is_lost_at_the_picture_border(self, ctx, renderer, screen, matrices):
        """A picture is what 4 x 4 pictures of its parts show, each culled for itself; also of what is sheared."""
        model = solid_model(Sphere((0.8, 0.1, -0.3), 0.3, RED), Box((-0.2, -0.2, -0.2), (0.2, 0.2, 0.2), BLUE))
        sheared = placed((0.2, -0.5, 0.1))
        sheared[:3, :3] = [[1.5, 1.2, 0], [0, 0.7, 0.9], [0.3, 0, 0.4]]
        for place in (placed((-0.4, 0.3, 0), 1.0, 0.8), placed((0.3, 0.4, -0.5), 4.0, 1.5), sheared):
            renderer.add_mesh(model, place)
        assert_parts_are_the_whole(ctx, screen, renderer.draw_meshes, matrices)


def test_no_meshes_draw_nothing(draw):
    assert not draw().any()
