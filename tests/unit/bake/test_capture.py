"""One geometry pass, all layers: probed at 64 x 64 on shapes whose pixels are known."""

import subprocess
import sys
from typing import Any

import moderngl
import numpy as np
import pytest

from bake import capture
from bake.capture import Capture, default_samples
from bake.resolve import resolve
from benchmarks.raw_pass import RawPass
from impostor.errors import GpuError, SettingsError
from impostor.model import Material, Model, Primitive
from impostor.views import View, basis_facing, direction, frame
from tests.data import ROOT

SIZE = 64
GREY = Material(base_color=(0.5, 0.5, 0.5, 1.0), double_sided=False)


def front(radius=1.0, depth_range=(-1.0, 1.0), distance=np.inf):
    return View(np.eye(3), np.zeros(3), radius, depth_range, distance)


def quad(left, bottom, right, top, z=0.0, material=GREY, colors=None, normal=(0, 0, 1), z_right=None):
    z_right = z if z_right is None else z_right
    corners = [[left, bottom, z], [right, bottom, z_right], [right, top, z_right], [left, top, z]]
    return Primitive(
        np.array(corners, np.float32),
        np.tile(np.float32(normal), (4, 1)),
        np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32),
        None if colors is None else np.broadcast_to(np.uint8(colors), (4, 4)),
        np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
        material,
    )


def sphere(center, radius=1.0, material=GREY, count=96):
    elevation, azimuth = np.meshgrid(np.linspace(-np.pi / 2, np.pi / 2, count), np.linspace(0, 2 * np.pi, 2 * count))
    normals = direction(azimuth, elevation).reshape(-1, 3)
    corner = np.arange((2 * count - 1) * count).reshape(-1, count)[:, :-1].ravel()
    first = np.stack([corner, corner + count, corner + count + 1], axis=-1)
    second = np.stack([corner, corner + count + 1, corner + 1], axis=-1)
    uvs = np.stack([azimuth / (2 * np.pi), 0.5 - elevation / np.pi], axis=-1).reshape(-1, 2)
    return Primitive(
        (normals * radius + center).astype(np.float32),
        normals.astype(np.float32),
        uvs.astype(np.float32),
        None,
        np.concatenate([first, second]).astype(np.uint32),
        material,
    )


def model(*primitives):
    return Model("probe", primitives)


def layers(primitives, view=None, samples=None, size=SIZE):
    with Capture(model(*primitives), size, samples) as capturing:
        return resolve(capturing.view(view or front()), capturing.samples)


def encode(linear):
    linear = np.asarray(linear, float)
    return 255 * np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)


def decode(byte):
    encoded = np.asarray(byte, float) / 255
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def test_row_0_is_the_top_and_column_0_the_left():
    tile = layers([quad(-1, 0.5, 0, 1)])
    expected = np.zeros((SIZE, SIZE))
    expected[:16, :32] = 1
    assert np.array_equal(tile.coverage, expected)


def test_coverage_is_the_fraction_of_the_texel():
    texel = 2 / SIZE
    tile = layers([quad(-1, 0, 5.5 * texel, 4.5 * texel)])
    assert tile.coverage[SIZE // 2 - 2, SIZE // 2 + 5] == 0.5
    assert tile.coverage[SIZE // 2 - 5, SIZE // 2 + 4] == 0.5
    assert tile.coverage[SIZE // 2 - 5, SIZE // 2 + 5] == 0.25


@pytest.mark.parametrize("distance", [np.inf, 6.0])
@pytest.mark.parametrize("azimuth, elevation", [(0, 0), (2.0, 0.4), (4.5, -0.8)])
def test_normal_and_depth_of_a_far_off_sphere_seen_from_anywhere(azimuth, elevation, distance):
    center = np.array([300.0, -50.0, 1000.0])
    ball = sphere(center)
    views = frame(basis_facing(direction(azimuth, elevation))[None], ball.positions, SIZE, distance)
    view = views[0]
    tile = layers([ball], view)
    inside = tile.coverage == 1
    texels = (np.arange(SIZE) + 0.5) / SIZE * 2 - 1
    x, y = np.meshgrid(texels * view.radius, -texels * view.radius)
    low, high = view.depth_range
    points = view.unproject(np.stack([x, y, low + tile.depth * (high - low)], axis=-1))
    steep = tile.normal[..., 2] < 0.4
    assert inside.sum() > 0.5 * SIZE * SIZE
    assert np.abs(np.linalg.norm(points - center, axis=-1) - 1)[inside & ~steep].max() < 5e-3
    in_view = (points - center) @ view.basis.T
    assert np.abs(tile.normal - in_view)[inside & ~steep].max() < 2e-2


@pytest.mark.parametrize("distance", [np.inf, 3.0])
def test_depth_is_linear_along_back_and_fills_the_range(distance):
    half = 0.9
    view = front(depth_range=(-half, half), distance=distance)
    tile = layers([quad(-half, -3, half, 3, -half, z_right=half)], view, samples=1)
    column = (np.arange(SIZE) + 0.5) / SIZE * 2 - 1
    along = column if np.isinf(distance) else column * distance / (distance + column)
    seen = np.abs(along) < half
    depth = tile.depth[SIZE // 2]
    assert np.array_equal(tile.coverage[SIZE // 2] == 1, seen)
    assert depth[seen] == pytest.approx(((along + half) / (2 * half))[seen], abs=3e-5)


def test_the_nearest_surface_is_seen_whatever_the_order():
    red = Material(base_color=(1, 0, 0, 1))
    near, far = quad(-1, -1, 1, 1, 0.5, red), quad(-1, -1, 1, 1, -0.5)
    for order in ([near, far], [far, near]):
        tile = layers(order)
        assert tile.color[5, 5].tolist() == [255, 0, 0, 255]
        assert tile.depth[5, 5] == pytest.approx(0.75, abs=2e-5)


def test_back_faces_vanish_unless_double_sided():
    view = View(basis_facing([0, 0, -1]), np.zeros(3), 1.0, (-1.0, 1.0))
    assert not layers([quad(-1, -1, 1, 1)], view).coverage.any()
    tilted = quad(-1, -1, 1, 1, material=Material(double_sided=True), normal=(0.6, 0, 0.8))
    tile = layers([tilted], view)
    assert tile.coverage.all()
    assert tile.normal[9, 9] == pytest.approx([0.6, 0, 0.8], abs=1e-4)


def test_a_normal_that_leans_away_is_bent_to_the_silhouette():
    tile = layers([quad(-1, -1, 1, 1, normal=(0.48, 0.64, -0.6))])
    assert tile.normal[9, 9] == pytest.approx([0.6, 0.8, 0], abs=1e-4)


def test_a_texture_keeps_its_top_left():
    pixels = np.zeros((2, 2, 4), np.uint8)
    pixels[0, 0], pixels[0, 1], pixels[1, 0], pixels[1, 1] = (
        (255, 0, 0, 255),
        (0, 255, 0, 255),
        (0, 0, 255, 255),
        (255, 255, 255, 255),
    )
    picture = Material(base_color=(1, 1, 1, 1), texture=pixels.repeat(32, 0).repeat(32, 1))
    color = layers([quad(-1, -1, 1, 1, material=picture)]).color
    assert color[10, 10, :3].tolist() == [255, 0, 0]
    assert color[10, 50, :3].tolist() == [0, 255, 0]
    assert color[50, 10, :3].tolist() == [0, 0, 255]
    assert color[50, 50, :3].tolist() == [255, 255, 255]


def test_two_textures_stay_on_their_own_surfaces():
    def painted(color):
        return Material(base_color=(1, 1, 1, 1), texture=np.full((8, 8, 4), (*color, 255), np.uint8))

    left, right = (
        quad(-1, -1, 0, 1, material=painted((200, 30, 30))),
        quad(0, -1, 1, 1, material=painted((30, 30, 200))),
    )
    for order in ([left, right], [right, left]):
        color = layers(order).color
        assert color[32, 16, :3].tolist() == [200, 30, 30]
        assert color[32, 48, :3].tolist() == [30, 30, 200]


def test_every_srgb_byte_of_a_texture_comes_back_within_one():
    pixels = np.full((16, 16, 4), 255, np.uint8)
    pixels[..., 0] = np.arange(256).reshape(16, 16)
    picture = Material(base_color=(1, 1, 1, 1), texture=pixels.repeat(4, 0).repeat(4, 1))
    seen = layers([quad(-1, -1, 1, 1, material=picture)], samples=1).color[2::4, 2::4, 0]
    assert np.abs(seen.astype(int) - pixels[..., 0]).max() <= 1


def test_factor_texture_and_vertex_color_multiply_in_linear_light():
    pixels = np.full((4, 4, 4), (200, 120, 40, 255), np.uint8)
    tinted = Material(base_color=(0.25, 0.5, 0.75, 1), texture=pixels)
    expected = encode(np.array([0.25, 0.5, 0.75]) * decode([200, 120, 40]) * decode([255, 128, 64]))
    tile = layers([quad(-1, -1, 1, 1, material=tinted, colors=(255, 128, 64, 255))])
    assert np.abs(tile.color[20, 20, :3] - expected).max() <= 1


def test_a_mip_map_averages_light_not_codes():
    stripes = np.full((512, 512, 4), 255, np.uint8)
    stripes[:, ::2, :3] = 0
    tile = layers([quad(-1, -1, 1, 1, material=Material(base_color=(1, 1, 1, 1), texture=stripes))])
    assert np.abs(tile.color[8:-8, 8:-8, 0].astype(int) - 188).max() <= 1


def test_opaque_ignores_alpha():
    pixels = np.full((4, 4, 4), (255, 255, 255, 0), np.uint8)
    assert layers([quad(-1, -1, 1, 1, material=Material(texture=pixels))]).coverage.all()


def test_a_mask_cuts_exactly_where_alpha_falls_below_the_cutoff():
    pixels = np.full((SIZE, SIZE, 4), 255, np.uint8)
    pixels[:, : SIZE // 2, 3], pixels[:, SIZE // 2 :, 3] = 127, 128
    cut = Material(texture=pixels, alpha_mode="MASK", alpha_cutoff=0.5)
    covered = layers([quad(-1, -1, 1, 1, material=cut)]).coverage
    assert not covered[:, 1 : SIZE // 2 - 1].any()
    assert covered[:, SIZE // 2 + 1 : -1].all()


def test_a_fine_mask_keeps_its_area_when_seen_small():
    pixels = np.full((256, 256, 4), 255, np.uint8)
    pixels[..., 3] = 255 * (np.arange(256) % 16 < 4)
    cut = Material(texture=pixels, alpha_mode="MASK")
    assert layers([quad(-1, -1, 1, 1, material=cut)]).coverage.mean() == pytest.approx(0.25, abs=0.02)


@pytest.mark.parametrize("alpha", [0.0, 0.1, 0.3, 0.5, 0.77, 1.0])
def test_blending_covers_as_much_as_alpha_says(alpha):
    glass = Material(base_color=(1, 1, 1, alpha), alpha_mode="BLEND")
    covered = layers([quad(-1, -1, 1, 1, material=glass)]).coverage
    assert covered.mean() == pytest.approx(alpha, abs=1 / 256)
    assert np.abs(covered - alpha).max() <= 1 / 16


def test_blending_does_not_depend_on_order():
    panes = [
        quad(-1, -1, 1, 1, z, Material(base_color=color, alpha_mode="BLEND"))
        for z, color in ((0.5, (1, 0, 0, 0.4)), (0.0, (0, 1, 0, 0.8)), (-0.5, (0, 0, 1, 0.6)))
    ]
    one, other = layers(panes), layers(panes[::-1])
    assert np.array_equal(one.color, other.color)
    assert np.array_equal(one.depth, other.depth)


def test_cut_outs_and_transparency_are_sampled_finer():
    assert default_samples(model(quad(-1, -1, 1, 1))) == 2
    for mode in ("MASK", "BLEND"):
        assert default_samples(model(quad(-1, -1, 1, 1), quad(0, 0, 1, 1, material=Material(alpha_mode=mode)))) == 4


@pytest.mark.parametrize("distance", [np.inf, 5.0])
def test_pixels_equal_those_of_a_bare_pass(distance):
    rng = np.random.default_rng(1)
    pixels = rng.integers(0, 256, (64, 64, 4), dtype=np.uint8)
    looks = [GREY, Material(texture=pixels), Material(texture=pixels, alpha_mode="MASK")]
    looks.append(Material(base_color=(1, 0.5, 0, 0.5), alpha_mode="BLEND"))
    balls = [sphere((index - 1.5, 0.3 * index, 0), 0.8, look, 24) for index, look in enumerate(looks)]
    probe = model(*balls, quad(-2, -1, 2, -0.5, colors=(250, 128, 3, 255)))
    points = np.concatenate([primitive.positions for primitive in probe.primitives])
    view = frame(basis_facing([[0.3, 0.4, 1.0]]), points, SIZE, distance)[0]
    raw = RawPass(probe, SIZE, 2)
    with Capture(probe, SIZE, 2) as capturing:
        ours, theirs = capturing.view(view), raw.view(view)
    raw.release()
    assert (ours.color[..., 3] > 0).mean() > 0.2
    for one, other in ((ours.color, theirs.color), (ours.surface, theirs.surface)):
        differ = np.abs(one.astype(int) - other).max(axis=-1) > 1
        assert differ.mean() < 1e-3


def test_reordering_a_large_mesh_changes_no_pixel(monkeypatch):
    ball = [sphere((0, 0, 0), 0.9)]
    kept = layers(ball)
    monkeypatch.setattr("bake.vertices.REORDER_FROM", 0)
    reordered = layers(ball)
    assert np.array_equal(kept.color, reordered.color)
    assert np.abs(kept.depth - reordered.depth).max() < 1e-4
    assert np.abs(kept.normal - reordered.normal).max() < 1e-3


def test_captures_live_side_by_side_and_after_one_another():
    one = Capture(model(quad(-1, -1, 0, 1)), SIZE)
    for _ in range(6):
        with Capture(model(quad(0, -1, 1, 1)), SIZE) as other:
            assert other.view(front()).color[0, -1, 3] == 255
            assert one.view(front()).color[0, 0, 3] == 255
    one.release()
    one.release()
    with pytest.raises(GpuError, match="released"):
        one.view(front())


def test_the_callers_context_stays_current_and_alive():
    headless: Any = {"backend": "egl"}
    ctx = moderngl.create_context(standalone=True, **headless)
    buffer = ctx.buffer(b"kept")
    with Capture(model(quad(-1, -1, 1, 1)), SIZE) as capturing:
        capturing.view(front())
        assert buffer.read() == b"kept"
    buffer.write(b"free")
    assert buffer.read() == b"free"
    ctx.release()


@pytest.mark.parametrize("size, samples", [(SIZE, 3), (SIZE, 0), (100_000, 2)])
def test_settings_that_cannot_be_are_refused(size, samples):
    with pytest.raises(SettingsError, match="expected"):
        Capture(model(quad(-1, -1, 1, 1)), size, samples)


def test_a_broken_shader_is_named_and_shown_with_its_lines(tmp_path, monkeypatch):
    for name in ("layers.vert", "layers.frag"):
        (tmp_path / name).write_text((capture.SHADERS / name).read_text())
    broken = (tmp_path / "layers.frag").read_text().replace("vec4 albedo = base_color;", "vec4 albedo = nowhere;")
    (tmp_path / "layers.frag").write_text(broken)
    monkeypatch.setattr(capture, "SHADERS", tmp_path)
    with Capture(model(quad(-1, -1, 1, 1)), SIZE) as capturing, pytest.raises(GpuError, match="nowhere") as error:
        capturing.view(front())
    line = broken.splitlines().index("    vec4 albedo = nowhere;") + 1
    assert f"0:{line}(" in str(error.value)
    assert f"{line:4d}      vec4 albedo = nowhere;" in error.value.__notes__[0]
    assert "\n" not in str(error.value)


def run(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, cwd=ROOT)


def test_without_opengl_the_error_says_what_to_install():
    done = run(
        "import ctypes, sys\n"
        "load = ctypes.CDLL.__init__\n"
        "def refuse(self, name, *rest, **more):\n"
        "    if name and 'GL' in str(name): raise OSError(f'{name}: cannot open shared object file')\n"
        "    load(self, name, *rest, **more)\n"
        "ctypes.CDLL.__init__ = refuse\n"
        "from impostor.errors import GpuError\n"
        "try: import bake.capture\n"
        "except GpuError as error: print(error)\n"
    )
    assert len(done.stdout.splitlines()) == 1
    assert "apt install libegl1" in done.stdout


def test_leaving_without_release_is_silent():
    done = run(
        "import numpy as np\n"
        "from tests.unit.bake.test_capture import Capture, SIZE, front, model, quad\n"
        "capturing = Capture(model(quad(-1, -1, 1, 1)), SIZE)\n"
        "print(capturing.view(front()).color[0, 0, 3])\n"
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "255\n", "")
