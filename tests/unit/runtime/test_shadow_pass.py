"""Shadows on the ground: strips of fans as NumPy projects them, meshes, and how much light each takes away."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, binary_erosion, label
from skimage.draw import polygon

from impostor.lighting import DirectionalLight
from impostor.shadow_projection import FEET, Ground, Quad, shadow_on_ground
from impostor.srgb import srgb_from_linear
from impostor.strips import silhouette_strips
from impostor.views import direction
from runtime import Instances
from runtime.gl.draw_calls import counted_draw_calls
from runtime.gl.offscreen import Offscreen
from runtime.ground.ground_pass import GroundSurface
from runtime.instances.quads import nearest_views, quads_toward
from runtime.shadows.strips import CastingFan
from runtime.viewing.viewer import Viewer
from tests.pictures import apart, bluish, filling, greenish, iou, looking, placed
from tests.solids import BLUE, GREEN, Box, Sphere, solid_fan, solid_model

SIZE = 128
LEVEL = Ground((0, 1, 0), 0.0)
SLOPE = Ground((0.15, 1, -0.1), -0.2)
WHITE = GroundSurface(albedo=(1, 1, 1), reach=1e4)
# A ring on a stem, a ball beside it: holes, parts at different depths, feet on the ground.
SOLIDS = (
    Box((-0.25, 0, -0.25), (0.25, 0.6, 0.25)),
    Box((-0.9, 0.5, -0.25), (0.9, 0.9, 0.25)),
    Box((-0.9, 1.7, -0.25), (0.9, 2.1, 0.25)),
    Box((-0.9, 0.8, -0.25), (-0.5, 1.8, 0.25)),
    Box((0.5, 0.8, -0.25), (0.9, 1.8, 0.25)),
    Sphere((0.8, 0.4, 0.9), 0.4),
)
RING = {"views": 16, "elevation_deg": 15.0, "size": 64}
FAN = solid_fan(*SOLIDS, **RING)
HIGH = {"views": 16, "elevation_deg": 60.0, "size": 64}
VIEWERS = {
    "orthographic": filling(2.4, 0.3, 0.5, (0.8, 0.5, -0.6)),
    "perspective": looking((2, 4, 6), (0.8, 0.4, -0.6), 40),
    "low": looking((-3, 1.4, 5), (0.6, 0.5, 0), 40),
}


@pytest.fixture
def screen(ctx):
    screen = Offscreen(ctx, SIZE, SIZE)
    yield screen
    screen.release()


@pytest.fixture
def ground(renderer, screen):
    """The ground with its shadows, (SIZE, SIZE, 4) uint8, and without."""

    def drawn(matrices, lights, plane=LEVEL, ambient=0.0, surface=WHITE):
        renderer.lights, renderer.ambient = lights, ambient
        screen.clear((0, 0, 0, 1))
        renderer.draw_ground(*matrices, plane, surface)
        bare = screen.color()
        renderer.draw_shadows(*matrices, plane)
        return screen.color(), bare

    return drawn


def shadowed(pictures, part=0.5):
    """Where more than this part of the ground's light is gone."""
    lit, bare = (picture[..., :3].max(axis=-1).astype(float) for picture in pictures)
    return (bare > 0) & (lit < (1 - part) ** (1 / 2.2) * bare)


def light_at(azimuth_deg, elevation_deg, color=(1, 1, 1)):
    return DirectionalLight.from_angles(azimuth_deg, elevation_deg, color)


def marked(renderer):
    """Which corners of pixels the first light's shadow holds, (SIZE + 1, SIZE + 1) bool."""
    marks = renderer._shadows._marks[None].texture
    pixels = np.frombuffer(marks.read(alignment=1), np.uint8)
    return pixels.reshape(SIZE + 1, SIZE + 1, marks.components)[::-1, :, 0] > 0


def on_pixels(corners):
    """Pixels all of whose corners are in the mask."""
    return corners[1:, 1:] & corners[1:, :-1] & corners[:-1, 1:] & corners[:-1, :-1]


def expected_mask(fan, place, matrices, light, plane):
    """The strips' triangles, projected by NumPy and filled corner of pixel by corner: (SIZE + 1, SIZE + 1) bool."""
    instances = Instances(fan, *place)
    eye = Viewer.from_matrices(*matrices, (0, 0, SIZE, SIZE)).eye
    quad = quads_toward(instances, eye)
    light_view = int(nearest_views(instances, np.append(light.toward, 0), np.array([0]))[0])
    strips = silhouette_strips(fan.silhouette[light_view])
    shadow = shadow_on_ground(
        strips,
        fan.views[light_view],
        fan.depth[light_view],
        fan.views[int(quad.view[0])],
        Quad(quad.center[0], quad.right[0], quad.up[0]),
        world_from_model=placed(*place),
        toward_light=light.toward,
        eye=eye,
        ground=plane,
        feet=FEET * place[2] * np.ptp(fan.bounds[:, 1]),
    )
    clip = shadow @ (matrices[0] @ matrices[1]).T
    pixels = (clip[:, :2] / clip[:, 3:] * (1, -1) + 1) / 2 * SIZE
    mask = np.zeros((SIZE + 1, SIZE + 1), bool)
    for corners in pixels[strips.triangles()]:
        mask[polygon(corners[:, 1], corners[:, 0], mask.shape)] = True
    return mask


def shadows_of_fan_and_mesh(renderer, ground, matrices, light):
    """Where the same object casts its shadow as a fan, and where as a mesh."""
    fan = renderer.add(FAN)
    strip = shadowed(ground(matrices, [light]))
    renderer.remove(fan)
    renderer.add_mesh(solid_model(*SOLIDS))
    return strip, shadowed(ground(matrices, [light]))


class TestShape:
    @pytest.mark.parametrize("viewer", VIEWERS)
    @pytest.mark.parametrize("plane", [LEVEL, SLOPE], ids=["level", "slope"])
    @pytest.mark.parametrize("place", [((0, 0, 0), 0.0, 1.0), ((0.4, 0.2, -0.5), 2.0, 0.7)], ids=["plain", "placed"])
    @pytest.mark.parametrize("options", [{}, {"distance": 5.0}, {"slopes": (0.2, 0.3, -0.2)}], ids=str)
    def test_the_gpu_projects_strips_as_numpy_does(self, renderer, ground, viewer, plane, place, options):
        fan, light = solid_fan(*SOLIDS, **RING, **options), light_at(-50, 35)
        renderer.add(fan, *place)
        expected = expected_mask(fan, place, VIEWERS[viewer], light, plane)
        pictures = ground(VIEWERS[viewer], [light], plane)
        visible = pictures[1][..., 0] > 0  # up to the horizon
        visible[:, -1] = False  # of what lies beyond the picture no corner is known
        under_horizon = np.pad(visible, ((1, 0), (0, 1)))  # corners, where the pixel above shows the ground
        found, expected = marked(renderer) & under_horizon, expected & under_horizon
        assert expected.sum() > 50
        # What lies on a triangle's edge may fall on either side.
        assert iou(found, expected) > (0.99 if expected.sum() > 2000 else 0.95)
        inside, touched = on_pixels(found) & visible, ~on_pixels(~found)
        assert not (shadowed(pictures) & visible & ~touched).any()
        assert not (inside & ~shadowed(pictures)).any()

    @pytest.mark.parametrize("matrices", [filling(1.2, 0.1, 0.5, (0.5, 0, -0.2)), looking((1, 2, 4), (1, 0, -0.5), 30)])
    def test_a_picture_full_of_shadow(self, renderer, ground, matrices):
        place, light = ((0, 0, 0), 0.3, 1.0), light_at(-60, 30)
        renderer.add(FAN, *place)
        ground(matrices, [light])
        expected = expected_mask(FAN, place, matrices, light, LEVEL)
        assert expected.sum() > 1500
        assert iou(marked(renderer), expected) > 0.99

    @pytest.mark.parametrize("view", [0, 3, 10])
    def test_it_is_the_meshs_shadow_when_the_light_is_a_views_own(self, renderer, ground, view):
        """Seen from a fan camera, too; a strip's outline lies half a texel inside."""
        azimuth = view * 360 / 16
        matrices = filling(3.0, np.radians(azimuth + 67.5), np.radians(15), (0, 0.3, 0))
        light = light_at(azimuth, 15)
        strip, mesh = shadows_of_fan_and_mesh(renderer, ground, matrices, light)
        assert mesh.sum() > 300
        assert iou(strip, mesh) > 0.9

    @pytest.mark.parametrize("light", [light_at(60, 40), light_at(-160, 25)])
    @pytest.mark.parametrize(
        ("elevation_deg", "distance", "floor"), [(15, 8, 0.82), (15, 40, 0.9), (5, 20, 0.75), (40, 12, 0.8)]
    )
    def test_it_is_the_meshs_shadow_for_a_viewer_who_is_no_fan_camera(
        self, renderer, ground, elevation_deg, distance, light, floor
    ):
        """From near, from below and from above; the paper's steps 3 to 5 for the whole shadow come to 0.1 to 0.7."""
        eye = (0, 0.8, 0) + distance * direction(0.7, np.radians(elevation_deg))
        matrices = looking(eye, (0, 0.8, 0), fov_deg=np.degrees(2 * np.arctan(4 / distance)))
        strip, mesh = shadows_of_fan_and_mesh(renderer, ground, matrices, light)
        assert mesh.sum() > 100
        assert iou(strip, mesh) > floor

    def test_an_object_of_no_height_is_all_feet(self, renderer, ground):
        low, high = FAN.bounds
        flat = replace(FAN, bounds=np.array([[*low[:1], 0, *low[2:]], [*high[:1], 0, *high[2:]]]))
        renderer.add(flat)
        assert CastingFan.of(Instances(flat), Viewer.from_matrices(*filling(), (0, 0, 64, 64)), LEVEL).feet > 0
        assert shadowed(ground(VIEWERS["perspective"], [light_at(-50, 35)])).sum() > 100

    @pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
    def test_a_copy_that_is_a_mesh_casts_where_its_mesh_does(self, renderer, ground, share):
        matrices, light = looking((4, 4, 7), (0, 0.5, 0), 45), light_at(60, 40)
        mesh = renderer.add_mesh(solid_model(*SOLIDS))
        expected = shadowed(ground(matrices, [light]))
        renderer.remove(mesh)
        model = solid_model(*SOLIDS)
        renderer.add(replace(FAN, bounds=model.bounds.astype(float)), model=model)
        renderer._placed.batches[0].levels.fan_share[:] = share
        found = iou(shadowed(ground(matrices, [light])), expected)
        assert found > (0.9 if share == 0 else 0.7)

    def test_a_mesh_shadow_is_the_mesh_pressed_along_the_light(self, renderer, ground):
        """A unit cube under light from +X at 45 degrees: the map is the square and its copy one metre toward -X."""
        pixel = 4 / SIZE
        shift = pixel / 4  # edges within pixels, half of which is then in the shadow
        renderer.add_mesh(solid_model(Box((-0.5, 0, -0.5), (0.5, 1, 0.5))), placed((0.25 + shift, 0, shift)))
        found = shadowed(ground(filling(2.0, 0.0, np.pi / 2), [light_at(90, 45)]), 0.2)
        x = (np.arange(SIZE) + 0.5) / SIZE * 4 - 2 - shift
        expected = (np.abs(x) < 0.5 + pixel / 2)[:, None] & ((x > -1.25 - pixel / 2) & (x < 0.75 + pixel / 2))[None, :]
        assert iou(found, expected) > 0.98

    @pytest.mark.parametrize("height", [0.0, 2.0])
    def test_an_object_off_the_ground_casts_away_from_under_it(self, renderer, ground, height):
        renderer.add_mesh(solid_model(Sphere((0, 0.5, 0), 0.5)), placed((1, height, 0)))
        found = shadowed(ground(filling(3.0, 0.0, np.pi / 2), [light_at(90, 45)]))
        _, columns = np.nonzero(found)
        assert (columns.mean() + 0.5) / SIZE * 6 - 3 == pytest.approx(0.5 - height, abs=0.05)

    @pytest.mark.parametrize("sink", [0.4, 0.8])
    def test_what_is_buried_casts_no_shadow(self, renderer, ground, sink):
        """A post in the ground shades as far as what stands out of it; what is right under it is not seen."""
        fan = solid_fan(Box((-0.2, 0, -0.2), (0.2, 1, 0.2)), views=16, elevation_deg=30, size=64)
        renderer.add(fan, (0, -sink, 0))
        found = shadowed(ground(filling(2.0, 0.0, np.radians(30)), [light_at(90, 30)]))
        _, columns = np.nonzero(found)
        left, right = (np.array([columns.min(), columns.max() + 1]) / SIZE * 4 - 2).tolist()
        assert left == pytest.approx(-0.2 - (1 - sink) / np.tan(np.radians(30)), abs=0.08)
        assert -0.2 < right < 0.2 + 0.08

    def test_far_from_the_origin(self, renderer, ground):
        fan, light = renderer.add(FAN), light_at(-50, 35)
        ground(VIEWERS["orthographic"], [light])
        expected = marked(renderer)
        renderer.remove(fan)
        renderer.add(FAN, (1000, 0, -1000))
        ground(filling(2.4, 0.3, 0.5, (1000.8, 0.5, -1000.6)), [light])
        assert iou(marked(renderer), expected) > 0.97

    def test_copies_of_a_mesh_are_one_draw_call(self, renderer, ground):
        """As many shadows as copies, each where its copy stands."""
        model, matrices = solid_model(Box((-0.1, 0, -0.1), (0.1, 0.4, 0.1))), filling(2.0, 0.0, np.pi / 2)
        for x in (-1.5, -0.5, 0.5, 1.5):
            renderer.add_mesh(model, placed((x, 0, 0.3 * x), x))
        with counted_draw_calls() as calls:
            found = shadowed(ground(matrices, [light_at(0, 45)]))
        assert label(binary_erosion(found))[1] == 4
        assert calls.count == 3  # the ground, the marks, the darkening

    @pytest.mark.parametrize("view", [0, 0.5])
    def test_a_solid_has_a_shadow_without_cracks(self, renderer, ground, view):
        renderer.add(solid_fan(Sphere((0, 1, 0)), **RING))
        light = light_at(view * 22.5, 40)
        for azimuth in (1.0, 2.0, 4.0):
            ground(filling(3.0, azimuth, 0.5), [light])
            assert label(~marked(renderer))[1] == 1

    def test_shadows_reach_past_the_picture_in_a_grazing_light(self, renderer, ground):
        """Thirty metres of shadow, and no triangle wraps around the eye."""
        renderer.add(FAN)
        found = shadowed(ground(looking((0, 1.7, 6), (0, 1, 0), 60, near=0.05, far=1000), [light_at(0, 3)]))
        assert found.any()
        assert not found[:40].any()


class TestLight:
    MATRICES = filling(2.5, 0.3, 0.9, (0, 0.3, 0))

    @pytest.mark.parametrize("ambient", [0.0, 0.2, 0.6])
    @pytest.mark.parametrize("albedo", [0.3, 1.0])
    def test_the_shadow_is_the_ground_without_that_light(self, renderer, screen, ground, ambient, albedo):
        light, surface = light_at(-50, 35, (0.5, 0.5, 0.5)), GroundSurface(albedo=(albedo,) * 3, reach=1e4)
        renderer.add(solid_fan(Sphere((0, 1, 0)), **RING))
        pictures = ground(self.MATRICES, [light], LEVEL, ambient, surface)
        inside = binary_erosion(shadowed(ground(self.MATRICES, [light])), np.ones((5, 5)))
        assert inside.sum() > 100
        expected = srgb_from_linear(albedo * ambient) * 255
        assert np.abs(pictures[0][inside][:, :3] - expected).max() < 8

    def test_overlapping_shadows_darken_once(self, renderer, ground):
        """Strips of one fan at different depths, of two fans, and of a fan and a mesh."""
        light, ambient = light_at(-50, 35, (0.8, 0.8, 0.8)), 0.2
        renderer.add(FAN, [(0, 0, 0), (0.3, 0, 0.2)], [0.0, 1.0])
        renderer.add_mesh(solid_model(*SOLIDS), placed((0.2, 0, 0.1)))
        shaded, bare = ground(self.MATRICES, [light], LEVEL, ambient)
        inside = binary_erosion(shaded[..., 0] < bare[..., 0] - 60, iterations=2)
        assert inside.sum() > 400
        assert np.ptp(shaded[inside][:, 0]) <= 1
        assert shaded[..., 0].min() == shaded[inside][:, 0].min()

    def test_each_light_takes_away_its_own_part(self, renderer, ground):
        """Red from one side, blue from the other: red shadow, blue shadow, and both where they cross."""
        ball = solid_fan(Sphere((0, 0.8, 0), 0.6), **HIGH)
        renderer.add(ball)
        red, blue = light_at(60, 50, (0.6, 0, 0)), light_at(-60, 50, (0, 0, 0.6))
        top, sun = filling(2.5, 0.0, np.radians(60)), np.sin(np.radians(50))
        shaded, bare = (picture.astype(int) for picture in ground(top, [red, blue], LEVEL, 0.2))
        no_red, no_blue = (apart(shaded[..., [c]], bare[..., [c]]) > 30 for c in (0, 2))
        assert no_red.sum() > 100 < no_blue.sum()
        assert (shaded[..., 1] == bare[..., 1]).all()
        both, one = no_red & no_blue, binary_erosion(no_red & ~no_blue, iterations=2)
        assert both.any()
        np.testing.assert_allclose(shaded[one][:, 2], bare[0, 0, 2], atol=1)
        dark, light = srgb_from_linear(np.array([0.2, 0.2 + 0.6 * sun])) * 255
        np.testing.assert_allclose(shaded[one][:, 0], dark, atol=5)
        np.testing.assert_allclose(bare[0, 0, [0, 2]], light, atol=1)

    @pytest.mark.parametrize("count", [4, 5, 9])
    def test_many_lights_each_cast(self, renderer, ground, count):
        """A ring of equal lights around a post: as many shadows, each with its share of the light gone."""
        post = solid_fan(Box((-0.15, 0, -0.15), (0.15, 1, 0.15)), **HIGH)
        renderer.add(post)
        elevation = np.radians(60)
        lights = [light_at(360 * index / count, 45, (0.9 / count,) * 3) for index in range(count)]
        shaded, bare = (
            picture[..., 0].astype(int) for picture in ground(filling(2.0, 0.0, elevation), lights, LEVEL, 0.1)
        )
        sun = 0.9 * np.sin(np.radians(45))
        expected = srgb_from_linear(0.1 + sun * (count - 1) / count) * 255
        angles = np.radians(360 * np.arange(count) / count) + np.pi
        for angle in angles:
            x, y = np.sin(angle) * 0.75, np.cos(angle) * 0.75 * np.sin(elevation)
            row, column = int((y / 2 + 1) / 2 * SIZE), int((x / 2 + 1) / 2 * SIZE)
            assert shaded[row, column] == pytest.approx(expected, abs=4)
            assert shaded[row, column] < bare[row, column]

    def test_where_all_shadows_meet_only_ambient_light_is_left(self, renderer, ground):
        """Six lights, more than one pass marks at once, all hidden by a roof."""
        renderer.add_mesh(solid_model(Box((-3, 1, -3), (3, 1.1, 3))))
        lights = [light_at(60 * index, 60, (0.15, 0.15, 0.15)) for index in range(6)]
        shaded, _ = ground(looking((0, 0.9, 0.01), (0, 0, 0), 60), lights, LEVEL, 0.1)
        np.testing.assert_allclose(shaded[64, 64, :3], srgb_from_linear(0.1) * 255, atol=8)

    @pytest.mark.parametrize("lights", [[], [light_at(30, -20)], [light_at(30, 0)], [light_at(30, 40, (0, 0, 0))]])
    def test_no_light_that_reaches_the_ground_no_shadow(self, renderer, ground, lights):
        renderer.add(FAN)
        renderer.add_mesh(solid_model(*SOLIDS))
        shaded, bare = ground(self.MATRICES, lights, LEVEL, 0.5)
        np.testing.assert_array_equal(shaded, bare)

    @pytest.mark.parametrize("matrices", [filling(2.5, 0.3, -0.5), looking((2, -1, 5)), filling(2.5, 0.3, 0.0)])
    def test_from_under_the_ground_no_shadow_is_seen(self, renderer, ground, matrices):
        renderer.add(FAN)
        shaded, bare = ground(matrices, [light_at(30, 40)])
        np.testing.assert_array_equal(shaded, bare)

    def test_hidden_copies_and_nothing_cast_nothing(self, renderer, ground):
        shaded, bare = ground(self.MATRICES, [light_at(30, 40)])
        np.testing.assert_array_equal(shaded, bare)
        renderer.add(FAN).visible[:] = False
        renderer.add(FAN, np.zeros((0, 3)))
        shaded, bare = ground(self.MATRICES, [light_at(30, 40)])
        np.testing.assert_array_equal(shaded, bare)

    def test_the_alpha_of_the_picture_is_left_alone(self, renderer, ground):
        renderer.add(FAN)
        shaded, _ = ground(self.MATRICES, [light_at(30, 40)])
        assert (shaded[..., 3] == 255).all()


class TestInTheScene:
    @pytest.mark.parametrize("turn", [0.0, 0.5, 0.9])
    @pytest.mark.parametrize("rise_deg", [0, 5, 15])
    @pytest.mark.parametrize("sun_deg", [-70, 110])
    def test_the_shadow_meets_the_feet(self, renderer, screen, ground, turn, rise_deg, sun_deg):
        """A post seen from between two fan cameras and above them: post and shadow are in one piece."""
        post = solid_fan(Box((-0.12, 0, -0.12), (0.12, 1.2, 0.12), GREEN), **RING)
        renderer.add(post)
        azimuth, elevation = turn * 2 * np.pi / 16, np.radians(15 + rise_deg)
        for matrices in (
            filling(1.6, azimuth, elevation, (0, 0.4, 0)),
            looking(9 * direction(azimuth, elevation), (0, 0.4, 0), 20),
        ):
            shadow = shadowed(ground(matrices, [light_at(sun_deg, 40)]), 0.3)
            renderer.draw(*matrices, output="albedo")
            body = greenish(screen.color())
            assert label(shadow)[1] == 1
            assert label(body | shadow, np.ones((3, 3)))[1] == 1
            contact = binary_dilation(body, np.ones((3, 3))) & shadow
            rows, _ = np.nonzero(body)
            assert contact.sum() >= 5
            assert np.nonzero(contact)[0].max() > rows.max() - 12

    def test_what_stands_before_a_shadow_hides_it(self, renderer, screen):
        matrices = VIEWERS["perspective"]
        renderer.lights, renderer.ambient = [light_at(-20, 35)], 0.1
        renderer.add(FAN, (0, 0, 0))
        wall = renderer.add_mesh(solid_model(Box((-1, 0, 1.5), (1.5, 1.0, 1.6), BLUE)))

        def picture(with_shadows):
            screen.clear((0, 0, 0, 1))
            renderer.draw_ground(*matrices, LEVEL, WHITE)
            renderer.draw_meshes(*matrices, output="albedo")
            if with_shadows:
                renderer.draw_shadows(*matrices, LEVEL)
            return screen.color()

        before, after = picture(False), picture(True)
        # Where it touches the ground it is as deep as the ground.
        hidden = binary_erosion(bluish(before), iterations=3)
        assert hidden.sum() > 300
        np.testing.assert_array_equal(after[hidden], before[hidden])
        renderer.remove(wall)
        assert (apart(picture(True), picture(False))[hidden] > 60).sum() > 50

    def test_depth_is_not_written(self, renderer, screen, ground):
        renderer.add(FAN)
        ground(VIEWERS["perspective"], [light_at(-50, 35)])
        shaded = screen.depth()
        renderer.remove(renderer._placed.batches[0].instances)
        ground(VIEWERS["perspective"], [light_at(-50, 35)])
        np.testing.assert_array_equal(screen.depth(), shaded)

    def test_a_shadow_has_no_holes_whatever_the_depth_buffers_range(self, renderer, ground):
        """The ground's own depth never comes before the darkening of it."""
        renderer.add(solid_fan(Sphere((0, 1, 0)), **RING), scales=3)
        for near, far in ((0.01, 1e4), (1, 50)):
            for elevation in (0.05, 0.3, 1.0):
                matrices = looking(20 * direction(0.2, elevation), (0, 0, 0), 40, near, far)
                found = shadowed(ground(matrices, [light_at(120, 50)]))
                assert found.sum() > 20
                assert label(~found)[1] == 1

    def test_in_a_viewport_inside_a_larger_framebuffer(self, ctx, renderer, ground):
        renderer.add(FAN)
        matrices = VIEWERS["perspective"]
        expected, _ = ground(matrices, [light_at(-50, 35)])
        wide = Offscreen(ctx, 200, 150)
        wide.clear((0, 0, 0, 1))
        wide.framebuffer.viewport = (61, 9, SIZE, SIZE)
        renderer.draw_ground(*matrices, LEVEL, WHITE)
        renderer.draw_shadows(*matrices, LEVEL)
        pixels = wide.color()
        wide.release()
        np.testing.assert_array_equal(pixels[150 - 9 - SIZE : 150 - 9, 61 : 61 + SIZE], expected)

    def test_a_forest_is_the_shadows_of_its_trees(self, renderer, ground):
        """Copies that share a view of the light, and copies that do not, in one call and one by one."""
        random = np.random.default_rng(4)
        positions, yaws = random.uniform(-2, 2, (12, 3)) * (1, 0, 1), np.repeat([0.0, 1.0, 2.5], 4)
        light, matrices = light_at(-50, 50), filling(4.0, 0.3, 0.8)
        renderer.add(FAN, positions, yaws, 0.6)
        together = shadowed(ground(matrices, [light]))
        renderer.remove(renderer._placed.batches[0].instances)
        alone = np.zeros_like(together)
        for position, yaw in zip(positions, yaws, strict=True):
            tree = renderer.add(FAN, position, yaw, 0.6)
            alone |= shadowed(ground(matrices, [light]))
            renderer.remove(tree)
        assert iou(together, alone) > 0.95


class TestOnAGroundThatFades:
    """Shadows go with the ground: they darken no sky."""

    SURFACE = GroundSurface(albedo=(1, 1, 1), reach=8.0, background=(0.5, 0.6, 0.9, 1.0))
    MATRICES = looking((0, 6, 10), (0, 0, 0), 90)

    @pytest.fixture
    def faded(self, renderer, screen):
        """Pictures with shadows that fade, with shadows that do not, and without."""

        def drawn(lights, ambient=0.1, matrices=self.MATRICES, plane=LEVEL, surface=self.SURFACE):
            renderer.lights, renderer.ambient = lights, ambient
            pictures = []
            for draw in (
                lambda: renderer.draw_shadows(*matrices, plane, surface),
                lambda: renderer.draw_shadows(*matrices, plane),
                lambda: None,
            ):
                screen.clear((0.5, 0.6, 0.9, 1))
                renderer.draw_ground(*matrices, plane, surface)
                draw()
                pictures.append(screen.color()[..., :3].astype(int))
            return pictures

        return drawn

    @pytest.mark.parametrize("count", [1, 6])
    def test_where_the_ground_is_gone_so_is_its_shadow(self, renderer, faded, count):
        """A roof over everything."""
        renderer.add_mesh(solid_model(Box((-40, 20, -40), (40, 20.1, 40))))
        fading, whole, bare = faded([light_at(60 * index, 75, (0.8 / count,) * 3) for index in range(count)])
        far = 40, 2
        np.testing.assert_array_equal(fading[far], bare[far])
        assert apart(whole, bare)[far] > 40
        # Below the middle of the picture the ground is whole.
        middle = SIZE // 2, SIZE // 2
        np.testing.assert_array_equal(fading[middle], whole[middle])
        assert apart(fading, bare)[middle] > 60

    def test_between_they_fade_evenly(self, renderer, faded):
        renderer.add_mesh(solid_model(Box((-40, 20, -40), (40, 20.1, 40))))
        fading, _, bare = faded([light_at(0, 80, (0.8, 0.8, 0.8))])
        row = apart(fading, bare)[SIZE // 2, SIZE // 2 :]
        assert (np.diff(row) <= 1).all()
        assert len(np.unique(row)) > 10

    def test_around_another_middle_on_a_slope(self, renderer, faded):
        renderer.add_mesh(solid_model(Box((-40, 20, -40), (40, 20.1, 40))))
        surface = GroundSurface(albedo=(1, 1, 1), reach=4.0, middle=(2, 0, 1), background=(0.5, 0.6, 0.9, 1.0))
        fading, _, bare = faded([light_at(0, 80)], plane=SLOPE, surface=surface)
        shade, ground = apart(fading, bare) > 30, apart(bare, bare[0, 0]) > 5
        assert shade.sum() > 100
        assert not (shade & ~ground).any()


class TestFrameByFrame:
    """What lasts from one frame to the next never shows in the picture."""

    MATRICES = filling(2.4, 0.3, 0.5, (0.8, 0.5, -0.6))

    def test_a_still_frame_is_drawn_like_the_first(self, renderer, ground):
        renderer.add(FAN)
        first, _ = ground(self.MATRICES, [light_at(-50, 35)])
        again, bare = ground(self.MATRICES, [light_at(-50, 35)])
        np.testing.assert_array_equal(first, again)
        assert (again != bare).any()

    @pytest.mark.parametrize(
        "change", ["position", "yaw", "scale", "hidden", "light", "plane", "mesh", "viewer", "strength"]
    )
    def test_every_change_shows(self, renderer, ground, change):
        """The frame after it is the one that a new renderer, which has nothing kept, would draw."""
        trees, mesh = (
            renderer.add(FAN, [(0, 0, 0), (1, 0, 0)]),
            renderer.add_mesh(solid_model(Sphere((-1, 0.5, 0), 0.4))),
        )
        scene = {"matrices": self.MATRICES, "lights": [light_at(-50, 35)], "plane": LEVEL}
        before, _ = ground(**scene)
        if change == "position":
            trees.positions[0, 2] += 0.5
        elif change == "yaw":
            trees.yaws[1] += 0.7
        elif change == "scale":
            trees.scales[0] *= 0.5
        elif change == "hidden":
            trees.visible[0] = False
        elif change == "mesh":
            mesh.world_from_model[1, 3] += 0.4
        elif change == "plane":
            scene["plane"] = Ground((0, 1, 0), -0.3)
        elif change == "viewer":
            scene["matrices"] = filling(2.4, 0.4, 0.5, (0.8, 0.5, -0.6))
        elif change == "strength":
            scene["lights"] = [light_at(-50, 35, (0.2, 0.2, 0.2))]
            scene["ambient"] = 0.5
        else:
            scene["lights"] = [light_at(-20, 35)]
        after, _ = ground(**scene)
        renderer._shadows.mark_anew()
        fresh, _ = ground(**scene)
        assert (after != before).any()
        np.testing.assert_array_equal(after, fresh)


class TestSmallOnTheScreen:
    @pytest.mark.parametrize(("half", "part"), [(5.0, 0.05), (10.0, 0.12), (20.0, 0.15)])
    def test_strips_of_coarser_silhouettes_cast_the_same_shadow(self, renderer, ground, half, part, monkeypatch):
        """Objects 30, 15 and 8 pixels high; most of what differs is a part of a pixel at the outline."""
        fan = solid_fan(*SOLIDS, views=16, elevation_deg=15, size=256)
        renderer.add(fan, [(x, 0, z) for x in (-4, 0, 4) for z in (-4, 0, 4)])
        scene = filling(half, 0.3, 0.6), [light_at(-50, 45)]
        coarse, bare = (picture[..., 0].astype(float) for picture in ground(*scene))
        levels = {level for _, _, level in renderer._shadows._mark_pass._strips._held}
        monkeypatch.setattr("runtime.shadows.strips.LARGEST_TEXEL", 1e-6)
        renderer._shadows.mark_anew()
        fine = ground(*scene)[0][..., 0].astype(float)
        assert levels and 0 not in levels
        shade = (bare - fine).sum()
        assert (bare - coarse).sum() == pytest.approx(shade, rel=part)
        assert np.abs(fine - coarse).sum() < 0.27 * shade
