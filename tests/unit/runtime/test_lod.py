"""Level of detail: who is a mesh and who a fan, and how one becomes the other without a gap, a pop or a flicker."""

import dataclasses

import numpy as np
import pytest
from numpy.typing import ArrayLike

from bake.fan import bake_fan
from impostor.errors import SettingsError
from impostor.lighting import DirectionalLight
from impostor.model import load_model
from impostor.shadow_projection import Ground
from impostor.views import direction
from runtime import LevelOfDetail
from runtime.fans.leaning import leaning
from runtime.fans.lod import FrameClock, Levels
from runtime.gl.offscreen import Offscreen
from runtime.instances.instances import Instances
from runtime.viewing.cameras import Camera
from runtime.viewing.viewer import Viewer
from tests import gl as raw
from tests.data import SAMPLES
from tests.gl import gl
from tests.pictures import apart, filling, looking
from tests.solids import BLUE, RED, Box, Sphere, solid_fan, solid_model

BALL = Sphere(color=RED)
MODEL = solid_model(BALL)
FAN = solid_fan(BALL, views=8, size=64)
OTHER = dataclasses.replace(solid_fan(Sphere(color=BLUE), views=8, size=64), name="other")
STATUE = SAMPLES / "statue.glb"
ALWAYS, NEVER = LevelOfDetail(mesh_above_px=0), LevelOfDetail(np.inf, 180.0)
HEIGHT = float(np.ptp(FAN.bounds, axis=0).max())


def levels(fan=FAN, positions: ArrayLike = (0.0, 0.0, 0.0), yaws=0.0, scales: ArrayLike = 1.0, **settings):
    """Levels without anything on the GPU."""
    return Levels(Instances(fan, positions, yaws, scales), None, LevelOfDetail(**settings))  # type: ignore[arg-type]


def viewer_at(eye, target=(0.0, 0.0, 0.0), size=600, fov_deg=40.0):
    return Viewer.from_matrices(*looking(eye, target, fov_deg, far=1e4), (0, 0, size, size))


def distance_for(pixels, size=600, fov_deg=40.0):
    """How far from the eye the ball is so many pixels large."""
    return HEIGHT * size / 2 / np.tan(np.radians(fov_deg) / 2) / pixels


class TestSettings:
    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            ({"mesh_above_px": -1}, "mesh_above_px is -1; expected at least 0 pixels"),
            ({"elevation_off_deg": 200}, "elevation_off_deg is 200; expected 0 to 180 degrees"),
            ({"elevation_above_px": np.nan}, "elevation_above_px is nan; expected at least 0 pixels"),
            ({"hysteresis": 0.9}, "hysteresis is 0.9; expected a factor of at least 1"),
            ({"fade_seconds": "1 s"}, "fade_seconds is '1 s'; expected at least 0 seconds"),
        ],
    )
    def test_what_is_out_of_range_is_refused(self, settings, message):
        with pytest.raises(SettingsError) as caught:
            LevelOfDetail(**settings)
        assert str(caught.value) == f"level of detail: {message}"

    @pytest.mark.parametrize("seconds", [-0.1, np.nan, "soon", None])
    def test_time_that_does_not_pass_is_refused(self, renderer, seconds):
        with pytest.raises(SettingsError, match="^advance: .* seconds; expected a number that is at least 0$"):
            renderer.advance(seconds)

    def test_a_mesh_of_something_else_is_refused(self, renderer):
        """As one that was loaded with another up axis, which would be drawn lying beside its fan."""
        tall = solid_model(Box((-0.3, -1, -0.3), (0.3, 1, 0.3)), name="tower")
        lying = solid_fan(Box((-0.3, -0.3, -1), (0.3, 0.3, 1)), views=2, size=16)
        with pytest.raises(SettingsError) as caught:
            renderer.add(lying, model=tall)
        assert "solids: model 'tower' and the fan's object have bounds that are" in str(caught.value)
        assert "expected the model that was baked" in str(caught.value)

    def test_a_level_of_detail_needs_a_mesh(self, renderer):
        with pytest.raises(SettingsError, match="level of detail without a model"):
            renderer.add(FAN, level_of_detail=ALWAYS)
        with pytest.raises(SettingsError, match="^model: a Fan; expected a Model"):
            renderer.add(FAN, model=FAN)
        with pytest.raises(SettingsError, match="^level_of_detail: a float; expected a LevelOfDetail"):
            renderer.add(FAN, model=MODEL, level_of_detail=256.0)


class TestWantedLevel:
    @pytest.mark.parametrize("scale", [0.1, 1.0, 30.0])
    def test_meshes_are_those_that_are_large_on_screen(self, scale):
        pixels = np.array([50, 150, 199, 201, 300, 1000])
        positions = np.zeros((6, 3))
        positions[:, 2] = -scale * distance_for(pixels)
        seen = levels(FAN, positions, scales=scale, mesh_above_px=200, elevation_off_deg=180)
        seen.update(viewer_at((0, 0, 0), (0, 0, -1)), np.inf)
        assert seen.as_mesh.tolist() == [False, False, False, True, True, True]
        np.testing.assert_array_equal(seen.fan_share, np.where(seen.as_mesh, 0, 1))

    def test_an_orthographic_camera_sees_all_copies_equally_large(self):
        for half, expected in ((2.0, True), (4.0, False)):
            seen = levels(FAN, [(0, 0, 0), (0, 0, -9)], mesh_above_px=200 * HEIGHT / 2)
            seen.update(Viewer.from_matrices(*filling(half), (0, 0, 600, 600)), np.inf)
            assert seen.as_mesh.tolist() == [expected] * 2

    def test_turning_the_camera_changes_nothing(self):
        eye = np.array([0, 0, distance_for(200)])
        seen = levels(scales=[1.02, 0.98], positions=np.zeros((2, 3)), mesh_above_px=200, hysteresis=1)
        for turn in np.linspace(0, 2 * np.pi, 25):
            seen.update(viewer_at(eye, eye + direction(turn, 0.2)), 0.1)
            assert seen.as_mesh.tolist() == [True, False]

    @pytest.mark.parametrize(
        ("layout", "elevations"), [("ring", {5: False, 14: False, 27: True, -12: True, 80: True}),
                                   ("hemisphere", {5: False, 45: False, 80: False, -30: True})],
    )  # fmt: skip
    def test_meshes_are_those_seen_from_where_the_fan_was_not(self, layout, elevations):
        fan = solid_fan(BALL, views=8 if layout == "ring" else 80, elevation_deg=10, size=16, layout=layout)
        for elevation, expected in elevations.items():
            for pixels in (40, 80):
                seen = levels(fan, yaws=2.0, mesh_above_px=1e4, elevation_off_deg=15, elevation_above_px=60)
                away = direction(1.0, np.radians(elevation))
                middle = seen.instances.view_vectors.middle
                seen.update(viewer_at(middle + away * distance_for(pixels), middle), np.inf)
                assert seen.as_mesh.tolist() == [expected and pixels > 60], (elevation, pixels)

    @pytest.mark.parametrize("number", [np.nan, np.inf])
    @pytest.mark.parametrize("name", ["positions", "yaws", "scales"])
    def test_a_copy_that_cannot_be_drawn_is_no_mesh(self, renderer, screen, name, number):
        copies = renderer.add(FAN, [(-0.5, 0, 0), (0.5, 0, 0)], model=MODEL, level_of_detail=ALWAYS)
        getattr(copies, name)[0] = number
        renderer.draw(*filling(2.0))
        assert renderer.statistics["meshes"] == 1

    def test_a_hidden_copy_is_not_drawn_as_its_mesh(self, renderer, screen):
        copies = renderer.add(FAN, [(-0.5, 0, 0), (0.5, 0, 0)], model=MODEL, level_of_detail=ALWAYS)
        copies.visible[:] = False
        renderer.draw(*filling(2.0))
        assert not screen.color().any()


class TestLeaning:
    """Copies that a mesh would be drawn in place of, were there one."""

    def test_fans_are_named_of_which_half_of_the_copies_lean(self):
        eye = 8 * direction(0, np.radians(40))
        copies = [Instances(FAN, (0, 0, 0)), Instances(FAN, (0.1, 0, 0)), Instances(OTHER, (9, 0, 0))]
        assert leaning(copies, viewer_at(eye)) == {"solids": pytest.approx(40, abs=1)}
        level = Instances(FAN, np.tile((0, 5.1, 0), (3, 1)))
        assert leaning([*copies, level], viewer_at(eye, (0, 2.5, 0), fov_deg=80)) == {}

    @pytest.mark.parametrize(
        ("eye", "size"),
        [(8 * direction(0, np.radians(19)), 600), (8 * direction(0, np.radians(70)), 60), ((0, 30, -8), 600)],
        ids=["near its views", "small", "behind"],
    )
    def test_what_does_not_show_is_not_named(self, eye, size):
        target = (0, 0, 0) if eye[2] > 0 else (0, 30, -20)
        assert leaning([Instances(FAN)], viewer_at(eye, target, size)) == {}

    def test_no_copies_lean_nowhere(self):
        assert leaning([Instances(FAN, np.zeros((0, 3)))], viewer_at((0, 9, 1))) == {}


class TestHysteresis:
    def flips(self, hysteresis, sizes, **settings):
        seen = levels(mesh_above_px=200, hysteresis=hysteresis, elevation_off_deg=180, **settings)
        found = []
        for pixels in sizes:
            seen.update(viewer_at((0, 0, distance_for(pixels))), 1 / 60)
            found.append(seen.as_mesh.item())
        return np.count_nonzero(np.diff(found))

    def test_a_camera_that_sways_does_not_flip_the_level(self):
        sway = [150, *200 * (1 + 0.08 * np.sin(np.arange(200) / 3))]
        assert self.flips(1.0, sway) > 15
        assert self.flips(1.25, sway) == 1

    def test_it_becomes_a_fan_again_below_the_lower_size(self):
        assert self.flips(1.25, [150, 201, 161, 161]) == 1
        assert self.flips(1.25, [150, 201, 161, 159, 199]) == 2

    def test_swaying_up_and_down_does_not_flip_it_either(self):
        for hysteresis, most in ((1.0, 1e9), (1.25, 1)):
            seen = levels(mesh_above_px=1e4, elevation_off_deg=20, elevation_above_px=10, hysteresis=hysteresis)
            found = []
            for elevation in 20 + 1.5 * np.sin(np.arange(100) / 2):
                seen.update(viewer_at(50 * direction(0.3, np.radians(elevation))), 1 / 60)
                found.append(seen.as_mesh.item())
            flips = np.count_nonzero(np.diff(found))
            assert flips <= most
            assert flips > 10 or hysteresis > 1


class TestTime:
    NEAR, FAR = (0, 0, distance_for(300)), (0, 0, distance_for(100))

    def test_a_crossfade_takes_its_time(self):
        seen = levels(mesh_above_px=200, fade_seconds=0.5)
        seen.update(viewer_at(self.FAR), 0.1)
        shares = []
        for _ in range(6):
            seen.update(viewer_at(self.NEAR), 0.1)
            shares.append(seen.fan_share.item())
        np.testing.assert_allclose(shares, [0.8, 0.6, 0.4, 0.2, 0, 0], atol=1e-6)
        assert shares[-1] == 0
        seen.update(viewer_at(self.FAR), 0.2)
        seen.update(viewer_at(self.NEAR), 0.1)
        np.testing.assert_allclose(seen.fan_share, 0.2, atol=1e-6)

    def test_what_is_not_seen_and_what_is_new_changes_at_once(self):
        seen = levels(mesh_above_px=200, fade_seconds=0.5)
        seen.update(viewer_at(self.NEAR), 0.01)
        assert seen.fan_share == 0
        away = (0, 0, 2 * self.FAR[2])
        seen.update(viewer_at(self.FAR, away), 0.01)
        assert seen.fan_share == 1

    def test_the_same_flight_is_the_same_to_the_bit(self):
        eyes = np.random.default_rng(0).uniform(-1, 1, (80, 3)).cumsum(axis=0) + (0, 3, 10)
        positions = np.random.default_rng(1).uniform(-9, 9, (50, 3))
        flights = []
        for _ in range(2):
            seen = levels(FAN, positions, mesh_above_px=120, fade_seconds=0.3)
            shares = []
            for eye in eyes:
                seen.update(viewer_at(eye), 1 / 60)
                shares.append(seen.fan_share.copy())
            flights.append(np.array(shares))
        np.testing.assert_array_equal(*flights)
        assert ((flights[0] > 0) & (flights[0] < 1)).sum() > 50

    def test_a_frame_is_chosen_for_once_and_time_adds_up(self):
        clock = FrameClock()
        assert [clock.take(), clock.take()] == [np.inf, np.inf]
        clock.advance(0.25)
        clock.advance(0.5)
        assert [clock.take(), clock.take()] == [0.75, None]
        clock.advance(0)
        assert clock.take() == 0

    def test_without_the_time_every_draw_chooses_for_itself(self, renderer, screen):
        renderer.add(FAN, model=MODEL, level_of_detail=LevelOfDetail(mesh_above_px=32))
        for half, meshes in ((1.5, 1), (5.0, 0), (1.5, 1)):
            renderer.draw(*filling(half))
            assert (renderer.statistics["meshes"], renderer.statistics["fading"]) == (meshes, 0)

    def test_more_draws_of_one_frame_show_the_same_levels(self, renderer, screen):
        """A mirror or a second viewport neither changes levels nor takes time from a crossfade."""
        renderer.add(FAN, model=MODEL, level_of_detail=LevelOfDetail(mesh_above_px=32, fade_seconds=1))
        renderer.advance(0)
        renderer.draw(*filling(5.0))
        for _ in range(2):
            renderer.advance(0.25)
            renderer.draw(*filling(1.5))
            renderer.draw(*filling(5.0))
        np.testing.assert_allclose(renderer._placed.batches[0].levels.fan_share, 0.5)
        renderer.advance(np.inf)
        renderer.draw(*filling(1.5))
        assert renderer._placed.batches[0].levels.fan_share == 0

    def test_copies_that_are_added_within_a_frame_have_a_level(self, renderer, screen):
        renderer.advance(0.1)
        renderer.draw(*filling(1.5))
        renderer.add(FAN, model=MODEL, level_of_detail=ALWAYS)
        renderer.draw(*filling(1.5))
        assert renderer.statistics["meshes"] == 1


@pytest.fixture
def halves(renderer, screen, monkeypatch):
    """Coverage by the fan alone and by the mesh alone, of copies in a crossfade."""

    def drawn(matrices, share):
        renderer.advance(0)
        renderer.draw(*matrices)
        levels = renderer._placed.batches[0].levels
        levels.fan_share = np.full(len(levels.instances), share, np.float32)
        covered = []
        for without in ("_mesh_pass.draw_copies", "_impostors.draw"):
            with monkeypatch.context() as patch:
                part, name = without.split(".")
                patch.setattr(getattr(renderer, part), name, lambda *_, **__: None)
                screen.clear()
                renderer.draw(*matrices)
                covered.append(screen.color()[..., 3] > 0)
        return covered

    return drawn


class TestCrossfade:
    @pytest.mark.parametrize("share", [1 / 512, 0.1, 0.25, 0.5, 0.73, 0.999])
    @pytest.mark.parametrize("copies", [[(0, 0, 0)], [(0.3, 0, 0.5), (-0.3, 0.4, -1), (0, -0.5, 1)]])
    def test_fan_and_mesh_share_the_pixels_out(self, renderer, halves, share, copies):
        """No pixel shows both, and none within both silhouettes shows neither."""
        renderer.add(FAN, copies, model=MODEL, level_of_detail=ALWAYS)
        whole = [halves(filling(1.8), each)[which] for which, each in ((0, 1), (1, 0))]
        fan, mesh = halves(filling(1.8), share)
        assert not (fan & mesh).any()
        assert ((fan | mesh) >= (whole[0] & whole[1])).all()
        assert ((fan | mesh) <= (whole[0] | whole[1])).all()
        inside = whole[0] & whole[1]
        assert inside.sum() > 500
        assert fan[inside].mean() == pytest.approx(share, abs=0.03)

    def test_every_pixel_changes_once(self, renderer, halves):
        """From the fan to the mesh and never back, while the fan's share falls."""
        renderer.add(FAN, model=MODEL, level_of_detail=ALWAYS)
        before = halves(filling(1.5), 1)[0]
        for share in np.linspace(1, 0, 21)[1:]:
            fan, _ = halves(filling(1.5), share)
            assert (fan <= before).all()
            before = fan
        assert not before.any()

    def test_a_transparent_mesh_fades_as_well(self, renderer, halves):
        """Its own dither and the crossfade's are strangers to each other."""
        material = dataclasses.replace(MODEL.primitives[0].material, base_color=(1, 1, 1, 0.5), alpha_mode="BLEND")
        veil = dataclasses.replace(MODEL, primitives=(dataclasses.replace(MODEL.primitives[0], material=material),))
        renderer.add(FAN, model=veil, level_of_detail=ALWAYS)
        # Front and back of the ball fall on the same half of the pixels.
        whole = halves(filling(1.5), 0)[1].sum()
        for share in (0.25, 0.5, 0.75):
            assert halves(filling(1.5), share)[1].sum() == pytest.approx(whole * (1 - share), rel=0.12)

    @pytest.mark.parametrize("output", ["lit", "albedo", "normal"])
    def test_a_copy_that_is_all_fan_or_all_mesh_is_drawn_as_such(self, renderer, screen, output):
        pictures = []
        for place in (
            lambda: renderer.add(FAN, (0.2, 0, 0), 0.3, 0.9, model=MODEL, level_of_detail=NEVER),
            lambda: renderer.add(FAN, (0.2, 0, 0), 0.3, 0.9),
            lambda: renderer.add(FAN, (0.2, 0, 0), 0.3, 0.9, model=MODEL, level_of_detail=ALWAYS),
            lambda: renderer.add_mesh(MODEL, renderer_matrix((0.2, 0, 0), 0.3, 0.9)),
        ):
            placed = place()
            screen.clear()
            renderer.draw(*filling(1.5), output=output)
            renderer.draw_meshes(*filling(1.5), output=output)
            pictures.append(screen.color())
            renderer.remove(placed)
        np.testing.assert_array_equal(pictures[0], pictures[1])
        np.testing.assert_array_equal(pictures[2], pictures[3])
        assert pictures[0].any()
        assert pictures[2].any()

    def test_the_shadow_does_not_change(self, renderer, screen):
        """It is the fan's at every level, so there is nothing to pop."""
        pictures = []
        for settings in (ALWAYS, NEVER, None):
            placed = renderer.add(FAN, (0, 1, 0), model=settings and MODEL, level_of_detail=settings)
            screen.clear((1, 1, 1, 1))
            renderer.draw(*looking((0, 3, 6)))
            screen.clear((1, 1, 1, 1))
            renderer.draw_shadows(*looking((0, 3, 6)), Ground(np.array([0.0, 1.0, 0.0])))
            pictures.append(screen.color())
            renderer.remove(placed)
        assert (pictures[0] < 200).any()
        np.testing.assert_array_equal(pictures[0], pictures[1])
        np.testing.assert_array_equal(pictures[0], pictures[2])


def renderer_matrix(position, yaw, scale):
    matrix = scale * np.array([[np.cos(yaw), 0, np.sin(yaw), 0], [0, 1, 0, 0], [-np.sin(yaw), 0, np.cos(yaw), 0]])
    matrix[:, 3] = position
    return np.vstack([matrix, [0, 0, 0, 1]])


class TestStatistics:
    def test_they_tell_what_is_drawn_and_what_is_not(self, renderer, screen):
        settings = LevelOfDetail(mesh_above_px=20, elevation_off_deg=180, fade_seconds=1)
        positions = [(0, 0, -2), (0.5, 0, -3), (0, 0, -40), (2, 0, -45), (-2, 0, -50), (0, 0, 30)]
        renderer.add(FAN, positions, model=MODEL, level_of_detail=settings)
        renderer.add(OTHER, (0, 0, -20))
        matrices = looking((0, 0, 3), (0, 0, -50))
        renderer.advance(0)
        renderer.draw(*matrices)
        triangles = MODEL.triangle_count
        found = renderer.statistics
        assert (found["meshes"], found["instances"], found["fading"]) == (2, 4, 0)
        assert (found["triangles"], found["triangles_spared"]) == (2 * triangles, 3 * triangles)
        renderer._placed.batches[0].instances.positions[2] = 0, 0.5, -2
        renderer.advance(0.5)
        renderer.draw(*matrices)
        found = renderer.statistics
        assert (found["meshes"], found["instances"], found["fading"]) == (3, 4, 1)
        assert (found["triangles"], found["triangles_spared"]) == (3 * triangles, 2 * triangles)

    def test_a_mesh_is_on_the_gpu_once(self, renderer, screen):
        """Whoever draws it; it goes when the last of them goes, and the picture of the others stays."""
        copies = renderer.add(FAN, model=MODEL, level_of_detail=ALWAYS)
        more = renderer.add(OTHER, model=MODEL, level_of_detail=ALWAYS)
        mesh = renderer.add_mesh(MODEL)
        assert mesh.buffers is renderer._placed.batches[0].levels.buffers is renderer._placed.batches[1].levels.buffers
        renderer.remove(copies)
        renderer.remove(more)
        renderer.draw_meshes(*filling(1.5))
        assert screen.color().any()
        renderer.remove(mesh)
        again = renderer.add(FAN, model=MODEL, level_of_detail=ALWAYS)
        renderer.draw(*filling(1.5))
        assert renderer.statistics["meshes"] == 1
        renderer.remove(again)


def test_the_state_is_left_as_it_was(renderer, screen):
    """Also where both shaders of both passes are used in one call."""
    renderer.add(FAN, [(0, 0, 0), (0.5, 0, 1), (0, 0, -3)], model=MODEL, level_of_detail=ALWAYS)
    renderer.add(OTHER, (0, 0, -2))
    renderer.advance(0)
    renderer.draw(*filling(2.0))
    renderer._placed.batches[0].levels.fan_share[:] = 0.5, 0, 1
    gl("glViewport", 3, 5, 40, 50)
    gl("glEnable", raw.SWITCHES["CULL_FACE"])
    gl("glCullFace", 0x0404)
    gl("glDepthMask", 0)
    before = raw.snapshot()
    renderer.draw(*filling(2.0))
    after = raw.snapshot()
    raw.set_plain()
    assert after == before
    assert renderer.statistics["fading"] == 1
    assert renderer.statistics["meshes"] == renderer.statistics["instances"] - 1 == 2


@pytest.fixture(scope="module")
def statue():
    """The statue and one view of it: a viewer two degrees beside is as far off as anyone is from a ring of 96."""
    model = load_model(STATUE)
    return model, bake_fan(model, views=1, size=128)


def changes(ctx, renderer, statue, settings, metres_a_second):
    """Mean change (frames - 1,) of the pixels around the object from frame to frame, of 255, on the way past 128 px."""
    model, fan = statue
    middle = fan.views.center.mean(axis=0)
    pixels = 200
    at_switch = float(np.ptp(fan.bounds, axis=0).max()) * pixels / 2 / np.tan(np.radians(10)) / 128
    picture = Offscreen(ctx, pixels, pixels)
    copies = renderer.add(fan, model=model, level_of_detail=settings)
    frames = []
    for frame in range(50):
        away = at_switch + metres_a_second * (10.5 - frame) / 60
        camera = Camera.perspective(middle + away * direction(np.radians(2), np.radians(15)), middle, 20, 1, 1, 50)
        renderer.advance(1 / 60)
        picture.clear((0.5, 0.6, 0.8, 1))
        renderer.draw(*camera.matrices)
        frames.append(picture.color()[..., :3].astype(float))
    covered = apart(frames[-1], frames[-1][0, 0]) > 0
    picture.release()
    renderer.remove(copies)
    return np.abs(np.diff(frames, axis=0)).mean(axis=-1)[:, covered].mean(axis=1)


@pytest.mark.parametrize("metres_a_second", [0.1, 1.0])
def test_a_slow_approach_shows_no_pop(ctx, renderer, statue, metres_a_second):
    """From frame to frame the crossfade adds little more than its part of the difference between fan and mesh."""
    renderer.lights = [DirectionalLight.from_angles(40, 45, (0.75, 0.75, 0.75))]
    plain = {"mesh_above_px": 128, "elevation_off_deg": 180}
    fan_only, mesh_only, cut, fade = (
        changes(ctx, renderer, statue, LevelOfDetail(**settings), metres_a_second)
        for settings in (
            {"mesh_above_px": np.inf, "elevation_off_deg": 180},
            {"mesh_above_px": 0},
            {**plain, "fade_seconds": 0},
            {**plain, "fade_seconds": 0.4},
        )
    )
    without = np.maximum(fan_only, mesh_only).max()
    assert np.argmax(cut) == 10
    # A cut is a jump, or the rest would prove nothing.
    assert cut[10] > 4 * without
    assert fade.max() < without + 1.5 * cut[10] / 24
    np.testing.assert_allclose(fade[36:], mesh_only[36:], atol=1e-9)
