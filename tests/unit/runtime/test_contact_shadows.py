"""Contact shadows: what an object keeps of the light from all around from the ground near its feet."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, map_coordinates

from impostor.environment import Environment, Room
from impostor.errors import SettingsError
from impostor.lighting import DirectionalLight
from impostor.shadow_projection import Ground
from impostor.srgb import linear_from_srgb
from impostor.views import direction
from runtime.gl.draw_calls import counted_draw_calls
from runtime.gl.offscreen import Offscreen
from runtime.ground.ground_pass import GroundSurface
from runtime.lights.contact_settings import ContactShadows
from runtime.shadows import contact
from runtime.shadows.footprints import LIFTS, SIDE, fan_footprint, model_footprint
from tests import gl as raw
from tests.pictures import filling, greenish, looking, placed
from tests.solids import GREEN, Box, Sphere, solid_fan, solid_model

SIZE = 256
LEVEL = Ground((0, 1, 0), 0.0)
WHITE = GroundSurface(albedo=(1, 1, 1), reach=1e4)
ABOVE = filling(1.0, 0.0, np.pi / 2 - 1e-4)
CUBE = Box((-0.25, 0, -0.25), (0.25, 0.5, 0.25))
# Cameras so high that from above the ground is where it is.
HIGH = {"views": 16, "elevation_deg": 87.0, "size": 64}
RING = {"views": 16, "elevation_deg": 15.0, "size": 64}


@pytest.fixture
def screen(ctx):
    screen = Offscreen(ctx, SIZE, SIZE)
    screen.clear((0, 0, 0, 1))
    yield screen
    screen.release()


@pytest.fixture
def hidden(renderer, screen):
    """The part of the ground's light that is gone, (SIZE, SIZE) float."""

    def drawn(settings=ContactShadows(), matrices=ABOVE, ambient=0.5, lights=(), plane=LEVEL):  # noqa: B008
        renderer.lights, renderer.ambient, renderer.contact_shadows = list(lights), ambient, settings
        screen.clear((0, 0, 0, 1))
        renderer.draw_ground(*matrices, plane, WHITE)
        bare = linear_from_srgb(screen.color()[..., :3] / 255)
        renderer.draw_shadows(*matrices, plane)
        lit = linear_from_srgb(screen.color()[..., :3] / 255)
        return 1 - (lit / np.maximum(bare, 1e-6))[..., 0] * (bare[..., 0] > 0) - (bare[..., 0] == 0)

    return drawn


def at(picture, x, z=0.0):
    """What a picture from above shows at a place on the ground."""
    return picture[int((z + 1) / 2 * SIZE), int((x + 1) / 2 * SIZE)]


def looked_up(footprint, x, z, lift):
    """What a footprint hides at places on the ground, 0 to 1."""
    places = np.stack([x, z], axis=-1)
    at = (places - footprint.low) / (footprint.high - footprint.low) * SIDE - 0.5
    return map_coordinates(footprint.hidden[..., lift] / 255, np.moveaxis(at[..., ::-1], -1, 0), order=1)


class TestDarkness:
    @pytest.mark.parametrize("kind", ["mesh", "fan"])
    def test_beside_a_wall_half_the_sky_is_hidden_and_less_farther_away(self, renderer, hidden, kind):
        if kind == "mesh":
            renderer.add_mesh(solid_model(CUBE))
        else:
            renderer.add(solid_fan(CUBE, **HIGH))
        found = hidden(ContactShadows(reach=0.5))
        steps = [at(found, x) for x in (0.28, 0.35, 0.45, 0.6)]
        assert 0.3 < steps[0] < 0.6
        assert steps == sorted(steps, reverse=True)
        assert at(found, 0.25 + 2 * 0.25 + 0.05) == pytest.approx(0, abs=0.01)
        np.testing.assert_allclose(at(found, 0.33), [at(found, -0.33), at(found, 0, 0.33)], atol=0.08)

    @pytest.mark.parametrize("elevation_deg", [5, 15, 40])
    @pytest.mark.parametrize("distance", [np.inf, 6.0])
    def test_a_fans_is_the_meshs(self, elevation_deg, distance):
        """A cube, and a ball that touches the ground in one point."""
        solids = CUBE, Sphere((0.6, 0.25, 0.4), 0.25)
        fan = solid_fan(*solids, views=24, elevation_deg=float(elevation_deg), size=96, distance=distance)
        found, expected = fan_footprint(fan, 0.5), model_footprint(solid_model(*solids), np.eye(3), 0.5)
        assert found.base == pytest.approx(expected.base, abs=0.02)
        assert found.reach == pytest.approx(expected.reach, abs=0.03)
        x, z = np.meshgrid(np.linspace(-0.7, 1.2, 60), np.linspace(-0.7, 1, 60))
        for lift in range(LIFTS):
            pictures = [looked_up(each, x, z, lift) for each in (found, expected)]
            outside = (np.abs(x) > 0.27) | (np.abs(z) > 0.27)
            assert np.abs(pictures[0] - pictures[1])[outside].mean() < 0.02
            # Of the last there is little left.
            assert lift == LIFTS - 1 or np.corrcoef(*(picture[outside] for picture in pictures))[0, 1] > 0.97

    def test_strength_scales_it_and_off_is_nothing(self, renderer, hidden):
        renderer.add_mesh(solid_model(CUBE))
        whole, half = hidden(ContactShadows(1.0, 0.5)), hidden(ContactShadows(0.5, 0.5))
        assert at(half, 0.3) == pytest.approx(at(whole, 0.3) / 2, abs=0.03)
        for nothing in (ContactShadows(strength=0.0), None):
            np.testing.assert_array_equal(hidden(nothing), 0)

    def test_only_light_from_all_around_is_taken_away(self, renderer, hidden):
        """Of a room, too, and none of a light's own."""
        renderer.add_mesh(solid_model(CUBE))
        settings, light = ContactShadows(reach=0.5), DirectionalLight((0, 1, 0), (0.25, 0.25, 0.25))
        alone = hidden(settings)
        np.testing.assert_allclose(
            at(hidden(settings, ambient=0.25, lights=[light]), 0.35), at(alone, 0.35) / 2, atol=0.02
        )
        outside = hidden(settings, ambient=0.0, lights=[light])
        assert at(outside, 0.3) == pytest.approx(0, abs=0.01)
        even = Environment("even", np.full((6, 8, 8, 3), 0.5, np.float32))
        renderer.rooms = [Room.far(even)]
        np.testing.assert_allclose(hidden(settings, ambient=0.0), alone, atol=0.02)

    def test_what_two_objects_leave_of_it_multiplies(self, renderer, hidden):
        left, right = placed((-0.35, 0, 0)), placed((0.35, 0, 0))
        mesh = renderer.add_mesh(solid_model(CUBE), left)
        one = hidden(ContactShadows(reach=0.5))
        renderer.remove(mesh)
        renderer.add_mesh(solid_model(CUBE), right)
        other = hidden(ContactShadows(reach=0.5))
        renderer.add_mesh(solid_model(CUBE), left)
        both = hidden(ContactShadows(reach=0.5))
        np.testing.assert_allclose(1 - both, (1 - one) * (1 - other), atol=0.03)
        assert at(both, 0) > at(one, 0)


class TestPlace:
    @pytest.mark.parametrize("kind", ["mesh", "fan"])
    def test_it_fades_as_the_object_rises(self, renderer, hidden, kind):
        darkest = []
        for height in (0.02, 0.06, 0.12, 0.2, 0.26):
            if kind == "mesh":
                placed_one = renderer.add_mesh(solid_model(CUBE), placed((0, height, 0)))
            else:
                placed_one = renderer.add(solid_fan(CUBE, **RING), (0, height, 0))
            darkest.append(hidden(ContactShadows(reach=0.5)).max())
            renderer.remove(placed_one)
        assert darkest == sorted(darkest, reverse=True)
        assert darkest[0] > 0.8
        assert darkest[-1] == 0

    def test_scale_and_place_carry_it_along(self, renderer, hidden):
        """Twice as large and aside, each place is as dark as half as far from the small one."""
        mesh = renderer.add_mesh(solid_model(CUBE))
        small = hidden(ContactShadows(reach=0.3))
        renderer.remove(mesh)
        renderer.add_mesh(solid_model(CUBE), placed((0.2, 0, -0.1), 0.0, 2.0))
        large = hidden(ContactShadows(reach=0.3))
        for x in (0.28, 0.32, 0.36):
            assert at(large, 0.2 + 2 * x, -0.1) == pytest.approx(at(small, x), abs=0.08)

    def test_a_mesh_that_is_tipped_over_darkens_where_it_lies(self, renderer, hidden):
        """A post on its side: long in x now, narrow in z."""
        post = solid_model(Box((-0.1, 0, -0.1), (0.1, 1, 0.1)))
        tipped = np.array([[0, 1, 0, -0.5], [-1, 0, 0, 0.1], [0, 0, 1, 0], [0, 0, 0, 1.0]])
        renderer.add_mesh(post, tipped)
        found = hidden(ContactShadows(reach=0.5))
        assert at(found, -0.45, 0.12) > 0.3 and at(found, 0.45, 0.12) > 0.3
        assert at(found, 0, 0.45) < 0.02

    def test_on_a_slope(self, renderer, hidden):
        plane = Ground((0.2, 1, 0.1), 0.0)
        turn = np.eye(4)
        across = np.cross((0, 0, 1), plane.normal)
        across /= np.linalg.norm(across)
        turn[:3, :3] = np.stack([across * -1, plane.normal, np.cross(across * -1, plane.normal)], axis=-1)
        renderer.add_mesh(solid_model(CUBE), turn)
        found = hidden(ContactShadows(reach=0.5), plane=plane)
        assert 0.25 < at(found, 0.3) < 0.65

    @pytest.mark.parametrize("rise_deg", [0, 10])
    @pytest.mark.parametrize("turn", [0.0, 0.5])
    def test_feet_and_shadow_meet(self, renderer, screen, hidden, turn, rise_deg):
        """Seen from between two cameras of a fan and above them."""
        renderer.add(solid_fan(Box((-0.12, 0, -0.12), (0.12, 1.2, 0.12), GREEN), **RING))
        azimuth, elevation = turn * 2 * np.pi / 16, np.radians(15 + rise_deg)
        matrices = looking(9 * direction(azimuth, elevation), (0, 0.4, 0), 15)
        dark = hidden(ContactShadows(reach=0.25), matrices) > 0.2
        renderer.draw(*matrices, output="albedo")
        body = greenish(screen.color())
        feet = np.nonzero(body)[0].max()
        touching = binary_dilation(body, np.ones((3, 3))) & dark & ~body
        assert touching.sum() >= 10
        assert np.abs(np.nonzero(touching)[0] - feet).min() <= 3
        assert not dark[: feet - 40].any()

    def test_a_new_place_shows_at_once(self, renderer, hidden):
        trees = renderer.add(solid_fan(CUBE, **RING))
        before = hidden()
        trees.positions[0, 0] += 0.3
        assert np.abs(hidden() - before).max() > 0.2
        trees.visible[:] = False
        np.testing.assert_array_equal(hidden(), 0)


class TestCost:
    def test_all_copies_of_a_fan_and_of_a_mesh_are_one_draw_call_each(self, renderer, hidden):
        fan, model = solid_fan(CUBE, **RING), solid_model(CUBE)
        renderer.add(fan)
        renderer.add_mesh(model)
        hidden()
        calls = []
        for count in (1, 40):
            with counted_draw_calls() as counted:
                renderer._shadows.mark_anew()
                renderer.draw_shadows(*ABOVE, LEVEL)
            calls.append(counted.count)
            places = np.random.default_rng(3).uniform(-1, 1, (count, 3)) * (1, 0, 1)
            renderer.add(fan, places)
            renderer.remove(renderer._placed.batches[0].instances)
            for place in places:
                renderer.add_mesh(model, placed(place, place[0]))
        assert calls[0] == calls[1] == 3

    def test_copies_outside_of_the_picture_draw_nothing(self, renderer, hidden):
        renderer.add(solid_fan(CUBE, **RING), [(5, 0, 0), (0, 0, -9)])
        with counted_draw_calls() as counted:
            hidden()
        assert counted.count == 1  # the ground

    def test_a_tumbling_mesh_keeps_a_bounded_number_of_footprints(self, renderer, hidden, monkeypatch):
        monkeypatch.setattr(contact, "MOST_FOOTPRINTS", 3)
        mesh = renderer.add_mesh(solid_model(CUBE))
        for angle in np.linspace(0, 1.2, 8):
            cos, sin = np.cos(angle), np.sin(angle)
            mesh.world_from_model = np.array([[cos, -sin, 0, 0], [sin, cos, 0, 0.4], [0, 0, 1, 0], [0, 0, 0, 1]])
            hidden()
            assert 1 <= len(renderer._shadows._mark_pass._contacts._held) <= 3
        renderer.remove(mesh)
        renderer.add(solid_fan(CUBE, **RING))
        hidden()
        assert len(renderer._shadows._mark_pass._contacts._held) == 1

    def test_state_is_left_as_it_was(self, renderer, screen):
        renderer.add(solid_fan(CUBE, **RING))
        renderer.add_mesh(solid_model(CUBE), placed((0.5, 0, 0)))
        renderer.contact_shadows = ContactShadows()
        before = raw.snapshot()
        renderer.draw_shadows(*ABOVE, LEVEL)
        assert raw.snapshot() == before


@pytest.mark.parametrize("wrong", [{"strength": -0.1}, {"strength": 1.1}, {"reach": 0.0}, {"reach": np.nan},
                                   {"strength": "a"}, {"reach": None}])  # fmt: skip
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(SettingsError, match=f"contact shadows: {next(iter(wrong))}"):
        ContactShadows(**wrong)


def test_other_settings_are_refused(renderer):
    with pytest.raises(SettingsError, match="contact_shadows"):
        renderer.contact_shadows = 0.5


def test_nothing_to_stand_on_is_nothing(renderer, hidden):
    """A fan that shows nothing, and one without height."""
    empty = solid_fan(CUBE, **RING)
    renderer.add(replace(empty, silhouette=np.zeros_like(empty.silhouette)))
    renderer.add_mesh(solid_model(Box((-0.3, 0, -0.3), (0.3, 0, 0.3))))
    np.testing.assert_array_equal(hidden(), 0)


def test_more_ways_of_leaning_than_footprints_are_kept_are_all_drawn(renderer, hidden, monkeypatch):
    monkeypatch.setattr(contact, "MOST_FOOTPRINTS", 2)
    model = solid_model(CUBE)
    places = [(x, 0.0, z) for x in (-0.65, 0.0, 0.65) for z in (-0.5, 0.5)]
    for number, place in enumerate(places):
        leaning = placed(place)
        sin, cos = np.sin(0.12 * number), np.cos(0.12 * number)
        leaning[:3, :3] = [[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]
        renderer.add_mesh(model, leaning)
    hidden()
    picture = hidden()
    assert all(at(picture, x, z) > 0.2 for x, _, z in places)


def test_another_reach_counts_at_once(renderer, hidden):
    renderer.add_mesh(solid_model(CUBE))
    near, far = hidden(ContactShadows(reach=0.1)), hidden(ContactShadows(reach=1.0))
    assert at(far, 0.4) > at(near, 0.4) + 0.05
