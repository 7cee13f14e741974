"""Animated fans: which poses a copy shows when, that a crossfade is neither a hole nor a heap, and what it costs."""

import numpy as np
import pytest

from impostor.errors import SettingsError
from runtime.animation import AnimatedFan, AnimatedInstances
from tests.pictures import apart, filling
from tests.solids import BLUE, GREEN, RED, Box, Sphere, card_fan, solid_fan


def card(color, size=16):
    """A fan of one view: a square of one colour."""
    return card_fan(np.full((size, size, 4), (*color, 255), np.uint8))


COLORS = RED, GREEN, BLUE
LIGHTS = AnimatedFan([card(color) for color in COLORS], seconds=3.0)


@pytest.fixture
def shown(renderer, screen):
    """Draws everything and returns the pixels; the unit square fills the picture."""

    def draw():
        screen.clear()
        renderer.draw(*filling(), output="albedo")
        return screen.color()

    return draw


class TestPoses:
    def test_key_poses_are_evenly_spaced_and_begin_again(self):
        found = LIGHTS.poses([0, 1 / 3, 2 / 3, 1, 4 / 3, -1 / 3])
        assert np.where(found.share < 0.5, found.last, found.following).tolist() == [0, 1, 2, 0, 1, 2]
        assert np.abs(found.share - np.rint(found.share)).max() == 0

    def test_between_two_poses_the_share_is_the_time_that_has_passed(self):
        found = LIGHTS.poses(np.array([0.25, 0.5, 0.75, 2.25]) / 3)
        assert found.last.tolist() == [0, 0, 0, 2] and found.following.tolist() == [1, 1, 1, 0]
        assert found.share == pytest.approx([0.25, 0.5, 0.75, 0.25])

    def test_a_short_fade_is_in_the_middle(self):
        found = AnimatedFan(LIGHTS.fans, 1.0, fade=0.2).poses(np.array([0.1, 0.39, 0.5, 0.55, 0.61]) / 3)
        assert found.share == pytest.approx([0, 0, 0.5, 0.75, 1], abs=1e-6)

    def test_without_a_fade_the_nearest_pose_is_shown(self):
        found = AnimatedFan(LIGHTS.fans, 1.0, fade=0).poses(np.linspace(0, 1, 1000))
        assert set(found.share.tolist()) == {0.0, 1.0}
        assert (np.where(found.share > 0, found.following, found.last) == np.rint(np.linspace(0, 3, 1000)) % 3).all()

    def test_one_pose_has_nothing_to_fade_to(self):
        assert not AnimatedFan([card(RED)], 1.0).poses(np.linspace(0, 1, 50)).share.any()

    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            (((), 1.0), "animation: no fans; expected one for each key pose"),
            (((card(RED), "walk.fan"), 1.0), "animation: a str; expected a Fan, as impostor.load gives"),
            (((card(RED),), 0.0), "animation: a cycle of 0.0 seconds; expected a time above 0"),
            (((card(RED),), 1.0, 1.5), "animation: fade is 1.5; expected 0 to 1"),
        ],
    )
    def test_what_is_refused(self, settings, message):
        with pytest.raises(SettingsError) as refused:
            AnimatedFan(*settings)
        assert str(refused.value) == message


class TestCopies:
    def test_each_keeps_its_own_time(self, renderer, shown):
        quarters = [(-0.5, 0.5, 0), (0.5, 0.5, 0), (-0.5, -0.5, 0), (0.5, -0.5, 0)]
        copies = AnimatedInstances(
            renderer, LIGHTS, quarters, scales=0.5, phases=[0, 1 / 3, 2 / 3, 0], speeds=[1, 1, -1, 0]
        )

        def colors():
            pixels = shown()
            return [pixels[row, column, :3].tolist() for row, column in ((16, 16), (16, 48), (48, 16), (48, 48))]

        assert colors() == [list(color) for color in (RED, GREEN, BLUE, RED)]
        copies.advance(1.0)
        assert colors() == [list(color) for color in (GREEN, BLUE, GREEN, RED)]
        copies.advance(3.0)
        assert colors() == [list(color) for color in (GREEN, BLUE, GREEN, RED)]

    def test_arrays_are_shown_with_the_next_advance(self, renderer, shown):
        copies = AnimatedInstances(renderer, LIGHTS, np.zeros((2, 3)), phases=[0, 1 / 3])
        copies.positions[:] = (-0.5, 0, 0), (0.5, 0, 0)
        copies.scales = 0.5
        copies.visible[1] = False
        copies.advance(0.0)
        pixels = shown()
        assert pixels[32, 16].tolist() == [*RED, 255] and pixels[32, 48].tolist() == [0, 0, 0, 0]
        copies.visible, copies.phases[:] = True, np.nan
        copies.phases[1] = 2 / 3
        copies.advance(0.0)
        pixels = shown()
        assert pixels[32, 16].tolist() == [0, 0, 0, 0] and pixels[32, 48].tolist() == [*BLUE, 255]

    def test_a_pose_of_its_own_place_and_turn(self, renderer, screen):
        """Key poses differ in what they show; where a copy stands is the same for all of them."""
        ball, box = (solid_fan(solid, views=8, size=64) for solid in (Sphere(), Box((-1, -1, -1), (1, 1, 1))))
        copies = AnimatedInstances(renderer, AnimatedFan([ball, box], 1.0), (0.3, 0.1, 0.2), 0.4, 0.8, phases=0.5)
        screen.clear()
        renderer.draw(*filling(2.0))
        found = screen.color()
        copies.remove()
        renderer.add(box, (0.3, 0.1, 0.2), 0.4, 0.8)
        screen.clear()
        renderer.draw(*filling(2.0))
        assert np.array_equal(found, screen.color())

    def test_removed_copies_are_gone(self, renderer, shown):
        copies = AnimatedInstances(renderer, LIGHTS, np.zeros((5, 3)))
        assert shown().any()
        copies.remove()
        assert not shown().any()
        assert renderer.statistics["instances"] == 0

    def test_two_share_the_textures_of_their_poses(self, renderer, shown):
        first, second = (AnimatedInstances(renderer, LIGHTS, np.zeros((5, 3))) for _ in range(2))
        first.remove()
        assert shown()[32, 32].tolist() == [*RED, 255]
        second.remove()

    def test_no_copies_are_no_error(self, renderer, shown):
        AnimatedInstances(renderer, LIGHTS, np.zeros((0, 3))).advance(1.0)
        assert not shown().any()

    @pytest.mark.parametrize(
        ("given", "message"),
        [
            ({"phases": [0, 0, 0]}, "card: phases of shape (3,); expected (2,) or ()"),
            ({"speeds": [0, np.inf]}, "card: speeds with a number that is not finite; expected finite ones"),
            ({"scales": 0.0}, "card: scales go down to 0; expected more than 0"),
        ],
    )
    def test_what_is_refused(self, renderer, given, message):
        with pytest.raises(SettingsError) as refused:
            AnimatedInstances(renderer, LIGHTS, np.zeros((2, 3)), **given)
        assert str(refused.value) == message
        assert renderer.statistics["instances"] == 0

    def test_time_has_to_be_finite(self, renderer):
        copies = AnimatedInstances(renderer, LIGHTS)
        with pytest.raises(SettingsError, match=r"advance: nan seconds; expected a finite number"):
            copies.advance(np.nan)


class TestCrossfade:
    @pytest.mark.parametrize("share", [0.25, 0.5, 0.9])
    def test_every_pixel_shows_one_of_the_two_poses(self, renderer, shown, share):
        AnimatedInstances(renderer, LIGHTS, phases=share / 3)
        pixels = shown()
        red, green = ((pixels[..., :3] == color).all(axis=-1) for color in (RED, GREEN))
        assert (red ^ green).all()
        assert green.mean() == pytest.approx(share, abs=0.01)

    def test_a_still_object_does_not_flicker(self, renderer, shown):
        """Soft edges, too: two fans of the same thing look like one at every moment of their crossfade."""
        still = [solid_fan(Sphere(radius=0.8), views=8, size=64) for _ in range(2)]
        copies = AnimatedInstances(renderer, AnimatedFan(still, 1.0))
        whole = shown()
        for _ in range(7):
            copies.advance(0.06)
            assert apart(shown(), whole).max() <= 1

    def test_it_costs_a_second_quad_only_while_it_lasts(self, renderer, shown):
        copies = AnimatedInstances(renderer, AnimatedFan(LIGHTS.fans, 3.0, fade=0.5), np.zeros((10, 3)))
        drawn = []
        for _ in range(4):
            shown()
            drawn.append(renderer.statistics["instances"])
            copies.advance(0.5)
        assert drawn == [10, 20, 10, 20]


def test_a_cycle_that_was_shown_once_needs_no_more_light(renderer, shown):
    copies = AnimatedInstances(renderer, LIGHTS, np.zeros((20, 3)), phases=np.linspace(0, 1, 20))
    for _ in range(6):
        copies.advance(0.5)
        shown()
    for _ in range(6):
        copies.advance(0.5)
        shown()
        assert renderer.statistics["relit"] == 0
