"""A walk without its window: keys, mouse and time in, pictures out."""

import os

import moderngl
import numpy as np
import pytest

from impostor.files.fan_file import write_fan
from impostor.files.scene_file import load_scene
from impostor.files.scene_watcher import SceneWatcher
from impostor.normal_code import BYTE_TO_NORMAL
from runtime.gl.draw_calls import counted_draw_calls
from runtime.stage.changes import SceneChanges
from runtime.walk.keys import HELD, KEYS, WINDOW
from runtime.walk.overlay import panel_picture
from runtime.walk.walk import HINT_SECONDS, Walk
from runtime.walk.walker import MOVES, TURNS
from tests.data import ROOT
from tests.solids import RED, Box, Sphere, solid_fan

TEXT = """
ambient = 1.0
background = [0, 0, 0.2]
[camera]
eye = [0, 6]
target = [0, 1.7, 0]
[[camera.path]]
time = 1
eye = [3, 6]
target = [0, 1, 0]
[[camera.path]]
time = 3
eye = [-3, 6]
target = [0, 1, 0]
[ground]
albedo = [0.3, 0.3, 0.3]
[[instance]]
fan = "box.fan"
"""


@pytest.fixture
def folder(tmp_path):
    write_fan(tmp_path / "box.fan", solid_fan(Box((-0.5, 0, -0.5), (0.5, 2, 0.5), RED), views=4, size=32))
    (tmp_path / "scene.toml").write_text(TEXT)
    return tmp_path


@pytest.fixture
def walk(ctx, folder):
    path = folder / "scene.toml"
    walk = Walk(ctx, load_scene(path), (64, 64), changes=SceneChanges(SceneWatcher(path)))
    yield walk
    walk.release()


def drawn(walk):
    walk.draw()
    return walk.picture().astype(int)


def presented(walk):
    """The picture with what lies over it."""
    walk.draw()
    with_overlay = walk._ctx.simple_framebuffer(walk.canvas.size)
    with_overlay.use()
    walk.present()
    pixels = np.frombuffer(with_overlay.read(), np.uint8).reshape(64, 64, 3)[::-1].astype(int)
    attached = with_overlay.color_attachments[0], with_overlay.depth_attachment
    walk.canvas.framebuffer.use()
    with_overlay.release()
    for each in attached:
        each.release()
    return pixels


def reddish(pixels):
    return (pixels[..., 0] > 150) & (pixels[..., 1] < 100)


def red(pixels):
    return np.count_nonzero(reddish(pixels))


def written(path, text):
    """A file with a new time of change."""
    path.write_text(text)
    status = path.stat()
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns + 1_000_000_000))


def test_walking_on_makes_what_is_ahead_larger(walk):
    before = red(drawn(walk))
    walk.press("forward")
    walk.step(1.0)
    walk.let_go("forward")
    nearer = red(drawn(walk))
    walk.step(1.0)
    assert nearer > 1.3 * before > 0
    assert red(drawn(walk)) == nearer


def test_the_mouse_looks_around(walk):
    walk.look(-60, 0)
    pixels = drawn(walk)
    columns = np.flatnonzero(reddish(pixels).any(axis=0))
    assert columns.min() > 34


def test_the_path_leads_until_someone_walks(walk):
    assert walk.follow_path()
    np.testing.assert_allclose(walk.walker.eye, (3, 1.7, 6))
    walk.step(1.0)
    np.testing.assert_allclose(walk.walker.eye, (0, 1.7, 6), atol=1e-9)
    walk.press("left")
    walk.let_go("left")
    walk.step(0.5)
    np.testing.assert_allclose(walk.walker.eye, (0, 1.7, 6), atol=1e-9)
    walk.press("path")
    for _ in range(5):
        walk.step(0.5)
    np.testing.assert_allclose(walk.walker.eye, (-3, 1.7, 6))
    assert not walk.follows_path
    walk.press("return")
    np.testing.assert_allclose(walk.walker.eye, (0, 1.7, 6))


def test_every_view_shows_something_of_its_own(walk):
    pictures = []
    for view in ("lit", "albedo", "normals", "depth", "overdraw", "codes"):
        walk.press(view)
        pictures.append(drawn(walk))
    grey = pictures[3]
    assert (grey.max(axis=-1) == grey.min(axis=-1)).all()
    assert grey[32, 32, 0] > grey[40, 2, 0] > 0 == grey[2, 2, 0]
    for a, b in ((0, 2), (0, 3), (0, 4), (2, 3), (3, 4), (0, 5), (1, 5), (2, 5), (4, 5)):
        assert (pictures[a] != pictures[b]).any()


def test_codes_are_those_of_the_fan_whatever_way_it_is_turned(walk, folder):
    """Each texel is the colour of the one code that it has; what has none is dark."""
    written(folder / "scene.toml", TEXT + "yaw_deg = 90\n")
    walk.step(1.0)
    walk.press("codes")
    found = drawn(walk)
    colors = np.unique(found[30:34, 31:33].reshape(-1, 3), axis=0)
    palette = np.rint((BYTE_TO_NORMAL[:225] / 2 + 0.5) * 255)
    for color in colors:
        assert np.abs(palette - color).max(axis=1).min() <= 1
    # The face toward the fan's own camera.
    np.testing.assert_allclose(colors, [[128, 128, 255]], atol=16)
    assert found[2, 2].max() < 40 and found[60, 4].max() < 120


def test_the_dither_is_seen_where_texels_are_not_filtered(ctx, tmp_path):
    write_fan(tmp_path / "box.fan", solid_fan(Sphere((0, 1, 0), 1, (200, 200, 200)), views=4, size=64))
    (tmp_path / "scene.toml").write_text(TEXT.replace("ambient = 1.0", "ambient = 0.1"))
    walk = Walk(ctx, load_scene(tmp_path / "scene.toml"), (256, 256))
    try:
        smooth = drawn(walk)
        walk.press("dither")
        texels = drawn(walk)
        walk.press("dither")
        np.testing.assert_array_equal(drawn(walk), smooth)
    finally:
        walk.release()
    apart = [np.abs(np.diff(each[100:150, 110:150, 0], axis=1)).mean() for each in (smooth, texels)]
    assert apart[1] > 1.1 * apart[0] > 0


def test_distances_are_half_grey_at_seven_walking_heights(walk):
    walk.press("depth")
    walk.walker.eye[2] = 0.5 + 7 * 1.7
    assert drawn(walk)[36, 32, 0] == pytest.approx(127, abs=6)


def test_help_and_statistics_lie_over_the_picture_and_not_in_it(walk):
    plain = drawn(walk)
    assert (presented(walk) != plain).any()
    walk.press("statistics")
    hint = (presented(walk) != plain).any(axis=-1)
    # A line in the corner.
    assert hint.any() and not hint[32:].any()
    walk.press("help")
    assert (presented(walk) != plain).any(axis=-1).sum() > 2 * hint.sum()
    walk.press("help")
    np.testing.assert_array_equal(presented(walk), plain)
    walk.press("statistics")
    assert (presented(walk) != plain).any()
    np.testing.assert_array_equal(walk.picture(), plain)


def test_the_hint_goes_by_itself(walk):
    walk.press("statistics")
    plain = drawn(walk)
    for seconds in (1.0, 6.0):
        walk.step(seconds)
        assert (presented(walk) != plain).any()
    walk.step(1.1)
    np.testing.assert_array_equal(presented(walk), plain)


def test_the_divider_is_drawn_where_it_was_dragged(walk):
    walk.press("statistics")
    walk.step(HINT_SECONDS)
    walk.press("split")
    walk.move_divider(-16)
    white = (presented(walk) == 255).all(axis=-1)[:10]
    assert np.flatnonzero(white.all(axis=0)).tolist() == [walk.divider, walk.divider + 1] == [16, 17]
    walk.move_divider(-1000)
    assert walk.divider == 0
    walk.press("split")
    assert walk.divider == -1


def test_resizing_keeps_what_is_seen(walk):
    before = drawn(walk)
    walk.resize((128, 96))
    assert drawn(walk).shape == (96, 128, 3)
    walk.resize((64, 64))
    np.testing.assert_array_equal(drawn(walk), before)


class TestChangesOfTheFiles:
    def test_the_next_pictures_show_them_from_where_the_walker_is(self, walk, folder):
        walk.press("forward")
        walk.step(0.5)
        walk.let_go("forward")
        before = walk.walker.eye.copy()
        assert red(drawn(walk))
        written(folder / "scene.toml", TEXT + "position = [0, 50]\n")
        walk.step(0.3)
        np.testing.assert_array_equal(walk.walker.eye, before)
        assert not red(drawn(walk))

    def test_another_camera_is_gone_to(self, walk, folder):
        written(folder / "scene.toml", TEXT.replace("eye = [0, 6]", "eye = [0, 9]"))
        walk.step(0.3)
        np.testing.assert_allclose(walk.walker.eye, (0, 1.7, 9))

    @pytest.mark.parametrize("broken", ["[camera", TEXT.replace("box.fan", "gone.fan"), TEXT + "scale = -1\n"])
    def test_what_is_wrong_in_them_is_shown_and_nothing_changes(self, walk, folder, broken):
        before = drawn(walk)
        written(folder / "scene.toml", broken)
        walk.step(0.3)
        np.testing.assert_array_equal(drawn(walk), before)
        assert "scene.toml" in "".join(walk._message)
        written(folder / "scene.toml", TEXT + "position = [0, 50]\n")
        walk.step(0.3)
        assert not red(drawn(walk))

    def test_a_fan_that_is_missing_is_baked_while_the_walk_goes_on(self, walk, folder, capfd):
        model = ROOT / "sample_models" / "lattice.glb"
        bake = "bake = { views = 2, size = 16, samples = 1 }"
        written(folder / "scene.toml", TEXT + f'[[instance]]\nmodel = "{model}"\n{bake}\nposition = [2, 0]\n')
        before = drawn(walk)
        walk.step(0.3)
        np.testing.assert_array_equal(drawn(walk), before)
        assert walk._changes.baking == str(model)
        for _ in range(600):
            walk._changes._bakery and walk._changes._bakery._process.wait(60)
            walk.step(0.3)
            if not walk._changes.baking:
                break
        assert (drawn(walk) != before).any()
        assert list((folder / "baked_fans").glob("lattice-*.fan"))
        assert capfd.readouterr().err.startswith(f"impostor: baking {model} (2 views of 16x16)")


def test_statistics_count_draw_calls_and_relit_tiles(walk):
    drawn(walk)
    first = walk.statistics.latest
    drawn(walk)
    again = walk.statistics.latest
    assert first["relit"] == 1 and again["relit"] == 0
    # The ground, its shadows and the fan.
    assert again["draw_calls"] == 3 < first["draw_calls"]
    summary = walk.statistics.summary()
    assert summary["frames"] == 2 and summary["tiles_relit"] == 1 and summary["frame_ms"] > 0


def test_drawing_is_watched_only_as_long_as_it_is_counted():
    before = moderngl.VertexArray.render
    with pytest.raises(ZeroDivisionError), counted_draw_calls():
        raise ZeroDivisionError
    assert moderngl.VertexArray.render is before


def test_text_is_light_on_dark_and_as_wide_as_it_needs_to_be():
    narrow, wide = panel_picture(("one",), 14), panel_picture(("one", ("two", "columns of text")), 14)
    assert wide.shape[0] > narrow.shape[0] and wide.shape[1] > 2 * narrow.shape[1]
    assert narrow[..., :3].max() > 200 and narrow[0, 0, :3].max() < 40
    assert (narrow[..., :3] <= narrow[..., 3:]).all()


def test_the_manual_names_every_key():
    page = (ROOT / "docs" / "walk.md").read_text()
    for key in KEYS.values():
        if key.label:
            assert f"| {key.label} | {key.help} |" in page
    assert {*MOVES, *TURNS} <= HELD


@pytest.mark.parametrize("action", sorted({key.action for key in KEYS.values()} - WINDOW))
def test_every_key_is_understood_and_a_picture_follows(walk, action):
    walk.press(action)
    walk.step(0.1)
    walk.let_go(action)
    assert drawn(walk).any()
