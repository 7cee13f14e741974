"""Which tiles are relit when lights move, and that all of them are right in the end."""

import numpy as np
import pytest

from impostor.environment import Environment, Reflection, Room
from impostor.environment.colormap import environment_colormap
from impostor.environment.cube import face_directions
from impostor.lighting import DirectionalLight, colormap
from impostor.views import basis_facing, direction
from runtime.fans.relighting import EXACT_ROWS, SHARED_TURN, distinct_turns
from runtime.lights.light_table import REMEMBERED, LightTable
from tests.pictures import filling
from tests.solids import Sphere, solid_fan

FAN = solid_fan(Sphere(), views=8, size=32)
MATRICES = filling(6.0, 0.3, 0.3)


def sun(azimuth_deg, color=(0.8, 0.8, 0.8)):
    return DirectionalLight.from_angles(azimuth_deg, 40, color)


@pytest.fixture
def table(ctx):
    table = LightTable(ctx)
    yield table
    table.release()


class TestChange:
    @pytest.mark.parametrize("turn_deg", [0.1, 1.0, 20.0])
    def test_it_bounds_what_any_normal_sees(self, table, turn_deg):
        before, after = [sun(10), sun(130, (0.3, 0.1, 0))], [sun(10 + turn_deg), sun(130, (0.3, 0.1, 0.02))]
        table.update(before, 0.2)
        table.update(after, 0.21)
        (found,) = table.change_since(np.array([1]))
        basis = basis_facing(direction(0.4, 0.2))
        first, last = colormap(basis, before, 0.2), colormap(basis, after, 0.21)
        seen = np.abs(last.diffuse - first.diffuse).max()
        assert seen <= found < 4 * seen + 0.03

    def test_unknown_versions_and_other_numbers_of_lights_are_wholly_off(self, table):
        table.update([sun(10)], 0.2)
        table.update([sun(10), sun(20)], 0.2)
        assert np.isinf(table.change_since(np.array([-1, 1]))).all()
        for turn in range(REMEMBERED + 1):
            table.update([sun(turn / 10)], 0.2)
        assert np.isinf(table.change_since(np.array([3]))).all()
        assert table.change_since(np.array([table.version])) == 0


class TestRoomChange:
    """Of surroundings that are bright on one side."""

    environment = Environment("side", (np.exp(2 * face_directions(16)[..., [0, 0, 0]]) / 8).astype(np.float32))
    reflections = (None, Reflection(0.9, 0.9, roughness=0.5, metal=1), Reflection(roughness=0.3))

    @pytest.mark.parametrize("reflection", reflections, ids=["matt", "metal", "lacquer"])
    @pytest.mark.parametrize(("turn_deg", "exposure"), [(0.1, 1), (1, 1), (20, 1), (0, 1.02)])
    def test_it_is_about_what_a_normal_sees(self, table, reflection, turn_deg, exposure):
        before = [Room.far(self.environment, 0.3)]
        after = [Room.far(self.environment, 0.3 + np.radians(turn_deg), exposure)]
        table.update([], 0, before)
        table.update([], 0, after)
        (found,) = table.change_since(np.array([1]), reflection)
        bases = basis_facing(direction(np.arange(6), 0.2))
        first, last = (environment_colormap(bases, np.zeros(3), rooms, reflection) for rooms in (before, after))
        seen = np.abs(last.diffuse + last.specular - first.diffuse - first.specular)[:, :225]
        assert 0.9 * np.sqrt(np.mean(seen**2)) <= found <= 2 * seen.max() + 1e-6
        if reflection is None:
            assert seen.max() <= 1.02 * found

    def test_a_room_that_moves_or_comes_is_wholly_another(self, table):
        box = Room.box(self.environment, (4, 4, 4))
        for rooms in ([], [box], [Room.box(self.environment, (4, 4, 4), (0, 0.1, 0))], [box, box]):
            table.update([], 0, rooms)
            assert np.isinf(table.change_since(np.array([table.version - 1]))).all()
        brighter = Room.box(self.environment, (4, 4, 4), exposure=1.01)
        table.update([], 0, [box, brighter])
        assert 0 < table.change_since(np.array([table.version - 1])) < 0.1


class TestSharedColormaps:
    def test_few_are_exact(self):
        firsts, kinds = distinct_turns(np.repeat(np.eye(3)[None], EXACT_ROWS, axis=0))
        assert len(firsts) == len(kinds) == EXACT_ROWS

    def test_many_share_and_are_no_farther_apart_than_said(self):
        random = np.random.default_rng(2)
        bases = np.stack(
            [
                basis_facing(direction(a, e))
                for a, e in zip(random.uniform(-9, 9, 4000), random.choice([0.1, 1.2], 4000), strict=True)
            ]
        )
        firsts, kinds = distinct_turns(bases)
        assert len(firsts) <= 2 * (np.pi / SHARED_TURN + 1)
        apart = np.einsum("nij,nij->n", bases, bases[firsts][kinds])
        assert np.degrees(np.arccos(np.clip((apart - 1) / 2, -1, 1))).max() < 1.5


class TestManyTiles:
    @pytest.fixture
    def few_texels(self, monkeypatch):
        monkeypatch.setattr("runtime.fans.relighting.TEXELS_A_FRAME", 4000)

    def drawn(self, renderer, screen, *lights):
        renderer.lights = lights
        screen.clear()
        renderer.draw(*MATRICES)
        return screen.color()

    def test_a_small_turn_is_spread_over_frames_and_then_exact(self, renderer, screen, few_texels):
        random = np.random.default_rng(3)
        renderer.add(FAN, random.uniform(-5, 5, (60, 3)), random.uniform(0, 6, 60))
        self.drawn(renderer, screen, sun(10))
        tiles = renderer.statistics["tiles"]
        first = self.drawn(renderer, screen, sun(10.3))
        assert 0 < renderer.statistics["relit"] < tiles / 2
        for _ in range(20):
            last = self.drawn(renderer, screen, sun(10.3))
        assert renderer.statistics["relit"] == 0
        renderer._impostors.forget()
        fresh = self.drawn(renderer, screen, sun(10.3))
        np.testing.assert_array_equal(last, fresh)
        assert np.abs(first.astype(int) - fresh).max() <= 4

    def test_a_large_turn_shows_at_once(self, renderer, screen, few_texels):
        random = np.random.default_rng(3)
        renderer.add(FAN, random.uniform(-5, 5, (60, 3)), random.uniform(0, 6, 60))
        self.drawn(renderer, screen, sun(10))
        turned = self.drawn(renderer, screen, sun(40))
        assert renderer.statistics["relit"] == renderer.statistics["tiles"]
        renderer._impostors.forget()
        np.testing.assert_array_equal(turned, self.drawn(renderer, screen, sun(40)))

    def test_surroundings_that_turn_slowly_are_spread_over_frames_and_then_exact(self, renderer, screen, few_texels):
        random = np.random.default_rng(3)
        renderer.add(FAN, random.uniform(-5, 5, (60, 3)), random.uniform(0, 6, 60))
        relit = []
        for yaw in (0.0, 0.004, *[0.008] * 20):
            renderer.rooms = [Room.far(TestRoomChange.environment, yaw)]
            last = self.drawn(renderer, screen)
            relit.append(renderer.statistics["relit"])
        assert relit[0] == renderer.statistics["tiles"]
        assert 0 < relit[1] < relit[0] / 2
        assert relit[-1] == 0
        renderer._impostors.forget()
        np.testing.assert_array_equal(last, self.drawn(renderer, screen))

    def test_a_sun_that_never_rests_leaves_no_tile_behind(self, renderer, screen, few_texels):
        random = np.random.default_rng(3)
        renderer.add(FAN, random.uniform(-5, 5, (60, 3)), random.uniform(0, 6, 60))
        for step in range(40):
            moving = self.drawn(renderer, screen, sun(10 + 0.2 * step))
        renderer._impostors.forget()
        assert np.abs(moving.astype(int) - self.drawn(renderer, screen, sun(10 + 0.2 * 39))).max() <= 6
