"""Penumbras of lights with a size, and the shadows that rooms cast."""

import numpy as np
import pytest
from scipy.ndimage import binary_erosion

from impostor.environment import Environment, Room
from impostor.environment.bright_lights import bright_lights
from impostor.environment.cube import face_directions
from impostor.errors import SettingsError
from impostor.lighting import DirectionalLight
from impostor.shadow_projection import LOWEST_LIGHT, Ground
from impostor.srgb import linear_from_srgb, srgb_from_linear
from impostor.views import direction
from runtime.gl.offscreen import Offscreen
from runtime.ground.ground_light import room_diffuse
from runtime.ground.ground_pass import GroundSurface
from runtime.shadows import soft_light
from tests import gl as raw
from tests.pictures import filling, looking, placed
from tests.solids import Box, Sphere, solid_fan, solid_model

SIZE = 512
LEVEL = Ground((0, 1, 0), 0.0)
WHITE = GroundSurface(albedo=(1, 1, 1), reach=1e4)
ABOVE = filling(1.0, 0.0, np.pi / 2 - 1e-4)
ACROSS = (np.arange(SIZE) + 0.5) / SIZE * 2 - 1  # metres from left to right in that picture
ROOF = solid_model(Box((-9, 1, -9), (9, 1.02, 9)))


@pytest.fixture
def screen(ctx):
    screen = Offscreen(ctx, SIZE, SIZE)
    yield screen
    screen.release()


@pytest.fixture
def ground(renderer, screen):
    """Linear light (SIZE, SIZE, 3) that is left on a white ground, and the light on it without shadows."""

    def drawn(lights, ambient=0.0, matrices=ABOVE, surface=WHITE):
        renderer.lights, renderer.ambient = lights, ambient
        screen.clear((0, 0, 0, 1))
        renderer.draw_ground(*matrices, LEVEL, surface)
        bare = screen.color()
        renderer.draw_shadows(*matrices, LEVEL)
        return tuple(linear_from_srgb(picture[..., :3] / 255) for picture in (screen.color(), bare))

    return drawn


def light_at(azimuth_deg, elevation_deg, softness=0.0, color=(1, 1, 1)):
    toward = direction(np.radians(azimuth_deg), np.radians(elevation_deg))
    return DirectionalLight(tuple(toward.tolist()), color, softness)


def half_plane(height):
    """Everything to the left of x = 0, at a height."""
    return Box((-6, height, -6), (0, height + 0.01, 6))


def seen_of_disc(offset, radius):
    """Part of a disc on the right side of a line at some offsets from its middle."""
    at = np.clip(offset / radius, -1, 1)
    return 1 - (np.arccos(at) - at * np.sqrt(1 - at**2)) / np.pi


class TestPenumbra:
    @pytest.mark.parametrize("height", [0.5, 1.0, 2.0])
    @pytest.mark.parametrize("softness", [0.05, 0.1, 0.2])
    def test_under_an_edge_it_is_what_the_edge_leaves_of_the_disc(self, renderer, ground, height, softness):
        """Twice the height times the tangent of the softness wide, evenly rising, and as much light as there should be.

        The rise of a disc's profile has half the disc's radius for standard deviation.
        """
        renderer.add_mesh(solid_model(half_plane(height)))
        lit, bare = ground([light_at(0, 90, softness)])
        profile, radius = (lit / bare)[SIZE // 2, :, 0], height * np.tan(softness)
        rise = np.diff(profile)
        assert rise.min() >= 0
        assert profile.min() == 0 and profile.max() == 1
        places = (ACROSS[1:] + ACROSS[:-1]) / 2
        middle = rise @ places
        width = 4 * np.sqrt(rise @ (places - middle) ** 2)
        assert width == pytest.approx(2 * radius, rel=0.15)
        assert middle == pytest.approx(0, abs=0.01)
        assert np.abs(profile - seen_of_disc(ACROSS, radius)).max() < 0.07

    @pytest.mark.parametrize("elevation_deg", [30, 60])
    def test_a_fans_is_the_meshs(self, renderer, ground, elevation_deg):
        plate, light = Box((-1.5, 1, -1), (0, 1.01, 1)), light_at(0, elevation_deg, 0.1)
        renderer.add(solid_fan(plate, views=8, elevation_deg=float(elevation_deg), size=128))
        elevation = np.radians(elevation_deg)
        lit, bare = ground([light], matrices=filling(1.0, 0.0, elevation, (0, 0, -1 / np.tan(elevation))))
        profile, radius = (lit / bare)[SIZE // 2, :, 0], np.tan(0.1) / np.sin(elevation)
        assert np.diff(profile).min() >= 0
        assert np.abs(profile - seen_of_disc(ACROSS, radius)).max() < 0.1

    @pytest.mark.parametrize("kind", ["mesh", "fan"])
    def test_it_grows_with_the_height_of_what_casts(self, renderer, ground, kind):
        """A post: sharp at its foot, soft at the tip of its shadow."""
        post = Box((-0.1, 0, -0.1), (0.1, 1.2, 0.1))
        if kind == "mesh":
            renderer.add_mesh(solid_model(post))
        else:
            renderer.add(solid_fan(post, views=16, elevation_deg=45.0, size=128))
        lit, bare = ground([light_at(90, 45, 0.15)], matrices=filling(1.0, 0, np.pi / 2 - 1e-4, (-0.6, 0, 0)))
        hidden = 1 - (lit / bare)[..., 0]

        def half_lit(x):
            """Rows that are neither dark nor light in the column over x."""
            column = hidden[:, int((x + 0.6 + 1) / 2 * SIZE)]
            return np.count_nonzero((column > 0.1) & (column < 0.9))

        assert half_lit(-0.12) < 0.3 * half_lit(-1.0)
        assert half_lit(-0.12) < half_lit(-0.3) < half_lit(-0.6) < half_lit(-1.0)

    def test_a_heavy_mesh_casts_from_fewer_points_and_as_softly(self, renderer, ground, monkeypatch):
        renderer.add_mesh(solid_model(half_plane(1.0)))
        monkeypatch.setattr(soft_light, "MOST_TRIANGLES", 1)
        lit, bare = ground([light_at(0, 90, 0.1)])
        assert np.abs((lit / bare)[SIZE // 2, :, 0] - seen_of_disc(ACROSS, np.tan(0.1))).max() < 0.2

    def test_light_is_neither_lost_nor_gained(self, renderer, ground):
        """A ball hides as much of a large source as of a small one."""
        renderer.add_mesh(solid_model(Sphere((0, 1, 0), 0.4)))
        hidden = [float((bare - lit).sum()) for lit, bare in (ground([light_at(0, 90, s)]) for s in (0.0, 0.05, 0.2))]
        assert hidden[1] == pytest.approx(hidden[0], rel=0.03)
        assert hidden[2] == pytest.approx(hidden[0], rel=0.06)


class TestOverlap:
    def test_what_hides_the_same_part_of_a_source_hides_it_once(self, renderer, ground):
        """An edge, and the same edge of a fan and of a mesh over it."""
        renderer.add_mesh(solid_model(half_plane(1.0)))
        once, _ = ground([light_at(0, 90, 0.1)], 0.1)
        renderer.add_mesh(solid_model(half_plane(1.0)), placed((-0.001, 0, 0)))
        twice, _ = ground([light_at(0, 90, 0.1)], 0.1)
        assert np.abs(once - twice).max() < 0.02

    def test_what_hides_different_parts_hides_both(self, renderer, ground):
        """Two edges from either side leave nothing of the source."""
        renderer.add_mesh(solid_model(half_plane(1.0)))
        renderer.add_mesh(solid_model(half_plane(1.0)), placed((0, 0, 0), np.pi))
        lit, bare = ground([light_at(0, 90, 0.1)], 0.2)
        assert (lit / bare).max() == pytest.approx(0.2 / 1.2, abs=0.01)

    def test_hard_and_soft_lights_each_take_their_own_part(self, renderer, ground):
        renderer.add_mesh(ROOF)
        lights = [light_at(20, 80, 0.1, (0.3, 0, 0)), light_at(90, 70, 0.0, (0, 0.3, 0))]
        lights.append(light_at(200, 60, 0.05, (0.1, 0.1, 0.3)))
        for chosen in ([0], [1], [0, 1], [0, 1, 2], [2, 0, 1, 0, 1, 2]):
            lit, bare = ground([lights[index] for index in chosen], 0.1, looking((0, 0.9, 0.01)))
            np.testing.assert_allclose(lit[SIZE // 2, SIZE // 2], 0.1, atol=0.015)
            assert 0.3 < bare[SIZE // 2, SIZE // 2].max() < 1


class TestCost:
    """What is not seen is not paid for."""

    SCENE = filling(2.4, 0.3, 0.5)

    def test_a_penumbra_within_a_pixel_is_none(self, renderer, ground):
        renderer.add(solid_fan(Sphere((0, 1, 0), 0.5), views=16, elevation_deg=15, size=64))
        renderer.add_mesh(solid_model(Box((0.5, 0, 0.5), (0.8, 0.6, 0.8))))
        hard, _ = ground([light_at(40, 45)], 0.2, self.SCENE)
        soft, _ = ground([light_at(40, 45, 1e-4)], 0.2, self.SCENE)
        np.testing.assert_array_equal(soft, hard)
        wide, _ = ground([light_at(40, 45, 0.05)], 0.2, self.SCENE)
        assert np.abs(wide - hard).max() > 0.1

    def test_a_still_frame_is_drawn_like_the_first(self, renderer, ground):
        renderer.add_mesh(solid_model(Sphere((0, 1, 0), 0.5)))
        lights = [light_at(40, 45, 0.1)]
        first, _ = ground(lights, 0.2, self.SCENE)
        again, _ = ground(lights, 0.2, self.SCENE)
        np.testing.assert_array_equal(first, again)
        softer, _ = ground([light_at(40, 45, 0.2)], 0.2, self.SCENE)
        assert np.abs(softer - first).max() > 0.05

    @pytest.mark.parametrize("elevation_deg", [8, 25, 70])
    @pytest.mark.parametrize("softness", [0.02, 0.3])
    def test_shadows_end_within_the_cells_that_are_drawn(self, renderer, ground, elevation_deg, softness, monkeypatch):
        renderer.add_mesh(solid_model(Sphere((0, 1, 0), 0.3)))
        renderer.add(solid_fan(Sphere((0, 1, 0), 0.3), views=16, elevation_deg=15, size=64), (0.5, 0, 0.5))
        lights, matrices = [light_at(130, elevation_deg, softness)], looking((3, 4, 7))
        found, _ = ground(lights, 0.2, matrices)
        monkeypatch.setattr("runtime.shadows.bounds.EDGE", 1000)
        renderer._shadows.mark_anew()
        everywhere, _ = ground(lights, 0.2, matrices)
        assert np.abs(found - everywhere).max() < 0.012


def test_state_is_left_as_it_was(renderer, screen):
    renderer.add(solid_fan(Sphere((0, 1, 0), 0.5), views=16, elevation_deg=15, size=64))
    renderer.add_mesh(ROOF)
    renderer.lights = [light_at(40, 45, 0.1), light_at(-40, 45)]
    screen.clear((0, 0, 0, 1))
    raw.gl("glLogicOp", 0x150A)  # INVERT
    before = raw.snapshot()
    renderer.draw_shadows(*ABOVE, LEVEL)
    after = raw.snapshot()
    raw.set_plain()
    raw.gl("glLogicOp", 0x1503)
    assert after == before


class TestPoints:
    GROUNDS = (LEVEL, Ground((0.3, 1, -0.2), 0.5))

    @pytest.mark.parametrize("count", soft_light.COUNTS.tolist())
    @pytest.mark.parametrize("elevation_deg", [0.2, 5, 40, 90])
    @pytest.mark.parametrize("softness", [0.005, 0.3, 1.0])
    @pytest.mark.parametrize("plane", GROUNDS, ids=["level", "slope"])
    def test_they_stand_on_the_disc_and_above_the_ground(self, count, elevation_deg, softness, plane):
        light = light_at(50, elevation_deg, softness)
        if plane.normal @ light.toward < LOWEST_LIGHT:
            light = DirectionalLight(tuple(plane.normal), softness=softness)
        points = soft_light.source_points(light, plane, count)
        unit = points / np.linalg.norm(points, axis=1)[:, None]
        assert np.arccos(np.clip(unit @ light.toward, -1, 1)).max() <= softness + 1e-6
        assert (points @ plane.normal).min() >= LOWEST_LIGHT * 0.999

    @pytest.mark.parametrize("count", soft_light.COUNTS.tolist())
    def test_each_has_bits_of_its_own_and_together_all(self, count):
        bits = soft_light.point_bits(count)
        assert len(bits) == count
        assert np.bitwise_or.reduce(bits) == np.sum(bits) == 2**24 - 1

    def test_more_are_needed_for_wider_penumbras_and_stronger_lights(self):
        widths = np.array([0.5, 3.0, 30.0, 60.0, 1e9])
        strong, weak = soft_light.points_needed(widths, 1.0), soft_light.points_needed(widths, 0.05)
        assert strong[0] == 1 and strong[-1] == soft_light.MOST_POINTS
        assert (np.diff(strong) >= 0).all() and (weak <= strong).all() and weak[-1] < strong[-1]
        assert set(strong.tolist()) | set(weak.tolist()) <= set(soft_light.COUNTS.tolist())


def sky_with_suns(*suns, sky=0.2):
    """An even environment with bright discs: azimuth and elevation in degrees, angular radius, radiance."""
    toward = face_directions(64)
    faces = np.full((*toward.shape[:3], 3), sky, np.float32)
    for azimuth_deg, elevation_deg, radius, radiance in suns:
        faces[toward @ direction(np.radians(azimuth_deg), np.radians(elevation_deg)) > np.cos(radius)] = radiance
    return Environment("suns", faces)


class TestRooms:
    SUNS = sky_with_suns((60, 50, 0.12, (20, 12, 6)), (-70, 40, 0.2, (1, 3, 6)))
    UNDER_THE_ROOF = looking((0, 0.9, 0.01))

    def test_the_ground_shows_the_diffuse_light_of_a_far_room(self, renderer, ground):
        renderer.rooms = [Room.far(self.SUNS, yaw=1.0, exposure=0.5)]
        _, bare = ground([light_at(0, 90, color=(0.1, 0, 0))], 0.05)
        expected = room_diffuse(renderer.rooms[0], LEVEL.normal) + 0.05 + np.array([0.1, 0, 0])
        np.testing.assert_allclose(bare[5, 5], expected, rtol=0.02)

    def test_each_place_is_lit_by_the_room_it_is_in(self, renderer, ground):
        blue, red = (sky_with_suns(sky=color) for color in ((0, 0, 0.5), (0.5, 0, 0)))
        renderer.rooms = [Room.box(blue, (2, 2, 2), (-1, 0, 0)), Room.box(red, (2, 2, 2), (1, 0, 0))]
        _, bare = ground([], 0.0)
        np.testing.assert_allclose(bare[SIZE // 2, SIZE // 4], (0, 0, 0.5), atol=0.01)
        np.testing.assert_allclose(bare[SIZE // 2, 3 * SIZE // 4], (0.5, 0, 0), atol=0.01)

    @pytest.mark.parametrize("count", [0, 1, 2])
    @pytest.mark.parametrize("yaw", [0.0, 2.0])
    def test_a_roof_takes_away_the_light_of_the_brightest_sources(self, renderer, ground, count, yaw):
        renderer.rooms, renderer.shadow_lights = [Room.far(self.SUNS, yaw, 0.6)], count
        renderer.add_mesh(ROOF)
        lit, bare = ground([], 0.05, self.UNDER_THE_ROOF)
        suns = bright_lights(renderer.rooms[0], 2)[:count]
        gone = np.sum([np.zeros(3), *(np.multiply(sun.color, sun.toward[1]) for sun in suns)], axis=0)
        middle = SIZE // 2, SIZE // 2
        np.testing.assert_allclose(bare[middle] - lit[middle], gone, atol=0.02)
        assert (gone.max() > 0.1) == (count > 0)

    def test_shadows_fall_away_from_the_sources(self, renderer, ground):
        renderer.rooms = [Room.far(sky_with_suns((90, 45, 0.1, (30, 30, 30))))]
        renderer.add_mesh(solid_model(Sphere((0, 0.5, 0), 0.2)))
        lit, bare = ground([])
        shadow = binary_erosion(lit[..., 0] < 0.8 * bare[..., 0])
        assert shadow.sum() > 100
        assert ACROSS[np.nonzero(shadow)[1]].mean() == pytest.approx(-0.5, abs=0.05)

    def test_an_even_room_casts_no_shadow(self, renderer, ground):
        renderer.rooms = [Room.far(sky_with_suns())]
        renderer.add_mesh(ROOF)
        lit, bare = ground([], 0.1, self.UNDER_THE_ROOF)
        np.testing.assert_array_equal(lit, bare)

    def test_a_room_that_changes_changes_its_shadows(self, renderer, ground):
        renderer.add_mesh(solid_model(Sphere((0, 0.5, 0), 0.2)))
        pictures = []
        for yaw in (0.0, 1.0):
            renderer.rooms = [Room.far(self.SUNS, yaw)]
            pictures.append(ground([])[0])
        assert np.abs(pictures[0] - pictures[1]).max() > 0.05

    @pytest.mark.parametrize("count", [-1, 1.5, "two", True])
    def test_another_count_is_refused(self, renderer, count):
        with pytest.raises(SettingsError, match="shadow_lights"):
            renderer.shadow_lights = count

    def test_a_count_may_be_numpys(self, renderer):
        renderer.shadow_lights = np.int64(1)
        assert renderer.shadow_lights == 1 and type(renderer.shadow_lights) is int


def test_the_shadow_of_a_room_alone_shows_its_colour(renderer, ground):
    """Where a red sun is hidden, the blue sky is left."""
    sky = sky_with_suns((0, 60, 0.1, (30, 0, 0)), sky=(0.0, 0.0, 0.3))
    renderer.rooms = [Room.far(sky)]
    renderer.add_mesh(ROOF)
    lit, bare = ground([], 0.0, TestRooms.UNDER_THE_ROOF)
    middle = SIZE // 2, SIZE // 2
    assert bare[middle][0] > 0.2
    np.testing.assert_allclose(lit[middle], (0, 0, 0.3), atol=0.03)
    np.testing.assert_allclose(srgb_from_linear(lit[middle][2]), srgb_from_linear(bare[middle][2]), atol=0.02)
