"""Game prototypes: the examples play; any framebuffer, viewport and context of a caller's shows the same."""

import os
import re
import shutil
import subprocess
import sys
from contextlib import contextmanager
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

import impostor
from bake.fan import bake_fan
from docs import choosing
from impostor.lighting import DirectionalLight
from impostor.model import load_model
from runtime import Camera, GroundSurface, ImpostorRenderer
from runtime.gl.context import make_context
from tests.data import ROOT, SAMPLES
from tests.pictures import apart, placed
from tests.solids import BLUE, GREEN, Box, Sphere, solid_fan, solid_model

XVFB = shutil.which("Xvfb")
needs_xvfb = pytest.mark.skipif(XVFB is None, reason="no Xvfb to open a window in")
GROUND, GRASS = impostor.Ground(np.array([0.0, 1.0, 0.0])), GroundSurface((0.2, 0.3, 0.1))


def run(*arguments, environment=None):
    """Standard output of an example that must end well."""
    done = subprocess.run(
        [sys.executable, *map(str, arguments)],
        cwd=ROOT,
        env={**os.environ, **(environment or {})},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def picture(path):
    """(H, W, 3) int; not blank."""
    pixels = np.asarray(Image.open(path).convert("RGB")).astype(int)
    assert pixels.std(axis=(0, 1)).max() > 5, f"{path} is blank"
    return pixels


def play(cache, out, *arguments):
    """The game without a window, small."""
    small = ("--views", 6, "--tile", 24, "--size", 240, 135)
    return run(ROOT / "examples" / "sunset_game.py", "--cache", cache, "--picture", out, *small, *arguments)


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """A folder with the game's fans."""
    folder = tmp_path_factory.mktemp("fans")
    play(folder, folder / "first.png", "--frames", 1)
    return folder


class TestSunsetGame:
    def test_fans_are_baked_once(self, cache, tmp_path):
        before = {path: path.stat().st_mtime_ns for path in cache.glob("*.fan")}
        assert {re.sub(r"[ \d].*", "", path.name) for path in before} == {"tree", "pine", "house", "statue", "tuft"}
        play(cache, tmp_path / "again.png", "--frames", 1)
        assert {path: path.stat().st_mtime_ns for path in cache.glob("*.fan")} == before

    def test_day_turns_to_night(self, cache, tmp_path):
        for name, time in (("day", 0.0), ("sunset", 0.6), ("night", 1.0)):
            play(cache, tmp_path / f"{name}.png", "--frames", 1, "--time", time)
        day, sunset, night = (picture(tmp_path / f"{name}.png") for name in ("day", "sunset", "night"))
        assert day.mean() > 1.2 * sunset.mean() > 2 * night.mean()
        # The sky at sunset is red, by day and by night it is blue; lanterns shine at night, too.
        sky = [frame[:25].mean(axis=(0, 1)) for frame in (day, sunset, night)]
        assert sky[1][0] > sky[1][2] and sky[2][2] > sky[2][0]
        assert night.max(axis=2).max() > 200

    def test_the_walker_gathers_lanterns(self, cache, tmp_path):
        said = play(cache, tmp_path / "played.png", "--frames", 30, "--step", 0.2)
        found = re.search(r"played.png: (\d+) of 24 lanterns after 30 frames", said)
        assert found and 2 <= int(found[1]) <= 24

    @needs_xvfb
    def test_it_plays_in_a_real_window(self, cache, tmp_path):
        with screen_number() as number:
            environment = {"DISPLAY": number, "SDL_VIDEODRIVER": "x11", "LIBGL_ALWAYS_SOFTWARE": "1"}
            environment |= {"CACHE": str(cache), "OUT": str(tmp_path / "window.png")}
            said = run("-c", KEYS_HELD, environment=environment)
        start, end, title, size = said.splitlines()[-4:]
        assert re.fullmatch(r"Lantern wood: \d+ of 24 lanterns", title)
        assert size == "(240, 135)"
        # Up and right are held: forward, and turned to the right.
        assert float(end.split()[0]) < float(start.split()[0]) - 0.3
        assert float(end.split()[1]) < float(start.split()[1]) - 0.1
        assert picture(tmp_path / "window.png").shape == (135, 240, 3)


# Plays the game in its window with two keys held, and closes it after twelve frames.
KEYS_HELD = """
import os, sys
sys.path.insert(0, "examples")
import moderngl, pygame, sunset_game
from pathlib import Path
from PIL import Image, ImageOps

class Held(dict):
    def __missing__(self, key):
        return key in (pygame.K_UP, pygame.K_RIGHT)

frames, world = 0, sunset_game.World()
def flip(flip=pygame.display.flip):
    global frames
    frames += 1
    if frames == 12:
        screen = moderngl.get_context().screen
        pixels = Image.frombytes("RGB", screen.size, screen.read())
        ImageOps.flip(pixels).save(os.environ["OUT"])
        print(world.place[2], world.heading)
        print(pygame.display.get_caption()[0])
        print(pygame.display.get_window_size())
        pygame.event.post(pygame.event.Event(pygame.QUIT))
    flip()
pygame.display.flip, pygame.key.get_pressed = flip, Held
print(world.place[2], world.heading)
sunset_game.play(world, sunset_game.fans(Path(os.environ["CACHE"]), 6, 24), (240, 135))
"""


@contextmanager
def screen_number():
    """The DISPLAY of a screen that nobody sees."""
    read, write = os.pipe()
    command = [str(XVFB), "-displayfd", str(write), "-screen", "0", "640x480x24", "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=[write], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as answers:
            yield f":{answers.readline().strip()}"
    finally:
        server.terminate()
        server.wait()


class TestWindowedForest:
    EXAMPLE = ROOT / "examples" / "windowed_forest.py"

    def test_it_is_short(self):
        assert len(self.EXAMPLE.read_text().splitlines()) < 60

    def test_it_draws_without_a_screen(self, tmp_path):
        small = ("--size", "320x180", "--picture", tmp_path / "forest.png")
        run(self.EXAMPLE, "--window", "headless", "--backend", "egl", *small)
        self.check(picture(tmp_path / "forest.png"))

    @needs_xvfb
    def test_it_draws_in_a_real_window(self, tmp_path):
        small = ("--size", "320x180", "--picture", tmp_path / "forest.png")
        with screen_number() as number:
            run(self.EXAMPLE, *small, environment={"DISPLAY": number, "LIBGL_ALWAYS_SOFTWARE": "1"})
        self.check(picture(tmp_path / "forest.png"))

    @staticmethod
    def check(pixels):
        assert pixels.shape == (180, 320, 3)
        assert np.ptp(pixels[:30], axis=(0, 1)).max() == 0, "the sky is not clear"
        wood = pixels[80:]
        leaves = wood[..., 1] > 1.15 * wood[..., 0]
        assert 0.15 < leaves.mean() < 0.85, "no trees, or nothing but trees"
        assert (wood.sum(axis=-1) < 160).mean() > 0.03, "nothing casts a shadow"


class TestContactSheet:
    def test_a_row_for_each_fan_and_a_column_for_each_side(self, tmp_path):
        for name in ("knot.stl", "truck.glb"):
            model = load_model(SAMPLES / name)
            impostor.save(tmp_path / f"{name}.fan", bake_fan(model, views=8, size=32))
        fans = (tmp_path / "truck.glb.fan", tmp_path / "knot.stl.fan")
        run(ROOT / "examples" / "contact_sheet.py", *fans, "-o", tmp_path / "sheet.png", "--cell", 64)
        sheet = picture(tmp_path / "sheet.png")
        assert sheet.shape == (128, 6 * 64, 3)
        truck, knot = (row.reshape(64, 6, 64, 3).swapaxes(0, 1) for row in np.split(sheet, 2))
        # The truck is teal, the knot has no colour; every cell shows another side or another light.
        for cells, colored in ((truck, True), (knot, False)):
            assert all((np.ptp(cell[16:48, 16:48], axis=-1) > 60).any() == colored for cell in cells)
            assert all(np.abs(a - b).mean() > 1 for a, b in pairwise(cells))
            assert all(apart(cell[:6], cell[0, 0]).max() <= 2 for cell in cells), "something reaches into the margin"


BALL = solid_fan(
    Sphere((0, 1, 0), 1.0), Box((-0.6, 0, -0.6), (0.6, 0.5, 0.6), GREEN), views=8, size=64, elevation_deg=15
)
BLOCK = solid_model(Box((-0.5, 0, -0.5), (0.5, 1.6, 0.5), BLUE))


@contextmanager
def scene(ctx):
    """A renderer with all that it draws: fans, a mesh and shadows."""
    renderer = ImpostorRenderer(ctx, cache_side=512)
    try:
        renderer.lights = [DirectionalLight.from_angles(60, 35, (0.8, 0.7, 0.6))]
        renderer.add(BALL, [(-1.4, 0, 0), (1.2, 0, 0.8)], [0.0, 1.0], [1.0, 0.7])
        renderer.add_mesh(BLOCK, placed((0.4, 0, -1.6), 0.5))
        yield renderer
    finally:
        renderer.release()


def draw(renderer, aspect=1.0):
    """One frame into whatever is bound."""
    matrices = Camera.perspective((0.5, 2.6, 8), (0, 0.8, 0), 38, aspect, 1, 60).matrices
    renderer.draw_meshes(*matrices)
    renderer.draw_ground(*matrices, GROUND, GRASS)
    renderer.draw_shadows(*matrices, GROUND)
    renderer.draw(*matrices)


@contextmanager
def framebuffer(ctx, size, samples=0, dtype="f1"):
    """A caller's own, cleared and bound."""
    parts = [ctx.renderbuffer(size, 4, samples, dtype=dtype), ctx.depth_renderbuffer(size, samples)]
    target = ctx.framebuffer(*parts)
    try:
        target.use()
        target.clear(0.2, 0.3, 0.4, 1.0)
        yield target
    finally:
        if ctx.fbo is target:
            # moderngl would go on binding the released one.
            (ctx.screen or ctx.detect_framebuffer(0)).use()
        for part in (target, *parts):
            part.release()


def pixels_of(ctx, target):
    """(H, W, 4) uint8 of a framebuffer with or without samples."""
    with framebuffer(ctx, target.size) as flat:
        ctx.copy_framebuffer(flat, target)
        return np.frombuffer(flat.read(components=4), np.uint8).reshape(target.height, target.width, 4)[::-1]


def frame_of(ctx, size=(128, 128), samples=0, dtype="f1"):
    """The scene as pixels."""
    with scene(ctx) as renderer, framebuffer(ctx, size, samples, dtype) as target:
        draw(renderer, size[0] / size[1])
        if dtype != "f1":
            read = np.frombuffer(target.read(components=4, dtype=dtype), np.float16).astype(float)
            return np.rint(read * 255).reshape(size[1], size[0], 4)[::-1]
        return pixels_of(ctx, target)


class TestCallersFramebuffer:
    @pytest.mark.parametrize("samples", [2, 4])
    def test_samples_smooth_edges_and_change_nothing_else(self, ctx, samples):
        plain, smooth = frame_of(ctx), frame_of(ctx, samples=samples)
        different = apart(plain, smooth)
        assert different.any(), "nothing was smoothed"
        assert different.mean() < 1.5
        assert (different > 8).mean() < 0.06

    def test_a_framebuffer_of_floats_shows_the_same(self, ctx):
        assert apart(frame_of(ctx), frame_of(ctx, dtype="f2")).max() <= 1

    @pytest.mark.parametrize("size", [(96, 48), (48, 96), (1, 97), (131, 7)])
    def test_any_size_shows_the_same_scene(self, ctx, size):
        """Against the scene drawn eight times finer and averaged."""
        found = frame_of(ctx, size).astype(float)
        finer = frame_of(ctx, (8 * size[0], 8 * size[1])).astype(float)
        expected = finer.reshape(size[1], 8, size[0], 8, 4).mean(axis=(1, 3))
        assert np.abs(found - expected)[..., :3].mean() < 6

    def test_one_renderer_serves_many_sizes_in_turn(self, ctx):
        """Large, small, upright, level, large again: each as if it were the only one."""
        sizes = [(160, 90), (20, 20), (90, 160), (160, 90)]
        with scene(ctx) as renderer:
            for size in sizes:
                with framebuffer(ctx, size) as target:
                    draw(renderer, size[0] / size[1])
                    found = pixels_of(ctx, target)
                assert apart(found, frame_of(ctx, size)).max() <= 1

    @pytest.mark.parametrize("viewport", [(16, 8, 64, 64), (-20, -30, 128, 128), (40, 50, 100, 120)])
    def test_a_viewport_beside_or_past_the_framebuffer(self, ctx, viewport):
        """What falls into the framebuffer is that part of the whole picture, the rest stays as it was."""
        x, y, width, height = viewport
        whole = frame_of(ctx, (width, height))
        with scene(ctx) as renderer, framebuffer(ctx, (96, 96)) as target:
            untouched = pixels_of(ctx, target).copy()
            target.use()
            target.viewport = viewport
            draw(renderer, width / height)
            found = pixels_of(ctx, target)
        expected = np.flipud(untouched).copy()
        low, high = np.maximum((x, y), 0), np.minimum((x + width, y + height), 96)
        part = np.flipud(whole)[low[1] - y : high[1] - y, low[0] - x : high[0] - x]
        expected[low[1] : high[1], low[0] : high[0]] = part
        assert apart(found, np.flipud(expected)).max() <= 2

    def test_what_the_caller_had_bound_is_bound_again(self, ctx):
        with (
            scene(ctx) as renderer,
            framebuffer(ctx, (64, 64), samples=4) as target,
            framebuffer(ctx, (32, 32)) as other,
        ):
            target.use()
            target.viewport = 3, 5, 40, 50
            draw(renderer)
            assert ctx.fbo is target and target.viewport == (3, 5, 40, 50)
            assert not (pixels_of(ctx, other) != pixels_of(ctx, other)[0, 0]).any()


class TestManyContexts:
    def test_two_contexts_draw_the_same_in_turns(self, ctx):
        expected = frame_of(ctx)
        second = make_context()
        try:
            with second, scene(second) as there, framebuffer(second, (128, 128)) as target:
                draw(there)
                with ctx:
                    assert np.array_equal(frame_of(ctx), expected)
                with second:
                    target.use()
                    target.clear(0.2, 0.3, 0.4, 1.0)
                    draw(there)
                    assert np.array_equal(pixels_of(second, target), expected)
        finally:
            second.release()

    def test_a_context_that_ends_takes_nothing_with_it(self, ctx):
        expected = frame_of(ctx)
        second = make_context()
        with second, scene(second) as there, framebuffer(second, (64, 64)):
            draw(there)
        second.release()
        with ctx:
            assert np.array_equal(frame_of(ctx), expected)


class TestPages:
    def test_the_numbers_on_choosing_are_the_scripts(self):
        page = choosing.PAGE.read_text()
        assert choosing.with_tables(page, choosing.read_results()) == page
        named = set(re.findall(r"figures/(choosing_\w+)\.png", page))
        assert named == set(choosing.plots(choosing.read_results()))
        assert all((ROOT / "docs" / "figures" / f"{name}.png").exists() for name in named)

    def test_the_code_on_the_page_about_games_runs_as_pasted(self, tmp_path):
        pieces = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "games.md").read_text(), re.DOTALL)
        assert len(pieces) >= 4
        (tmp_path / "sample_models").symlink_to(SAMPLES)
        command = [sys.executable, "-c", "\n".join(pieces)]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == 0, done.stderr
        shown = picture(tmp_path / "dusk.png")
        assert shown.shape == (360, 640, 3)
        # At dusk the light is red: so are the walls, and the shadows on the meadow are not.
        assert shown[100:].mean(axis=(0, 1))[0] > shown[100:].mean(axis=(0, 1))[2]
