"""What goes wrong is one line on standard error that names file or flag and value; nothing is left behind."""

import struct
import warnings

import numpy as np
import pytest

from impostor.cli import main
from tests.data import DATA, needs_data
from tests.end_to_end.commands import CUBE, CUBE_FACES, SMALL, SQUARE, SQUARE_FACES, baked, run, write_obj

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
BAKE = "bake ok.obj -o o.fan "
RENDER = "render good.fan -o o.png "
COMPARE = "compare good.fan cube.obj "
MODELS = (".3mf", ".dae", ".glb", ".gltf", ".obj", ".off", ".ply", ".stl")


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    folder = tmp_path_factory.mktemp("good")
    model = write_obj(folder / "cube.obj", CUBE, CUBE_FACES)
    return baked(model, folder / "good.fan").read_bytes()


@pytest.fixture
def folder(tmp_path, good, monkeypatch):
    """A folder of good and bad files, and in it the process."""
    files = {
        "ok.obj": (TRIANGLE + "f 1 2 3\n").encode(),
        "empty.glb": b"",
        "text.glb": b"hello, I am a text file",
        "tiny.obj": b"v 0 0 0\nv 1e-30 0 0\nv 0 1e-30 0\nf 1 2 3\n",
        "faceless.obj": TRIANGLE.encode(),
        "points.obj": (TRIANGLE + "l 1 2\np 1\n").encode(),
        "nan.obj": b"v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n",
        "textured.obj": f"mtllib textured.mtl\n{TRIANGLE}vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n".encode(),
        "textured.mtl": b"newmtl a\nmap_Kd gone.png\n",
        "lying.stl": bytes(80) + struct.pack("<I", 4_000_000_000),
        "there.fan": b"an output of last week",
        "there.png": b"an output of last week",
        "good.fan": good,
        "cut.fan": good[: len(good) // 2],
        "altered.fan": good[:-500] + bytes([good[-500] ^ 1]) + good[-499:],
        "empty.fan": b"",
    }
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    write_obj(tmp_path / "cube.obj", CUBE, CUBE_FACES)
    write_obj(tmp_path / "square.obj", [[x, 0, -y] for x, y, _ in SQUARE], SQUARE_FACES)
    (tmp_path / "folder.fan").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def contents(folder):
    return {path.name: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


@pytest.mark.parametrize(
    ("command", "code", "parts"),
    [
        # Models
        ("bake empty.glb -o o.fan", 1, ["empty.glb", "0 bytes", "expected"]),
        ("bake text.glb -o o.fan", 1, ["text.glb", "b'hell'", "expected b'glTF'"]),
        ("bake faceless.obj -o o.fan", 1, ["faceless.obj", "no triangles", "expected"]),
        ("bake points.obj -o o.fan", 1, ["points.obj", "no triangles", "expected"]),
        ("bake nan.obj -o o.fan", 1, ["nan.obj", "vertex 1", "nan", "expected finite"]),
        ("bake tiny.obj -o o.fan", 1, ["tiny.obj: 1e-30 m large; expected at least 1e-18 m"]),
        ("bake textured.obj -o o.fan", 1, ["textured.obj", "map_Kd", "gone.png", "missing", "expected"]),
        ("bake lying.stl -o o.fan", 1, ["lying.stl", "4000000000 triangles", "84"]),
        ("bake gone.obj -o o.fan", 1, ["gone.obj", "no such file", "expected"]),
        ("bake folder.fan -o o.fan", 1, ["folder.fan", "directory", "expected"]),
        ("bake good.fan -o o.fan", 1, ["good.fan", "'.fan'", "expected", *MODELS]),
        ("bake square.obj -o o.fan --elevation 0 --views 4 --size 16", 2, ["--size", "no texel", "edge-on"]),
        ("render scene.toml -o o.png", 1, ["scene.toml", "does not exist", "expected"]),
        ("info gone.ply", 1, ["gone.ply", "no such file", "expected"]),
        ("compare good.fan nan.obj", 1, ["nan.obj", "vertex 1", "expected finite"]),
        ("compare good.fan tiny.obj", 1, ["tiny.obj: 1e-30 m"]),
        (
            "compare good.fan square.obj",
            1,
            ["square.obj: is not what good.fan shows", "1 m apart", "; expected the model"],
        ),
        # Outputs
        (f"bake gone.obj -o {'long' * 60}.fan", 1, ["long.fan: cannot be written: File name too long; expected"]),
        ("bake ok.obj -o there.fan", 1, ["there.fan", "exists", "--force"]),
        ("bake ok.obj -o folder.fan --force", 1, ["folder.fan", "is a directory", "expected"]),
        ("bake ok.obj -o missing/o.fan", 1, ["missing/o.fan", "does not exist", "expected"]),
        ("bake ok.obj -o ok.obj/o.fan", 1, ["ok.obj/o.fan", "does not exist", "expected"]),
        ("bake ok.obj -o /proc/o.fan --views 1 --size 8", 1, ["/proc/o.fan", "cannot be written"]),
        ("bake ok.obj -o ok.obj --force", 1, ["ok.obj", "'.obj'", "expected", "'.fan'"]),
        ("bake ok.obj -o o.fan --picture o.fan", 1, ["o.fan", "expected", "'.png'"]),
        ("bake ok.obj -o o.fan --picture there.png", 1, ["there.png", "exists", "--force"]),
        ("bake ok.obj -o o.fan --picture missing/o.png", 1, ["missing/o.png", "does not exist", "expected"]),
        ("render good.fan -o there.png", 1, ["there.png", "exists", "--force"]),
        ("render good.fan -o good.fan --force", 1, ["good.fan", "expected", "'.png'"]),
        ("render good.fan -o o.jpg", 1, ["o.jpg", "'.jpg'", "expected", "'.png'"]),
        ("render good.fan -o /proc/o.png --size 8x8", 1, ["/proc/o.png", "cannot be written"]),
        ("info good.fan --picture there.png", 1, ["there.png", "exists", "--force"]),
        ("compare good.fan cube.obj --picture there.png", 1, ["there.png", "exists", "--force"]),
        # Fans
        ("render cut.fan -o o.png", 1, ["cut.fan", "bytes", "truncated"]),
        ("render altered.fan -o o.png", 1, ["altered.fan", "altered"]),
        ("render gone.fan -o o.png", 1, ["gone.fan", "no such file", "expected"]),
        ("info empty.fan --json", 1, ["empty.fan", "0 bytes"]),
        ("info folder.fan", 1, ["folder.fan", "expected"]),
        ("validate cut.fan", 1, ["cut.fan", "bytes", "truncated"]),
        ("validate ok.obj", 1, ["ok.obj", "not a .fan"]),
        ("compare cut.fan cube.obj", 1, ["cut.fan", "bytes", "truncated"]),
        ("compare cube.obj good.fan", 1, ["cube.obj", "not a .fan"]),
        # Numbers and choices
        (BAKE + "--views 0", 2, ["--views", "0", "expected 1 to 2048"]),
        (BAKE + "--views -3", 2, ["--views", "-3", "expected 1 to 2048"]),
        (BAKE + "--views 1e3", 2, ["--views", "'1e3'", "expected a valid integer"]),
        (BAKE + "--views 99999999", 2, ["--views", "99999999", "expected"]),
        (BAKE + "--size 100000", 2, ["--size", "100000", "expected 8 to 4096"]),
        (BAKE + "--size 0", 2, ["--size", "0", "expected 8 to 4096"]),
        (BAKE + "--elevation 90", 2, ["--elevation", "90", "expected"]),
        (BAKE + "--elevation nan", 2, ["--elevation", "nan", "expected"]),
        (BAKE + "--elevation steep", 2, ["--elevation", "'steep'", "expected a valid number"]),
        (BAKE + "--layout cube", 2, ["--layout", "'cube'", "ring, hemisphere, sphere"]),
        (BAKE + "--layout sphere --elevation 15", 2, ["--elevation", "15", "sphere", "expected it of a ring"]),
        (BAKE + "--perspective 0", 2, ["--perspective", "0 m", "expected"]),
        (BAKE + "--perspective -5", 2, ["--perspective", "-5 m", "expected"]),
        (BAKE + "--perspective inf", 2, ["--perspective", "inf m", "expected"]),
        (BAKE + "--perspective 0.5", 2, ["--perspective", "0.5 m", "expected more than 0.74"]),
        (BAKE + "--perspective 1e300", 2, ["--perspective", "1e+300 m", "expected at most"]),
        (BAKE + "--samples 3", 2, ["--samples", "3", "expected 1, 2 or 4"]),
        (BAKE + "--up x", 2, ["--up", "'x'", "expected y or z"]),
        ("info ok.obj --picture o.png", 2, ["--picture", "ok.obj", "expected a .fan"]),
        (RENDER + "--size 10", 2, ["--size", "'10'", "expected WIDTHxHEIGHT"]),
        (RENDER + "--size 0x10", 2, ["--size", "'0x10'", "expected WIDTHxHEIGHT"]),
        (RENDER + "--size 99999x9", 2, ["--size", "'99999x9'", "at most 16384"]),
        (RENDER + "--size ²x²", 2, ["--size", "'²x²'", "expected WIDTHxHEIGHT"]),
        (RENDER + "--light 1,2,3", 2, ["--light", "'1,2,3'", "expected 2 or 5"]),
        (RENDER + "--light north,up", 2, ["--light", "'north,up'", "expected 2 or 5"]),
        (RENDER + "--light nan,0", 2, ["--light", "'nan,0'", "finite"]),
        (RENDER + "--light 0,45,-1,0,0", 2, ["--light", "'0,45,-1,0,0'", "expected", "colour"]),
        (RENDER + "--light 45,135", 2, ["--light", "'45,135'", "expected", "-90 to 90"]),
        (RENDER + "--ambient -1", 2, ["--ambient", "-1", "expected"]),
        (RENDER + "--environment a.hdr --exposure 0", 2, ["--exposure: 0; expected a number above 0"]),
        (RENDER + "--ambient dark", 2, ["--ambient", "'dark'", "expected a valid number"]),
        (RENDER + "--gloss 1", 2, ["--gloss", "'1'", "expected 2"]),
        (RENDER + "--gloss 1,0", 2, ["--gloss", "'1,0'", "expected"]),
        (RENDER + "--background red", 2, ["--background", "'red'", "expected 3"]),
        (RENDER + "--background 255,0,0", 2, ["--background", "'255,0,0'", "expected", "0 to 1"]),
        (RENDER + "--up y", 2, ["--up", "good.fan", "expected it with a model"]),
        (RENDER + "--allow-missing-textures", 2, ["--allow-missing-textures", "good.fan", "expected it with a model"]),
        ("info good.fan --up z", 2, ["--up", "good.fan", "expected it with a model"]),
        (RENDER + "--method guess", 2, ["--method", "'guess'", "expected", "nearest"]),
        (RENDER + "--output shiny", 2, ["--output", "'shiny'", "lit, albedo, normal, depth, alpha"]),
        (RENDER + "--elevation 91", 2, ["--elevation", "91", "expected -90 to 90"]),
        (RENDER + "--azimuth nan", 2, ["--azimuth", "nan", "expected"]),
        (RENDER + "--eye 1,2", 2, ["--eye", "'1,2'", "expected 3"]),
        (RENDER + "--eye 1,2,3 --target 1,2,3", 2, ["eye and target", "[1.0, 2.0, 3.0]", "expected"]),
        (RENDER + "--eye 1,2,3 --azimuth 30", 2, ["--azimuth", "30", "--eye", "expected"]),
        (RENDER + "--eye 1,2,3 --fov 180", 2, ["--fov", "180", "expected"]),
        (RENDER + "--target 1,2,3", 2, ["--target", "1,2,3", "--eye", "expected"]),
        (RENDER + "--fov 30", 2, ["--fov", "30", "--eye", "expected"]),
        (COMPARE + "--offsets abc", 2, ["--offsets", "'abc'", "expected"]),
        (COMPARE + "--offsets 0,80", 2, ["--offsets", "80", "ring at 15", "expected -105 to 75"]),
        (COMPARE + "--offsets=-106", 2, ["--offsets", "-106", "ring at 15", "expected -105 to 75"]),
        (COMPARE + "--offsets 0,,5", 2, ["--offsets", "'0,,5'", "expected"]),
        (COMPARE + "--cameras 0", 2, ["--cameras", "0", "expected 1 to 360"]),
        (COMPARE + "--size 5", 2, ["--size", "5", "expected 16 to 4096"]),
        (COMPARE + "--up x", 2, ["--up", "'x'", "expected y or z"]),
        (COMPARE + "--light 1,2,3", 2, ["--light", "'1,2,3'", "expected 2 or 5"]),
        (COMPARE + "--method guess", 2, ["--method", "'guess'", "expected", "nearest"]),
        # Usage
        ("bake -o o.fan ", 2, ["MODEL: missing; expected one (see impostor bake --help)"]),
        ("bake ok.obj", 2, ["--output: missing; expected one (see impostor bake --help)"]),
        ("bake", 2, ["MODEL", "impostor bake --help"]),
        ("bake ok.obj", 2, ["-o", "impostor bake --help"]),
        ("bake -o o.fan", 2, ["MODEL", "impostor bake --help"]),
        ("render good.fan", 2, ["-o", "impostor render --help"]),
        ("compare good.fan", 2, ["MODEL", "impostor compare --help"]),
        ("validate", 2, ["FILE", "impostor validate --help"]),
        ("info", 2, ["FILE", "impostor info --help"]),
        (BAKE + "more.obj", 2, ["more.obj", "--help"]),
        (BAKE + "--shiny", 2, ["--shiny", "--help"]),
        (BAKE + "--size", 2, ["--size", "requires", "--help"]),
        ("shine", 2, ["'shine'", "--help"]),
        ("--shine", 2, ["--shine", "--help"]),
    ],
)
def test_bad_input_is_one_line(folder, capfd, command, code, parts):
    before = contents(folder)
    assert run(*command.split()) == code
    out, err = capfd.readouterr()
    assert out == ""
    assert err.startswith(("impostor: ", "cut.fan: ", "ok.obj: ")) and err.count("\n") == 1
    assert all(part in err for part in parts), err
    assert contents(folder) == before


@pytest.mark.parametrize("name", ["", " "])
def test_an_output_without_a_name(folder, capfd, name):
    before = contents(folder)
    assert main(["bake", "ok.obj", "-o", name]) == 1
    assert capfd.readouterr().err.count("\n") == 1
    assert contents(folder) == before


def test_more_than_the_memory_holds_is_one_line(folder, capfd, monkeypatch):
    def zeros(shape, *arguments, zeros=np.zeros, **options):
        if np.prod(shape, dtype=float) > 1e9:
            raise MemoryError
        return zeros(shape, *arguments, **options)

    monkeypatch.setattr(np, "zeros", zeros)
    assert main([*BAKE.split(), "--views", "2048", "--size", "4096"]) == 1
    out, err = capfd.readouterr()
    assert out == "" and err.count("\n") == 1
    assert "memory" in err and "smaller or fewer" in err
    assert not (folder / "o.fan").exists()


def test_warnings_are_a_line_each_and_only_of_what_was_done(folder, capfd):
    (folder / "lines.obj").write_text(TRIANGLE + "f 1 2 3\nl 1 2\n")
    assert run("bake", "lines.obj", "-o", "o.fan", *SMALL) == 0
    out, err = capfd.readouterr()
    assert out == ""
    assert err == "impostor: warning: lines.obj: points and lines, not drawn\n"


def test_a_command_leaves_its_process_as_it_was(folder, capfd):
    """A command may be called from a program: it leaves warnings as it found them."""
    before = list(warnings.filters), warnings.showwarning
    assert run("info", "ok.obj") == 0
    assert run("info", "gone.obj") == 1
    assert (list(warnings.filters), warnings.showwarning) == before
    capfd.readouterr()


@needs_data
def test_every_malformed_model_is_refused_in_one_line_or_drawn(folder, capfd):
    drawn = set()
    for model in sorted(path for path in (DATA / "malformed").rglob("*") if path.suffix.lower() in MODELS):
        code = run("bake", model, "-o", "o.fan", *SMALL)
        out, err = capfd.readouterr()
        assert out == ""
        if code == 0:
            drawn.add(model.stem)
            assert all(line.startswith("impostor: warning: ") for line in err.splitlines())
            (folder / "o.fan").unlink()
        else:
            assert (code, err.count("\n")) == (1, 1)
            assert err.startswith(f"impostor: {model}: ")
        assert not list(folder.glob("*o.fan*"))
    # A cut-off list of solids, a mesh full of holes, triangle soup: odd, but each has triangles to draw.
    assert drawn == {
        "AnisotropyBarnLamp",
        "assimp__malformed_property_index_oob",
        "assimp__triangle_with_empty_solid",
        "meshoptimizer__fuzz",
        "tinygltf__zero-sized-bin-chunk-440",
        "trimesh__busted",
        "trimesh__soup",
    }
