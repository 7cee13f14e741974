"""The commands as a technical artist types them: bake, look, check, draw, compare."""

import os
import pty
import subprocess
import sys

import numpy as np
import pytest

from impostor.files.fan_file import read_fan
from impostor.model import load_model
from tests.data import SAMPLES
from tests.end_to_end.commands import (
    COMMAND,
    CUBE,
    CUBE_FACES,
    SMALL,
    SQUARE,
    SQUARE_FACES,
    baked,
    json_of,
    ok,
    overlap,
    pixels,
    rendered,
    run,
    write_obj,
)
from tests.solids import Sphere

BARE = ("--no-shadow", "--background", "transparent")
ASCII = {"PYTHONIOENCODING": "ascii"}
PLAIN = {"LC_ALL": "C", "LANG": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
KNOT = SAMPLES / "knot.stl"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("commands")


@pytest.fixture(scope="module")
def knot(folder):
    return baked(KNOT, folder / "knot.fan", "--views", 8, "--size", 64)


@pytest.fixture(scope="module")
def sphere(folder):
    positions, _, faces = Sphere(center=(3, 1, -2)).triangles(24)
    model = write_obj(folder / "sphere.obj", positions, faces)
    return model, baked(model, folder / "sphere.fan", "--views", 8, "--size", 64, "--elevation", 0)


@pytest.fixture(scope="module", params=["truck.glb", "house.glb"])
def textured(request, folder):
    model = SAMPLES / request.param
    return model, baked(model, folder / f"{model.stem}.fan", "--views", 4, "--size", 128)


# --- bake, info, validate


def test_bake_says_what_it_made(tmp_path, capsys):
    out = ok(capsys, "bake", KNOT, "-o", tmp_path / "a.fan", "--views", 4, "--size", 32)
    size = (tmp_path / "a.fan").stat().st_size
    assert out.startswith(f"{KNOT} (7,680 triangles) -> {tmp_path / 'a.fan'} (4 views of 32x32, {size / 1e6:.1f} MB, ")
    assert out.count("\n") == 1
    assert ok(capsys, "bake", KNOT, "-o", tmp_path / "b.fan", *SMALL) == ""
    assert sorted(os.listdir(tmp_path)) == ["a.fan", "b.fan"]


def test_info_of_a_fan(knot, capsys):
    summary = json_of(capsys, "info", knot, "--json")
    fan = read_fan(knot)
    assert (summary["layout"], summary["views"], summary["tile_size"]) == ("ring", 8, 64)
    assert (summary["bytes"], summary["covered_texels"]) == (knot.stat().st_size, fan.covered_texels)
    assert (summary["source"], summary["source_sha256"]) == ("knot", fan.source["sha256"])
    assert summary["settings"] == fan.settings
    assert summary["uniform_albedo"] == "#e7e7e7"
    np.testing.assert_allclose(np.array(summary["bounds_m"]).T, fan.bounds, rtol=1e-5)
    lines = ok(capsys, "info", knot).splitlines()
    assert len(lines) == len(summary)
    assert "camera                   orthographic" in lines
    assert any(line.startswith("settings ") and "views 8" in line and "{" not in line for line in lines)


def test_info_of_a_model(capsys):
    summary = json_of(capsys, "info", SAMPLES / "house.glb", "--json")
    assert summary["triangles"] == 4335
    assert len(summary["textures"]) == 1
    assert summary["radius_m"] == pytest.approx(6, rel=0.3)
    assert "triangles      4335\n" in ok(capsys, "info", SAMPLES / "house.glb")


def test_info_of_a_tiny_model_is_not_rounded_away(tmp_path, capsys):
    positions, _, faces = Sphere().triangles(8)
    model = write_obj(tmp_path / "tiny.obj", positions * 1e-6, faces)
    assert json_of(capsys, "info", model, "--json")["radius_m"] == pytest.approx(1e-6, rel=1e-3)
    fan = baked(model, tmp_path / "tiny.fan")
    assert json_of(capsys, "info", fan, "--json")["texel_m"] == pytest.approx(2e-6 / 28, rel=1e-2)


def test_up_z_lays_a_model_down(tmp_path, capsys):
    bounds = [json_of(capsys, "info", KNOT, "--json", "--up", axis)["bounds_m"] for axis in "yz"]
    (x, y, z), lying = bounds
    assert lying == [x, z, [-y[1], -y[0]]]
    fan = baked(KNOT, tmp_path / "z.fan", *SMALL, "--up", "z")
    assert json_of(capsys, "info", fan, "--json")["bounds_m"] == lying
    row = json_of(capsys, "compare", fan, KNOT, "--json", "--offsets", 0, "--cameras", 1)["rows"][0]
    assert row["iou"] > 0.5  # turned again by itself, as the fan says


def test_the_contact_sheet_has_a_row_for_each_layer(knot, tmp_path, capsys):
    ok(capsys, "info", knot, "--picture", tmp_path / "sheet.png")
    sheet, fan = pixels(tmp_path / "sheet.png"), read_fan(knot)
    assert sheet.shape == (4 * 64, 8 * 64, 3)
    assert np.array_equal(sheet[-64:, :64, 0] == 255, fan.silhouette[0])
    ok(capsys, "bake", KNOT, "-o", tmp_path / "k.fan", "--picture", tmp_path / "k.png", *SMALL)
    assert pixels(tmp_path / "k.png").shape == (4 * 32, 4 * 32, 3)


def test_validate_names_what_is_sound_and_what_is_not(knot, tmp_path, capsys):
    assert ok(capsys, "validate", knot, knot) == f"{knot}: sound\n" * 2
    data = bytearray(knot.read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "altered.fan").write_bytes(data)
    assert run("validate", tmp_path / "altered.fan", knot) == 1
    out, err = capsys.readouterr()
    assert out == f"{knot}: sound\n"
    assert err.startswith(f"{tmp_path / 'altered.fan'}: ") and err.count("\n") == 1


def test_a_missing_texture_may_be_allowed(tmp_path, capsys):
    model = write_obj(tmp_path / "square.obj", SQUARE, SQUARE_FACES)
    model.write_text("mtllib square.mtl\nusemtl paint\n" + model.read_text())
    (tmp_path / "square.mtl").write_text("newmtl paint\nKd 1 0 0\nmap_Kd gone.png\n")
    fan = tmp_path / "square.fan"
    assert run("bake", model, "-o", fan, *SMALL) == 1
    assert "gone.png" in capsys.readouterr().err and not fan.exists()
    allowed = (
        ("bake", model, "-o", fan, *SMALL),
        ("render", model, "-o", tmp_path / "a.png", "--size", "16x16", "--output", "albedo"),
        ("compare", fan, model, "--offsets", 0, "--cameras", 1),
    )
    for command in allowed:
        assert run(*command, "--allow-missing-textures") == 0
        err = capsys.readouterr().err
        assert err.count("\n") == 1 and err.startswith(f"impostor: warning: {model}: ") and "gone.png" in err
    assert read_fan(fan).uniform_albedo.tolist() == [255, 0, 0]
    assert pixels(tmp_path / "a.png")[8, 8].tolist() == [255, 0, 0, 255]


# --- render


@pytest.mark.parametrize("azimuth", [0, 90])
def test_a_fan_and_its_mesh_align_to_the_pixel(textured, tmp_path, azimuth):
    # Measured: 0.995 and 0.980 for the truck, 0.988 and 0.997 for the house.
    flags = ("--size", "128x128", "--azimuth", azimuth, "--output", "alpha")
    mesh, fan = (rendered(subject, tmp_path / "a.png", *flags) >= 128 for subject in textured)
    aligned = overlap(mesh, fan)
    assert aligned > 0.97
    for step in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        assert overlap(mesh, np.roll(fan, step, axis=(0, 1))) < aligned


@pytest.mark.parametrize(
    ("output", "largest_mean"),
    [("albedo", 6), ("normal", 12), ("depth", 4), ("lit", 8)],  # measured: 4.0, 8.8, 2.5, 5.1 of 255
)
def test_every_output_of_a_fan_is_near_to_its_mesh(textured, tmp_path, output, largest_mean):
    flags = ("--size", "128x128", "--azimuth", 90, *BARE)
    pictures = [rendered(subject, tmp_path / "a.png", *flags, "--output", output) for subject in textured]
    alphas = [rendered(subject, tmp_path / "a.png", *flags, "--output", "alpha") for subject in textured]
    both = np.minimum(*alphas) >= 250
    assert np.abs(pictures[0] - pictures[1])[both].mean() < largest_mean
    assert pictures[0][both].std() > 10  # not both empty


def test_the_picture_keeps_its_size_and_frames_the_shorter_side(sphere, tmp_path):
    for subject in sphere:
        wide = rendered(subject, tmp_path / "a.png", "--size", "90x50", "--output", "alpha", "--elevation", 0) >= 128
        assert wide.shape == (50, 90)
        rows, columns = np.nonzero(wide)
        assert rows.min() in (0, 1) and rows.max() in (48, 49)
        assert (columns.min() + columns.max()) / 2 == pytest.approx(44.5, abs=0.6)
        assert np.ptp(columns) == pytest.approx(np.ptp(rows), abs=1)


@pytest.mark.parametrize(
    ("light", "bright", "dark"),
    [
        ("90,0", (32, 56), (32, 8)),
        ("-90,0", (32, 8), (32, 56)),
        ("0,90", (8, 32), (56, 32)),
        ("0,-80", (56, 32), (8, 32)),
    ],
)
def test_light_falls_on_the_side_it_comes_from(sphere, tmp_path, light, bright, dark):
    flags = ("--size", "64x64", "--elevation", 0, "--ambient", 0, "--light", f"{light},1,1,1", *BARE)
    for subject in sphere:
        lit = rendered(subject, tmp_path / "a.png", *flags)[..., 0]
        assert lit[bright] > 150
        assert lit[dark] < 10


def test_lights_add_up_in_linear_light(sphere, tmp_path):
    flags = ("--size", "32x32", "--elevation", 0, "--ambient", 0, *BARE)
    colors = "0,0,0.4,0,0", "0,0,0,0.2,0"
    for subject in sphere:
        each = [rendered(subject, tmp_path / "a.png", *flags, "--light", color)[16, 16] for color in colors]
        both = rendered(subject, tmp_path / "a.png", *flags, "--light", colors[0], "--light", colors[1])[16, 16]
        np.testing.assert_allclose(both[:3], each[0][:3] + each[1][:3], atol=1)


def test_perspective_sees_the_object_where_it_stands(sphere, tmp_path):
    # A ball of 1 m, 20 m away: its edge is asin(1/20) off the axis. A fan shows it on a quad in front of its middle.
    edge = 101 * np.tan(np.arcsin(1 / 20)) / np.tan(np.radians(5))
    eye = ("--size", "101x101", "--eye", "3,1,18", "--fov", 10, "--output", "alpha")
    for subject, largest in zip(sphere, (1.01, 1.05), strict=True):
        rows, columns = np.nonzero(rendered(subject, tmp_path / "a.png", *eye, "--target", "3,1,-2") >= 128)
        assert rows.mean() == pytest.approx(50, abs=0.5) and columns.mean() == pytest.approx(50, abs=0.5)
        assert edge - 1.5 < np.ptp(columns) + 1 < largest * edge + 1
        # Looking past it to the right puts it on the left.
        aside = np.nonzero(rendered(subject, tmp_path / "a.png", *eye, "--target", "3.5,1,-2") >= 128)[1]
        assert aside.mean() == pytest.approx(50 - 50.5 * (0.5 / 20) / np.tan(np.radians(5)), abs=1)


def test_an_eye_without_a_target_looks_at_the_middle(sphere, tmp_path):
    for subject in sphere:
        flags = ("--size", "101x101", "--eye", "23,1,-2", "--fov", 10, "--output", "alpha")
        rows, columns = np.nonzero(rendered(subject, tmp_path / "a.png", *flags) >= 128)
        assert rows.mean() == pytest.approx(50, abs=1) and columns.mean() == pytest.approx(50, abs=1)


def test_depth_is_white_at_the_near_end(sphere, tmp_path):
    for subject in sphere:
        flags = ("--size", "64x64", "--elevation", 0, "--output", "depth")
        depth = rendered(subject, tmp_path / "a.png", *flags)
        assert depth[32, 32] == pytest.approx(255, abs=6)
        assert depth[32, 56] == pytest.approx(127.5 + 127.5 * np.sqrt(1 - (24.5 / 32 * 1.02) ** 2), abs=12)
        assert depth[0, 0] == 0


def test_a_shadow_falls_away_from_the_light_and_can_be_left_out(sphere, tmp_path):
    fan = baked(sphere[0], tmp_path / "a.fan", "--views", 8, "--size", 64)
    for subject in (sphere[0], fan):
        flags = ("--size", "96x96", "--eye", "3,6,9", "--fov", 40, "--light", "-90,45", "--ambient", 0.1)
        lit = rendered(subject, tmp_path / "a.png", *flags)[..., 0]
        object_only = rendered(subject, tmp_path / "a.png", *flags, *BARE)
        beside = (object_only[..., 3] == 0) & (np.arange(96)[:, None] > 48)
        columns = np.nonzero(beside & (lit < 0.6 * np.median(lit[beside])))[1]
        assert len(columns) > 40
        assert columns.mean() > np.nonzero(object_only[..., 3])[1].mean() + 5  # the light is on the left


def test_what_lies_flat_on_the_ground_does_not_flicker_with_it(tmp_path):
    model = write_obj(tmp_path / "mat.obj", [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], [[0, 2, 1], [0, 3, 2]])
    for subject in (model, baked(model, tmp_path / "mat.fan", "--views", 4, "--size", 64, "--elevation", 45)):
        flags = ("--size", "64x64", "--elevation", 45)
        whole = rendered(subject, tmp_path / "a.png", *flags, "--output", "alpha") == 255
        assert np.ptp(rendered(subject, tmp_path / "a.png", *flags)[whole], axis=0).max() < 8


def test_gloss_brightens_where_the_light_is_mirrored(sphere, tmp_path):
    for subject in sphere:
        flags = ("--size", "64x64", "--elevation", 0, "--light", "60,0,0.4,0.4,0.4", *BARE)
        plain, glossy = (
            rendered(subject, tmp_path / "a.png", *flags, *more)[..., 0] for more in ((), ("--gloss", "1,40"))
        )
        row, column = np.unravel_index((glossy - plain).argmax(), plain.shape)
        assert column == pytest.approx(31.5 + 32 / 1.02 * np.sin(np.radians(30)), abs=3)
        assert row == pytest.approx(31.5, abs=3)


@pytest.mark.parametrize(
    ("camera", "off"), [(("--elevation", 60), 45), (("--elevation", -20), 35), (("--eye", "0,9,1"), 68)]
)
def test_a_picture_from_far_off_the_ring_says_so(knot, tmp_path, capsys, camera, off):
    assert run("render", knot, "-o", tmp_path / "a.png", "--size", "16x16", *camera) == 0
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    assert err.startswith("impostor: warning: knot: seen from an elevation of ")
    assert float(err.split(" degrees, ")[1].split()[0]) == pytest.approx(off, abs=1)


def test_a_picture_near_the_ring_or_of_a_mesh_or_a_hemisphere_is_as_expected(knot, tmp_path, capsys):
    hemisphere = baked(KNOT, tmp_path / "h.fan", "--views", 24, "--size", 32, "--layout", "hemisphere")
    for subject, elevation in ((knot, 34), (knot, -4), (KNOT, 80), (hemisphere, 85)):
        flags = ("--size", "16x16", "--elevation", elevation, "--force")
        ok(capsys, "render", subject, "-o", tmp_path / "a.png", *flags)


# --- compare


def test_compare_prints_a_table_json_and_a_picture(knot, tmp_path, capsys):
    common = ("compare", knot, KNOT, "--cameras", 2, "--offsets", "0,20")
    table = ok(capsys, *common).splitlines()
    assert table[0].split() == ["method", "offset", "PSNR", "dB", "SSIM", "FLIP", "IoU"]
    report = json_of(capsys, *common, "--json", "--picture", tmp_path / "c.png")
    assert set(report) == {"rows"}
    assert [row["offset_deg"] for row in report["rows"]] == [0, 20]
    for row, line in zip(report["rows"], table[1:], strict=True):
        assert list(row) == ["method", "offset_deg", "psnr_db", "ssim", "flip", "iou"]
        assert row["method"] == "nearest"
        found = [float(word) for word in line.split()[1:]]
        assert found == pytest.approx([row[key] for key in list(row)[1:]], abs=0.01)
    near, far = report["rows"]
    assert near["psnr_db"] > far["psnr_db"] > 10 and near["iou"] > far["iou"] > 0.5
    assert pixels(tmp_path / "c.png").shape == (2 * 64, 3 * 64, 3)


def test_more_views_are_nearer_to_the_mesh(knot, tmp_path, capsys):
    more = baked(KNOT, tmp_path / "more.fan", "--views", 32, "--size", 64)
    few, many = (
        json_of(capsys, "compare", fan, KNOT, "--json", "--offsets", 0, "--cameras", 4, "--size", 64)["rows"][0]
        for fan in (knot, more)
    )
    assert many["psnr_db"] > few["psnr_db"] + 2
    assert many["flip"] < few["flip"] and many["ssim"] > few["ssim"] and many["iou"] > few["iou"]


def test_compare_warns_of_another_file(knot, tmp_path, capsys):
    (part,) = load_model(KNOT).primitives
    saved_again = write_obj(tmp_path / "knot.obj", part.positions, part.triangles)
    assert run("compare", knot, saved_again, "--offsets", 0, "--cameras", 1) == 0
    out, err = capsys.readouterr()
    assert err.count("\n") == 1
    assert "warning" in err and str(saved_again) in err and str(knot) in err
    assert out.count("\n") == 2


def test_compare_refuses_another_object(knot, sphere, capsys):
    assert run("compare", knot, sphere[0], "--offsets", 0, "--cameras", 1) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"impostor: {sphere[0]}: is not what {knot} shows: ") and err.count("\n") == 1


def test_compare_where_there_is_nothing_to_see_is_still_json(tmp_path, capsys):
    """Between two views of a square the camera sees its edge; equal pictures have a PSNR that JSON can say."""
    model = write_obj(tmp_path / "square.obj", SQUARE, SQUARE_FACES)
    fan = baked(model, tmp_path / "square.fan", "--views", 2, "--size", 32)
    (row,) = json_of(capsys, "compare", fan, model, "--json", "--offsets", 0, "--cameras", 1, "--size", 16)["rows"]
    assert (row["psnr_db"], row["ssim"], row["flip"], row["iou"]) == (100, 1, 0, 1)


# --- flags and terminals


@pytest.mark.parametrize(
    "flags",
    [
        ("--views", 6, "--elevation", -20, "--layout", "ring", "--size", 40, "--samples", 1),
        ("--views", 9, "--layout", "hemisphere", "--size", 33),
        ("--views", 9, "--layout", "sphere", "--size", 33, "--up", "z"),
        ("--views", 5, "--perspective", 2.5, "--size", 24, "--samples", 2),
    ],
)
def test_the_flags_of_bake(tmp_path, capsys, flags):
    ok(capsys, "bake", KNOT, "--output", tmp_path / "a.fan", *flags, "--quiet")
    assert ok(capsys, "validate", tmp_path / "a.fan").endswith("sound\n")
    settings = read_fan(tmp_path / "a.fan").settings
    for flag, value in zip(flags[::2], flags[1::2], strict=True):
        assert settings[flag.removeprefix("--")] == value
    elevation = settings["elevation"] or 15
    ok(capsys, "render", tmp_path / "a.fan", "-o", tmp_path / "a.png", "--size", "32x32", "--elevation", elevation)


def test_every_flag_of_render_is_taken(knot, tmp_path, capsys):
    ok(
        capsys, "render", knot, "-o", tmp_path / "a.png", "--size", "40x30", "--azimuth", -400, "--elevation", 30,
        "--light", "10,20", "--light", "30,40,0.5,0.25,1", "--ambient", 0.1, "--gloss", "0.5,20", "--method", "nearest",
        "--output", "lit", "--no-shadow", "--background", "1,0,0", "--force",
    )  # fmt: skip
    assert pixels(tmp_path / "a.png")[0, 0].tolist() == [255, 0, 0, 255]
    ok(capsys, "render", KNOT, "-o", tmp_path / "b.png", "--up", "z", "--allow-missing-textures", "--size", "8x8")


def test_every_flag_of_compare_is_taken(knot, tmp_path, capsys):
    ok(
        capsys, "compare", knot, KNOT, "--json", "--offsets", "-5,75", "--cameras", 1, "--method", "nearest",
        "--size", 16, "--light", "0,45", "--picture", tmp_path / "a.png", "--up", "y", "--force", "--quiet",
        "--allow-missing-textures",
    )  # fmt: skip


def test_force_replaces_an_output(tmp_path, capsys):
    (tmp_path / "a.fan").write_text("old")
    ok(capsys, "bake", KNOT, "-o", tmp_path / "a.fan", *SMALL, "--force")
    (tmp_path / "a.png").write_text("old")
    ok(capsys, "render", tmp_path / "a.fan", "-o", tmp_path / "a.png", "--size", "8x8", "--force")
    assert pixels(tmp_path / "a.png").shape == (8, 8, 4)


def test_without_arguments_the_commands_are_listed(capsys):
    for arguments in ((), ("--help",), ("-h",)):
        out = ok(capsys, *arguments)
        assert all(f"\n  {command} " in out for command in ("bake", "info", "validate", "render", "compare"))
    for command in ("bake", "info", "validate", "render", "compare"):
        assert f"Usage: impostor {command} " in ok(capsys, command, "--help")


def on_a_terminal(*arguments):
    """What a command writes on standard error when that is a terminal."""
    reading, writing = pty.openpty()
    with subprocess.Popen([COMMAND, *map(str, arguments)], stdout=subprocess.PIPE, stderr=writing) as process:
        os.close(writing)
        written = b""
        while True:
            try:
                piece = os.read(reading, 65536)
            except OSError:  # Linux says this when the other end has closed
                break
            if not piece:
                break
            written += piece
    os.close(reading)
    assert process.returncode == 0
    return written.decode()


def test_a_bar_is_drawn_on_a_terminal_only(tmp_path, monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    arguments = ("bake", KNOT, "-o", tmp_path / "a.fan", "--views", 8, "--size", 32, "--force")
    assert "8/8" in on_a_terminal(*arguments)
    assert on_a_terminal(*arguments, "--quiet") == ""
    piped = subprocess.run([COMMAND, *map(str, arguments)], capture_output=True, text=True, check=True)
    assert piped.stderr == ""


class TestNames:
    """File names are bytes; what is printed has the terminal's encoding, and what is stored is UTF-8."""

    def test_a_name_that_the_terminal_cannot_show_is_printed_in_codes(self, tmp_path):
        fan = baked(write_obj(tmp_path / "tree.obj", CUBE, CUBE_FACES), tmp_path / "\u6728.fan")
        done = subprocess.run([COMMAND, "info", fan], capture_output=True, text=True, env=os.environ | ASCII)
        assert (done.returncode, done.stderr) == (0, "")
        assert "\\u6728.fan" in done.stdout

    @pytest.mark.skipif(sys.platform == "darwin", reason="its file systems take UTF-8 only")
    @pytest.mark.parametrize(("raw", "stored"), [(b"b\xff", "b\ufffd"), ("\u6728".encode(), "\u6728")])
    def test_a_name_that_is_no_text_bakes_and_is_told(self, tmp_path, raw, stored):
        model, fan = (os.fsencode(tmp_path) + b"/" + raw + suffix for suffix in (b".obj", b".fan"))
        write_obj(tmp_path / "cube.obj", CUBE, CUBE_FACES).rename(os.fsdecode(model))
        command = [os.fsencode(COMMAND), b"bake", model, b"-o", fan, b"--views", b"2", b"--size", b"16"]
        done = subprocess.run(command, capture_output=True, env=os.environ | PLAIN)
        assert (done.returncode, done.stderr) == (0, b"")
        assert read_fan(os.fsdecode(fan)).source["name"] == stored
