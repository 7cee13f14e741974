"""Surfaces with PTMs: every pixel as NumPy lights it, on any mesh, at any size, under any light."""

import numpy as np
import pytest

from impostor.errors import SettingsError
from impostor.lighting import DirectionalLight, Gloss, LocalLight
from impostor.model import Model
from impostor.ptm.normals import normals
from impostor.ptm.polynomials import Polynomials, basis
from impostor.ptm.quantise import Ptm, quantise
from impostor.ptm.shading import ambient_gain, shaded
from impostor.shadow_projection import Ground
from impostor.srgb import linear_from_srgb, srgb_from_linear
from impostor.views import direction
from runtime.gl.context import make_context
from runtime.gl.offscreen import Offscreen
from runtime.gl.state import preserved_state
from runtime.ground.ground_pass import GroundSurface
from runtime.meshes.tangents import tangent_mesh
from runtime.surfaces import relit_pictures
from runtime.surfaces.buffers import MOST_LIGHTS, lights_at
from runtime.surfaces.relit_pictures import PATIENCE
from runtime.surfaces.surface_pass import Surface, SurfacePass, lying_on, rectangle
from runtime.viewing.viewer import Viewer
from tests import gl as raw
from tests.conftest import live_objects
from tests.gl import gl
from tests.pictures import filling, iou, looking, placed
from tests.solids import Box, Sphere, solid_fan, solid_model

SIZE = 64
SUN = DirectionalLight.from_angles(30, 40, (0.8, 0.6, 0.4))
WHITE = DirectionalLight((0.3, 0.2, 0.8))
LAMP = DirectionalLight.from_angles(-60, 55, (0.1, 0.2, 0.5))
LIGHTS = {
    "one": [SUN],
    "two": [SUN, LAMP],
    "grazing": [DirectionalLight((1, 0.3, 0.01))],
    "just set": [DirectionalLight((0.5, 0.1, -0.03))],
    "behind": [DirectionalLight((0.2, 0.1, -1)), SUN],
    "bright": [DirectionalLight((0.4, 0, 0.6), (1.6, 1.6, 1.6))],
}


def matt_polynomials(size=SIZE, roughness=0.3, seed=1):
    """Bumps of a matt white material, fitted: (size, size, 6) on the sRGB curve."""
    rng = np.random.default_rng(seed)
    slopes = rng.normal(0, roughness, (size, size, 2))
    bumps = np.concatenate([-slopes, np.ones((size, size, 1))], axis=-1)
    bumps /= np.linalg.norm(bumps, axis=-1, keepdims=True)
    angles = rng.uniform((0, 0.2), (2 * np.pi, np.pi / 2), (80, 2))
    toward = np.stack([np.cos(angles[:, 0]) * np.cos(angles[:, 1]), np.sin(angles[:, 0]) * np.cos(angles[:, 1]),
                       np.sin(angles[:, 1])], axis=-1)  # fmt: skip
    photographs = srgb_from_linear(np.maximum(bumps @ toward.T, 0))
    return photographs @ np.linalg.pinv(basis(toward[:, 0], toward[:, 1])).T


def painted(size=SIZE, seed=2):
    """Smooth colours (size, size, 3)."""
    rng = np.random.default_rng(seed)
    waves = np.arange(size)[:, None] * rng.uniform(0.02, 0.2, 6) + rng.uniform(0, 6, 6)
    return 0.55 + 0.4 * np.sin(waves[:, None, :3] + waves[None, :, 3:])


def make_ptm(kind="LRGB", size=SIZE, curve="srgb", roughness=0.3):
    shape, color = matt_polynomials(size, roughness)[:, :, None], painted(size).astype(np.float32)
    if kind == "RGB":
        return quantise(Polynomials((shape * color[..., None]).astype(np.float32), curve=curve))
    if kind == "LUM":
        matrix = np.array([[1, 1.402, 0, -0.701], [1, -0.714136, -0.344136, 0.529136], [1, 0, 1.772, -0.886]])
        chroma = 0.5 + 0.3 * (color[..., :2] - 0.5)
        return quantise(Polynomials(shape.astype(np.float32), chroma=chroma, rgb_from_luma=matrix, curve=curve))
    return quantise(Polynomials(shape.astype(np.float32), color, curve=curve))


def plain_ptm(terms, size=1):
    """A PTM that is the same everywhere: one value on the linear curve for red, green and blue."""
    coefficients = np.tile(np.asarray(terms, np.float32), (size, size, 3, 1))
    return quantise(Polynomials(coefficients, curve="linear"))


@pytest.fixture
def surfaces(ctx):
    drawn = SurfacePass(ctx, anisotropy=1.0)
    yield drawn
    drawn.release()


@pytest.fixture
def draw(ctx, surfaces, screen):
    def drawn(*placed_surfaces, lights=(SUN,), ambient=0.0, matrices=None, output="lit", clear=True):
        if clear:
            screen.clear()
        with preserved_state(ctx) as state:
            viewer = Viewer.from_matrices(*(matrices or filling()), state.viewport)
            surfaces.draw(state, placed_surfaces, viewer, lights, ambient, output)
        return screen.color()

    return drawn


def expected(ptm, lights, ambient=0.0):
    toward, colors = [light.toward for light in lights], [light.color for light in lights]
    return shaded(ptm.polynomials(), toward, colors, ambient) * 255


class TestEqualsNumPy:
    """One texel a pixel: within 1 of 255, of which half is rounding and 0.28 the shader's curve."""

    @pytest.mark.parametrize("lights", LIGHTS)
    @pytest.mark.parametrize("kind", ["LRGB", "RGB", "LUM"])
    def test_flat_pixel_by_pixel_and_relit(self, surfaces, draw, kind, lights):
        ptm, ambient = make_ptm(kind), (0.1, 0.05, 0.2)
        surface, reference = Surface(ptm, rectangle(2, 2)), expected(make_ptm(kind), LIGHTS[lights], ambient)
        first = draw(surface, lights=LIGHTS[lights], ambient=ambient)
        assert surfaces.statistics == {"surfaces": 1, "plain": 0, "relit": 0}
        for _ in range(PATIENCE):
            relit = draw(surface, lights=LIGHTS[lights], ambient=ambient)
        assert surfaces.statistics == {"surfaces": 1, "plain": 1, "relit": 1}
        assert np.ptp(reference) > 30
        assert np.abs(first[..., :3] - reference).max() < 1
        np.testing.assert_array_equal(relit, first)

    @pytest.mark.parametrize("kind", ["LRGB", "RGB"])
    def test_values_in_linear_light(self, draw, kind):
        ptm = make_ptm(kind, curve="linear")
        found = draw(Surface(ptm, rectangle(2, 2)), lights=[SUN, LAMP], ambient=0.1)
        assert np.abs(found[..., :3] - expected(ptm, [SUN, LAMP], 0.1)).max() < 1

    @pytest.mark.parametrize("kind", ["LRGB", "RGB"])
    def test_lamps_near_the_surface(self, draw, kind):
        ptm, near = make_ptm(kind), LocalLight((0.4, 0.3, 0.7), (0.5, 0.45, 0.4))
        behind = LocalLight((-0.5, 0, -0.05), (0.2, 0.2, 0.3))
        found = draw(Surface(ptm, rectangle(2, 2)), lights=[LAMP, near, behind], ambient=0.1)
        across = (np.arange(SIZE) + 0.5) / 32 - 1
        points = np.stack([*np.meshgrid(across, -across), np.zeros((SIZE, SIZE))], axis=-1)
        toward, colors = [np.broadcast_to(LAMP.toward, points.shape)], [np.broadcast_to(LAMP.color, points.shape)]
        for lamp in (near, behind):
            toward.append(np.array(lamp.position) - points)
            colors.append(lamp.color / (toward[-1] ** 2).sum(axis=-1, keepdims=True))
        reference = shaded(ptm.polynomials(), np.array(toward), np.array(colors), 0.1) * 255
        assert np.abs(found[..., :3] - reference).max() < 1.5

    def test_a_curved_mesh_pixel_by_pixel(self, draw):
        """A ball whose picture's right is east and whose top is north; texels all alike."""
        terms = np.array([-0.2, -0.1, 0.15, 0.3, 0.25, 0.5])
        found = draw(Surface(plain_ptm(terms), mapped_ball()), lights=[DirectionalLight((0.3, 0.5, 0.8))])
        across = (np.arange(SIZE) + 0.5) / 32 - 1
        x, y = np.meshgrid(across, -across)
        seen = x**2 + y**2 < 0.9
        normal = np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], axis=-1)
        east = np.stack([normal[..., 2], 0 * x, -x], axis=-1) / np.sqrt(np.maximum(1 - y**2, 1e-9))[..., None]
        light = np.array([0.3, 0.5, 0.8]) / np.linalg.norm([0.3, 0.5, 0.8])
        u, v, height = east @ light, np.cross(normal, east) @ light, normal @ light
        seen &= height > 0.05
        value = basis(u, v) @ plain_ptm(terms).polynomials().coefficients[0, 0, 0]
        assert seen.sum() > 1500
        assert np.abs(found[..., 0] - srgb_from_linear(value) * 255)[seen].max() < 3

    @pytest.mark.parametrize("kind", ["LRGB", "RGB"])
    def test_normals(self, draw, kind):
        """All but those few whose two brightest lights are nearly a tie, within 1.5 degrees."""
        ptm = make_ptm(kind, roughness=0.6)
        found = draw(Surface(ptm, rectangle(2, 2)), output="normal")[..., :3] / 127.5 - 1
        reference = normals(ptm.polynomials())
        assert (reference[..., 2] < 1e-3).sum() > 50
        apart = np.arccos(np.clip(np.einsum("hwi,hwi->hw", found, reference), -1, 1))
        assert (np.linalg.norm(found - reference, axis=-1) < 0.026).mean() > 0.995, np.degrees(apart).max()


def mapped_ball(detail=96):
    positions, facing, triangles = Sphere().triangles(detail)
    around, up = np.meshgrid(np.arange(2 * detail + 1), np.arange(detail + 1))
    uvs = np.stack([around / (2 * detail), up / detail], axis=-1).reshape(-1, 2)
    return Model.from_arrays(positions, triangles, facing, uvs=uvs)


class TestAmbient:
    @pytest.mark.parametrize("curve", ["srgb", "linear"])
    def test_a_matt_surface_shows_its_albedo(self, draw, curve):
        angles = np.radians(np.linspace(3, 88, 30))
        albedo, heights = 0.4, np.repeat(np.cos(angles), 8)
        turn = np.tile(np.arange(8) * np.pi / 4, 30)
        radius = np.sqrt(1 - heights**2)
        light = albedo * heights
        terms = np.linalg.lstsq(
            basis(radius * np.cos(turn), radius * np.sin(turn)) * np.repeat(np.sin(angles), 8)[:, None] ** 0.5,
            (light if curve == "linear" else srgb_from_linear(light)) * np.repeat(np.sin(angles), 8) ** 0.5,
            rcond=None,
        )[0]
        ptm = quantise(Polynomials(np.tile(terms.astype(np.float32), (1, 1, 3, 1)), curve=curve))
        found = draw(Surface(ptm, rectangle(2, 2)), lights=(), ambient=0.8)
        assert abs(found[20, 20, 0] - srgb_from_linear(0.8 * albedo) * 255) < 4

    def test_the_gain_is_the_one_of_the_mean_cosine(self):
        assert ambient_gain("linear") == 2
        assert 1 / ambient_gain("srgb") == pytest.approx(
            linear_from_srgb(np.mean(srgb_from_linear(np.linspace(0, 1, 200001)))), rel=1e-3
        )


class TestGeometry:
    def test_the_light_comes_from_the_right_side_however_the_surface_is_turned(self, draw):
        """A PTM that is bright under light from its right, hung on four walls and laid on the ground."""
        ptm = plain_ptm([0, 0, 0, 0.4, 0, 0.5])
        for yaw, lit in ((0, (1, 0, 1)), (90, (1, 0, -1)), (180, (-1, 0, -1)), (-90, (-1, 0, 1))):
            turn = placed(yaw=np.radians(yaw))
            other = turn[:3, 2] * 2 - np.array(lit)
            camera = filling(azimuth=np.radians(yaw))
            bright, dark = (
                draw(Surface(ptm, rectangle(2, 2), world_from_model=turn), lights=[DirectionalLight(toward)],
                     matrices=camera)[32, 32, 0]
                for toward in (tuple(lit), tuple(other))
            )  # fmt: skip
            amount = 0.4 * np.sqrt(0.5)
            assert abs(bright - srgb_from_linear(0.5 + amount) * 255) < 2
            assert abs(dark - srgb_from_linear(0.5 - amount) * 255) < 2

    def test_up_in_the_picture_is_up_on_the_wall_and_away_on_the_ground(self, draw):
        ptm = plain_ptm([0, 0, 0, 0, 0.4, 0.5])
        wall = Surface(ptm, rectangle(2, 2))
        above, below = (draw(wall, lights=[DirectionalLight((0, y, 1))])[32, 32, 0] for y in (1, -1))
        assert int(above) - int(below) > 60
        floor = Surface(ptm, rectangle(2, 2), world_from_model=lying_on(Ground((0, 1, 0), 0.0)))
        away, toward = (
            draw(floor, lights=[DirectionalLight((0, 1, z))], matrices=filling(elevation=1.0))[32, 32, 0]
            for z in (-1, 1)
        )
        assert (away, toward) == (above, below)

    def test_a_picture_is_upright_and_not_mirrored(self, draw):
        terms = np.zeros((SIZE, SIZE, 3, 6), np.float32)
        terms[:8, :8, 0, 5] = terms[:8, -8:, 1, 5] = terms[-8:, :8, 2, 5] = 1
        found = draw(Surface(quantise(Polynomials(terms)), rectangle(2, 2)), lights=[WHITE])
        for row, column, color in ((3, 3, [255, 0, 0]), (3, 60, [0, 255, 0]), (60, 3, [0, 0, 255]), (60, 60, [0] * 3)):
            assert found[row, column].tolist() == [*color, 255]

    def test_a_mirrored_mesh_is_lit_as_it_lies(self, draw):
        """Mirrored texture coordinates turn the picture's right, and with it the light."""
        mirrored = Model.from_arrays(
            [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]], np.tile((0.0, 0, 1), (4, 1)),
            uvs=[[1, 1], [0, 1], [0, 0], [1, 0]],
        )  # fmt: skip
        light = [DirectionalLight((0.8, 0.3, 0.5))]
        ptm = make_ptm()
        turned = [DirectionalLight((-0.8, 0.3, 0.5))]
        found = draw(Surface(ptm, mirrored), lights=light)
        assert np.abs(found[:, ::-1, :3] - expected(ptm, turned)).max() < 1

    def test_tangents_follow_the_texture_not_the_edges(self):
        """Turned texture coordinates on a tilted triangle; a vertex between mirrored halves is split."""
        corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0]], float)
        uvs = [[0.5, 0.5], [0.5, 0.1], [0.1, 0.5], [0.5, 0.1]]
        mesh = tangent_mesh(Model.from_arrays(corners, [[0, 1, 2], [0, 2, 3]], np.tile((0.0, 0, 1), (4, 1)), uvs=uvs))
        assert len(mesh.positions) == 6
        np.testing.assert_allclose(mesh.tangents[:, :3], np.tile((0, -1, 0), (6, 1)), atol=1e-6)
        right = mesh.positions[mesh.triangles[0]].mean(axis=0)[0] > 0
        sides = mesh.tangents[mesh.triangles, 3].mean(axis=1)
        # Light from +x of the right half is up in its picture, where v falls.
        np.testing.assert_array_equal(sides, [1, -1] if right else [-1, 1])
        assert mesh.frame is None

    def test_a_degenerate_picture_still_gives_frames(self):
        mesh = tangent_mesh(Model.from_arrays([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], uvs=[[0.5, 0.5]] * 3))
        np.testing.assert_allclose(np.linalg.norm(mesh.tangents[:, :3], axis=1), 1, atol=1e-6)
        np.testing.assert_allclose(np.einsum("ni,ni->n", mesh.tangents[:, :3], mesh.normals), 0, atol=1e-6)

    def test_surfaces_and_meshes_intersect(self, ctx, renderer, draw, screen):
        renderer.lights, renderer.ambient = [], 0.0
        renderer.add_mesh(solid_model(Box((-1, -1, -0.5), (0, 1, 0.5))))
        screen.clear()
        renderer.draw_meshes(*filling())
        found = draw(Surface(plain_ptm([0, 0, 0, 0, 0, 1]), rectangle(2, 2)), lights=[WHITE], clear=False)
        assert not found[:, :32, 0].any()
        assert (found[:, 33:, 0] == 255).all()
        depth = screen.depth()
        assert (depth[:, 33:] > depth[:, :31].max()).all()


class TestTiling:
    def test_every_tile_is_the_whole_picture(self, draw):
        ptm = make_ptm(size=32)
        found = draw(Surface(ptm, rectangle(2, 2), tiling=(2, 2)))[..., :3]
        reference = np.tile(expected(ptm, [SUN]), (2, 2, 1))
        assert np.abs(found - reference).max() < 1

    @pytest.mark.parametrize("draws", [1, PATIENCE + 1], ids=["pixel by pixel", "relit"])
    def test_a_seam_is_filtered_like_any_texels(self, draw, draws):
        """A picture that fits itself shows no seam: 16 texels on 32 pixels, twice."""
        wave = 0.5 + 0.4 * np.sin((np.arange(16) + 0.5) / 16 * 2 * np.pi)
        terms = np.zeros((16, 16, 3, 6), np.float32)
        terms[..., 5] = wave[None, :, None]
        surface = Surface(quantise(Polynomials(terms)), rectangle(2, 2), tiling=(2, 2))
        for _ in range(draws):
            row = draw(surface)[10, :, 0].astype(int)
        np.testing.assert_array_equal(row[:32], row[32:])
        steps = np.abs(np.diff(row))
        assert steps[31] <= steps[:31].max()

    @pytest.mark.parametrize("draws", [1, PATIENCE + 1], ids=["pixel by pixel", "relit"])
    def test_a_single_picture_does_not_bleed_over_its_edges(self, draw, draws):
        terms = np.zeros((4, 4, 3, 6), np.float32)
        terms[:, 2:, :, 5] = 1
        surface = Surface(quantise(Polynomials(terms)), rectangle(2, 2))
        for _ in range(draws):
            found = draw(surface, lights=[WHITE])
        assert not found[:, 0, 0].any()
        assert (found[:, 63, 0] == 255).all()


class TestDistance:
    @pytest.mark.parametrize("draws", [1, PATIENCE + 1], ids=["pixel by pixel", "relit"])
    @pytest.mark.parametrize("kind", ["LRGB", "RGB"])
    def test_far_away_a_surface_is_its_mean(self, draw, kind, draws):
        """The mean of the values, as they are linear in the coefficients; 16 x 16 texels a pixel, within 2 of 255."""
        ptm = make_ptm(kind, size=256, roughness=0.15)
        surface = Surface(ptm, rectangle(0.5, 0.5))
        for _ in range(draws):
            found = draw(surface, lights=[WHITE])
        means = expected(ptm, [WHITE]).reshape(16, 16, 16, 16, 3).mean(axis=(1, 3))
        assert np.ptp(means) > 60
        assert np.abs(found[24:40, 24:40, :3] - means)[1:-1, 1:-1].max() < 2

    @pytest.mark.parametrize("kind", ["LRGB", "RGB"])
    def test_a_picture_of_odd_sides_far_away(self, draw, kind):
        ptm = make_ptm(kind, size=251, roughness=0.15)
        surface = Surface(ptm, rectangle(0.5, 0.5))
        for _ in range(PATIENCE + 1):
            found = draw(surface, lights=[WHITE])
        means = expected(ptm, [WHITE]).mean(axis=(0, 1))
        np.testing.assert_allclose(found[24:40, 24:40, :3].mean(axis=(0, 1)), means, atol=2)

    def test_bright_texels_give_more_of_the_colour(self, draw):
        """Red in the light among blue in the dark is red from afar, not purple."""
        color = np.zeros((64, 64, 3), np.float32)
        color[..., 0], color[::2, :, 0], color[::2, :, 2] = 1, 0, 1
        shape = np.zeros((64, 64, 1, 6), np.float32)
        shape[..., 5] = 0.8
        shape[::2, ..., 5] = 0.05
        found = draw(Surface(quantise(Polynomials(shape, color)), rectangle(0.25, 0.25)), lights=[WHITE])[32, 32]
        assert abs(found[0] - 0.4 * 255) < 3
        assert found[2] < 0.05 * 255

    def test_anisotropy_keeps_a_grazing_floor_sharp(self, ctx, screen):
        terms = np.zeros((64, 64, 3, 6), np.float32)
        terms[:, ::2, :, 5] = 1
        floor = Surface(quantise(Polynomials(terms)), rectangle(2, 8), (1, 1), lying_on(Ground((0, 1, 0), 0.0)))
        contrasts = []
        for anisotropy in (1.0, 16.0):
            drawn = SurfacePass(ctx, anisotropy)
            screen.clear()
            with preserved_state(ctx) as state:
                matrices = looking((0, 0.25, 4), (0, 0, 0), 30)
                drawn.draw(state, [floor], Viewer.from_matrices(*matrices, state.viewport), [SUN])
            contrasts.append(screen.color()[30:34, 16:48, 0].astype(float).std(axis=1).mean())
            drawn.release()
        assert contrasts[1] > 1.3 * contrasts[0]


class TestLight:
    def test_a_lamp_falls_off_with_the_square_of_the_distance(self, draw):
        surface = Surface(plain_ptm([0, 0, 0, 0, 0, 1]), rectangle(2, 2))
        for distance in (1.0, 2.0, 3.0):
            found = draw(surface, lights=[LocalLight((0.03, -0.03, distance))])[32, 32, 0]
            assert abs(found - srgb_from_linear(1 / distance**2) * 255) < 2

    def test_the_strongest_lights_are_taken(self):
        rng = np.random.default_rng(0)
        lamps = [LocalLight(tuple(at)) for at in rng.uniform(-3, 3, (60, 3))]
        far = LocalLight((1e4, 0, 0))
        taken = lights_at([far, *lamps, SUN], np.zeros(3), 0.1)
        assert len(taken) == MOST_LIGHTS and SUN in taken and far not in taken
        nearest = sorted(np.linalg.norm([lamp.position for lamp in lamps], axis=1))
        assert max(np.linalg.norm(each.position) for each in taken if each is not SUN) <= nearest[MOST_LIGHTS - 1]

    def test_more_lights_than_a_sum_of_pictures_holds(self, draw):
        lights = [DirectionalLight.from_angles(7 * i, 30 + i % 40, (0.02, 0.015, 0.02)) for i in range(48)]
        ptm = make_ptm()
        found = draw(Surface(ptm, rectangle(2, 2)), lights=lights)
        assert np.abs(found[..., :3] - expected(ptm, lights)).max() < 1

    @pytest.mark.parametrize("orthographic", [True, False])
    def test_a_highlight_on_the_normals_of_the_ptm(self, draw, orthographic):
        """Bumps that all lean one way move the highlight as a normal would."""
        lean, gloss, eye = np.array([0.3, 0.2]), Gloss(0.8, 40.0), np.array([0, 0, 3.0])
        terms = [-0.1, -0.1, 0, 0.2 * lean[0], 0.2 * lean[1], 0.0]  # brightest at `lean`; below black
        normal = np.append(lean, np.sqrt(1 - lean @ lean))
        light = direction(0.6, 0.3)
        matrices = filling() if orthographic else looking(eye, fov_deg=2 * np.degrees(np.arctan(1 / 3)))
        surface = Surface(plain_ptm(terms), rectangle(2, 2), gloss=gloss)
        found = draw(surface, lights=[DirectionalLight(tuple(light))], matrices=matrices)[..., 0]
        across = (np.arange(SIZE) + 0.5) / 32 - 1
        x, y = np.meshgrid(across, -across)
        toward = np.stack([0 * x, 0 * x, 0 * x + 1] if orthographic else [-x, -y, 0 * x + 3], axis=-1)
        half = light + toward / np.linalg.norm(toward, axis=-1, keepdims=True)
        half /= np.linalg.norm(half, axis=-1, keepdims=True)
        reference = srgb_from_linear(0.8 * np.maximum(half @ normal, 0) ** 40) * 255
        assert reference.max() > 50
        assert np.abs(found - reference).max() < 6  # of which the 8 bits of the coefficients take most

    def test_no_light_is_black_and_albedo_is_lit_from_everywhere(self, draw):
        ptm = make_ptm()
        assert not draw(Surface(ptm, rectangle(2, 2)), lights=())[..., :3].any()
        found = draw(Surface(ptm, rectangle(2, 2)), lights=(), output="albedo")
        assert np.abs(found[..., :3] - expected(ptm, [], 1.0)).max() < 1


class TestStripShadow:
    def test_a_fan_darkens_a_ptm_ground(self, renderer, draw, screen):
        """The strips' shadow lies on the PTM where it lies on a plain ground."""
        renderer.lights, renderer.ambient = [DirectionalLight.from_angles(-60, 40)], 0.1
        renderer.add(solid_fan(Sphere((0, 0.6, 0), 0.5), views=12, size=64, elevation_deg=20))
        ground, matrices = Ground((0, 1, 0), 0.0), filling(2.0, 0.2, 0.7)

        def darkened(draw_ground):
            screen.clear()
            draw_ground()
            bare = screen.color()[..., :3].sum(axis=-1, dtype=float)
            renderer.draw_shadows(*matrices, ground)
            return bare, screen.color()[..., :3].sum(axis=-1) < 0.6 * bare

        floor = Surface(make_ptm("RGB", 32, roughness=0.1), rectangle(8, 8), (2, 2), lying_on(ground))
        options = {"lights": renderer.lights, "ambient": 0.1, "matrices": matrices}
        bare, on_ptm = darkened(lambda: draw(floor, **options))
        _, on_plain = darkened(lambda: renderer.draw_ground(*matrices, ground, GroundSurface((0.5, 0.5, 0.5))))
        assert np.ptp(bare) > 200
        assert on_plain.sum() > 60
        assert iou(on_ptm, on_plain) > 0.85


class TestRelitPictures:
    def test_lights_that_move_are_not_worth_a_picture(self, surfaces, draw):
        surface = Surface(make_ptm(), rectangle(2, 2))
        for step in range(2 * PATIENCE):
            draw(surface, lights=[DirectionalLight.from_angles(step // 2, 40)])
            assert surfaces.statistics["plain"] == 0

    def test_surfaces_that_face_the_same_way_share_one(self, surfaces, draw):
        ptm, model = make_ptm(), rectangle(0.5, 0.5)
        walls = [Surface(ptm, model, world_from_model=placed((x, 0, 0))) for x in (-0.6, 0, 0.6)]
        walls.append(Surface(ptm, model, world_from_model=placed((0, 0.6, 0), yaw=0.4)))
        relit = 0
        for _ in range(PATIENCE + 2):
            draw(*walls)
            relit += surfaces.statistics["relit"]
        assert relit == 2
        assert surfaces.statistics["plain"] == 4

    def test_a_turned_surface_is_lit_anew(self, surfaces, draw):
        surface = Surface(make_ptm(), rectangle(2, 2))
        for _ in range(PATIENCE + 1):
            before = draw(surface)
        surface.world_from_model = placed(yaw=0.5)
        after = draw(surface, matrices=filling(azimuth=0.5))
        assert surfaces.statistics["plain"] == 0
        assert np.abs(after.astype(int) - before).mean() > 3

    def test_what_changes_or_goes_is_freed(self, surfaces, draw):
        wall, other = Surface(make_ptm(), rectangle(2, 2)), Surface(make_ptm("RGB"), rectangle(1, 1))
        draw()
        bare = live_objects()
        for _ in range(PATIENCE + 1):
            draw(wall, other)
        full = live_objects()
        wall.ptm = make_ptm("RGB")
        draw(wall)
        assert len(live_objects()["Texture"]) < len(full["Texture"])
        draw()
        assert live_objects() == bare

    def test_pictures_keep_within_their_room(self, surfaces, draw, monkeypatch):
        monkeypatch.setattr(relit_pictures, "MOST_TEXELS", 2 * SIZE * SIZE)
        model = rectangle(0.4, 0.4)
        walls = [Surface(make_ptm(), model, world_from_model=placed((0.45 * i - 0.7, 0, 0))) for i in range(4)]
        for _ in range(PATIENCE + 2):
            found = draw(*walls)
        assert surfaces.statistics["plain"] == 2
        assert np.abs(found[:, 3:15].astype(int) - found[:, 46:58]).max() < 40
        hidden = [Surface(wall.ptm, model, world_from_model=placed((50, 0, 0))) for wall in walls[:2]]
        for _ in range(PATIENCE + 2):
            draw(*hidden, *walls[2:])
        assert surfaces.statistics == {"surfaces": 2, "plain": 2, "relit": 0}


class TestCaller:
    def test_the_state_is_left_as_it_was_and_not_relied_on(self, ctx, surfaces, screen):
        """Every path once, and once a relit picture is made, under a state that is all askew."""
        small = make_ptm(size=SIZE // 2)
        scene = [
            Surface(small, rectangle(1, 1), world_from_model=placed((-0.5, 0.5, 0))),
            Surface(make_ptm("RGB"), rectangle(1, 1), world_from_model=placed((0.5, 0.5, 0)), gloss=Gloss(0.3)),
            Surface(small, mapped_ball(12), world_from_model=placed((0, -0.5, 0), scale=0.4)),
        ]

        def frame():
            screen.clear((0.2, 0.3, 0.4, 1))
            gl("glEnable", raw.SWITCHES["SCISSOR_TEST"])
            gl("glScissor", 5, 7, 50, 40)
            before = raw.snapshot()
            with preserved_state(ctx) as state:
                viewer = Viewer.from_matrices(*filling(), state.viewport)
                surfaces.draw(state, scene, viewer, [SUN, LAMP], 0.1)
            assert raw.snapshot() == before
            gl("glDisable", raw.SWITCHES["SCISSOR_TEST"])

        texture, sampler = raw.made("Textures"), raw.made("Samplers")
        try:
            frame()
            plain = screen.color()
            for _ in range(PATIENCE):
                screen.framebuffer.use()
                raw.set_askew([texture], sampler)
                before = raw.snapshot()
                with preserved_state(ctx) as state:
                    viewer = Viewer.from_matrices(*filling(), state.viewport)
                    surfaces.draw(state, scene, viewer, [SUN, LAMP], 0.1)
                assert raw.snapshot() == before
                raw.set_plain()
            assert surfaces.statistics["relit"] == 1
            frame()
        finally:
            raw.set_plain()
            raw.deleted("Textures", texture)
            raw.deleted("Samplers", sampler)
        assert (plain[:17] == plain[0, 0]).all() and np.ptp(plain[20:50, 10:50]) > 100
        np.testing.assert_array_equal(screen.color(), plain)

    def test_a_second_context(self, context, draw):
        surface = Surface(make_ptm(), rectangle(2, 2))
        reference = draw(surface)
        other = make_context()
        try:
            theirs, picture = SurfacePass(other), Offscreen(other, SIZE, SIZE)
            picture.clear()
            with preserved_state(other) as state:
                theirs.draw(state, [surface], Viewer.from_matrices(*filling(), state.viewport), [SUN])
            found = picture.color()
            theirs.release()
            picture.release()
            assert not any(live_objects().values())
        finally:
            other.release()
            context.__enter__()
        assert np.abs(found.astype(int) - reference).max() <= 1

    @pytest.mark.parametrize(
        ("change", "words"),
        [
            ({"tiling": (1, 0)}, "expected two numbers above 0"),
            ({"world_from_model": np.eye(3)}, r"expected \(4, 4\)"),
            ({"world_from_model": np.diag([1.0, 0, 1, 1])}, "no inverse"),
            ({"ptm": "wall.ptm"}, "expected a Ptm"),
        ],
    )
    def test_what_cannot_be_drawn_is_refused(self, change, words):
        with pytest.raises(SettingsError, match=words):
            Surface(**{"ptm": make_ptm(size=4), "model": rectangle(1, 1), **change})

    @pytest.mark.parametrize("sides", [(-1, 1), (1, 0), (float("nan"), 1), (1, float("inf"))])
    def test_a_rectangle_without_area_is_refused(self, sides):
        with pytest.raises(SettingsError, match="rectangle"):
            rectangle(*sides)

    def test_refusals_that_need_the_mesh_and_the_ptm(self, draw):
        ptm = make_ptm(size=4)
        bare = Model.from_arrays([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
        with pytest.raises(SettingsError, match="no texture coordinates"):
            draw(Surface(ptm, bare))
        series = Ptm(ptm.coefficients, ptm.scale, ptm.bias, ptm.color, parameters="series")
        with pytest.raises(SettingsError, match="expected a PTM of light directions"):
            draw(Surface(series, rectangle(1, 1)))
        with pytest.raises(SettingsError, match="expected one of"):
            draw(Surface(ptm, rectangle(1, 1)), output="lid")
