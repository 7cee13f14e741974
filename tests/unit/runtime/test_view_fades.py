"""Crossfades between a fan's views: how long they take, whom they leave alone, and what is seen meanwhile."""

import dataclasses

import numpy as np
import pytest

from impostor.errors import SettingsError
from runtime import LevelOfDetail
from runtime.animation import AnimatedFan, AnimatedInstances
from runtime.instances.view_fades import VIEW_FADE_SECONDS, ViewFades
from tests.pictures import apart, filling
from tests.solids import GREEN, RED, Box, Sphere, solid_fan, solid_model

BALL, PLINTH = Sphere((0.3, 0, 0.2), 0.8, RED), Box((-0.9, -1.2, -0.9), (0.9, -0.5, 0.9), GREEN)
MODEL = solid_model(BALL, PLINTH)
FAN = dataclasses.replace(solid_fan(BALL, PLINTH, views=8, size=64), bounds=MODEL.bounds)
ONE = np.array([0])
# Azimuths whose nearest views are 0 and 1, 22.5 degrees being as far from the one as from the other.
FIRST, SECOND, THIRD = np.radians([20, 25, 70])


def fades_at(*frames, fade_seconds=0.4):
    """(nearest view, seconds) of frame after frame: the view shown and its share after each."""
    fades = ViewFades(1)
    found = []
    for view, seconds in frames:
        fades.update(ONE, np.array([view]), seconds, fade_seconds)
        found.append((fades.shown.item(), round(fades.share.item(), 5)))
    return found


class TestTime:
    def test_a_switch_takes_its_seconds(self):
        frames = [(0, 1.0), (0, 1.0), *[(1, 0.1)] * 5]
        assert fades_at(*frames) == [(0, 1), (0, 1), (1, 0.25), (1, 0.5), (1, 0.75), (1, 1), (1, 1)]

    def test_who_turns_round_takes_back_what_has_been_shown(self):
        frames = [(0, 0.0), (1, 0.1), (0, 0.1), (0, 0.1)]
        assert fades_at(*frames) == [(0, 1), (1, 0.25), (0, 1), (0, 1)]
        frames = [(0, 0.0), (1, 0.3), (0, 0.1), (1, 0.05)]
        assert fades_at(*frames) == [(0, 1), (1, 0.75), (0, 0.5), (1, 0.625)]

    def test_a_fast_viewer_has_short_fades(self):
        """Each takes as long as the last view stayed, and ends when the next begins."""
        frames = [(0, 0.0), (1, 0.1), *[(1, 0.01)] * 9, (2, 0.01), *[(2, 0.01)] * 9]
        found = fades_at(*frames)
        shares = [share for view, share in found if view == 2]
        np.testing.assert_allclose(shares, np.arange(1, 11) / 10, atol=1e-5)

    def test_a_viewer_faster_than_frames_sees_no_fade(self):
        assert fades_at((0, 0.0), (1, 0.05), (2, 0.05), (3, 0.05))[2:] == [(2, 1), (3, 1)]

    def test_who_comes_into_the_picture_shows_the_nearest_view_at_once(self):
        fades = ViewFades(2)
        both = np.array([0, 1])
        fades.update(both, np.array([0, 0]), 0.1, 0.4)
        fades.update(ONE, np.array([1]), 0.1, 0.4)
        fades.update(both, np.array([1, 1]), 0.1, 0.4)
        assert fades.shown.tolist() == [1, 1]
        np.testing.assert_allclose(fades.share, [0.5, 1])
        fades.update(ONE + 1, np.array([1]), 0.0, 0.4)
        assert not fades.fading
        fades.update(both, np.array([1, 1]), 0.0, 0.4)
        # Of what was out of sight in the middle of a fade nothing is left.
        np.testing.assert_allclose(fades.share, 1)

    @pytest.mark.parametrize("seconds", [0.4, 1.0, np.inf])
    def test_as_much_time_as_a_fade_takes_ends_all(self, seconds):
        assert fades_at((0, 0.0), (1, 0.1), (2, seconds), (2, 0.0))[2:] == [(2, 1), (2, 1)]

    def test_no_seconds_of_a_fade_are_none(self):
        assert fades_at((0, 0.0), (1, 0.0), (2, 0.1), fade_seconds=0) == [(0, 1), (1, 1), (2, 1)]

    def test_frames_in_which_no_time_passes(self):
        with np.errstate(all="raise"):
            found = fades_at((0, 0.0), (1, 0.0), (2, 0.0), (2, 0.0), (2, 0.1), (3, 0.0), (3, 0.0))
        assert np.isfinite([share for _, share in found]).all()
        assert found[4] == (2, 1)

    @pytest.mark.parametrize(("rested", "share"), [(0.0, 1.0), (0.09, 0.5), (10.0, 0.25)])
    def test_time_in_which_nothing_moves_is_time_that_a_view_stayed(self, rested, share):
        fades = ViewFades(1)
        for view, seconds in ((0, 0.0), (1, 0.01)):
            fades.update(ONE, np.array([view]), seconds, 0.4)
        fades.rest(rested)
        fades.update(ONE, np.array([2]), 0.1, 0.4)
        assert fades.share.item() == pytest.approx(share, abs=0.03)


@pytest.fixture
def seen(renderer, screen):
    """Draws what is placed from an azimuth, so many seconds later."""

    def drawn(azimuth, seconds=None):
        if seconds is not None:
            renderer.advance(seconds)
        screen.clear()
        renderer.draw(*filling(1.8, azimuth), output="albedo")
        return screen.color()

    return drawn


def both(renderer, seen):
    """The picture from the second azimuth as the first view shows it, and as the second does."""
    seen(FIRST, np.inf)
    renderer.view_fade_seconds = 1e6
    before = seen(SECOND, 0.0)
    after = seen(SECOND, np.inf)
    renderer.view_fade_seconds = VIEW_FADE_SECONDS
    seen(FIRST, np.inf)
    assert (apart(before, after) > 30).sum() > 200
    return before, after


def ranks(side=64):
    """(side, side), of the dither in crossfade.glsl; row 0 at the top."""
    x, y = np.meshgrid(np.arange(side, dtype=np.uint64), np.arange(side, dtype=np.uint64)[::-1])
    return (((x * 3242174889 + y * 2447445414) % 2**32 >> 24) + 0.5) / 256


class TestPicture:
    def test_every_pixel_is_one_of_the_two_views(self, renderer, seen):
        """No hole, no pixel drawn by both; more and more of them are the second's."""
        renderer.add(FAN)
        before, after = both(renderer, seen)
        seen(FIRST, 1.0)
        for share in (0.25, 0.5, 0.75):
            found = seen(SECOND, VIEW_FADE_SECONDS / 4)
            assert renderer.statistics["fading"] == renderer.statistics["instances"] == 1
            assert renderer.statistics["tiles"] == 2
            np.testing.assert_array_equal(found, np.where((ranks() < share)[..., None], after, before))
        np.testing.assert_array_equal(seen(SECOND, VIEW_FADE_SECONDS / 4), after)
        assert renderer.statistics["fading"] == 0

    def test_a_renderer_that_is_never_told_the_time_switches_at_once(self, renderer, seen):
        renderer.add(FAN)
        seen(FIRST)
        first = seen(SECOND)
        assert renderer.statistics["fading"] == 0
        np.testing.assert_array_equal(seen(SECOND), first)

    def test_no_seconds_switch_at_once(self, renderer, seen):
        renderer.add(FAN)
        _, after = both(renderer, seen)
        renderer.view_fade_seconds = 0
        seen(FIRST, 0.1)
        np.testing.assert_array_equal(seen(SECOND, 0.01), after)

    def test_another_look_at_the_same_frame_changes_no_fade(self, renderer, seen):
        """And from the same place it shows the same fade."""
        renderer.add(FAN)
        both(renderer, seen)
        seen(FIRST, 1.0)
        fading = seen(SECOND, VIEW_FADE_SECONDS / 2)
        seen(THIRD)
        assert renderer.statistics["fading"] == 0
        np.testing.assert_array_equal(seen(SECOND), fading)
        seen(FIRST)
        seen(THIRD)
        np.testing.assert_array_equal(seen(SECOND, 0.0), fading)

    def test_a_copy_that_stands_still_keeps_its_time(self, renderer, seen):
        """The pass draws the last frame's quads again, and yet the view has stayed."""
        renderer.add(FAN)
        before, after = both(renderer, seen)
        seen(SECOND, 0.05)
        for seconds in (0.0, 0.05, 0.001, 0.05, 0.05):
            seen(FIRST, seconds)
        found = seen(SECOND, VIEW_FADE_SECONDS / 2)
        np.testing.assert_array_equal(found, np.where((ranks() < 0.5)[..., None], after, before))

    def test_together_with_a_level_of_detail(self, renderer, seen):
        """Mesh, one view and the next share the pixels out."""
        settings = LevelOfDetail(mesh_above_px=np.inf, elevation_off_deg=180.0, fade_seconds=1e6)
        renderer.add(FAN, model=MODEL, level_of_detail=settings)
        before, after = both(renderer, seen)
        levels = renderer._placed.batches[0].levels
        levels.fan_share[:] = 0
        levels.update = lambda *_: None
        mesh = seen(SECOND, np.inf)
        levels.fan_share[:] = 1
        seen(FIRST, np.inf)
        levels.fan_share[:] = 0.5
        found = seen(SECOND, VIEW_FADE_SECONDS / 2)
        at = ranks()[..., None]
        # Quads go over meshes with the depth they were baked with, so mesh and fan agree on no edge.
        expected = np.where(at < 0.25, after, np.where(at < 0.5, before, mesh))
        assert (apart(found, expected) > 3).mean() < 0.01

    def test_together_with_poses(self, renderer, seen):
        """Of an animation whose two key poses share a copy, each fades from view to view within its part."""
        other = dataclasses.replace(FAN, name="other", color=FAN.color[..., [2, 0, 1, 3]].copy())
        dancer = AnimatedInstances(renderer, AnimatedFan([FAN, other], 4.0), phases=0.25)
        np.testing.assert_allclose(np.abs([pose.shares.item() for pose in dancer.poses]), 0.5)
        pictures = []
        for one in range(2):
            for number, pose in enumerate(dancer.poses):
                pose.visible[:], pose.shares[:] = number == one, 1.0
            pictures.append(both(renderer, seen))
        dancer.advance(0.0)
        seen(FIRST, np.inf)
        found = seen(SECOND, VIEW_FADE_SECONDS / 2)
        at = ranks()[..., None]
        first, second = (np.where(at < start + 0.25, after, before)
                         for start, (before, after) in zip((0, 0.5), pictures, strict=True))  # fmt: skip
        np.testing.assert_array_equal(found, np.where(at < 0.5, first, second))

    def test_a_share_is_kept_to_by_the_mesh_as_well(self, renderer, seen):
        """Two copies that share the pixels out do so at every level of detail."""
        settings = LevelOfDetail(mesh_above_px=0.0)
        renderer.add_mesh(MODEL)
        copies = [renderer.add(FAN, model=MODEL, level_of_detail=settings) for _ in range(2)]
        whole = seen(FIRST)
        copies[1].visible = False
        copies[0].shares = 0.3
        part = seen(FIRST)
        at = ranks()[..., None]
        np.testing.assert_array_equal(part, np.where(at < 0.3, whole, 0))
        copies[0].shares = -0.7
        np.testing.assert_array_equal(seen(FIRST), np.where(at < 0.3, 0, whole))
        copies[0].shares = 0
        assert not seen(FIRST).any()
        assert renderer.statistics["meshes"] == 0


class TestSetting:
    def test_it_is_as_it_was_set(self, renderer):
        assert renderer.view_fade_seconds == VIEW_FADE_SECONDS
        renderer.view_fade_seconds = np.float32(0.5)
        assert renderer.view_fade_seconds == 0.5

    @pytest.mark.parametrize("seconds", [-1, np.nan, np.inf, "soon", None, (1,)])
    def test_what_is_no_time_is_refused(self, renderer, seconds):
        with pytest.raises(SettingsError, match="^view_fade_seconds: .*; expected a number from 0 to 1e\\+09$"):
            renderer.view_fade_seconds = seconds
        assert renderer.view_fade_seconds == VIEW_FADE_SECONDS
