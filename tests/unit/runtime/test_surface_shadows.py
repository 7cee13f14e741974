"""Surfaces and shadows: they cast as meshes do, and flat ones are darkened where the light does not reach them."""

import numpy as np
import pytest

from impostor.errors import SettingsError
from impostor.lighting import DirectionalLight, LocalLight
from impostor.model import Model
from impostor.ptm.polynomials import Polynomials
from impostor.ptm.quantise import quantise
from impostor.shadow_projection import Ground
from impostor.views import rotation_about_y
from runtime import ContactShadows, ImpostorRenderer, Offscreen
from runtime.ground.ground_pass import GroundSurface
from runtime.surfaces.surface_pass import lying_on, rectangle
from tests.pictures import apart, filling, iou, looking, placed
from tests.solids import Box, Sphere, solid_fan, solid_model

SIZE = 128
LEVEL = Ground((0, 1, 0))
GREY = quantise(Polynomials(np.full((1, 1, 3, 6), (0, 0, 0, 0, 0, 0.4), np.float32), curve="linear"))
TOWER = Box((-0.2, -0.5, -0.2), (0.2, 0.5, 0.2))
AHEAD = filling(1.0)
SIDE = DirectionalLight((1, 0, 1))
"""From the right at 45 degrees onto what faces +Z: a metre before it is a metre to the left on it."""


@pytest.fixture
def screen(ctx):
    screen = Offscreen(ctx, SIZE, SIZE)
    yield screen
    screen.release()


@pytest.fixture
def wall(renderer):
    """Two metres square, around the origin, facing +Z."""
    renderer.lights, renderer.ambient = [SIDE], 0
    return renderer.add_surface(GREY, rectangle(2, 2))


@pytest.fixture
def picture(renderer, screen):
    """Surfaces with the shadows on one of them, (SIZE, SIZE, 3) uint8."""

    def drawn(surface=None, matrices=AHEAD):
        screen.clear((0, 0, 0, 1))
        renderer.draw_surfaces(*matrices)
        if surface is not None:
            renderer.draw_shadows(*matrices, surface)
        return screen.color()[..., :3]

    return drawn


def ground_under(renderer, screen, matrices):
    screen.clear((0, 0, 0, 1))
    renderer.draw_ground(*matrices, LEVEL, GroundSurface(albedo=(1, 1, 1), reach=1e4))
    renderer.draw_shadows(*matrices, LEVEL)
    return screen.color()[..., :3]


def across(low, high):
    """Pixels between two places on the wall, by their x, and by y where the tower's shadow is."""
    x = (np.arange(SIZE) + 0.5) * 2 / SIZE - 1
    return ((x > low) & (x < high))[None] & (abs(x) < 0.5)[:, None]


class TestOnAWall:
    @pytest.mark.parametrize("kind", ["mesh", "fan"])
    def test_what_stands_before_it_casts_along_the_light(self, renderer, wall, picture, kind):
        """A tower 0.4 m wide and half a metre before the wall: its shadow from -0.9 m to -0.1 m."""
        at = (0.0, 0.0, 0.5)
        if kind == "mesh":
            renderer.add_mesh(solid_model(TOWER), placed(at))
        else:
            renderer.add(solid_fan(TOWER, views=32, elevation_deg=0, size=128), at)
        assert iou(picture(wall).max(axis=-1) == 0, across(-0.9, -0.1)) > 0.9

    def test_a_fan_casts_where_its_mesh_does_seen_from_above(self, renderer, picture):
        """Nothing has its feet on a wall, for the shadow to meet them."""
        renderer.lights, renderer.ambient = [DirectionalLight((3, 0.5, 0.35))], 0
        wall = renderer.add_surface(GREY, rectangle(8, 4), world_from_model=placed((0, 1, 0)))
        ball, at, above = Sphere((0, 0.6, 0), 0.4), (0, 0, 0.35), looking((1, 5, 3))
        fan = renderer.add(solid_fan(ball, views=64, elevation_deg=15, size=128), at)
        strips = picture(wall, above)
        renderer.remove(fan)
        renderer.add_mesh(solid_model(ball), placed(at))
        bare = picture(matrices=above)
        assert iou(apart(strips, bare) > 20, apart(picture(wall, above), bare) > 20) > 0.95

    def test_what_is_behind_it_casts_nothing(self, renderer, wall, picture):
        renderer.add_mesh(solid_model(TOWER), placed((0.2, 0, -0.5)))
        renderer.add(solid_fan(TOWER, views=8, size=32), (-0.2, 0, -0.6))
        np.testing.assert_array_equal(picture(wall), picture())

    @pytest.mark.parametrize("softness_deg", [0, 3])
    @pytest.mark.parametrize("kind", ["mesh", "fan"])
    def test_what_is_stuck_in_it_casts_with_what_stands_out(self, renderer, wall, picture, kind, softness_deg):
        """Of a ball a cap, so flat that all of it is lit: nothing is dark but what it stands on."""
        renderer.lights = [DirectionalLight((1, 0, 1), softness=np.radians(softness_deg))]
        ball = Sphere((0, 0, 0), 0.5)
        if kind == "mesh":
            renderer.add_mesh(solid_model(ball), placed((0, 0, -0.45)))
        else:
            renderer.add(solid_fan(ball, views=32, elevation_deg=0, size=128), (0, 0, -0.45))
        x = (np.arange(SIZE) + 0.5) * 2 / SIZE - 1
        away = np.hypot(x, x[:, None]) > np.sqrt(0.5**2 - 0.45**2) + 2 / SIZE
        np.testing.assert_array_equal(picture(wall)[away], picture()[away])

    def test_neither_does_it_on_itself_nor_what_goes_on_beside_it(self, renderer, wall, picture):
        renderer.add_surface(GREY, rectangle(1, 1), world_from_model=placed((1.2, 0, 0)))
        np.testing.assert_array_equal(picture(wall), picture())

    def test_neither_does_a_model_at_a_slant_to_its_own_axes(self, renderer, picture):
        renderer.lights, renderer.ambient = [SIDE], 0
        turn = rotation_about_y(0.5) @ rotation_about_y(0.4)[[1, 2, 0]][:, [1, 2, 0]]
        (flat,) = rectangle(2, 2).primitives
        slanted = Model.from_arrays(flat.positions @ turn.T, flat.triangles, flat.normals @ turn.T, uvs=flat.uvs)
        back = np.eye(4)
        back[:3, :3] = turn.T
        wall = renderer.add_surface(GREY, slanted, world_from_model=back)
        np.testing.assert_array_equal(picture(wall), picture())
        renderer.add_mesh(solid_model(TOWER), placed((0, 0, 0.5)))
        assert iou(picture(wall).max(axis=-1) == 0, across(-0.9, -0.1)) > 0.9

    def test_another_wall_casts_on_it(self, renderer, wall, picture):
        renderer.add_surface(GREY, rectangle(0.2, 1), world_from_model=placed((0.8, 0, 0.8), np.pi / 2))
        shadow = picture(wall).max(axis=-1) == 0
        assert iou(shadow[:, : SIZE * 3 // 4], across(-0.1, 0.1)[:, : SIZE * 3 // 4]) > 0.9

    def test_nothing_is_darkened_beside_it(self, renderer, wall, picture, screen):
        renderer.add_mesh(solid_model(TOWER), placed((0, 0, 1.2)))
        far = filling(3.0)
        floor = GroundSurface(albedo=(1, 1, 1), reach=1e4)
        behind = Ground((0, 0, 1), -0.5)
        screen.clear((0, 0, 0, 1))
        renderer.draw_surfaces(*far)
        renderer.draw_ground(*far, behind, floor)
        bare = screen.color()
        renderer.draw_shadows(*far, wall)
        changed = apart(screen.color(), bare) > 0
        rows, columns = np.nonzero(changed)
        third = SIZE // 3
        assert changed.any() and rows.min() >= third - 1 and columns.min() >= third - 1

    def test_each_of_many_lights_takes_what_it_gave(self, renderer, wall, picture):
        renderer.lights = [SIDE, *[DirectionalLight((-1, 0.1 * n, 1)) for n in range(5)]]
        renderer.add_mesh(solid_model(TOWER), placed((0, 0, 0.5)))
        before, after = picture(), picture(wall)
        both = after[SIZE // 2, [SIZE // 4, SIZE * 3 // 4], 0].astype(float) / before[SIZE // 2, SIZE // 2, 0]
        # Five in six of the light are gone on the right, one in six on the left.
        np.testing.assert_allclose(both**2.2, (5 / 6, 1 / 6), atol=0.03)

    def test_a_lamp_goes_on_shining_in_the_shadow_of_the_sun(self, renderer, wall, picture):
        renderer.lights, lamp = [DirectionalLight((0, 0, 1), (0.5, 0.5, 0.5))], LocalLight((0, 0, 20), (200, 200, 200))
        renderer.local_lights = [lamp]
        renderer.add_mesh(solid_model(TOWER), placed((0, 0, 0.5)))
        shadow = picture(wall)
        renderer.lights = []
        middle = SIZE // 2, SIZE // 2
        np.testing.assert_allclose(shadow[middle].astype(int), picture()[middle], atol=2)

    def test_light_from_behind_casts_nothing(self, renderer, wall, picture):
        renderer.lights = [DirectionalLight((1, 0, -1))]
        renderer.ambient = 0.5
        renderer.add_mesh(solid_model(TOWER), placed((0, 0, 0.5)))
        np.testing.assert_array_equal(picture(wall), picture())

    def test_it_moves_with_the_wall(self, renderer, wall, picture):
        renderer.add_mesh(solid_model(TOWER), placed((0, 0, 0.5)))
        before = picture(wall)
        wall.world_from_model = placed((0, 0, 0.2))
        moved = picture(wall)
        assert iou(moved.max(axis=-1) == 0, across(-0.7, 0.1)) > 0.9
        wall.world_from_model = placed()
        np.testing.assert_array_equal(picture(wall), before)


def test_a_mirrored_wall_has_its_shadows_where_it_shows_light(renderer, picture):
    """A PTM's normal is the cross of its picture's right and up: mirrored, a wall that faced +Z is lit from -Z."""
    renderer.lights, renderer.ambient = [SIDE], 0.5
    wall = renderer.add_surface(GREY, rectangle(2, 2), world_from_model=np.diag([-1.0, 1, 1, 1]))
    renderer.add_mesh(solid_model(TOWER), placed((0, 0, 0.5)))
    lit = picture()
    np.testing.assert_array_equal(picture(wall), lit)
    renderer.lights = []
    np.testing.assert_array_equal(picture(), lit)


class TestOnTheGround:
    CAMERA = looking((3, 4, 5), (0, 0, 0))

    def test_a_surface_casts_as_a_mesh_of_its_model_does(self, renderer, screen):
        renderer.lights, renderer.ambient = [DirectionalLight((0.5, 1, 0.8))], 0.2
        upright = placed((0, 0.5, 0), 0.3)
        surface = renderer.add_surface(GREY, rectangle(1, 1), world_from_model=upright)
        cast = ground_under(renderer, screen, self.CAMERA)
        renderer.remove(surface)
        bare = ground_under(renderer, screen, self.CAMERA)
        renderer.add_mesh(rectangle(1, 1), upright)
        np.testing.assert_array_equal(cast, ground_under(renderer, screen, self.CAMERA))
        assert (apart(cast, bare) > 30).sum() > 100

    def test_a_floor_of_ptm_does_not_darken_the_ground_it_is(self, renderer, screen):
        renderer.lights = [DirectionalLight((0.5, 1, 0.8))]
        sloping = Ground((0.2, 1, 0.1), 0.3)
        renderer.add_surface(GREY, rectangle(40, 40), world_from_model=lying_on(sloping, (3, 0, 2)))
        screen.clear((0, 0, 0, 1))
        renderer.draw_ground(*self.CAMERA, sloping, GroundSurface(albedo=(1, 1, 1), reach=1e4))
        bare = screen.color()
        renderer.draw_shadows(*self.CAMERA, sloping)
        np.testing.assert_array_equal(screen.color(), bare)

    def test_contact_shadows_fall_on_what_lies(self, renderer, picture):
        renderer.lights, renderer.ambient, renderer.contact_shadows = [], 0.6, ContactShadows(1.0, 1.0)
        renderer.add_mesh(solid_model(TOWER), placed((0, 0.55, 0)))
        floor = renderer.add_surface(GREY, rectangle(4, 4), world_from_model=lying_on(Ground((0, 1, 0), 0.05)))
        wall = renderer.add_surface(GREY, rectangle(4, 4), world_from_model=placed((0, 0, -0.25)))
        bare = picture(matrices=self.CAMERA)
        assert (apart(picture(floor, self.CAMERA), bare) > 20).any()
        np.testing.assert_array_equal(picture(wall, self.CAMERA), bare)

    @pytest.mark.parametrize("kind", ["mesh", "fan"])
    def test_what_is_under_it_touches_it_nowhere(self, renderer, picture, kind):
        """As what stands under a table."""
        renderer.lights, renderer.ambient, renderer.contact_shadows = [], 0.6, ContactShadows(1.0, 1.0)
        table = renderer.add_surface(GREY, rectangle(4, 4), world_from_model=lying_on(LEVEL))
        if kind == "mesh":
            renderer.add_mesh(solid_model(TOWER), placed((0, -0.6, 0)))
        else:
            renderer.add(solid_fan(TOWER, views=8, size=32), (0, -0.6, 0))
        np.testing.assert_array_equal(picture(table, self.CAMERA), picture(matrices=self.CAMERA))


def test_where_it_is_not_seen_nothing_is_marked(renderer, wall, picture):
    renderer.add_mesh(solid_model(TOWER), placed((0, 0, 0.5)))
    before = renderer.memory["shadow marks"]
    for beside in (filling(1.0, center=(2.5, 0, 0)), looking((0, 0, 2), (0, 0, 4)), looking((0, 0, -2))):
        picture(wall, beside)
        assert renderer.memory["shadow marks"] == before
    picture(wall)
    assert renderer.memory["shadow marks"] > before


class TestRefusals:
    def test_a_surface_that_is_not_flat(self, renderer):
        corners, faces = [[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
        bent = renderer.add_surface(GREY, Model.from_arrays(corners, faces, uvs=np.zeros((4, 2)), name="sail"))
        with pytest.raises(SettingsError, match=r"sail reaches 0\.\d+ m out of a plane; expected a flat model"):
            renderer.draw_shadows(*AHEAD, bent)

    def test_a_sheet_with_two_fronts(self, renderer):
        corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
        faces, normals = [[0, 1, 2], [3, 5, 4]], [[0, 0, 1]] * 3 + [[0, 0, -1]] * 3
        sheet = Model.from_arrays(corners * 2, faces, normals, uvs=np.zeros((6, 2)), name="sheet")
        sheet = renderer.add_surface(GREY, sheet)
        with pytest.raises(SettingsError, match="sheet faces every way as much as its opposite; expected a flat model"):
            renderer.draw_shadows(*AHEAD, sheet)

    def test_a_ground_that_fades_with_a_surface(self, renderer, wall):
        with pytest.raises(SettingsError, match="surface: given for shadows on a Surface; expected it with a Ground"):
            renderer.draw_shadows(*AHEAD, wall, GroundSurface())

    def test_a_surface_of_another_renderer(self, ctx, renderer):
        other = ImpostorRenderer(ctx, cache_side=64)
        surface = other.add_surface(GREY, rectangle(1, 1))
        with pytest.raises(SettingsError, match="a Surface that is not in this renderer"):
            renderer.draw_shadows(*AHEAD, surface)
        other.release()


def test_marks_go_with_their_surface(renderer, wall, picture):
    renderer.add_mesh(solid_model(TOWER), placed((0, 0, 0.5)))
    before = renderer.memory
    second = renderer.add_surface(GREY, rectangle(1, 1), world_from_model=placed((0, 0, -0.1)))
    picture(wall), picture(second)
    both = renderer.memory["shadow marks"]
    renderer.remove(second)
    one = renderer.memory["shadow marks"]
    renderer.remove(wall)
    assert both > one > renderer.memory["shadow marks"] == before["shadow marks"]
