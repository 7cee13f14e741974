"""What a renderer is given: arrays written in place or replaced, and one line for what it cannot draw."""

import numpy as np
import pytest

from impostor.errors import GpuError, SettingsError
from impostor.lighting import DirectionalLight
from impostor.shadow_projection import Ground
from runtime import ImpostorRenderer
from runtime.animation import AnimatedFan, AnimatedInstances
from runtime.ground.ground_pass import GroundSurface
from runtime.lights.contact_settings import ContactShadows
from runtime.surfaces.surface_pass import rectangle
from runtime.viewing.cameras import Camera
from tests.ptms import random_ptm
from tests.solids import Box, Sphere, solid_fan, solid_model

FAN = solid_fan(Sphere((0, 1, 0)), views=6, size=32)
MODEL = solid_model(Box((-0.5, 0, -0.5), (0.5, 1.5, 0.5)))
LEVEL = Ground((0, 1, 0))
MATRICES = Camera.perspective((0, 5, 9), (0, 0.7, 0), 45, 1, 1, 40).matrices
SUN = DirectionalLight((0, 1, 1))
DRAWS = {
    "draw": lambda renderer: renderer.draw(*MATRICES),
    "draw_meshes": lambda renderer: renderer.draw_meshes(*MATRICES),
    "draw_ground": lambda renderer: renderer.draw_ground(*MATRICES, LEVEL, GroundSurface()),
    "draw_shadows": lambda renderer: renderer.draw_shadows(*MATRICES, LEVEL),
}


def problem(caught):
    """The error's message, which is one line."""
    assert "\n" not in str(caught.value) and "expected" in str(caught.value)
    return str(caught.value)


class TestLights:
    @pytest.mark.parametrize(
        ("lights", "message"),
        [
            (SUN, "lights: a DirectionalLight; expected a list of DirectionalLight"),
            (None, "lights: a NoneType; expected"),
            ("sun", "lights: a str; expected"),
            ([SUN, (0, 1, 0)], "lights: number 1 is a tuple; expected a DirectionalLight"),
        ],
    )
    def test_what_is_no_list_of_lights_is_refused_when_it_is_set(self, renderer, lights, message):
        with pytest.raises(SettingsError) as caught:
            renderer.lights = lights
        assert problem(caught).startswith(message)
        assert all(isinstance(light, DirectionalLight) for light in renderer.lights)

    @pytest.mark.parametrize("draw", list(DRAWS))
    def test_what_is_no_light_is_refused_when_it_was_put_into_the_list(self, renderer, screen, draw):
        renderer.add(FAN)
        renderer.lights = [SUN]
        renderer.lights[0] = "sun"
        with pytest.raises(SettingsError) as caught:
            DRAWS[draw](renderer)
        assert problem(caught).startswith("lights: number 0 is a str")

    @pytest.mark.parametrize("ambient", [np.nan, -0.1, (0.1, 0.2), (0.1, np.inf, 0.1), np.zeros((3, 1)), "dim", None])
    def test_impossible_ambient_light_is_refused_when_it_is_set(self, renderer, ambient):
        with pytest.raises(SettingsError) as caught:
            renderer.ambient = ambient
        assert problem(caught).startswith("ambient: ")
        np.testing.assert_array_equal(renderer.ambient, 0.25)

    def test_ambient_light_is_replaced_and_never_changed_in_place(self, renderer):
        mine = np.full(3, 0.5)
        renderer.ambient = mine
        mine[:] = np.nan
        np.testing.assert_array_equal(renderer.ambient, 0.5)
        with pytest.raises(ValueError, match="read-only"):
            renderer.ambient[0] = 1
        renderer.ambient = 2 * renderer.ambient
        np.testing.assert_array_equal(renderer.ambient, [1, 1, 1])


class TestWhatIsPlaced:
    @pytest.mark.parametrize("fan", ["tree.fan", None, MODEL])
    def test_only_a_fan_is_added_as_one(self, renderer, fan):
        with pytest.raises(SettingsError) as caught:
            renderer.add(fan)
        assert problem(caught) == f"fan: a {type(fan).__name__}; expected a Fan, as impostor.load gives"

    def test_only_a_model_is_added_as_one(self, renderer):
        with pytest.raises(SettingsError) as caught:
            renderer.add_mesh(FAN)
        assert problem(caught) == "model: a Fan; expected a Model, as impostor.load_model gives"

    @pytest.mark.parametrize(
        "matrix", [np.eye(3), np.full((4, 4), np.nan), np.diag([1, 0, 1, 1]), "here", [[1], [2, 3]]]
    )
    def test_impossible_places_of_a_mesh_are_refused(self, renderer, matrix):
        with pytest.raises(SettingsError) as caught:
            renderer.add_mesh(MODEL, matrix)
        assert "world_from_model" in problem(caught)

    @pytest.mark.parametrize("draw", ["draw_meshes", "draw_shadows"])
    def test_a_place_that_became_impossible_is_refused(self, renderer, screen, draw):
        renderer.add_mesh(MODEL).world_from_model = np.eye(3)
        with pytest.raises(SettingsError) as caught:
            DRAWS[draw](renderer)
        assert problem(caught).endswith("world_from_model of shape (3, 3); expected (4, 4)")


class TestMatrices:
    @pytest.mark.parametrize("draw", list(DRAWS))
    @pytest.mark.parametrize(
        ("clip", "view", "message"),
        [
            (np.eye(3), np.eye(4), "clip_from_view of shape (3, 3); expected (4, 4)"),
            (np.eye(4), np.eye(4)[None], "view_from_world of shape (1, 4, 4); expected (4, 4)"),
            (np.eye(4), np.full((4, 4), np.nan), "view_from_world with a number that is not finite"),
            ("perspective", np.eye(4), "clip_from_view is a str; expected numbers of shape (4, 4)"),
            (np.zeros((4, 4)), np.eye(4), "clip_from_view @ view_from_world has no inverse"),
            (np.eye(4), np.diag([1.0, 1, 0, 1]), "clip_from_view @ view_from_world has no inverse"),
        ],
    )
    def test_what_is_no_camera_is_refused(self, renderer, screen, draw, clip, view, message):
        calls = {"draw_ground": (LEVEL, GroundSurface()), "draw_shadows": (LEVEL,)}
        with pytest.raises(SettingsError) as caught:
            getattr(renderer, draw)(clip, view, *calls.get(draw, ()))
        assert message in problem(caught)

    def test_a_matrix_that_only_rounding_keeps_from_being_singular_is_refused(self, renderer, screen):
        rank_3 = np.random.default_rng(0).normal(size=(4, 3)) @ np.random.default_rng(1).normal(size=(3, 4))
        with pytest.raises(SettingsError, match="clip_from_view @ view_from_world has no inverse"):
            renderer.draw(rank_3, np.eye(4))

    def test_a_transposed_view_is_told_from_one(self, renderer, screen):
        with pytest.raises(SettingsError, match=r"last row .* expected \(0, 0, 0, 1\): column vectors"):
            renderer.draw(MATRICES[0], MATRICES[1].T)

    @pytest.mark.parametrize("metres", [1e-9, 1, 1e9])
    def test_any_scale_of_world_and_any_range_of_depth_is_taken(self, renderer, screen, metres):
        eye = np.array([1, 2, 3]) * metres
        for camera in (
            Camera.perspective(eye, 0 * eye, 1, 1, 1e-6 * metres, 1e6 * metres),
            Camera.perspective(1e6 * eye, 1e6 * eye + 1e-3 * metres, 170, 4, 1e-3 * metres, 1e3 * metres),
            Camera.orthographic(eye, metres, 0.3, 0.4),
        ):
            renderer.draw(*camera.matrices)


class TestGround:
    @pytest.mark.parametrize(
        "texture",
        [
            np.zeros((4, 4, 3), np.uint8),
            np.zeros((4, 4), np.uint8),
            np.zeros((4, 4, 4), np.float32),
            np.zeros((0, 4, 4), np.uint8),
        ],
    )
    def test_a_texture_of_another_kind_is_refused(self, renderer, screen, texture):
        with pytest.raises(SettingsError) as caught:
            renderer.draw_ground(*MATRICES, LEVEL, GroundSurface(texture=texture))
        assert problem(caught) == f"ground texture: {texture.shape} {texture.dtype}; expected (H, W, 4) uint8"

    def test_a_texture_that_is_no_array_is_refused(self, renderer, screen):
        with pytest.raises(SettingsError, match="^ground texture: a list; expected a ndarray$"):
            renderer.draw_ground(*MATRICES, LEVEL, GroundSurface(texture=[[[0, 0, 0, 0]]]))

    def test_what_is_no_ground_is_refused(self, renderer, screen):
        with pytest.raises(SettingsError, match="^ground: a tuple; expected a Ground or a Surface$"):
            renderer.draw_shadows(*MATRICES, (0, 1, 0))
        with pytest.raises(SettingsError, match="^ground: a tuple; expected a Ground$"):
            renderer.draw_ground(*MATRICES, (0, 1, 0), GroundSurface())
        with pytest.raises(SettingsError, match="^surface: a tuple; expected a GroundSurface$"):
            renderer.draw_ground(*MATRICES, LEVEL, (0.5, 0.5, 0.5))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("exponent", [8, 14, 18, 30, 38, 40, 160, 300, 308])
@pytest.mark.parametrize("name", ["positions", "yaws", "scales"])
@pytest.mark.parametrize("sign", [-1, 1])
def test_numbers_of_any_size_are_drawn_or_left_out(renderer, screen, name, exponent, sign):
    renderer.lights = [SUN]
    renderer.contact_shadows = ContactShadows(0.5)
    copies = renderer.add(FAN, [(0, 0, 0), (1, 0, 0)])
    # A scale below 0 is no copy; one that is next to nothing is a hard one.
    getattr(copies, name)[0] = 10.0 ** (sign * exponent) if name == "scales" else sign * 10.0**exponent
    for draw in DRAWS.values():
        draw(renderer)
    assert renderer.statistics["instances"] >= 1


class TestRemoving:
    UNKNOWN = "; expected something that was added to this renderer and not taken away since"

    def place_all(self, renderer):
        surface = renderer.add_surface(random_ptm(size=(16, 16)), rectangle(1, 1))
        return [
            renderer.add(FAN),
            renderer.add_mesh(MODEL),
            surface,
            AnimatedInstances(renderer, AnimatedFan([FAN], 1)),
        ]

    def test_whatever_was_placed_is_taken_away_once(self, renderer, screen):
        things = self.place_all(renderer)
        for thing in things:
            renderer.remove(thing)
        for draw in (renderer.draw, renderer.draw_meshes, renderer.draw_surfaces):
            draw(*MATRICES)
        assert not screen.color().any()
        for thing in things:
            with pytest.raises(SettingsError, match=f"^remove: an? {type(thing).__name__}{self.UNKNOWN}$"):
                renderer.remove(thing)

    @pytest.mark.parametrize("thing", [None, "tree", 3, FAN, MODEL, []])
    def test_what_was_never_placed_is_refused(self, renderer, thing):
        with pytest.raises(SettingsError, match=f"^remove: an? {type(thing).__name__}{self.UNKNOWN}$"):
            renderer.remove(thing)

    def test_what_another_renderer_has_stays_there(self, ctx, renderer):
        other = ImpostorRenderer(ctx, cache_side=256)
        try:
            for thing in self.place_all(other):
                with pytest.raises(SettingsError, match=self.UNKNOWN):
                    renderer.remove(thing)
                other.remove(thing)
        finally:
            other.release()

    def test_an_animation_takes_itself_away(self, renderer):
        dancer = AnimatedInstances(renderer, AnimatedFan([FAN, FAN], 1))
        dancer.remove()
        assert not renderer._placed.batches
        with pytest.raises(SettingsError, match=self.UNKNOWN):
            dancer.remove()


def test_a_released_renderer_says_so(ctx, screen):
    renderer = ImpostorRenderer(ctx, cache_side=256)
    copies = renderer.add(FAN)
    renderer.release()
    for use in (*DRAWS.values(), lambda renderer: renderer.add(FAN), lambda renderer: renderer.add_mesh(MODEL),
                lambda renderer: renderer.memory, lambda renderer: renderer.remove(copies)):  # fmt: skip
        with pytest.raises(GpuError) as caught:
            use(renderer)
        assert problem(caught) == "ImpostorRenderer: has been released; expected one that is in use"
