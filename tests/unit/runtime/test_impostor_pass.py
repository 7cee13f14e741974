"""Fans as quads: where they land, how their edges blend, what is in front of what, and how many there may be."""

from typing import ClassVar

import moderngl
import numpy as np
import pytest
from scipy.ndimage import binary_erosion

from impostor.lighting import DirectionalLight, Gloss
from impostor.views import direction
from runtime import ImpostorRenderer, LevelOfDetail
from runtime.fans.impostor_pass import _ascending
from runtime.fans.textures import FanTextures
from runtime.gl.offscreen import Offscreen
from tests.pictures import apart, assert_parts_are_the_whole, bluish, filling, iou, looking, placed
from tests.solids import BLUE, GREEN, RED, WHITE, Box, Sphere, card_fan, corner_card, solid_fan, solid_model

BALL = Sphere(color=RED)
FAN = solid_fan(BALL, views=8, size=64)
PAINTED = solid_fan(BALL, Box((-0.9, -1.2, -0.9), (0.9, -0.3, 0.9), GREEN), views=8, size=64, elevation_deg=15)
SUN = [DirectionalLight.from_angles(50, 40, (0.7, 0.7, 0.7))]


@pytest.fixture
def draw(renderer, screen):
    """Draws meshes, then fans, over a background and returns the pixels."""

    def drawn(matrices, output="albedo", background=(0.0, 0.0, 0.0, 0.0)):
        screen.clear(background)
        renderer.draw_meshes(*matrices, output=output)
        renderer.draw(*matrices, output=output)
        return screen.color()

    return drawn


class TestWhereItLands:
    def test_a_card_is_upright_and_not_mirrored(self, renderer, draw):
        renderer.add(card_fan(corner_card(64)))
        pixels = draw(filling())
        for row, column, color in ((0, 0, RED), (31, 31, RED), (0, 63, GREEN), (63, 0, BLUE), (32, 32, WHITE)):
            assert pixels[row, column].tolist() == [*color, 255]

    def test_a_texel_is_a_pixel_at_the_tiles_own_size(self, renderer, draw):
        card = np.random.default_rng(0).integers(0, 256, (64, 64, 4), np.uint8)
        card[..., 3] = 255
        renderer.add(card_fan(card))
        assert apart(draw(filling()), card).max() <= 1

    @pytest.mark.parametrize("output", ["albedo", "lit", "normal"])
    @pytest.mark.parametrize("fan", [FAN, PAINTED], ids=["uniform", "painted"])
    def test_it_is_the_mesh_at_a_baked_view(self, renderer, screen, draw, fan, output):
        model = solid_model(BALL) if fan is FAN else solid_model(BALL, Box((-0.9, -1.2, -0.9), (0.9, -0.3, 0.9), GREEN))
        view = fan.views[1]
        matrices = filling(2.0, np.pi / 4, np.arcsin(view.basis[2, 1]))
        renderer.lights = SUN
        mesh = renderer.add_mesh(model, gloss=Gloss(0.3, 8))
        expected = draw(matrices, output)
        renderer.remove(mesh)
        renderer.add(fan, gloss=Gloss(0.3, 8))
        found = draw(matrices, output)
        assert iou(found[..., 3] >= 128, expected[..., 3] >= 128) > 0.97
        inside = binary_erosion((found[..., 3] == 255) & (expected[..., 3] == 255), iterations=2)
        assert inside.sum() > 400
        error = apart(found, expected)[inside]
        # Codes are 1/17 apart and dithered; an edge between two colours may be a pixel off.
        assert error.mean() < 6
        assert np.percentile(error, 90) < (20 if output != "albedo" else 2)

    @pytest.mark.parametrize("fan", [FAN, PAINTED], ids=["uniform", "painted"])
    @pytest.mark.parametrize(
        ("position", "yaw", "scale"), [((0.5, -0.3, 0), 0, 1), ((0, 0, 0), 1.0, 0.5), ((-1, 1, 3), 4, 1.3)]
    )
    def test_a_placed_copy_is_the_placed_mesh(self, renderer, draw, fan, position, yaw, scale):
        solids = (BALL,) if fan is FAN else (BALL, Box((-0.9, -1.2, -0.9), (0.9, -0.3, 0.9), GREEN))
        matrices = filling(4.0, yaw + np.pi / 2, np.arcsin(fan.views[2].basis[2, 1]))
        mesh = renderer.add_mesh(solid_model(*solids), placed(position, yaw, scale))
        expected = draw(matrices)
        renderer.remove(mesh)
        renderer.add(fan, position, yaw, scale)
        found = draw(matrices)
        assert iou(found[..., 3] >= 128, expected[..., 3] >= 128) > 0.9
        assert (apart(found, expected) > 60).mean() < 0.02

    @pytest.mark.parametrize("view", [0, 3])
    def test_a_perspective_fan_is_the_mesh_from_its_own_camera(self, renderer, draw, view):
        solids = (BALL, Box((-0.6, -1, 0.5), (0.6, -0.4, 1.2), BLUE))
        fan = solid_fan(*solids, views=8, size=64, distance=4.0, slopes=(0.4, 0, 0))
        camera = fan.views[view]
        eye = camera.center + camera.distance * camera.basis[2]
        matrices = looking(eye, camera.center, fov_deg=np.degrees(2 * np.arctan(camera.radius / 4)))
        mesh = renderer.add_mesh(solid_model(*solids))
        expected = draw(matrices)
        renderer.remove(mesh)
        renderer.add(fan)
        found = draw(matrices)
        assert iou(found[..., 3] >= 128, expected[..., 3] >= 128) > 0.97
        assert (apart(found, expected) > 40).mean() < 0.08
        inside = binary_erosion(found[..., 3] == 255, iterations=2)
        assert iou(bluish(found) & inside, bluish(expected) & inside) > 0.95

    @pytest.mark.parametrize("slopes", [(0.3, 0, 0), (0, 0.5, -1.0), (-0.2, 1.5, 0)])
    def test_the_plane_it_lies_in_does_not_show_from_its_own_camera(self, renderer, draw, slopes):
        flat = renderer.add(PAINTED)
        expected = draw(filling(2.0, np.pi / 4, np.radians(15)))
        renderer.remove(flat)
        renderer.add(solid_fan(BALL, Box((-0.9, -1.2, -0.9), (0.9, -0.3, 0.9), GREEN),
                               views=8, size=64, elevation_deg=15, slopes=slopes))  # fmt: skip
        assert (apart(draw(filling(2.0, np.pi / 4, np.radians(15))), expected) > 8).sum() < 5


class TestEdges:
    @pytest.mark.parametrize("background", [(1, 1, 1, 1), (0, 0, 0, 1), (0, 1, 1, 1), (0.5, 0.5, 0.5, 1)])
    @pytest.mark.parametrize("painted", [False, True])
    @pytest.mark.parametrize("half", [1.3, 3.0, 9.0])
    def test_no_fringe(self, renderer, draw, background, painted, half):
        """Every pixel lies between the object's colour and the background, also in coarser tiles."""
        colors = [(200, 40, 20), (190, 60, 30)] if painted else [(200, 40, 20)] * 2
        fan = solid_fan(Sphere((0, 0.3, 0), 1.0, colors[0]), Sphere((0, -0.6, 0), 0.8, colors[1]), views=3, size=64)
        renderer.add(fan)
        pixels = draw(filling(half), background=background)[..., :3]
        ends = np.array([*colors, np.multiply(background[:3], 255)])
        assert (pixels >= ends.min(axis=0) - 3).all()
        assert (pixels <= ends.max(axis=0) + 3).all()
        assert (apart(pixels, ends[2]) > 100).any()

    def test_over_nothing_the_colour_is_premultiplied(self, renderer, draw):
        renderer.add(FAN)
        pixels = draw(filling(1.5)).astype(int)
        edge = (pixels[..., 3] > 20) & (pixels[..., 3] < 235)
        assert edge.sum() > 20
        np.testing.assert_allclose(pixels[edge][:, 0], pixels[edge][:, 3], atol=2)
        assert not pixels[..., 1:3].any()

    def test_half_a_texel_of_coverage_is_half_the_background(self, renderer, draw):
        card = corner_card(64)
        card[..., 3] = 128
        renderer.add(card_fan(card))
        assert draw(filling(), background=(0, 0, 1, 1))[5, 5].tolist() == pytest.approx([128, 0, 127, 255], abs=1)


def meeting(renderer, draw, first, second, matrices, **options):
    """Where the second, blue, shows: first as a fan and as a mesh."""
    other = renderer.add_mesh(solid_model(second))
    mesh = renderer.add_mesh(solid_model(first))
    expected = draw(matrices)
    renderer.remove(mesh)
    fan = renderer.add(solid_fan(first, **options))
    found = draw(matrices)
    renderer.remove(fan)
    renderer.remove(other)
    return found, expected


class TestDepth:
    VIEWERS: ClassVar = {
        "its own view": filling(2.0),
        "between views": filling(2.0, 0.1, 0.1),
        "perspective": looking((0.5, 0.3, 5)),
    }

    @pytest.mark.parametrize("viewer", VIEWERS)
    @pytest.mark.parametrize(
        "other",
        [
            Sphere((0.9, 0.2, 0.3), 0.8, BLUE),
            Sphere((0, 0, 0.6), 0.7, BLUE),
            Box((-2, -0.6, -2), (2, -0.5, 2), BLUE),
            Box((0.1, -2, -2), (0.2, 2, 2), BLUE),
            Box((-2, -2, -0.6), (2, 2, -0.4), BLUE),
        ],
        ids=["sphere beside", "sphere in front", "floor", "wall", "wall behind"],
    )
    @pytest.mark.parametrize("options", [{}, {"distance": 6.0}, {"slopes": (0.5, 0.2, 0.1)}], ids=str)
    def test_a_fan_and_a_mesh_intersect_as_two_meshes_do(self, renderer, draw, viewer, other, options):
        options = {"views": 32, "size": 64, **options}
        found, expected = meeting(renderer, draw, BALL, other, self.VIEWERS[viewer], **options)
        mask = bluish(found), bluish(expected)
        if mask[1].sum() > 40:
            assert iou(*mask) > 0.9
        else:
            assert mask[0].sum() < 60

    def test_two_fans_intersect_as_two_meshes_do(self, renderer, draw):
        other = Sphere((0.9, 0.2, 0.3), 0.8, BLUE)
        renderer.add_mesh(solid_model(BALL, other))
        expected = draw(filling(2.0))
        renderer.remove(renderer._placed.meshes[0])
        renderer.add(solid_fan(other, views=8, size=64))
        renderer.add(FAN)
        assert iou(bluish(draw(filling(2.0))), bluish(expected)) > 0.9

    @pytest.mark.parametrize("matrices", [filling(1.5), looking((0, 0, 12), fov_deg=15, near=8, far=16)])
    def test_the_depth_buffer_holds_the_surface(self, renderer, screen, draw, matrices):
        mesh = renderer.add_mesh(solid_model(BALL))
        draw(matrices)
        expected = screen.depth()
        renderer.remove(mesh)
        renderer.add(FAN)
        draw(matrices)
        found = screen.depth()
        inside = binary_erosion((found < 1) & (expected < 1), iterations=3)
        assert inside.sum() > 400
        # Metres along the line of sight.
        scale = 2 / abs(matrices[0][2, 2]) if matrices[0][3, 3] else 11.5**2 * 8 / (8 * 16)
        assert np.percentile(np.abs(found - expected)[inside], 95) * scale < 0.12
        assert np.abs(found - expected)[inside].mean() * scale < 0.04

    def test_what_reaches_past_the_eye_is_in_front_of_everything(self, renderer, draw):
        """The sphere's front bulges past a camera that stands inside of it."""
        renderer.add_mesh(solid_model(Box((-5, -5, -3), (5, 5, -2.5), BLUE)))
        renderer.add(FAN)
        pixels = draw(looking((0, 0, 0.7), near=0.05))
        assert not bluish(pixels)[28:36, 28:36].any()

    def test_a_mesh_drawn_later_is_hidden_behind_a_fan(self, renderer, screen):
        screen.clear()
        renderer.add(FAN)
        renderer.draw(*filling(2.0), output="albedo")
        renderer.add_mesh(solid_model(Box((-2, -2, -3), (2, 2, -2), BLUE)))
        renderer.draw_meshes(*filling(2.0), output="albedo")
        assert screen.color()[32, 32].tolist() == [255, 0, 0, 255]
        assert screen.color()[2, 2].tolist() == [0, 0, 255, 255]


class TestManyCopies:
    def test_all_copies_of_all_fans_are_one_draw_call(self, renderer, draw, monkeypatch):
        calls = []
        rendered = moderngl.VertexArray.render

        def spied(array, *arguments, **options):
            if array is renderer._impostors._whole.array:
                calls.append(options["instances"])
            return rendered(array, *arguments, **options)

        monkeypatch.setattr(moderngl.VertexArray, "render", spied)
        renderer.add(FAN, np.random.default_rng(0).uniform(-3, 3, (500, 3)))
        renderer.add(PAINTED, np.random.default_rng(1).uniform(-3, 3, (300, 3)))
        draw(filling(5.0))
        assert calls == [800]
        assert renderer.statistics["instances"] == 800

    def test_a_covered_rectangle_takes_nothing_off_the_picture(self, renderer, draw, monkeypatch):
        fan, matrices = (
            solid_fan(Sphere(color=RED), Box((-1, -1, 0), (0, 0, 0.1), GREEN), views=4, size=64),
            filling(1.2),
        )
        ball = renderer.add(fan)
        cut = draw(matrices)
        renderer.remove(ball)
        monkeypatch.setattr(FanTextures, "rectangles", np.tile((-1, -1, 1, 1), (len(fan.views) * len(fan.normal), 1)))
        renderer.add(fan)
        np.testing.assert_array_equal(draw(matrices), cut)

    @pytest.mark.parametrize("matrices", [filling(3.0, 0.2), looking((1, 1, 9))])
    def test_the_order_of_the_arrays_does_not_show(self, renderer, draw, matrices):
        random = np.random.default_rng(2)
        positions, yaws = random.uniform(-1.5, 1.5, (40, 3)), random.uniform(0, 6, 40)
        copies = renderer.add(PAINTED, positions, yaws)
        others = renderer.add(card_fan(corner_card()), positions[:5] + 0.1)
        expected = draw(matrices, "lit")
        shuffled = random.permutation(40)
        renderer.remove(copies)
        renderer.remove(others)
        renderer.add(card_fan(corner_card()), positions[4::-1] + 0.1)
        renderer.add(PAINTED, positions[shuffled], yaws[shuffled])
        # Tiles lie elsewhere in the cache now, which may round a colour the other way.
        assert apart(draw(matrices, "lit"), expected).max() <= 2

    @pytest.mark.parametrize("digits", [0, 6])
    def test_copies_are_sorted_as_numpy_sorts_them(self, digits):
        values = (np.random.default_rng(0).normal(0, 30, 5000).round(digits) + 0.0).astype(np.float32)
        np.testing.assert_array_equal(_ascending(values), np.argsort(values, kind="stable"))

    def test_copies_that_were_added_apart_share_tiles(self, renderer, draw):
        for x in (-2.0, 0.0, 2.0):
            renderer.add(FAN, (x, 0, 0))
        assert draw(filling(4.0), "lit").any()
        assert renderer.statistics["relit"] == 1

    def test_a_near_copy_blends_over_a_far_one(self, renderer, draw):
        """Its edge shows the far one through it, and not the background."""
        card = np.full((8, 8, 4), (255, 0, 0, 255), np.uint8)
        veil = np.full((8, 8, 4), (0, 255, 0, 128), np.uint8)
        renderer.add(card_fan(veil), (0, 0, 1))
        renderer.add(card_fan(card), (0, 0, -1))
        assert draw(filling(), background=(0, 0, 1, 1))[30, 30].tolist() == pytest.approx([127, 128, 0, 255], abs=1)

    def test_copies_outside_the_picture_cost_nothing(self, renderer, draw):
        renderer.add(FAN, [(0, 50, 0), (50, 0, 0), (0, -50, 0), (0, 0, 60)])
        assert not draw(looking((0, 0, 20))).any()
        assert not any(renderer.statistics.values())

    def test_no_copies_and_hidden_copies_draw_nothing(self, renderer, draw):
        renderer.add(FAN, np.zeros((0, 3)))
        copies = renderer.add(FAN, np.zeros((3, 3)))
        copies.visible[:] = False
        assert not draw(filling()).any()
        copies.visible[1] = True
        assert draw(filling()).any()

    @pytest.mark.parametrize(
        ("matrices", "elevation"),
        [(filling(4.0, 0.1, 1.2), 0), (looking((1, 7, 4)), 0), (looking((0.5, 0.2, 3)), 15)],
    )
    @pytest.mark.parametrize("slopes", [(0, 0, 0), (0.2, 0.5, -1.4)])
    def test_no_part_is_lost_at_the_picture_border(self, ctx, renderer, screen, matrices, elevation, slopes):
        """A picture is what 4 x 4 pictures of its parts show, each culled for itself."""
        fan = solid_fan(BALL, Box((-0.9, -1.2, -0.9), (0.9, -0.3, 0.9), GREEN),
                        views=8, size=64, elevation_deg=elevation, slopes=slopes)  # fmt: skip
        renderer.add(fan, [(0, 0, 0), (1.8, 0.3, -1), (-1.5, 0.8, -2)], [0, 1, 2])
        assert_parts_are_the_whole(ctx, screen, renderer.draw, matrices)


class TestCrossfade:
    """A fan whose share falls just short of 1 goes through the crossfade's shader and yet keeps all of its pixels."""

    NEARLY_ONE = np.float32(1 - 1e-6)
    LEVEL = LevelOfDetail(np.inf, 180.0)

    def test_the_order_stays_far_to_near(self, renderer, draw):
        """Veils one behind the other, some in a crossfade: each is seen through those before it, as without."""
        random = np.random.default_rng(0)
        veil = np.full((16, 16, 4), (255, 255, 255, 100), np.uint8)
        veil[..., :3] = random.integers(0, 256, 3)
        card, matrices = card_fan(veil), filling(2.0)
        model = solid_model(Box((-1, -1, -1), (1, 1, 1)))
        positions = random.uniform(-1, 1, (60, 3)) * (1.5, 1.5, 3)
        plain = [renderer.add(card, positions[:40]), renderer.add(PAINTED, positions[40:])]
        expected = draw(matrices)
        for placed_before in plain:
            renderer.remove(placed_before)
        renderer.add(card, positions[:40], model=model, level_of_detail=self.LEVEL)
        renderer.add(PAINTED, positions[40:])
        for fading in ([], [39], [0, 7, 21], range(40)):
            renderer.advance(0)
            draw(matrices)
            renderer._placed.batches[0].levels.fan_share[:] = 1
            renderer._placed.batches[0].levels.fan_share[list(fading)] = self.NEARLY_ONE
            # Tiles lie elsewhere in the cache now, which may round a colour the other way.
            assert apart(draw(matrices), expected).max() <= 3
            assert renderer.statistics["fading"] == len(fading)
            assert renderer.statistics["instances"] == 60

    @pytest.mark.parametrize("output", ["lit", "normal"])
    def test_its_shader_shows_the_same_picture(self, renderer, draw, output):
        renderer.add(FAN, (0.2, 0.1, 0), 0.5, model=solid_model(BALL), level_of_detail=self.LEVEL)
        renderer.advance(0)
        expected = draw(filling(1.5), output)
        renderer._placed.batches[0].levels.fan_share[:] = self.NEARLY_ONE
        np.testing.assert_array_equal(draw(filling(1.5), output), expected)
        assert renderer.statistics["fading"] == 1


class TestSizes:
    CHECKS = np.zeros((64, 64, 4), np.uint8)
    CHECKS[..., 3] = 255
    CHECKS[(np.indices((64, 64)).sum(axis=0) % 2) == 0] = 255

    @pytest.mark.parametrize("texels_a_pixel", [2, 3, 5, 8, 16])
    def test_a_small_picture_does_not_alias(self, renderer, draw, texels_a_pixel):
        """A chequerboard finer than a pixel is the grey of its mean light, wherever it stands."""
        copies = renderer.add(card_fan(self.CHECKS, levels=5))
        grey = 188
        for shift in (0.0, 0.013, 0.031):
            copies.positions[0, :2] = shift * texels_a_pixel, -shift
            pixels = draw(filling(texels_a_pixel))[..., 0]
            inside = binary_erosion(pixels > 0, iterations=2) if texels_a_pixel < 10 else pixels > 180
            assert inside.any()
            assert np.abs(pixels[inside].astype(int) - grey).max() < 8

    @pytest.mark.parametrize("half", [1.5, 3, 6, 12, 24])
    def test_light_is_kept_at_every_size(self, renderer, draw, half):
        """The object gives the picture as much light as its mesh does, on the mean of where it may stand."""
        renderer.lights = SUN
        mesh = renderer.add_mesh(solid_model(BALL))
        expected = draw(filling(1.1), "lit")[..., 0].sum(dtype=float) * 1.1**2
        renderer.remove(mesh)
        copies = renderer.add(FAN)
        found = []
        for shift in np.random.default_rng(0).uniform(-0.5, 0.5, (30, 2)) * half / 32:
            copies.positions[0, :2] = shift
            found.append(draw(filling(half), "lit")[..., 0].sum(dtype=float) * half**2)
        assert np.mean(found) == pytest.approx(expected, rel=0.05)

    def test_a_picture_that_is_magnified_is_smooth(self, renderer, draw):
        ramp = np.full((16, 16, 4), 255, np.uint8)
        ramp[..., :3] = (np.arange(16) * 16)[None, :, None]
        renderer.add(card_fan(ramp), scales=4)
        row = draw(filling())[32, :, 0].astype(int)
        assert np.diff(row).max() <= 3
        assert np.ptp(row) > 40

    @pytest.mark.parametrize("scale", [1e-4, 1e4])
    def test_any_scale(self, renderer, draw, scale):
        renderer.add(FAN, scales=scale)
        pixels = draw(filling(1.5 * scale))
        assert pixels[32, 32].tolist() == [255, 0, 0, 255]
        assert 0.25 < (pixels[..., 3] > 128).mean() < 0.45

    def test_tiles_of_an_odd_size(self, renderer, draw):
        """Half of 9 texels is 4, but half of two tiles of 9 is 9: such levels are left out."""
        card = card_fan(corner_card(9), levels=3)
        renderer.add(card)
        assert draw(filling(3.0))[26, 26].tolist() == [255, 0, 0, 255]

    def test_a_camera_in_the_middle_of_a_copy(self, renderer, draw):
        renderer.add(FAN)
        draw(looking((0, 0, 1e-6), (0, 0, -1)))
        draw(looking((0, 0, 0), (0, 0, -1)))

    def test_far_from_the_origin(self, renderer, draw):
        """The caller's matrices are float64; what is left of a metre there is another matter."""
        renderer.add(FAN)
        expected = draw(filling(1.5))
        renderer.remove(renderer._placed.batches[0].instances)
        renderer.add(FAN, (1000, 0, 1000))
        assert (apart(draw(filling(1.5, center=(1000, 0, 1000))), expected) > 16).mean() < 0.02


class TestFullCache:
    """A cache of 9 tiles of 64 texels, 49 of 32, 196 of 16."""

    POSITIONS = np.stack(np.meshgrid(*[np.arange(-3.5, 4)] * 2), axis=-1).reshape(-1, 2)
    POSITIONS = np.insert(POSITIONS * 2.4, 2, 0, axis=1)
    YAWS = np.arange(64) * 0.01

    def pictures(self, ctx, fan, count, matrices, side):
        """The picture, and the statistics of two equal draws."""
        renderer, picture = ImpostorRenderer(ctx, cache_side=side), Offscreen(ctx, 512, 512)
        try:
            renderer.add(fan, self.POSITIONS[:count], self.YAWS[:count])
            statistics = []
            for _ in range(2):
                picture.clear()
                renderer.draw(*matrices)
                statistics.append(renderer.statistics)
            return picture.color(), *statistics
        finally:
            renderer.release()
            picture.release()

    def test_coarser_tiles_when_there_are_more_than_fit(self, ctx):
        enough, plenty = (self.pictures(ctx, PAINTED, 49, filling(10.0), side) for side in (256, 2048))
        assert plenty[1]["coarser"] == 0 < enough[1]["coarser"]
        assert enough[1]["instances"] == enough[1]["tiles"] == enough[1]["relit"] == 49
        assert enough[2] == {**enough[1], "relit": 0}
        assert apart(*(pictures[0] for pictures in (enough, plenty))).mean() < 12
        assert iou(enough[0][..., 3] > 128, plenty[0][..., 3] > 128) > 0.9

    def test_more_tiles_than_fit_at_any_size(self, ctx):
        """A fan whose size is odd has no coarser tiles."""
        fan = solid_fan(BALL, views=8, size=63)
        assert len(fan.normal) == 1
        enough, plenty = (self.pictures(ctx, fan, 64, filling(10.0), side) for side in (256, 2048))
        assert enough[1]["instances"] == 64
        # A pixel whose coverage is just the cut-off may fall on either side of it.
        assert (apart(enough[0], plenty[0]) > 2).sum() <= 2

    def test_the_cache_is_emptied_when_yaws_go_on_turning(self, ctx, renderer, draw):
        """Every frame needs a new tile; 40 of them do not fit where 9 do."""
        small = ImpostorRenderer(ctx, cache_side=256)
        try:
            copies = small.add(FAN)
            for frame in range(40):
                copies.yaws[0] = frame * 1e-4
                small.draw(*filling(1.5))
                assert small.statistics["coarser"] == 0
                assert small.statistics["relit"] == 1
        finally:
            small.release()

    def test_fans_of_different_sizes_share_the_cache(self, renderer, draw):
        renderer.add(card_fan(corner_card(512)), (-1, 0, 0))
        renderer.add(card_fan(corner_card(16)), (1, 0, 0))
        pixels = draw(filling(2.0))
        assert pixels[20, 4].tolist() == pixels[20, 36].tolist() == [255, 0, 0, 255]
        renderer.add(card_fan(corner_card(1024)), (1, 1, 1))
        pixels = draw(filling(2.0))
        assert pixels[20, 4].tolist() == pixels[4, 36].tolist() == [255, 0, 0, 255]
        assert pixels[20, 36].tolist() == [0, 0, 255, 255]


class TestOtherFramebuffers:
    def scene(self, renderer):
        renderer.add_mesh(solid_model(Sphere((0.9, 0.2, 0.3), 0.8, BLUE)))
        renderer.add(PAINTED)

    def test_a_viewport_inside_a_larger_framebuffer(self, ctx, renderer, draw):
        self.scene(renderer)
        expected = draw(filling(2.0), "lit")
        wide = Offscreen(ctx, 160, 100)
        wide.clear()
        wide.framebuffer.viewport = (70, 11, 64, 64)
        renderer.draw_meshes(*filling(2.0))
        renderer.draw(*filling(2.0))
        pixels = wide.color()
        wide.release()
        np.testing.assert_array_equal(pixels[100 - 11 - 64 : 100 - 11, 70 : 70 + 64], expected)
        assert np.count_nonzero(pixels[..., 3]) == np.count_nonzero(expected[..., 3])

    def test_a_multisampled_framebuffer(self, ctx, renderer, draw):
        self.scene(renderer)
        plain = draw(filling(2.0), "lit")
        buffers = ctx.renderbuffer((64, 64), samples=4), ctx.depth_renderbuffer((64, 64), samples=4)
        multisampled = ctx.framebuffer([buffers[0]], buffers[1])
        resolved = Offscreen(ctx, 64, 64)
        multisampled.use()
        multisampled.clear(depth=1.0)
        renderer.draw_meshes(*filling(2.0))
        renderer.draw(*filling(2.0))
        ctx.copy_framebuffer(resolved.framebuffer, multisampled)
        resolved.framebuffer.use()
        pixels = resolved.color()
        for resource in (multisampled, *buffers, resolved):
            resource.release()
        # The outlines of the mesh are smooth now; the fan's are either way.
        assert (apart(pixels, plain) > 4).mean() < 0.08
        assert apart(pixels, plain).mean() < 3

    def test_a_framebuffer_without_depth(self, ctx, renderer):
        texture = ctx.texture((64, 64), 4)
        target = ctx.framebuffer([texture])
        target.use()
        target.clear()
        renderer.add(FAN)
        renderer.draw(*filling(1.5), output="albedo")
        pixels = np.frombuffer(texture.read(), np.uint8).reshape(64, 64, 4)
        ctx.detect_framebuffer(0).use()
        target.release()
        texture.release()
        assert pixels[32, 32].tolist() == [255, 0, 0, 255]


def test_the_view_nearest_to_the_viewer_is_shown(renderer, draw):
    """A ring of views of a die: each side has a colour of its own."""
    sides = [
        Box((-1, -1, 0.9), (1, 1, 1), RED),
        Box((0.9, -1, -1), (1, 1, 1), GREEN),
        Box((-1, -1, -1), (1, 1, -0.9), BLUE),
    ]
    renderer.add(solid_fan(*sides, views=4, size=32))
    for turn, color in ((-40, RED), (0, RED), (40, RED), (50, GREEN), (90, GREEN), (170, BLUE), (200, BLUE)):
        assert draw(filling(2.0, np.radians(turn), 0.3))[32, 32].tolist() == [*color, 255]
    eye = 9 * direction(np.radians(95), 0.2)
    assert draw(looking(eye))[32, 32].tolist() == [0, 255, 0, 255]
