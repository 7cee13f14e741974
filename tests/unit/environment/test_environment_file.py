"""Environment maps as files: what is read is what a viewer inside sees, and everything else is one clear line."""

import importlib
import re
import shutil

import numpy as np
import OpenImageIO as oiio
import pytest
from PIL import Image

from impostor.environment.bright_lights import brightest_direction
from impostor.environment.cube import face_directions, solid_angles
from impostor.environment.environment import Environment
from impostor.environment.panorama import panorama_directions, panorama_from_faces
from impostor.errors import EnvironmentFileError, OutputError, SettingsError
from impostor.files.cube_files import NAMES
from impostor.files.environment_file import describe_map, read_environment, write_environment
from impostor.srgb import linear_from_srgb
from tests.data import DATA, SAMPLES, needs_data

ENV = DATA / "env"
TOWARD = {"right": (1, 0, 0), "left": (-1, 0, 0), "up": (0, 1, 0), "down": (0, -1, 0), "ahead": (0, 0, -1)}
TOWARD["behind"] = (0, 0, 1)
COLORS = np.random.default_rng(2).random((32, 64, 3)).astype(np.float32)


def write(path, texels, kind="float", names=None, **attributes):
    """A picture as OpenImageIO writes it."""
    height, width, channels = texels.shape
    spec = oiio.ImageSpec(width, height, channels, kind)
    if names:
        spec.channelnames = tuple(names)
    for name, value in attributes.items():
        spec.attribute(name, value)
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec) and output.write_image(np.ascontiguousarray(texels)) and output.close()
    return path


def bent(path, texels, place, values):
    """A picture with some texel that it should not have."""
    texels = texels.copy()
    texels[place] = values
    return write(path, texels)


def photographs(folder, names=NAMES[0], suffix=".png", size=16, prefix=""):
    """Six photographs from inside: grey, with a bright top left quarter, each 20 codes brighter than the last."""
    folder.mkdir(exist_ok=True)
    for index, name in enumerate(names):
        texels = np.full((size, size, 3), 40 + 20 * index, np.uint8)
        texels[: size // 2, : size // 2] += 100
        Image.fromarray(texels).save(folder / f"{prefix}{name}{suffix}")
    return folder


def code(index, bright=False):
    """The radiance of such a photograph."""
    return float(linear_from_srgb((40 + 20 * index + 100 * bright) / 255))


def refusal(path, **options):
    """The one line with which a map is refused."""
    with pytest.raises(EnvironmentFileError) as raised:
        read_environment(path, **options)
    line = str(raised.value)
    assert "\n" not in line and "expected" in line
    return line


@pytest.mark.parametrize("suffix", [".hdr", ".exr"])
def test_a_panorama_looks_along_minus_z_in_its_middle(tmp_path, suffix):
    environment = read_environment(write(tmp_path / f"map{suffix}", (1 + panorama_directions(64)).astype(np.float32)))
    assert environment.size == 32 and environment.name == str(tmp_path / f"map{suffix}")
    toward = np.array(list(TOWARD.values()), float)
    assert environment.radiance(toward) == pytest.approx(1 + toward, abs=0.03)


def test_whole_numbers_are_srgb_and_floats_are_linear(tmp_path):
    grey = np.full((16, 32, 3), 188, np.uint8)
    for name in ("a.png", "a.jpg", "a.tif"):
        Image.fromarray(grey).save(tmp_path / name)
        assert read_environment(tmp_path / name).faces == pytest.approx(float(linear_from_srgb(188 / 255)), abs=1e-5)
    write(tmp_path / "b.png", grey.astype(np.uint16) * 257, "uint16")
    assert read_environment(tmp_path / "b.png").faces == pytest.approx(float(linear_from_srgb(188 / 255)), abs=1e-5)
    assert read_environment(write(tmp_path / "c.exr", grey / np.float32(255))).faces == pytest.approx(188 / 255)


@pytest.mark.parametrize(
    ("names", "shown"),
    [("RGBA", [1, 2, 3]), ("Y", [1, 1, 1]), ("YA", [1, 1, 1]), ("ZRGB", [2, 3, 4]), ("ABGR", [4, 3, 2])],
)
def test_three_channels_count_or_one_as_grey(tmp_path, names, shown):
    texels = np.ones((16, 32, len(names)), np.float32) * np.arange(1, len(names) + 1, dtype=np.float32)
    if names.endswith("A"):
        texels[..., -1] = 0.5
    environment = read_environment(write(tmp_path / "map.exr", texels, names=names))
    assert environment.faces.reshape(-1, 3) == pytest.approx(np.tile(shown, (6 * 64, 1)))


def test_alpha_does_not_darken_a_png(tmp_path):
    Image.fromarray(np.full((16, 32, 4), (200, 100, 50, 20), np.uint8)).save(tmp_path / "a.png")
    shown = linear_from_srgb(np.array([200, 100, 50]) / 255)
    assert read_environment(tmp_path / "a.png").faces[0, 0, 0] == pytest.approx(shown, abs=1e-5)


@pytest.mark.parametrize(("lines", "flip"), [("+Y 32 +X 64", np.s_[::-1]), ("-Y 32 -X 64", np.s_[:, ::-1])])
def test_scanlines_run_as_the_header_says(tmp_path, lines, flip):
    path = write(tmp_path / "a.hdr", COLORS)
    write(tmp_path / "b.hdr", COLORS[flip])
    path.write_bytes(path.read_bytes().replace(b"-Y 32 +X 64", lines.encode()))
    assert np.array_equal(read_environment(path).faces, read_environment(tmp_path / "b.hdr").faces)


def test_the_headers_exposure_is_taken_back(tmp_path):
    path = write(tmp_path / "a.hdr", COLORS)
    before = read_environment(path).faces
    path.write_bytes(path.read_bytes().replace(b"\n\n", b"\nEXPOSURE=4.0\n\n", 1))
    assert read_environment(path).faces == pytest.approx(before / 4)


@pytest.mark.parametrize("names", NAMES)
def test_six_faces_by_any_of_their_names(tmp_path, names):
    environment = read_environment(photographs(tmp_path / "six", names, prefix="Old Bridge_"))
    looks = [TOWARD[way] for way in ("right", "left", "up", "down", "ahead", "behind")]
    for index, look in enumerate(looks):
        beside = np.add(look, np.where(np.array(look) == 0, -0.5, 0))
        shown = environment.radiance([beside])[0, 0]
        assert min(abs(shown - code(index)), abs(shown - code(index, True))) < 1e-3


def test_photographs_are_not_mirrored(tmp_path):
    environment = read_environment(photographs(tmp_path / "six"))
    # From inside, looking ahead, the bright quarter is up and to the left; above, the front is at the picture's foot.
    assert environment.radiance([(-0.5, 0.5, -1)])[0] == pytest.approx([code(4, True)] * 3, abs=1e-3)
    assert environment.radiance([(0.5, 0.5, -1)])[0] == pytest.approx([code(4)] * 3, abs=1e-3)
    assert environment.radiance([(1, 0.5, -0.5)])[0] == pytest.approx([code(0, True)] * 3, abs=1e-3)
    assert environment.radiance([(-0.5, 1, 0.5)])[0] == pytest.approx([code(2, True)] * 3, abs=1e-3)
    assert environment.radiance([(-0.5, -1, -0.5)])[0] == pytest.approx([code(3, True)] * 3, abs=1e-3)


def test_mirrored_faces_are_opengls_own(tmp_path):
    environment = read_environment(photographs(tmp_path / "six"), mirrored=True)
    assert environment.faces[4, 2, 2] == pytest.approx([code(4, True)] * 3, abs=1e-5)
    assert environment.radiance([(-0.5, 0.5, 1)])[0] == pytest.approx([code(4, True)] * 3, abs=1e-3)
    assert environment.radiance([(1, 0.5, 0.5)])[0] == pytest.approx([code(0, True)] * 3, abs=1e-3)


@pytest.mark.parametrize("option", [{"mirrored": True}, {"flip_y": True}])
def test_options_mirror_panoramas_as_they_mirror_faces(tmp_path, option):
    path = write(tmp_path / "map.exr", (1 + panorama_directions(64)).astype(np.float32))
    toward = np.random.default_rng(1).normal(size=(50, 3))
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    sign = (1, 1, -1) if "mirrored" in option else (1, -1, 1)
    assert read_environment(path, **option).radiance(toward) == pytest.approx(1 + toward * sign, abs=0.05)
    six = photographs(tmp_path / "six")
    plain, turned = read_environment(six), read_environment(six, **option)
    assert turned.radiance(toward) == pytest.approx(plain.radiance(toward * sign), abs=1e-5)


def test_a_pattern_picks_one_map_of_several(tmp_path):
    photographs(tmp_path, prefix="day_")
    photographs(tmp_path, prefix="night_", size=32)
    assert read_environment(tmp_path / "day_*.png").size == 16
    assert read_environment(tmp_path / "night_*.png").size == 32
    assert "face posx more than once (day_posx.png, night_posx.png)" in refusal(tmp_path)


def test_a_horizontal_cross_is_cut_up(tmp_path):
    faces = [np.asarray(Image.open(photographs(tmp_path / "six") / f"{name}.png")) for name in NAMES[0]]
    cross = np.zeros((48, 64, 3), np.uint8)
    for (row, column), face in zip([(1, 2), (1, 0), (0, 1), (2, 1), (1, 1), (1, 3)], faces, strict=True):
        cross[16 * row : 16 * row + 16, 16 * column : 16 * column + 16] = face
    Image.fromarray(cross).save(tmp_path / "cross.png")
    assert np.array_equal(read_environment(tmp_path / "cross.png").faces, read_environment(tmp_path / "six").faces)
    assert describe_map(tmp_path / "cross.png") == "cross, 64x48"
    Image.fromarray(np.asarray(Image.effect_noise((64, 48), 90).convert("RGB"))).save(tmp_path / "photo.png")
    assert "is 64x48; expected a panorama of 2:1, a horizontal cross of 4:3" in refusal(tmp_path / "photo.png")


def test_size_and_exposure(tmp_path):
    path = write(tmp_path / "a.exr", np.full((32, 64, 3), 2.0, np.float32))
    environment = read_environment(path, 64, exposure=0.5)
    assert environment.size == 64 and environment.faces == pytest.approx(1.0)
    assert read_environment(photographs(tmp_path / "six", size=12)).size == 16
    assert read_environment(tmp_path / "six", 8).size == 8
    for options, said in (
        ({"size": 100}, "size: 100; expected a power of two from 8 to 4096"),
        ({"exposure": 0.0}, "exposure: 0; expected a number above 0"),
        ({"exposure": float("nan")}, "exposure: nan; expected"),
        ({"exposure": 1e39}, "exposure: 1e+39 makes radiance infinite; expected at most 1.70141e+38"),
        ({"exposure": 3e38}, "exposure: 3e+38 makes radiance infinite; expected at most 1.70141e+38"),
    ):
        with pytest.raises(SettingsError, match=re.escape(said)):
            read_environment(path, **options)


def test_what_is_no_map_is_said(tmp_path):
    assert "does not exist" in refusal(tmp_path / "none.hdr")
    (tmp_path / "empty.hdr").write_bytes(b"")
    assert "is empty; expected a picture" in refusal(tmp_path / "empty.hdr")
    (tmp_path / "text.hdr").write_text("hello, this is no picture\n")
    assert "begins with b'hell'; expected an HDR, EXR" in refusal(tmp_path / "text.hdr")
    (tmp_path / "radiance.hdr").write_text("#?RADIANCE\nhello\n")
    assert "truncated or damaged" in refusal(tmp_path / "radiance.hdr")
    assert "is 100x60; expected a panorama of 2:1" in refusal(write(tmp_path / "a.exr", np.ones((60, 100, 3), "f4")))
    assert "has none of the six faces" in refusal(photographs(tmp_path / "other", ["a", "b"]))
    assert "has none of the six faces" in refusal(tmp_path / "*.png")
    assert "does not exist" in refusal(tmp_path / "nowhere" / "*.png")
    assert "has more than one *; expected one" in refusal(tmp_path / "*_*.png")


@pytest.mark.parametrize("size", ["-Y 1000000 +X 2000000", "-Y 30000 +X 60000"])
def test_a_header_that_claims_too_much_costs_nothing(tmp_path, size):
    path = tmp_path / "huge.hdr"
    path.write_bytes(f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\n".encode() + b"x" * 100)
    refusal(path)
    png = tmp_path / "huge.png"
    Image.fromarray(np.zeros((4, 8, 3), np.uint8)).save(png)
    data = bytearray(png.read_bytes())
    data[16:24] = (10**6).to_bytes(4, "big") * 2
    png.write_bytes(data)
    refusal(png)


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (np.nan, "1 texel is not finite, the first in row 3, column 5 (nan)"),
        (np.inf, "1 texel is not finite, the first in row 3, column 5 (inf)"),
        (-0.5, "1 texel is negative, the first in row 3, column 5 (-0.5)"),
    ],
)
def test_a_bad_texel_is_counted_and_placed(tmp_path, value, said):
    assert said in refusal(bent(tmp_path / "a.exr", COLORS, (3, 5, 1), value))


def test_only_what_lossy_compression_leaves_below_zero_is_zero(tmp_path):
    below = COLORS.copy()
    below[3, 5] = -0.004
    assert "negative" in refusal(write(tmp_path / "a.exr", below))
    path = write(tmp_path / "b.exr", np.tile(below, (4, 4, 1)), compression="dwaa:1")
    assert oiio.ImageInput.open(str(path)).read_image("float").min() < 0
    assert read_environment(path).faces.min() >= 0
    below[3, 5] = -0.5
    assert "negative" in refusal(write(tmp_path / "c.exr", below, compression="dwaa:1"))


def test_other_primaries_and_cut_windows_are_refused(tmp_path):
    texels = np.ones((8, 16, 3), np.float32)
    spec = oiio.ImageSpec(16, 8, 3, "half")
    spec.attribute("chromaticities", oiio.TypeDesc("float[8]"), (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32, 0.34))
    output = oiio.ImageOutput.create("a.exr")
    assert output.open(str(tmp_path / "a.exr"), spec) and output.write_image(texels) and output.close()
    assert "red primary at 0.713, 0.293; expected those of sRGB" in refusal(tmp_path / "a.exr")
    spec = oiio.ImageSpec(16, 8, 3, "half")
    spec.full_width, spec.full_height = 32, 16
    output = oiio.ImageOutput.create("b.exr")
    assert output.open(str(tmp_path / "b.exr"), spec) and output.write_image(texels) and output.close()
    assert "holds 16x8 texels of 32x16; expected all of them" in refusal(tmp_path / "b.exr")


def test_six_faces_are_six_squares_of_one_size(tmp_path):
    six = photographs(tmp_path / "six")
    (six / "negz.png").rename(six / "other.png")
    assert "lacks face negz; expected pictures named posx, negx, posy, negy, posz, negz" in refusal(six)
    photographs(tmp_path / "words", NAMES[2])
    (tmp_path / "words" / "top.png").unlink()
    assert "lacks face top; expected pictures named right, left, top" in refusal(tmp_path / "words")
    Image.new("RGB", (16, 8)).save(six / "negz.png")
    assert "negz.png: is 16x8; expected a square face" in refusal(six)
    Image.new("RGB", (8, 8)).save(six / "negz.png")
    assert "negz.png: is 8x8; expected 16x16 as posx.png" in refusal(six)


@pytest.mark.parametrize("name", ["a.hdr", "a.exr", "lossy.exr", "a.png", "a.jpg", "a.tif"])
def test_a_truncated_file_is_refused_at_every_length(tmp_path, name, capfd):
    path = tmp_path / name
    if name.endswith("r"):
        write(path, COLORS, "half", **({"compression": "dwab:45"} if name == "lossy.exr" else {}))
    else:
        Image.fromarray((COLORS * 255).astype(np.uint8)).save(path)
    data, whole = path.read_bytes(), read_environment(path).faces
    for length in sorted({*range(0, 300, 15), *range(0, len(data), len(data) // 25), len(data) - 1}):
        path.write_bytes(data[:length])
        try:
            read = read_environment(path)
        except EnvironmentFileError as error:
            assert "\n" not in str(error)
        else:
            assert np.array_equal(read.faces, whole), length
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("name", ["a.hdr", "a.exr"])
def test_a_damaged_file_is_refused_or_read(tmp_path, name):
    path, random = write(tmp_path / name, COLORS, "half"), np.random.default_rng(4)
    data = path.read_bytes()
    for _ in range(60):
        damaged = bytearray(data)
        for place in random.integers(len(data), size=3):
            damaged[place] = random.integers(256)
        path.write_bytes(damaged)
        try:
            assert read_environment(path).size <= 1024
        except EnvironmentFileError as error:
            assert "\n" not in str(error)


@pytest.mark.parametrize(("name", "apart"), [("six", 0), ("six/b_*.exr", 0), ("six/*.hdr", 0.004), ("six/*.png", 0.01)])
def test_faces_that_were_written_are_read_again(tmp_path, name, apart):
    environment = Environment("test", np.random.default_rng(6).random((6, 16, 16, 3), dtype=np.float32))
    written = write_environment(tmp_path / name, environment)
    assert len(written) == 6 and all(file.is_file() for file in written)
    assert read_environment(tmp_path / name).faces == pytest.approx(environment.faces, abs=apart)


@pytest.mark.parametrize(("name", "apart"), [("a.exr", 1e-6), ("a.hdr", 0.004), ("a.png", 0.01)])
def test_a_panorama_that_was_written_is_the_environment(tmp_path, name, apart):
    environment = Environment("test", np.tile((face_directions(32).astype(np.float32) + 1) / 2, 1))
    (written,) = write_environment(tmp_path / name, environment)
    assert written == tmp_path / name and describe_map(written) == "panorama, 128x64"
    assert read_environment(written).faces == pytest.approx(environment.faces, abs=0.02)
    texels = oiio.ImageInput.open(str(written)).read_image("float")
    shown = linear_from_srgb(texels) if name.endswith("png") else texels
    assert shown == pytest.approx(panorama_from_faces(environment.faces), abs=apart)


def test_hdr_files_are_not_darker_than_what_is_written(tmp_path):
    environment = Environment("test", np.random.default_rng(6).random((6, 64, 64, 3), dtype=np.float32))
    write_environment(tmp_path / "*.hdr", environment)
    assert read_environment(tmp_path / "*.hdr").faces.mean() == pytest.approx(environment.faces.mean(), rel=1e-4)


def test_writing_replaces_nothing_unasked_and_leaves_nothing_behind(tmp_path):
    environment = Environment("test", np.ones((6, 8, 8, 3), np.float32))
    write_environment(tmp_path / "six", environment)
    before = (tmp_path / "six" / "posx.exr").read_bytes()
    with pytest.raises(OutputError, match="exists already"):
        write_environment(tmp_path / "six", environment)
    write_environment(tmp_path / "six", environment, force=True)
    assert (tmp_path / "six" / "posx.exr").read_bytes() == before
    for name, said in (("a.jpg", "ends in '.jpg'; expected a name that ends in .hdr, .exr, .png, or a folder"),
                       ("a_*_*.exr", "has more than one"),
                       ("none/a.hdr", "does not exist"), ("none/six", "does not exist")):  # fmt: skip
        with pytest.raises(OutputError, match=said):
            write_environment(tmp_path / name, environment)
    assert [file.name for file in tmp_path.iterdir()] == ["six"]
    assert {file.name for file in (tmp_path / "six").iterdir()} == {f"{name}.exr" for name in NAMES[0]}


def test_the_samples_are_bright_where_they_say():
    meadow = read_environment(SAMPLES / "environments" / "meadow.exr")
    x, y, z = brightest_direction(meadow)
    assert np.degrees([np.arctan2(x, z), np.arcsin(y)]) == pytest.approx([128, 36], abs=1)
    assert meadow.faces.max() > 5000
    study = read_environment(SAMPLES / "environments" / "study.exr")
    glass, paper = study.radiance([(2, 0.7, 0.05), (2, 1.4, 2.5)]).mean(axis=1)
    assert glass > 3 * paper
    # In a room of 4 x 3 x 6 metres the tiles of the floor, which are half a metre wide, alternate along the left wall.
    tiles = study.radiance([(-1.75, -1.5, z) for z in np.arange(-1.75, 2, 0.5)]).mean(axis=1)
    assert np.abs(np.diff(tiles)).min() > 0.1 and np.all(np.diff(np.sign(np.diff(tiles))) != 0)


@pytest.mark.parametrize("name", ["meadow", "study"])
def test_the_script_makes_the_samples(monkeypatch, name):
    monkeypatch.syspath_prepend(SAMPLES)
    script, scene = importlib.import_module("environments"), importlib.import_module(name)
    kept = oiio.ImageInput.open(str(SAMPLES / "environments" / f"{name}.exr")).read_image("float")
    made = np.log(script.panorama(scene.radiance, 24))
    assert np.abs(made - np.log(kept.reshape(24, 16, 48, 16, 3).mean(axis=(1, 3)))).mean() < 0.06


@needs_data
@pytest.mark.parametrize("name", ["blender_forest.exr", "blender_studio.exr", "venice_sunset_1k.hdr"])
def test_real_panoramas_keep_their_light(name):
    texels = oiio.ImageInput.open(str(ENV / name)).read_image("float").astype(float)
    rows = -np.diff(np.cos(np.arange(513) * np.pi / 512))[:, None, None] / 2048
    environment = read_environment(ENV / name)
    mean = (environment.faces * solid_angles(256)[..., None]).sum(axis=(0, 1, 2)) / (4 * np.pi)
    assert mean == pytest.approx((texels * rows).sum(axis=(0, 1)), rel=1e-3)


@needs_data
def test_a_real_cube_map_has_no_seams(tmp_path):
    shutil.copytree(ENV / "cube_Bridge2", tmp_path / "bridge")
    environment = read_environment(tmp_path / "bridge", 256)
    rng = np.random.default_rng(3)
    axes = np.array([rng.permutation([1, 1, 0]) * rng.choice([-1, 1], 3) for _ in range(300)], float)
    axes += np.where(axes == 0, rng.uniform(-0.9, 0.9, axes.shape), 0)
    across = np.where(np.arange(3) == np.abs(axes).argmax(axis=1)[:, None], 0.012, 0) * np.sign(axes)
    differences = np.abs(environment.radiance(axes + across) - environment.radiance(axes - across)).mean()
    mirrored = read_environment(tmp_path / "bridge", 256, flip_y=True)
    assert differences < 0.02 < np.abs(environment.faces - mirrored.faces).mean()
