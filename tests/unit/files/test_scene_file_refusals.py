"""Scene files: what is wrong is named with its line, soon and in little memory."""

import struct
import time
import tracemalloc
import zlib

import pytest
from PIL import Image

from impostor.errors import SceneFileError
from impostor.files.scene_document import LARGEST_FILE
from impostor.files.scene_file import load_scene
from tests.scene_files import CAMERA, fill, refused

INSTANCE = "[[instance]]\nmodel = 'a.glb'"
SCATTER = "[[scatter]]\nmodel = 'a.glb'\ncount = 5\ncircle = [0, 0, 5]"
SURFACE = "[[surface]]\nptm = 'a.ptm'\nwidth = 1\nheight = 1"


@pytest.fixture
def folder(tmp_path):
    return fill(tmp_path)


@pytest.mark.parametrize(
    ("text", "line", "problem"),
    [
        ("", 1, "camera: is missing; expected a table"),
        ("camera = 3", 1, "camera: 3; expected a table, [camera]"),
        ("[camera]\neye = [0, 0, 1]", 1, "camera.target: is missing; expected it, or a [[camera.path]]"),
        ("[camera]\neye = [0, 0, 1]\ntarget = [0.0, 0, 1]", 3, "camera.target: [0.0, 0, 1]; expected another point"),
        (f"{CAMERA}near = 5\nfar = 5", 5, "camera.far: 5; expected more than near, 5"),
        (f"{CAMERA}fov_deg = 180", 4, "camera.fov_deg: 180; expected a number from 1 to 170"),
        (f"{CAMERA}fov_deg = nan", 4, "camera.fov_deg: nan; expected a number from 1 to 170"),
        (f"{CAMERA}fov_deg = true", 4, "camera.fov_deg: true; expected a number"),
        (f"{CAMERA}walking_height = inf", 4, "camera.walking_height: inf; expected a number above 0"),
        (f"{CAMERA}walking_height = 0", 4, "camera.walking_height: 0; expected a number above 0"),
        (f"{CAMERA}[[camera.path]]\ntime=0\neye=[0,0]\ntarget=[0,0,0]", 4, "camera.path: 1 keys; expected at least 2"),
        (f"{CAMERA}fov = 3", 4, "camera.fov: unknown key; expected 'fov_deg'"),
        (f"{CAMERA}[[room]]", 4, "room[0].environment: is missing; expected one with 'far'"),
        (f"{CAMERA}[[room]]\nenvironment = 'a.jpg'", 5, "room[0].environment: 'a.jpg'; expected a file there"),
        (f"{CAMERA}[[room]]\nsky = true", 5, "room[0].sky: none; expected a [sun] in the scene"),
        (
            f"{CAMERA}[sun]\n[[room]]\nsky = true\nenvironment = 'a.hdr'",
            7,
            "room[0].environment: 'a.hdr'; expected none with",
        ),
        (f"{CAMERA}[sun]\n[[room]]\nsky = true\nshape = 'sphere'\nradius = 1", 6, "room[0].sky: it with 'sphere'"),
        (f"{CAMERA}[[room]]\nenvironment = ''", 5, "room[0].environment: ''; expected the path of a .hdr or .exr file"),
        (f"{CAMERA}[[room]]\nshape = 'box'", 4, "room[0].size: is missing; expected one with 'box'"),
        (f"{CAMERA}[[room]]\nshape = 'sphere'\nradius = 1\nsize = [1, 1, 1]", 7, "room[0].size: [1, 1, 1]; expected"),
        (f"{CAMERA}[[room]]\nenvironment = 'a.hdr'\nradius = 1", 6, "room[0].radius: 1; expected none with 'far'"),
        (f"{CAMERA}[[room]]\nenvironment = 'a.hdr'\nexposure = -1", 6, "room[0].exposure: -1; expected a number"),
        (f"{CAMERA}" + "[[room]]\nenvironment = 'a.hdr'\n" * 5, 4, "room: 5 tables; expected at most 4"),
        (f"{CAMERA}{INSTANCE}\nreflection = {{metal = 2}}", 6, "instance[0].reflection.metal: 2; expected a number"),
        (f"{CAMERA}[lamp]", 4, "lamp: unknown key; expected one of ambient, background, camera,"),
        (f"ambient = -1\n{CAMERA}", 1, "ambient: -1; expected one or three linear numbers"),
        (f"background = '#12345'\n{CAMERA}", 1, "background: '#12345'; expected one or three linear numbers"),
        (f"{CAMERA}[instance]\nmodel = 'a.glb'", 4, "instance: [instance]; expected tables, each below [[instance]]"),
        (f"{CAMERA}[[instance]]", 4, "instance[0]: no subject; expected fan or model"),
        (f"{CAMERA}[[instance]]\nmodel = 'a.blend'", 5, "instance[0].model: 'a.blend'; expected the path of a .3mf, "),
        (f"{CAMERA}[[instance]]\nmodel = 'c.glb'", 5, "instance[0].model: 'c.glb'; expected a file there"),
        (f"{CAMERA}[[instance]]\nmodel = 'deep.glb'", 5, "instance[0].model: 'deep.glb'; expected a file there"),
        (f"{CAMERA}[[instance]]\nmodel = 7", 5, "instance[0].model: 7; expected the path of"),
        (f"{CAMERA}[[instance]]\nmodel = '{'x' * 999}.glb'", 5, f"instance[0].model: '{'x' * 56}...; expected a file"),
        (f'{CAMERA}[[instance]]\nmodel = "\\u0000.glb"', 5, 'instance[0].model: "\\u0000.glb"; expected the path'),
        (f"{CAMERA}{INSTANCE}\nfan = 'a.fan'", 5, "instance[0].model: 'a.glb'; expected lod = true beside a fan"),
        (f"{CAMERA}[[instance]]\nfan = 'a.fan'\nlod = true", 6, "instance[0].lod: true; expected a model beside it"),
        (f"{CAMERA}[[instance]]\nfan = 'a.fan'\n[instance.bake]", 6, "instance[0].bake: a table; expected none"),
        (
            f"{CAMERA}{INSTANCE}\nbake.views = 0",
            6,
            "instance[0].bake.views: 0; expected a whole number from 1 to 2,048",
        ),
        (f"{CAMERA}{INSTANCE}\nbake = {{size = 256,\n layout = 'cone'}}", None, "is not TOML"),
        (f"{CAMERA}{INSTANCE}\nbake = {{layout = 'cone'}}", 6, "instance[0].bake.layout: 'cone'; expected \"ring\", "),
        (
            f"{CAMERA}{INSTANCE}\nbake = {{layout = 'sphere', elevation_deg = 5}}",
            6,
            "instance[0].bake.elevation_deg: 5",
        ),
        (f"{CAMERA}{INSTANCE}\n{INSTANCE}\nscale = 0", 8, "instance[1].scale: 0; expected a number above 0"),
        (
            f"{CAMERA}{INSTANCE}\nposition = [\n 1,\n 'x', 3]",
            6,
            "instance[0].position: [ 1, 'x', 3]; expected [x, y, z]",
        ),
        (f"{CAMERA}{INSTANCE}\nposition = [1, 2, 1e6]", 6, "instance[0].position: [1, 2, 1e6]; expected [x, y, z], or"),
        (f"{CAMERA}{INSTANCE}\nposition = [1]", 6, "instance[0].position: [1]; expected [x, y, z], or"),
        (f"{CAMERA}{INSTANCE}\nposition = 1979-05-27", 6, "instance[0].position: 1979-05-27; expected [x, y, z], or"),
        (f"{CAMERA}{INSTANCE}\nscale = {'9' * 400}", 6, f"instance[0].scale: {'9' * 57}...; expected a number above 0"),
        (f"{CAMERA}{INSTANCE}\nscale = {'9' * 5000}", None, "has a value that cannot be read"),
        (f"{CAMERA}{INSTANCE}\nscale = 1\nscale = 1", 7, "is not TOML: a key is given twice"),
        (f"{CAMERA}{SCATTER}\nrectangle = [0, 0, 1, 1]", 7, "scatter[0].circle: rectangle and circle; expected one of"),
        (f"{CAMERA}[[scatter]]\nmodel = 'a.glb'\ncount = 5", 4, "scatter[0]: no area; expected one of rectangle, "),
        (f"{CAMERA}[[scatter]]\nmodel = 'a.glb'", 4, "scatter[0].count: is missing; expected a whole number from 1 to"),
        (f"{CAMERA}[[scatter]]\n# count\ncount = 1e9", 6, "scatter[0].count: 1e9; expected a whole number from 1 to"),
        (f"{CAMERA}[[scatter]]\ncount = 1_000_000_000", 5, "scatter[0].count: 1_000_000_000; expected a whole number"),
        (
            f"{CAMERA}{SCATTER}\n{SCATTER.replace('count = 5', 'count = 999_999')}",
            10,
            "scatter[1].count: 1,000,004 copies strewn",
        ),
        (f"{CAMERA}{SCATTER}\nscale = [2, 1]", 8, "scatter[0].scale: [2, 1]; expected a number above 0 and at most"),
        (f"{CAMERA}{SCATTER}\nminimum_distance = -1", 8, "scatter[0].minimum_distance: -1; expected a number from 0"),
        (f"{CAMERA}{SCATTER}\ndensity = 'a.png'", 8, "scatter[0].density: 'a.png'; expected a PNG that can be read"),
        (f"{CAMERA}{SCATTER}\nseed = -1", 8, "scatter[0].seed: -1; expected a whole number from 0"),
        (
            f"{CAMERA}[ground]\ntilt_deg = 20\n{SCATTER}\nmax_slope_deg = 15",
            10,
            "scatter[0].max_slope_deg: 15; expected at least 20, the tilt of the whole ground",
        ),
        (
            f"{CAMERA}[[scatter]]\nmodel = 'a.glb'\ncount = 5\npolygon = [\n[0, 0],\n[1, 1],\n[1, 0],\n[0, 1]]",
            7,
            "scatter[0].polygon: edges cross between z 0 and 1",
        ),
        (f"{CAMERA}[ground]\ntexture = 'a.png'\nptm = 'a.ptm'", 6, "ground.ptm: 'a.ptm'; expected a texture or a PTM"),
        (f"{CAMERA}{SURFACE}\ntiling = [1, 0]", 8, "surface[0].tiling: [1, 0]; expected two numbers above 0"),
        (f"{CAMERA}{SURFACE}\n[surface.gloss]\nx = 1", 8, "surface[0].gloss: [surface.gloss]; expected a number"),
        (f"{CAMERA}[sun]\ntime_of_day = 07:30:00", 5, "sun.time_of_day: 07:30:00; expected a number from 0 to 24"),
        (f"{CAMERA}[sun]\n'odd key' = 1", 5, "sun.'odd key': unknown key; expected one of color, "),
        (f"{CAMERA}[sun", 4, "is not TOML: expected"),
        (f"{CAMERA}x = ", None, "is not TOML"),
    ],
)
def test_refused_with_the_line_and_the_key(folder, text, line, problem):
    message = refused(folder, text)
    if line is None:
        assert problem in message
    else:
        assert message.startswith(f"line {line}: {problem}")


def test_times_of_a_flight_must_rise(folder):
    key = "[[camera.path]]\ntime = {}\neye = [0, 0, 1]\ntarget = [0, 0, 0]\n"
    message = refused(folder, CAMERA + key.format(1) + key.format(4) + key.format(4.0))
    assert message == "line 13: camera.path[2].time: 4.0; expected more than the key before, 4"


def test_a_flight_needs_somewhere_to_look(folder):
    key = "[[camera.path]]\ntime = {}\neye = [0, 0, 1]\ntarget = [0, 0, 1]\n"
    assert refused(folder, CAMERA + key.format(0) * 2).startswith("line 7: camera.path[0].target: [0, 0, 1]; ")


def png(width, height):
    """The start of a PNG that claims a size and 9999 bytes of data."""
    head = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + head + struct.pack(">II", zlib.crc32(head), 9999) + b"IDAT"


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (png(100_000, 100_000), "expected a PNG of at most 4,194,304 texels"),
        (png(2049, 2048), "2049 x 2048 texels; expected a PNG of at most 4,194,304"),
        (png(8, 8), "expected a PNG that can be read"),
        (b"", "expected a PNG that can be read"),
    ],
)
def test_a_density_that_lies_about_its_size_costs_nothing(folder, data, problem):
    (folder / "d.png").write_bytes(data)
    tracemalloc.start()
    message = refused(folder, f"{CAMERA}{SCATTER}\ndensity = 'd.png'")
    assert tracemalloc.get_traced_memory()[1] < 10_000_000
    tracemalloc.stop()
    assert message.startswith("line 8: scatter[0].density: ") and problem in message


def test_a_black_density_is_refused(folder):
    Image.new("L", (4, 4)).save(folder / "d.png")
    message = refused(folder, f"{CAMERA}{SCATTER}\ndensity = 'd.png'")
    assert message == "line 8: scatter[0].density: is 0 everywhere; expected some place for points"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (b"# " + b"x" * LARGEST_FILE, "is larger than 1,048,576 bytes"),
        (CAMERA.encode() + b"# \xff", "line 4: is not UTF-8"),
        ("a = " + "[" * 100_000, "is nested too deeply"),
        ("a = " + "{b=" * 100_000, "is nested too deeply"),
        ("\n" + "a." * 100_000 + "b = 1", "line 2: a key of more than 32 parts"),
        ("[" + "'a' . " * 100_000 + "b]", "line 1: a key of more than 32 parts"),
        ("a" * 1_000_000, "line 1: is not TOML"),
        ('"' * 1_000_000, "is not TOML"),
        ("x = 1\n" + '"a' * 500_000, "is not TOML"),
        (CAMERA + "[[instance]]\n" * 20_000, "line 4: instance: 20,000 tables; expected at most 10,000"),
        (CAMERA + "[[scatter]]\n" * 257, "line 4: scatter: 257 tables; expected at most 256"),
        (CAMERA + "[a]\n" + "\n".join(f"k{n} = 1" for n in range(60_000)), "line 4: a: unknown key"),
    ],
)
def test_hostile_files_end_soon(folder, text, problem):
    started = time.process_time()
    assert problem in refused(folder, text)
    assert time.process_time() - started < 5


@pytest.mark.parametrize(
    ("path", "problem"), [("none.toml", "does not exist"), (".", "is a directory"), ("a\0b", "cannot be read")]
)
def test_no_scene_file(folder, path, problem):
    with pytest.raises(SceneFileError, match=problem):
        load_scene(folder / path)


@pytest.mark.parametrize("header", ["[[instance]]", "[[mesh]]"])
def test_a_model_that_may_not_be_read(folder, header, monkeypatch):
    def refuse(path):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr("impostor.files.baked_fans._stamp", refuse)
    message = refused(folder, f"{CAMERA}{header}\nmodel = 'a.glb'")
    kind = header.strip("[]")
    assert (
        message == f"line 5: {kind}[0].model: 'a.glb' cannot be read: Permission denied; expected a model that can be"
    )
