"""`impostor walk`: in a real window with real keys and a real mouse, and without one."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from PIL import Image

from impostor.files.fan_file import write_fan
from tests.end_to_end.commands import COMMAND, CUBE, CUBE_FACES, json_of, pixels, run, write_obj
from tests.solids import BLUE, RED, Box, solid_fan

needs_xvfb = pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no Xvfb, the display without a screen")
SIZE = (320, 240)
SCENE = """
[camera]
eye = [0, 8]
target = [0, 1.7, 0]
[[camera.path]]
time = 0
eye = [0, 8]
target = [0, 1, 0]
[[camera.path]]
time = 1
eye = [4, 6]
target = [3, 1, 0]
[sun]
time_of_day = 15
[ground]
albedo = [0.3, 0.3, 0.3]
[[instance]]
fan = "red.fan"
[[instance]]
fan = "blue.fan"
position = [4, 0]
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A red pillar straight ahead and a blue one to its right, in the sun."""
    folder = tmp_path_factory.mktemp("scene")
    for name, color in (("red", RED), ("blue", BLUE)):
        pillar = Box((-0.5, 0, -0.5), (0.5, 2.5, 0.5), color)
        write_fan(folder / f"{name}.fan", solid_fan(pillar, views=8, size=64))
    (folder / "scene.toml").write_text(SCENE)
    return folder / "scene.toml"


@pytest.fixture(scope="module")
def display():
    """A display of its own: its name, as in DISPLAY."""
    reading, writing = os.pipe()
    command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", "800x600x24", "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=(writing,), stderr=subprocess.DEVNULL)
    os.close(writing)
    with os.fdopen(reading) as answer:
        number = answer.readline().strip()
    if not number:
        pytest.fail("Xvfb does not start")
    yield f":{number}"
    server.terminate()
    server.wait()


class Player:
    """Someone who sits before the window: looks at it, presses keys and moves the mouse."""

    def __init__(self, name, process):
        from Xlib import X, display

        self.process = process
        self.display = display.Display(name)
        deadline = time.monotonic() + 60
        while (window := self._find(self.display.screen().root)) is None:
            assert process.poll() is None and time.monotonic() < deadline, "no window"
            time.sleep(0.1)
        self.window = window
        window.set_input_focus(X.RevertToParent, X.CurrentTime)
        self.display.sync()
        before = self.until(lambda seen: seen.mean() > 60)
        # Past the dark window that says that it is loading; what levels of detail there are have settled.
        self.until(lambda seen: (seen == before).all())

    def _find(self, window):
        for child in window.query_tree().children:
            # pyglet has a hidden window of its own.
            if " - impostor" in str(child.get_wm_name()) and child.get_attributes().map_state == 2:
                return child
        return None

    def see(self):
        """What the window shows: (H, W, 3) int."""
        from Xlib import X

        place = self.window.get_geometry()
        image = self.window.get_image(0, 0, place.width, place.height, X.ZPixmap, 0xFFFFFFFF)
        return np.frombuffer(image.data, np.uint8).reshape(place.height, place.width, 4)[..., 2::-1].astype(int)

    def until(self, wanted, seconds=30):
        """What is seen once it is as it is wanted."""
        deadline = time.monotonic() + seconds
        while not wanted(seen := self.see()):
            assert self.process.poll() is None, "the window has gone"
            assert time.monotonic() < deadline, "not seen in time"
            time.sleep(0.1)
        return seen

    def press(self, name, seconds=0.1):
        from Xlib import XK, X
        from Xlib.ext import xtest

        key = self.display.keysym_to_keycode(XK.string_to_keysym(name))
        xtest.fake_input(self.display, X.KeyPress, key)
        self.display.sync()
        time.sleep(seconds)
        xtest.fake_input(self.display, X.KeyRelease, key)
        self.display.sync()

    def move(self, right, down=0, button=None):
        """Move the mouse by so many pixels, a few at a time."""
        from Xlib import X
        from Xlib.ext import xtest

        if button:
            xtest.fake_input(self.display, X.ButtonPress, button)
        for _ in range(10):
            xtest.fake_input(self.display, X.MotionNotify, True, x=right // 10, y=down // 10)
            self.display.sync()
            time.sleep(0.03)
        if button:
            xtest.fake_input(self.display, X.ButtonRelease, button)
        self.display.sync()


@pytest.fixture
def player(display, scene, tmp_path):
    """Starts a walk in a window; help and statistics are put away."""
    processes = []

    def start(*flags):
        command = [str(COMMAND), "walk", str(scene), "--size", "320x240", "--window", *flags]
        environment = {**os.environ, "DISPLAY": display}
        process = subprocess.Popen(
            command, env=environment, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        processes.append(process)
        player = Player(display, process)
        for key in "hhi":
            before = player.see()
            player.press(key)
            player.until(lambda seen, before=before: (seen != before).any())
        time.sleep(0.3)
        return player

    yield start
    for process in processes:
        if process.poll() is None:
            process.kill()
        process.communicate()


def red(seen):
    return (seen[..., 0] > 1.5 * seen[..., 1] + 20) & (seen[..., 0] > seen[..., 2])


def middle_column(mask):
    """Of the columns that show something."""
    return np.flatnonzero(mask.any(axis=0)).mean()


def dark_ground(seen):
    """Ground in the shadow, below the horizon."""
    lower = seen[150:]
    grey = np.ptp(lower, axis=-1) < 60
    return np.count_nonzero(grey & (lower.sum(axis=-1) < 0.75 * np.median(lower.sum(axis=-1))))


@needs_xvfb
class TestWindow:
    def test_walking_looking_switching_and_leaving(self, player, tmp_path):
        window = player()
        start = window.see()
        assert abs(middle_column(red(start)) - SIZE[0] / 2) < 8

        window.press("o")
        bare = window.until(lambda seen: dark_ground(seen) < 0.3 * dark_ground(start))
        window.press("o")
        window.until(lambda seen: (seen == start).all())
        assert (bare[:100] == start[:100]).all()

        window.press("w", 0.8)
        nearer = window.until(lambda seen: np.count_nonzero(red(seen)) > 1.3 * np.count_nonzero(red(start)))
        assert abs(middle_column(red(nearer)) - SIZE[0] / 2) < 8

        window.move(60)
        turned = window.until(lambda seen: middle_column(red(seen)) < SIZE[0] / 2 - 20)
        assert np.count_nonzero(red(turned))

        time.sleep(0.5)
        seen = window.see()
        window.press("p")
        deadline = time.monotonic() + 20
        while not (tmp_path / "scene-001.png").exists() and time.monotonic() < deadline:
            time.sleep(0.1)
        written = pixels(tmp_path / "scene-001.png")
        assert written.shape == (SIZE[1], SIZE[0], 3)
        assert np.abs(written - seen).max() <= 1

        window.press("Escape")
        out, err = window.process.communicate(timeout=30)
        assert window.process.returncode == 0
        assert "pictures of 320x240" in out
        assert err == f"impostor: {tmp_path / 'scene-001.png'} written\n"

    def test_the_mouse_drags_the_sun_and_the_divider(self, player):
        window = player("--free-mouse")
        start = window.see()
        window.move(40)
        time.sleep(0.5)
        assert (window.see() == start).all(), "a free mouse does not look around"
        window.move(0, -60, button=3)
        window.until(lambda seen: (seen[150:] != start[150:]).any())
        time.sleep(0.3)
        dragged = window.see()
        window.press("m")
        split = window.until(lambda seen: (seen[:10, 160] == 255).all())
        assert (split[:10, 170:] == dragged[:10, 170:]).all()
        where = window.window.query_pointer()
        window.move((162 - where.win_x) * 10 // 10 - (162 - where.win_x) % 10, 0)
        where = window.window.query_pointer()
        assert abs(where.win_x - 160) < 9
        window.move(80, 0, button=1)
        window.until(lambda seen: (seen[:10, 240] == 255).all() and not (seen[:10, 160] == 255).all())

    def test_ctrl_c_ends_it_in_one_line(self, player):
        window = player()
        window.process.send_signal(signal.SIGINT)
        _, err = window.process.communicate(timeout=30)
        assert (window.process.returncode, err) == (130, "impostor: stopped\n")

    def test_a_scripted_run_is_what_is_drawn_without_a_window(self, display, scene, tmp_path):
        flags = ["--size", "320x240", "--frames", "3", "--fps", "10", "--quiet"]
        pictures = []
        for kind in ("--window", "--headless"):
            path = tmp_path / f"{kind}.png"
            subprocess.run(
                [COMMAND, "walk", scene, kind, *flags, "--picture", path],
                env={**os.environ, "DISPLAY": display}, check=True, timeout=120,
            )  # fmt: skip
            pictures.append(pixels(path))
        assert np.abs(pictures[0] - pictures[1]).max() <= 2

    def test_the_renderer_leaves_the_windows_state_as_it_was(self, display):
        environment = {**os.environ, "DISPLAY": display}
        done = subprocess.run(
            [sys.executable, "-c", STATE_IN_A_WINDOW],
            env=environment, capture_output=True, text=True, timeout=120, check=False,
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, "")


STATE_IN_A_WINDOW = """
from runtime import Camera, ImpostorRenderer
from runtime.walk.window import Window
from impostor.shadow_projection import Ground
from runtime.ground.ground_pass import GroundSurface
from tests.gl import snapshot
from tests.solids import Box, solid_fan, solid_model

window = Window("state", (64, 48), catch_mouse=False)
renderer = ImpostorRenderer(window.ctx, cache_side=256)
solid = Box((-0.5, 0, -0.5), (0.5, 1, 0.5))
renderer.add(solid_fan(solid, views=4, size=32))
renderer.add_mesh(solid_model(solid))
matrices = Camera.perspective((0, 1, 4), (0, 0.5, 0), 45, 4 / 3, 0.1, 50).matrices
window._window.use()
before = snapshot()
renderer.draw_meshes(*matrices)
renderer.draw_ground(*matrices, Ground((0, 1, 0)), GroundSurface())
renderer.draw_shadows(*matrices, Ground((0, 1, 0)))
renderer.draw(*matrices)
assert snapshot() == before
assert window.ctx.error == "GL_NO_ERROR"
renderer.release()
window.close()
"""


def video_frames(path):
    import av

    with av.open(str(path)) as container:
        rate = container.streams.video[0].average_rate
        return rate, [frame.to_ndarray(format="rgb24").astype(int) for frame in container.decode(video=0)]


@pytest.fixture
def without_display(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)


@pytest.mark.usefixtures("without_display")
class TestWithoutWindow:
    def test_it_says_so_and_tells_what_it_cost(self, scene, capsys):
        assert run("walk", scene, "--size", "160x120", "--frames", 2, "--json") == 0
        out, err = capsys.readouterr()
        assert err == "impostor: no display; drawing 2 pictures without a window\n"
        summary = json.loads(out)
        assert (summary["frames"], summary["size"], summary["instances"]) == (2, [160, 120], 2)
        assert summary["frame_ms"] > 0 and summary["draw_calls"] > 0 and summary["tiles_relit"] >= 2

    def test_a_film_follows_the_path_at_its_rate(self, scene, tmp_path, capsys):
        film, last = tmp_path / "film.mp4", tmp_path / "last.png"
        assert run("walk", scene, "--size", "160x120", "--record", film, "--fps", 8, "--picture", last, "--quiet") == 0
        rate, frames = video_frames(film)
        assert (rate, len(frames)) == (8, 9)
        # The camera goes to the right, around the red pillar: the blue one comes nearer.
        blue = [np.count_nonzero(frame[..., 2] > frame[..., 0] + 90) for frame in (frames[0], frames[-1])]
        assert blue[1] > blue[0]
        assert np.abs(pixels(last) - frames[-1]).mean() < 8
        assert capsys.readouterr() == ("", "")

    def test_a_film_has_an_even_size_and_the_summary_says_it(self, scene, tmp_path, capsys):
        film = tmp_path / "film.mp4"
        flags = ("--size", "65x49", "--record", film, "--frames", 2)
        assert json_of(capsys, "walk", scene, *flags, "--json")["size"] == [64, 48]
        assert video_frames(film)[1][0].shape[:2] == (48, 64)

    def test_the_same_again_gives_the_same_picture(self, scene, tmp_path, capsys):
        for name in "ab":
            flags = ("--size", "160x120", "--frames", 4, "--picture", tmp_path / f"{name}.png", "--headless", "--quiet")
            assert run("walk", scene, *flags) == 0
        np.testing.assert_array_equal(pixels(tmp_path / "a.png"), pixels(tmp_path / "b.png"))

    def test_render_draws_what_the_scene_begins_with(self, scene, tmp_path):
        assert run("render", scene, "-o", tmp_path / "a.png", "--size", "160x120") == 0
        seen = pixels(tmp_path / "a.png")
        assert abs(middle_column(red(seen)) - 80) < 4
        assert run("render", scene, "-o", tmp_path / "b.png", "--size", "160x120", "--eye", "0,1.7,4") == 0
        assert np.count_nonzero(red(pixels(tmp_path / "b.png"))) > 2 * np.count_nonzero(red(seen))

    def test_a_fan_that_is_missing_is_baked_once(self, tmp_path, capfd):
        write_obj(tmp_path / "cube.obj", CUBE, CUBE_FACES)
        (tmp_path / "scene.toml").write_text(
            "[camera]\neye = [0.5, 0.5, 4]\ntarget = [0.5, 0.5, 0]\n"
            '[[instance]]\nmodel = "cube.obj"\nbake = { views = 4, size = 32 }\n'
        )
        for messages in (1, 0):
            flags = ("--size", "64x48", "-o", tmp_path / f"{messages}.png")
            assert run("render", tmp_path / "scene.toml", *flags) == 0
            err = capfd.readouterr().err
            assert err.count("\n") == messages and err.count("impostor: baking") == messages
        assert np.asarray(Image.open(tmp_path / "0.png")).max() > 60

    @pytest.mark.parametrize("command", ["render", "walk"])
    def test_quiet_says_nothing_of_a_bake(self, tmp_path, capfd, command):
        write_obj(tmp_path / "cube.obj", CUBE, CUBE_FACES)
        (tmp_path / "scene.toml").write_text(
            "[camera]\neye = [0.5, 0.5, 4]\ntarget = [0.5, 0.5, 0]\n"
            '[[instance]]\nmodel = "cube.obj"\nbake = { views = 2, size = 16 }\n'
        )
        flags = {"render": ("-o", tmp_path / "a.png"), "walk": ("--headless", "--frames", "1")}[command]
        assert run(command, tmp_path / "scene.toml", "--size", "64x48", "--quiet", *flags) == 0
        assert capfd.readouterr() == ("", "")

    def test_a_fan_that_leans_is_warned_of_once(self, scene, tmp_path, capfd):
        flags = ("-o", tmp_path / "a.png", "--size", "320x240", "--target", "2,0,0")
        assert run("render", scene, *flags, "--eye", "2,1.7,6") == 0
        assert capfd.readouterr().err == ""
        assert run("render", scene, *flags, "--force", "--eye", "0,8,2") == 0
        (line,) = capfd.readouterr().err.splitlines()
        assert line.startswith("impostor: warning: ") and "degrees away from its views; expected at most 20" in line

    def test_a_model_that_cannot_be_baked_is_said_in_one_more_line(self, tmp_path, capfd):
        (tmp_path / "no.obj").write_text("no model")
        (tmp_path / "scene.toml").write_text(
            '[camera]\neye = [0, 1, 4]\ntarget = [0, 0, 0]\n[[instance]]\nmodel = "no.obj"\n'
        )
        assert run("walk", tmp_path / "scene.toml", "--headless") == 1
        first, second = capfd.readouterr().err.splitlines()
        assert first.startswith("impostor: baking") and "no.obj" in second and "expected" in second

    @pytest.mark.parametrize(
        ("flags", "code", "message"),
        [
            (["--window"], 1, "impostor: window: cannot be opened"),
            (["--size", "0x4"], 2, "impostor: --size: '0x4'; expected"),
            (["--frames", "0"], 2, "impostor: --frames: 0; expected 1 to"),
            (["--fps", "0"], 2, "impostor: --fps: 0; expected 1 to"),
            (["--record", "film.avi"], 1, "impostor: film.avi: ends in '.avi'; expected"),
            (["--record", "film.mp4", "--window"], 2, "impostor: --window: given with --record"),
            (["--picture", "a.jpg"], 1, "impostor: a.jpg: ends in '.jpg'; expected"),
            (["--headless", "--size", "99999x1"], 2, "impostor: --size: '99999x1'; expected"),
        ],
    )
    def test_what_cannot_be_done_is_said_in_one_line(self, scene, capfd, flags, code, message):
        done = subprocess.run([COMMAND, "walk", scene, *flags], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout) == (code, "")
        assert done.stderr.startswith(message) and done.stderr.count("\n") == 1

    @pytest.mark.parametrize(
        ("text", "message"),
        [(None, "gone.toml"), ("[camera]\n", "eye"), ("[camera", "line 1")],
    )
    @pytest.mark.parametrize("command", [["walk"], ["render", "-o", "a.png"]])
    def test_a_scene_that_cannot_be_read_is_said_in_one_line(self, tmp_path, capsys, text, message, command):
        path = tmp_path / "gone.toml"
        if text is not None:
            path.write_text(text)
        assert run(*command, path) == 1
        err = capsys.readouterr().err
        assert message in err and err.count("\n") == 1

    def test_a_film_of_a_scene_without_a_path_is_refused(self, tmp_path, capsys):
        (tmp_path / "still.toml").write_text("[camera]\neye = [0, 1, 4]\ntarget = [0, 0, 0]\n")
        assert run("walk", tmp_path / "still.toml", "--record", tmp_path / "film.mp4") == 2
        assert "has no camera path; expected" in capsys.readouterr().err
        assert run("walk", tmp_path / "still.toml", "--record", tmp_path / "film.mp4", "--frames", 2, "--quiet") == 0

    @pytest.mark.parametrize("flag", ["--light", "--azimuth", "--background", "--up"])
    def test_flags_of_objects_are_refused_with_a_scene(self, scene, tmp_path, capsys, flag):
        value = {"--light": "0,40", "--azimuth": "3", "--background": "1,1,1", "--up": "z"}[flag]
        assert run("render", scene, "-o", tmp_path / "a.png", flag, value) == 2
        assert capsys.readouterr().err.startswith(f"impostor: {flag}: given with {scene}")

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_a_stopped_film_leaves_nothing(self, scene, tmp_path, number):
        film = tmp_path / "film.mp4"
        command = [COMMAND, "walk", scene, "--record", film, "--frames", "100000", "--size", "64x48"]
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        deadline = time.monotonic() + 60
        while not any(each.stat().st_size for each in tmp_path.iterdir()) and time.monotonic() < deadline:
            assert process.poll() is None
            time.sleep(0.1)
        process.send_signal(number)
        _, err = process.communicate(timeout=30)
        assert (process.returncode, err) == (128 + number, "impostor: stopped\n")
        assert list(tmp_path.iterdir()) == []

    def test_a_stopped_bake_leaves_nothing_and_says_so_once(self, tmp_path):
        write_obj(tmp_path / "cube.obj", CUBE, CUBE_FACES)
        bake = "bake = { views = 2000, size = 256 }"
        (tmp_path / "scene.toml").write_text(
            f'[camera]\neye = [0, 1, 4]\ntarget = [0, 0, 0]\n[[instance]]\nmodel = "cube.obj"\n{bake}\n'
        )
        command = [COMMAND, "walk", tmp_path / "scene.toml", "--headless"]
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        assert process.stderr is not None
        first = process.stderr.readline()
        time.sleep(5)  # past the imports of the bake, in the midst of which other libraries make their own errors of it
        process.send_signal(signal.SIGINT)
        _, rest = process.communicate(timeout=30)
        assert (process.returncode, rest) == (130, "impostor: stopped\n")
        assert first.startswith("impostor: baking")
        assert not list((tmp_path / "baked_fans").iterdir())
