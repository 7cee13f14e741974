"""A scene on the GPU: what it shows, and what stays as it is when a part of it changes."""

from dataclasses import replace

import numpy as np
import pytest

from impostor.errors import ImpostorError
from impostor.files.fan_file import write_fan
from impostor.files.ptm_file import write_ptm
from impostor.files.scene_file import load_scene
from impostor.ptm import quantise
from runtime.gl.canvas import Canvas
from runtime.stage.stage import Stage
from runtime.walk.walker import Walker
from tests.ptms import matt_bumps
from tests.solids import BLUE, RED, Box, solid_fan, solid_model

LOW, HIGH = (-0.5, 0.0, -0.5), (0.5, 1.0, 0.5)
BACKGROUND = (0.25, 0.5, 0.75)
SCENE = """
ambient = 1.0
background = [0.25, 0.5, 0.75]
[camera]
eye = [0, 0.5, 5]
target = [0, 0.5, 0]
near = 0.5
"""
COPY = '[[instance]]\nfan = "box.fan"\nposition = [{x}, 0, {z}]\n'


def box_fan(color):
    """The box as a fan that says how large it is."""
    return replace(solid_fan(Box(LOW, HIGH, color), views=4, size=32), bounds=np.array([LOW, HIGH]))


def write_ply(path, model):
    """A model with colours by vertex."""
    (primitive,) = model.primitives
    rows = zip(primitive.positions.tolist(), primitive.normals.tolist(), primitive.colors.tolist(), strict=True)
    names = ["x", "y", "z", "nx", "ny", "nz"]
    header = ["ply", "format ascii 1.0", f"element vertex {len(primitive.positions)}"]
    header += [f"property float {name}" for name in names]
    header += [f"property uchar {name}" for name in ("red", "green", "blue", "alpha")]
    header += [f"element face {len(primitive.triangles)}", "property list uchar int vertex_indices", "end_header"]
    lines = [" ".join(map(str, [*position, *normal, *color])) for position, normal, color in rows]
    lines += [f"3 {a} {b} {c}" for a, b, c in primitive.triangles.tolist()]
    path.write_text("\n".join(header + lines) + "\n")


@pytest.fixture
def folder(tmp_path):
    """A red box as a fan, and the same box in blue as a mesh."""
    write_fan(tmp_path / "box.fan", box_fan(RED))
    write_ply(tmp_path / "box.ply", solid_model(Box(LOW, HIGH, BLUE)))
    return tmp_path


@pytest.fixture
def scene(folder):
    """Makes scenes in the folder."""

    def make(text, name="scene.toml"):
        (folder / name).write_text(SCENE + text)
        return load_scene(folder / name)

    return make


@pytest.fixture
def stage(ctx):
    """Makes stages that the test need not release."""
    made = []

    def make(scene):
        made.append(Stage(ctx, scene))
        return made[-1]

    yield make
    for each in made:
        each.release()


@pytest.fixture
def seen(ctx):
    """Draws what a stage's camera sees, 64x64."""
    canvas = Canvas(ctx, 64, 64)

    def see(stage, **how):
        camera, walker = stage.scene.camera, Walker(np.zeros(3))
        walker.look_at(camera.eye, camera.target)
        lighting = {"lights": stage.scene.lights, "ambient": stage.scene.ambient, "background": BACKGROUND}
        stage.light(**lighting)
        near, far = stage.range_from(walker.eye)
        view = walker.camera(camera.fov_deg, 1.0, near, far)
        stage.draw(canvas, view, **how)
        return canvas.pixels().astype(int)

    yield see
    canvas.release()


def reddish(pixels):
    return (pixels[..., 0] > 150) & (pixels[..., 2] < 100)


def bluish(pixels):
    return (pixels[..., 2] > 150) & (pixels[..., 0] < 100)


def test_a_copy_stands_where_the_scene_says_before_its_background(stage, scene, seen):
    pixels = seen(stage(scene(COPY.format(x=-1.2, z=0))))
    columns = np.flatnonzero(reddish(pixels).any(axis=0))
    assert columns.min() > 5 and columns.max() < 28
    np.testing.assert_allclose(pixels[5, 60], 255 * np.array([0.5371, 0.7354, 0.8805]), atol=1.5)


def test_meshes_and_surfaces_are_drawn_too(stage, scene, seen, folder):
    write_ptm(quantise(matt_bumps()[1]), folder / "wall.ptm")
    text = '[[mesh]]\nmodel = "box.ply"\nposition = [1.2, 0, 0]\n'
    text += '[[surface]]\nptm = "wall.ptm"\nwidth = 1\nheight = 1\nposition = [-1.2, 0.5, 0]\n'
    shown, bare = seen(stage(scene(text))), seen(stage(scene("", "bare.toml")))
    changed = np.flatnonzero((shown != bare).any(axis=(0, 2)))
    assert bluish(shown)[:, 36:].any() and not bluish(shown)[:, :30].any()
    assert changed.min() < 20 and not ((changed > 28) & (changed < 34)).any()


def test_moved_copies_keep_what_is_on_the_gpu(stage, scene, seen):
    shown = stage(scene(COPY.format(x=-1.2, z=0)))
    seen(shown)
    (before,) = (copies.shown for copies in shown._copies.things.values())
    shown.change(scene(COPY.format(x=1.2, z=0)))
    (after,) = (copies.shown for copies in shown._copies.things.values())
    assert before is after
    columns = np.flatnonzero(reddish(seen(shown)).any(axis=0))
    assert columns.min() > 36


def test_copies_come_and_go(stage, scene, seen):
    one, two = COPY.format(x=-1.2, z=0), COPY.format(x=1.2, z=0)
    shown = stage(scene(one))
    shown.change(scene(one + two))
    both = reddish(seen(shown))
    assert both[:, :30].any() and both[:, 34:].any()
    shown.change(scene(""))
    assert not reddish(seen(shown)).any()


def test_a_fan_that_is_written_anew_is_shown_anew(stage, scene, seen, folder):
    shown = stage(scene(COPY.format(x=0, z=0)))
    assert reddish(seen(shown)).any()
    write_fan(folder / "box.fan", box_fan(BLUE), force=True)
    shown.change(scene(COPY.format(x=0, z=0)))
    pixels = seen(shown)
    assert bluish(pixels).any() and not reddish(pixels).any()


def test_a_change_that_cannot_be_made_changes_nothing(stage, scene, seen, folder):
    shown = stage(scene(COPY.format(x=0, z=0)))
    before = seen(shown)
    (folder / "broken.fan").write_bytes(b"no fan")
    text = '[[mesh]]\nmodel = "box.ply"\n' + COPY.format(x=1, z=0).replace("box.fan", "broken.fan")
    with pytest.raises(ImpostorError, match="broken.fan"):
        shown.change(scene(text, "broken.toml"))
    np.testing.assert_array_equal(seen(shown), before)
    assert shown.scene.path.name == "scene.toml"


def test_a_scene_that_cannot_be_shown_leaves_nothing_behind(ctx, scene, folder):
    (folder / "broken.fan").write_bytes(b"no fan")
    with pytest.raises(ImpostorError, match="broken.fan"):
        Stage(ctx, scene('[[mesh]]\nmodel = "box.ply"\n' + COPY.format(x=1, z=0).replace("box.fan", "broken.fan")))


LOD = '[[instance]]\nfan = "box.fan"\nmodel = "box.ply"\nlod = true\nposition = [0, 0, 0]\n'


@pytest.mark.parametrize("text", [LOD, LOD + COPY.format(x=40, z=0)])
def test_a_split_screen_has_meshes_on_the_left_and_fans_on_the_right(stage, scene, seen, text):
    shown = stage(scene(text))
    shown.prepare_split()
    for split in (0.5, 0.45):
        pixels = seen(shown, split=split)
        divider = round(split * 64)
        assert bluish(pixels)[:, :divider].any() and not reddish(pixels)[:, :divider].any()
        assert reddish(pixels)[:, divider:].any() and not bluish(pixels)[:, divider:].any()
    whole = seen(shown)
    assert reddish(whole).any() != bluish(whole).any()


def test_the_nearer_of_copies_with_levels_is_a_mesh(stage, scene, seen):
    near, far = seen(stage(scene(LOD.replace("[0, 0, 0]", "[0, 0.3, 4.2]")))), seen(stage(scene(LOD)))
    assert bluish(near).any() and not reddish(near).any()
    assert reddish(far).any() and not bluish(far).any()


GROUND = "[ground]\nalbedo = [0.8, 0.8, 0.8]\n"
SUN = "[[light]]\nazimuth_deg = 30\nelevation_deg = 40\ncolor = [2, 2, 2]\n"


@pytest.mark.parametrize("azimuth", [90, -90])
def test_shadows_lie_on_the_side_away_from_the_light_and_can_be_left_out(stage, scene, seen, azimuth):
    text = GROUND + SUN.replace("30", str(azimuth)) + COPY.format(x=0, z=0)
    shown = stage(scene(text))
    with_shadow, without = seen(shown), seen(shown, shadows=False)
    columns = np.flatnonzero((without > with_shadow).any(axis=(0, 2)))
    left, right = 32 - columns.min(), columns.max() - 31
    # Azimuth 90 is +X, the right of the picture.
    assert left > right + 2 if azimuth > 0 else right > left + 2


def test_albedo_is_the_same_under_any_light(stage, scene, seen):
    text = GROUND + COPY.format(x=0, z=0)
    dim, bright = (stage(scene(text + SUN.replace("[2, 2, 2]", color))) for color in ("[0.1, 0, 0]", "[3, 3, 3]"))
    np.testing.assert_array_equal(seen(dim, view="albedo"), seen(bright, view="albedo"))
    assert (seen(dim) != seen(bright)).any()


def test_normals_are_those_of_the_viewer(stage, scene, seen):
    pixels = seen(stage(scene(GROUND + COPY.format(x=0, z=0))), view="normals")
    np.testing.assert_allclose(pixels[32, 32], (128, 128, 255), atol=12)
    np.testing.assert_allclose(pixels[63, 2], (128, 255, 128), atol=2)
    np.testing.assert_allclose(pixels[2, 2], (128, 128, 128), atol=1)


def test_overdraw_adds_up_the_quads(stage, scene, seen):
    row = "".join(COPY.format(x=0, z=-z) for z in range(3))
    one, three = (seen(stage(scene(text)), view="overdraw") for text in (COPY.format(x=0, z=0), row))
    assert one[32, 32, 0] == pytest.approx(32, abs=1)
    assert three[32, 32, 0] == pytest.approx(96, abs=3)
    assert not one[:, :10].any()


@pytest.mark.parametrize("picture", ["", 'ptm = "floor.ptm"\ntile = 1.5\n'])
def test_the_ground_reaches_as_far_wherever_the_eye_is(stage, scene, seen, folder, picture):
    write_ptm(quantise(matt_bumps()[1]), folder / "floor.ptm")
    here = GROUND + picture + "reach = 30\n"
    pictures = []
    for x in (0, 900):
        text = SCENE.replace("eye = [0, 0.5, 5]", f"eye = [{x}, 0.5, 5]").replace(
            "target = [0, 0.5, 0]", f"target = [{x}, 0.5, 0]"
        )
        (folder / f"{x}.toml").write_text(text + here)
        pictures.append(seen(stage(load_scene(folder / f"{x}.toml"))))
    # 900 m are 600 repeats.
    assert np.abs(pictures[0] - pictures[1]).max() <= 12
    assert (pictures[1][60] != pictures[1][2]).any()


def test_triangles_of_fans_that_are_seen_are_counted(stage, scene, seen, ctx):
    text = '[[instance]]\nmodel = "box.ply"\nposition = [{}, 0, 0]\n'
    loaded = scene(text.format(0) + text.format(1) + text.format(500))
    write_fan_for(loaded)
    shown = stage(loaded)
    seen(shown)
    walker = Walker(np.zeros(3))
    walker.look_at(loaded.camera.eye, loaded.camera.target)
    assert shown.triangles_not_drawn(walker.camera(50, 1, 0.1, 100), (64, 64)) == 2 * 12


def write_fan_for(loaded):
    """Put the fan where a bake of its model would."""
    (placement,) = loaded.instances
    placement.subject.fan.parent.mkdir()
    write_fan(placement.subject.fan, box_fan(RED))


def test_shadows_fall_on_a_wall(stage, scene, seen, folder):
    write_ptm(quantise(matt_bumps()[1]), folder / "wall.ptm")
    wall = '[[surface]]\nptm = "wall.ptm"\nwidth = 8\nheight = 8\nposition = [0, 0, -1]\n'
    text = SUN.replace("30", "60") + wall + COPY.format(x=0, z=0)
    shown = stage(scene(text))
    darker = (seen(shown, shadows=False) > seen(shown)).any(axis=(0, 2))
    # The light is on the right, so the shadow on the left of the copy.
    assert darker[10:20].any() and not darker[44:].any()


@pytest.mark.parametrize("back", [5, 14, 40])
def test_shadows_on_the_ground_are_not_seen_through_what_lies_on_it(stage, scene, seen, folder, back):
    """The light is right behind the viewer: the shadow of a panel at two centimetres' height lies all under it."""
    write_ptm(quantise(matt_bumps()[1]), folder / "panel.ptm")
    panel = '[[surface]]\nptm = "panel.ptm"\nwidth = 2\nheight = 2\nposition = [0, 0.02, 0]\npitch_deg = 90\n'
    sun = SUN.replace("30", "0").replace("40", "10")
    shown = scene(GROUND + sun + panel)
    eye = (0.0, back * np.tan(np.radians(10)), float(back))
    shown = stage(replace(shown, camera=replace(shown.camera, eye=eye, target=(0.0, 0.0, 0.0), fov_deg=100 / back)))
    bare = seen(shown, shadows=False)
    # Four pixels at the panel's corners may be partly ground.
    assert (seen(shown) != bare).any(axis=-1).sum() <= 4
    assert np.ptp(bare[..., 0]) > 30
