"""The colormap on the GPU: the same numbers as `impostor.lighting.colormap`, and written only when it must be."""

import numpy as np
import pytest

from impostor.environment import Environment, Reflection, Room
from impostor.environment.blending import diffuse_weights, mirrored_room
from impostor.environment.colormap import environment_colormap, surface_points
from impostor.lighting import DirectionalLight, Gloss, colormap
from impostor.srgb import srgb_from_linear
from impostor.views import basis_facing, direction, rotation_about_y
from runtime.fans.colormap_pass import PLACE_DTYPE, ROW_DTYPE, ColormapPass, Surroundings, tile_origins
from runtime.fans.textures import FanTextures
from runtime.gl.state import preserved_state
from runtime.lights.light_table import LightTable
from runtime.rooms.environments import RoomTable
from runtime.viewing.cameras import Camera
from tests.solids import BLUE, RED, Box, Sphere, solid_fan

BASES = np.concatenate(
    [basis_facing(direction([0.0, 1.3, -2.4], 0.26)) @ rotation_about_y(yaw).T for yaw in (0.0, 0.7, 3.0)]
)
RANDOM = np.random.default_rng(3)
AMBIENT = (0.1, 0.2, 0.05)


def lights(count):
    toward = direction(RANDOM.uniform(-np.pi, np.pi, count), RANDOM.uniform(-1.5, 1.5, count))
    return [DirectionalLight(tuple(each), tuple(RANDOM.uniform(0, 2 / count, 3))) for each in toward]


@pytest.fixture
def colormaps(ctx, screen):
    made = ColormapPass(ctx)
    yield made
    made.release()


@pytest.fixture
def table(ctx):
    made = LightTable(ctx)
    yield made
    made.release()


def written(ctx, colormaps, table, rows, **options):
    """Entries (N, 512, 4) of the rows of a ROW_DTYPE array after they were written."""
    with preserved_state(ctx):
        colormaps.write(rows, table, **options)
    width, height = colormaps.texture.size
    texels = np.frombuffer(colormaps.texture.read(), np.float32).reshape(height, width, 4)
    tiles = [texels[y : y + 16, x : x + 32].reshape(16, 2, 16, 4) for x, y in tile_origins(rows["row"])]
    return np.stack(tiles).swapaxes(1, 2).reshape(len(rows), 512, 4)


def rows_for(bases, gloss, albedo=(1, 1, 1, 0)):
    rows = np.zeros(len(bases), ROW_DTYPE)
    rows["row"] = RANDOM.permutation(ColormapPass.ROWS)[: len(bases)]
    rows["basis"], rows["albedo"] = bases, albedo
    rows["gloss"] = gloss.strength, gloss.shininess
    return rows


@pytest.mark.parametrize("count", [0, 1, 3, 100])
@pytest.mark.parametrize("gloss", [Gloss(), Gloss(0.4, 24.0)], ids=["matt", "glossy"])
def test_the_gpu_equals_numpy(ctx, colormaps, table, count, gloss):
    lit_by = lights(count)
    table.update(lit_by, AMBIENT)
    found = written(ctx, colormaps, table, rows_for(BASES, gloss))
    expected = colormap(BASES, lit_by, AMBIENT, gloss)
    assert np.abs(found[:, :256, :3] - expected.diffuse).max() < 1e-5
    assert np.abs(found[:, 256:, :3] - expected.specular).max() < 1e-5
    assert (expected.specular.max() > 0.05) == (count > 0 and gloss.strength > 0)


def test_one_albedo_folds_everything_into_the_first_half(ctx, colormaps, table):
    """So that one texture is enough: albedo * diffuse + specular, on the sRGB curve."""
    lit_by, gloss, albedo = lights(3), Gloss(0.3, 10.0), (0.5, 0.25, 1.0)
    table.update(lit_by, AMBIENT)
    found = written(ctx, colormaps, table, rows_for(BASES, gloss, (*albedo, 1)))
    expected = colormap(BASES, lit_by, AMBIENT, gloss)
    colors = srgb_from_linear(expected.diffuse * albedo + expected.specular)
    assert np.abs(found[:, :256, :3] - colors).max() < 1e-5
    assert not found[:, 225:256].any()


def test_rows_of_either_kind_together_and_no_others(ctx, colormaps, table):
    lit_by, albedo = lights(2), (0.5, 0.25, 1.0)
    table.update(lit_by, AMBIENT)
    rows = rows_for(BASES, Gloss(0.3, 10.0), (*albedo, 0))
    rows["row"] = np.arange(len(rows)) * 7 + 3
    written(ctx, colormaps, table, rows)
    kept, rows = rows[1:2], rows[[0, *range(2, len(rows))]]
    table.update(lit_by, 0.5)
    rows["albedo"][::2, 3] = 1
    before = np.frombuffer(colormaps.texture.read(), np.float32)
    found = written(ctx, colormaps, table, rows)
    expected = colormap(rows["basis"], lit_by, 0.5, Gloss(0.3, 10.0))
    colors = srgb_from_linear(expected.diffuse * albedo + expected.specular)
    assert np.abs(found[::2, :256, :3] - colors[::2]).max() < 1e-5
    assert np.abs(found[1::2, :256, :3] - expected.diffuse[1::2]).max() < 1e-5
    assert np.abs(found[1::2, 256:, :3] - expected.specular[1::2]).max() < 1e-5
    changed = before != np.frombuffer(colormaps.texture.read(), np.float32)
    changed = changed.reshape(ColormapPass.ROWS // 2, 16, 2, 32, 4).swapaxes(1, 2).reshape(ColormapPass.ROWS, -1)
    others = np.setdiff1d(np.arange(ColormapPass.ROWS), rows["row"])
    assert kept["row"][0] in others and not changed[others].any()


def test_a_full_texture_of_rows(ctx, colormaps, table):
    table.update(lights(1), 0.0)
    bases = basis_facing(direction(np.linspace(0, 6, ColormapPass.ROWS), 0.3))
    found = written(ctx, colormaps, table, rows_for(bases, Gloss()))
    expected = colormap(bases, table._held[0], 0.0)
    assert np.abs(found[:, :256, :3] - expected.diffuse).max() < 1e-5


def test_normals_as_colours_are_the_viewers(ctx, colormaps, table):
    table.update([], 1.0)
    viewer = basis_facing(direction(0.4, 0.1))
    found = written(ctx, colormaps, table, rows_for(BASES, Gloss()), normals_for=viewer)
    facing = viewer @ BASES[4].T @ [0, 0, 1]
    np.testing.assert_allclose(found[4, 112, :3], facing / 2 + 0.5, atol=1e-6)


FAN = solid_fan(Sphere(color=RED), views=8, size=32)
PAINTED = solid_fan(Sphere(color=RED), Box((-1, -1, -1), (1, 0, 1), BLUE), views=8, size=32)


def camera(azimuth):
    made = Camera.orthographic((0, 0, 0), 4.0, azimuth, 0.0)
    return made.clip_from_view, made.view_from_world


NOISE = [Environment(f"noise {size}", 4 * RANDOM.random((6, size, size, 3), np.float32) ** 4) for size in (8, 32)]
HALL, ROTUNDA = Room.box(NOISE[0], (10, 4, 8), yaw=0.4), Room.sphere(NOISE[1], 3, (2, 0, 1), exposure=0.5)
SKY, STARS = Room.far(NOISE[1], yaw=1.0), Room.far(NOISE[0])
HALF_FLOAT = 2e-3  # what 16 bits, and a filter of 8, leave of the brightest texel


class TestSurroundings:
    @pytest.fixture
    def textures(self, ctx):
        made = FanTextures(ctx, PAINTED)
        yield made
        made.release()

    @pytest.fixture
    def rooms(self, ctx):
        made = RoomTable(ctx)
        yield made
        made.release()

    def surroundings(self, rooms, textures, among, reflection):
        """Of copies at random places, and their views, places and scales."""
        rooms.update(among)
        count = 40
        views = RANDOM.integers(0, len(PAINTED.views), count)
        centers, scales = RANDOM.uniform((-3, -1.8, -2), (3, 1.8, 2), (count, 3)), RANDOM.uniform(0.2, 1, count)
        places = np.zeros(count, PLACE_DTYPE)
        places["center"], places["scale"], places["view"] = centers, scales, views
        places["weights"][:, : len(among)] = diffuse_weights(among, centers)
        places["mirrored"][np.arange(count), mirrored_room(among, centers)] = 1
        return Surroundings(rooms, places, reflection, textures.points), views, centers, scales

    @pytest.mark.parametrize(
        "among",
        [[SKY], [HALL], [ROTUNDA, SKY], [ROTUNDA, HALL, SKY, STARS]],
        ids=["far", "box", "two", "four"],
    )
    @pytest.mark.parametrize(
        "reflection",
        [None, Reflection(), Reflection(0.9, 0.7, 4, 0.5, 1), Reflection(0.6, 0.1, 3, 0.25, 0.4)],
        ids=["matt", "lacquer", "metal", "half metal"],
    )
    @pytest.mark.parametrize("folded", [0, 1])
    def test_the_gpu_equals_numpy(self, ctx, colormaps, table, textures, rooms, among, reflection, folded):
        lit_by, gloss, albedo = lights(2), Gloss(0.3, 10.0), (0.5, 0.25, 1.0, folded)
        table.update(lit_by, AMBIENT)
        around, views, centers, scales = self.surroundings(rooms, textures, among, reflection)
        bases = PAINTED.views.basis[views]
        found = written(ctx, colormaps, table, rows_for(bases, gloss, albedo), surroundings=around)
        points = surface_points(PAINTED)[views] * scales[:, None, None]
        lit = colormap(bases, lit_by, AMBIENT, gloss)
        expected = environment_colormap(bases, centers, among, reflection, points, lit)
        bound = HALF_FLOAT * 4
        if folded:
            colors = srgb_from_linear(expected.diffuse * albedo[:3] + expected.specular)
            assert np.abs(found[:, :256, :3] - colors).max() < 12.92 * bound
            return
        assert np.abs(found[:, :256, :3] - expected.diffuse).max() < bound
        assert np.abs(found[:, 256:, :3] - expected.specular).max() < bound


class TestRelitOnlyWhenNeeded:
    """`statistics["relit"]` counts the tiles that the last draw sent through a new colormap."""

    @pytest.fixture
    def drawn(self, renderer, screen):
        def draw(azimuth=0.05, **options):
            screen.clear()
            renderer.draw(*camera(azimuth), **options)
            return renderer.statistics["relit"], screen.color()

        return draw

    @pytest.mark.parametrize("fan", [FAN, PAINTED], ids=["uniform", "painted"])
    def test_an_unchanged_scene_relights_nothing(self, renderer, drawn, fan):
        renderer.add(fan, [(-2, 0, 0), (2, 0, 0)], [0.0, 1.0])
        first, picture = drawn()
        again, same = drawn()
        assert (first, again) == (2, 0)
        np.testing.assert_array_equal(picture, same)
        assert drawn(azimuth=0.1)[0] == 0

    @pytest.mark.parametrize("fan", [FAN, PAINTED], ids=["uniform", "painted"])
    def test_every_change_of_light_is_seen(self, renderer, drawn, fan):
        renderer.add(fan)
        pictures = [drawn()[1]]
        for lit_by, ambient in (
            (lights(1), 0.25),
            (lights(2), 0.25),
            ([], 0.25),
            ([], (0.3, 0.2, 0.1)),
            ([DirectionalLight((0, 0, 1))], 0),
        ):
            renderer.lights, renderer.ambient = lit_by, ambient
            relit, picture = drawn()
            assert relit == 1
            assert np.abs(pictures[-1].astype(int) - picture).max() > 3
            pictures.append(picture)

    def test_a_light_list_changed_in_place_is_seen(self, renderer, drawn):
        renderer.add(FAN)
        renderer.lights = [DirectionalLight((0, 0, 1))]
        drawn()
        renderer.lights.append(DirectionalLight((0, 1, 0)))
        assert drawn()[0] == 1

    def test_equal_lights_made_anew_are_no_change(self, renderer, drawn):
        renderer.add(FAN)
        renderer.lights, renderer.ambient = [DirectionalLight((0, 0, 1))], np.array([0.1, 0.2, 0.3])
        drawn()
        renderer.lights, renderer.ambient = (DirectionalLight((0, 0, 2)),), (0.1, 0.2, 0.3)
        assert drawn()[0] == 0

    def test_every_change_of_the_surroundings_is_seen(self, renderer, drawn):
        renderer.lights, renderer.ambient = [], 0
        renderer.add(PAINTED, reflection=Reflection())
        dark = drawn()[1]
        for rooms in ([SKY], [Room.far(NOISE[1], yaw=2.0)], [HALL], [ROTUNDA, HALL], []):
            renderer.rooms = rooms
            relit, picture = drawn()
            assert relit == 1
            assert (np.abs(picture.astype(int) - dark).max() > 20) == bool(rooms)
            assert drawn()[0] == 0

    def test_equal_rooms_made_anew_are_no_change(self, renderer, drawn):
        renderer.add(FAN)
        renderer.rooms = [Room.far(NOISE[1], yaw=1.0)]
        drawn()
        renderer.rooms = (Room.far(NOISE[1], yaw=1.0),)
        assert drawn()[0] == 0

    def test_copies_share_a_tile_where_the_light_is_the_same(self, renderer, drawn):
        renderer.add(FAN, [(-2, 0, 0), (2, 0, 0), (2.001, 0, 0)], reflection=Reflection())
        for rooms, tiles in (([], 1), ([SKY], 1), ([HALL], 2), ([SKY, STARS], 1), ([ROTUNDA, SKY], 2)):
            renderer.rooms = rooms
            assert drawn()[0] == tiles

    def test_a_copy_that_moves_in_a_room_is_lit_anew(self, renderer, drawn):
        copies = renderer.add(FAN, reflection=Reflection())
        renderer.rooms = [HALL]
        drawn()
        copies.positions[:, 0] = 1
        assert drawn()[0] == 1

    def test_a_copy_with_another_reflection_has_a_tile_of_its_own(self, renderer, drawn):
        renderer.rooms = [SKY]
        renderer.add(FAN, (-2, 0, 0))
        renderer.add(FAN, (2, 0, 0), reflection=Reflection())
        renderer.add(FAN, (0, 2, 0), reflection=Reflection())
        assert drawn()[0] == 2

    def test_albedo_and_normals_have_no_surroundings(self, renderer, drawn):
        renderer.add(PAINTED, reflection=Reflection())
        plain = [drawn(output=output)[1] for output in ("albedo", "normal")]
        renderer.rooms = [HALL]
        for output, expected in zip(("albedo", "normal"), plain, strict=True):
            np.testing.assert_array_equal(drawn(output=output)[1], expected)

    def test_a_turn_and_another_view_are_seen(self, renderer, drawn):
        copies = renderer.add(FAN, [(-2, 0, 0), (2, 0, 0)])
        assert drawn()[0] == 1
        copies.yaws[1] = 0.01
        assert drawn()[0] == 1
        assert drawn(azimuth=np.pi / 4)[0] == 2
        # Both views are still in the cache.
        assert drawn()[0] == 0

    def test_moving_shrinking_and_hiding_relight_nothing(self, renderer, drawn):
        copies = renderer.add(FAN, [(-2, 0, 0), (2, 0, 0)])
        drawn()
        copies.positions[:, 1] = 1
        copies.scales[0] = 0.9
        copies.visible[1] = False
        assert drawn()[0] == 0
        assert renderer.statistics["instances"] == 1

    def test_a_copy_with_another_gloss_has_a_tile_of_its_own(self, renderer, drawn):
        renderer.add(FAN, (-2, 0, 0))
        renderer.add(FAN, (2, 0, 0), gloss=Gloss(0.5))
        renderer.add(FAN, (0, 2, 0), gloss=Gloss(0.5))
        assert drawn()[0] == 2

    def test_going_to_another_output_and_back(self, renderer, drawn):
        renderer.add(FAN)
        _, lit = drawn()
        for output in ("albedo", "normal"):
            assert np.abs(drawn(output=output)[1].astype(int) - lit).max() > 20
            np.testing.assert_array_equal(drawn()[1], lit)

    def test_normals_turn_with_the_viewer(self, renderer, drawn):
        """The same fan view, seen a little from the side: its normals lean."""
        renderer.add(FAN)
        _, front = drawn(azimuth=0.0, output="normal")
        _, side = drawn(azimuth=0.3, output="normal")
        front, side = (picture[29:35, 29:35, :3].mean(axis=(0, 1)) / 127.5 - 1 for picture in (front, side))
        np.testing.assert_allclose(front[:2], 0, atol=0.02)
        np.testing.assert_allclose(side, rotation_about_y(-0.3) @ front, atol=0.02)
