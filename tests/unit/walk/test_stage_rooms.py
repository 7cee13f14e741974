"""Rooms of a scene on the stage: their light, their walls, how they turn, and what they capture of the scene."""

import numpy as np
import pytest
from OpenImageIO import ImageBuf, ImageSpec

from impostor.environment.panorama import panorama_directions
from impostor.errors import EnvironmentFileError
from runtime.gl.canvas import Canvas
from runtime.stage.stage import Stage
from runtime.walk.walker import Walker
from tests.solids import Box, solid_model
from tests.unit.walk.test_stage import HIGH, LOW, bluish, reddish, write_ply

SCENE = """
ambient = 0
contact_shadow = 0
[camera]
eye = [0, 0.5, 5]
target = [0, 0.5, 0]
"""
WHITE = (255, 255, 255)


def write_panorama(path, paint):
    """An EXR panorama whose radiance is a function of direction."""
    radiance = np.ascontiguousarray(paint(panorama_directions(64)), np.float32)
    picture = ImageBuf(ImageSpec(128, 64, 3, "float"))
    assert picture.set_pixels(picture.roi, radiance) and picture.write(str(path))


def red_on_the_right(directions):
    """Red from +X, blue from -X."""
    right = (directions[..., :1] > 0).astype(float)
    return right * (1, 0, 0) + (1 - right) * (0, 0, 1)


@pytest.fixture
def folder(tmp_path):
    write_ply(tmp_path / "box.ply", solid_model(Box(LOW, HIGH, WHITE)))
    write_panorama(tmp_path / "sides.exr", red_on_the_right)
    return tmp_path


@pytest.fixture
def see(ctx, folder):
    """Draws scenes, 64x64, rooms turned by some yaws."""
    from impostor.files.scene_file import load_scene

    canvas, stages = Canvas(ctx, 64, 64), {}

    def draw(text, yaws=None, target=None):
        if text not in stages:
            (folder / "scene.toml").write_text(SCENE + text)
            stages[text] = Stage(ctx, load_scene(folder / "scene.toml"))
        stage, walker = stages[text], Walker(np.zeros(3))
        camera = stage.scene.camera
        walker.look_at(camera.eye, target or camera.target)
        stage.light(stage.scene.lights, stage.scene.ambient, (0, 0, 0), yaws)
        stage.draw(canvas, walker.camera(50, 1.0, *stage.range_from(walker.eye)))
        return canvas.pixels().astype(int)

    yield draw
    for stage in stages.values():
        stage.release()
    canvas.release()


def test_a_far_room_is_the_sky_and_the_light(see):
    pixels = see('[[room]]\nenvironment = "sides.exr"\n[[mesh]]\nmodel = "box.ply"\n')
    assert reddish(pixels)[:, 40:].all() and bluish(pixels)[:, :20].all()
    # The white face toward the viewer gets half of each.
    red, green, blue = pixels[30, 32]
    assert abs(red - blue) < 10 and red > 100 and green < 20


def test_an_invisible_room_still_lights(see):
    pixels = see('[[room]]\nenvironment = "sides.exr"\nvisible = false\n[[mesh]]\nmodel = "box.ply"\n')
    assert not pixels[:, :10].any() and pixels[30, 32, 0] > 100


def test_a_room_turns_with_what_it_lights(see):
    text = '[[room]]\nenvironment = "sides.exr"\n[[mesh]]\nmodel = "box.ply"\nyaw_deg = 45\n'
    straight, turned = see(text), see(text, [np.pi])
    assert reddish(straight)[5, 60] and bluish(turned)[5, 60]
    right_side = np.s_[28:36, 34:38]
    assert straight[right_side][..., 0].mean() > straight[right_side][..., 2].mean() + 30
    assert turned[right_side][..., 2].mean() > turned[right_side][..., 0].mean() + 30


def test_the_sky_stands_where_the_sun_does(see):
    """In the evening, with the sun in the north-west: a viewer who looks north has it on the left."""
    sun = "[sun]\ntime_of_day = {}\nday_of_year = 172\nlatitude_deg = 60\nnorth_deg = 180\n"
    evening, morning = (see(sun.format(hours) + "[[room]]\nsky = true\n")[:20].mean(axis=(0, 2)) for hours in (21, 3))
    assert evening[:8].mean() > 1.2 * evening[-8:].mean()
    assert morning[-8:].mean() > 1.2 * morning[:8].mean()


def test_a_mirror_shows_the_side_that_it_faces(see):
    """A mirror turned to the right of the viewer shows red from +X."""
    mirror = "reflection = { least = 1, metal = 1 }"
    text = f'[[room]]\nenvironment = "sides.exr"\n[[mesh]]\nmodel = "box.ply"\nyaw_deg = 30\n{mirror}\n'
    pixels = see(text)
    assert pixels[30, 33, 0] > 200 and pixels[30, 33, 2] < 50


def test_a_room_without_a_map_shows_the_scene_but_not_what_mirrors(see, folder):
    """A red box on the left and a blue one on the right; the mirror between them, turned left, shows red."""
    write_ply(folder / "red.ply", solid_model(Box(LOW, HIGH, (255, 0, 0))))
    write_ply(folder / "blue.ply", solid_model(Box(LOW, HIGH, (0, 0, 255))))
    around = "".join(
        f'[[mesh]]\nmodel = "{color}.ply"\nposition = [{x}, -1.5, 0]\nscale = 4\n'
        for color, x in (("red", -4), ("blue", 4))
    )
    mirror = '[[mesh]]\nmodel = "box.ply"\nyaw_deg = {yaw}\nreflection = {{ least = 1, metal = 1 }}\n'
    room = '[[room]]\nshape = "box"\nsize = [12, 6, 12]\nposition = [0, 0.5, 0]\nvisible = false\n'
    light = "[[light]]\nazimuth_deg = 90\nelevation_deg = 30\n[[light]]\nazimuth_deg = -90\nelevation_deg = 30\n"
    left = see(light + room + around + mirror.format(yaw=-30))[30, 30]
    right = see(light + room + around + mirror.format(yaw=30))[30, 33]
    assert left[0] > 60 and left[0] > 2 * left[2], left
    assert right[2] > 60 and right[2] > 2 * right[0], right


def test_a_map_that_cannot_be_read_is_refused_by_name(see, folder):
    (folder / "broken.exr").write_bytes(b"v/1\x01 and no more")
    with pytest.raises(EnvironmentFileError, match=r"broken\.exr"):
        see('[[room]]\nenvironment = "broken.exr"\n')


def test_a_camera_sees_as_far_as_the_walls_of_a_room_not_yet_captured(ctx, folder):
    from impostor.files.scene_file import load_scene

    room = '[[room]]\nshape = "box"\nsize = [60, 30, 60]\nposition = [0, 0, 0]\n'
    (folder / "scene.toml").write_text(SCENE + room + '[[mesh]]\nmodel = "box.ply"\n')
    stage = Stage(ctx, load_scene(folder / "scene.toml"))
    assert stage.range_from(np.zeros(3))[1] > np.linalg.norm([30, 15, 30])
    stage.release()
