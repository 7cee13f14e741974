"""`impostor ptm fit`, `compare`, `direct`, `capture` and `lights`, as a user types them."""

import shutil
import subprocess

import numpy as np
import pytest
from PIL import Image

from impostor.files.lp_file import read_lp
from impostor.files.ptm_file import read_ptm, write_ptm
from impostor.ptm import Polynomials, quantise
from impostor.ptm.polynomials import evaluate
from tests.captures import LIGHTS, known_polynomials, photographed, write_capture_set, write_photographs
from tests.data import DATA, SAMPLES, needs_data
from tests.end_to_end.commands import COMMAND, json_of, ok, pixels, run

ROSETTE = SAMPLES / "relief" / "rosette.lp"
SYNTHETIC = DATA / "rti" / "synthrti"
UV = LIGHTS[:, :2]


@pytest.fixture
def pictures():
    return photographed(known_polynomials(24, 32), UV)


@pytest.fixture
def lp(tmp_path, pictures):
    return write_capture_set(tmp_path, pictures, LIGHTS)


def refused(capsys, *arguments):
    """The one line on standard error of a command that must fail, and its exit code."""
    code = run(*arguments)
    out, err = capsys.readouterr()
    assert code in (1, 2) and out == ""
    assert err.startswith("impostor: ") and err.count("\n") == 1
    return code, err


@pytest.mark.parametrize("format", ["lrgb", "RGB", "lum"])
def test_fit_writes_a_file_that_shows_the_photographs(capsys, tmp_path, lp, pictures, format):
    said = ok(capsys, "ptm", "fit", lp, "-o", tmp_path / "a.ptm", "--format", format)
    assert f"32x24 {format.upper()}" in said and "30 photographs" in said and "condition number" in said
    ptm = read_ptm(tmp_path / "a.ptm")
    assert (ptm.format, ptm.size, ptm.curve, ptm.parameters) == (format.upper(), (32, 24), "srgb", "light")
    if format == "RGB":
        drawn = evaluate(ptm.polynomials(), *UV[3])
        assert np.abs(drawn - pictures[3] / 255).max() < 0.02


def test_fit_records_the_curve_and_what_its_parameters_are(tmp_path, lp):
    assert run("ptm", "fit", lp, "-o", tmp_path / "a.ptm", "--linear", "--view", "--quiet") == 0
    assert (read_ptm(tmp_path / "a.ptm").curve, read_ptm(tmp_path / "a.ptm").parameters) == ("linear", "view")


def test_fit_with_jpeg_planes_is_smaller(tmp_path):
    sizes = []
    for name, flags in (("raw", ()), ("jpeg", ("--jpeg", 90))):
        assert run("ptm", "fit", ROSETTE, "-o", tmp_path / f"{name}.ptm", *flags, "--quiet") == 0
        sizes.append((tmp_path / f"{name}.ptm").stat().st_size)
    assert sizes[1] < sizes[0] / 3


def test_the_same_photographs_give_the_same_bytes(tmp_path):
    for name, workers in (("a", 1), ("b", 3)):
        assert run("ptm", "fit", ROSETTE, "-o", tmp_path / f"{name}.ptm", "--workers", workers, "--quiet") == 0
    assert (tmp_path / "a.ptm").read_bytes() == (tmp_path / "b.ptm").read_bytes()


def test_focus_stack_of_one_parameter(capsys, tmp_path):
    distances = np.linspace(300, 700, 7)
    known = known_polynomials(6, 6)
    known[..., [1, 2, 4]] = 0
    parameters = np.column_stack([np.linspace(-1, 1, 7), np.zeros(7)])
    paths = write_photographs(tmp_path, photographed(known, parameters), name="focus stack ")
    (tmp_path / "focus.lp").write_text(
        "7\n" + "".join(f"{p.name} {d}\n" for p, d in zip(paths, distances, strict=True))
    )
    said = ok(capsys, "ptm", "fit", tmp_path / "focus.lp", "--series", 1, "--format", "rgb", "-o", tmp_path / "f.ptm")
    assert "u -1..1 is 300..700" in said
    ptm = read_ptm(tmp_path / "f.ptm")
    assert ptm.parameters == "series"
    assert np.abs(ptm.polynomials().coefficients - known).max() < 0.02


def test_series_of_two_parameters_within_one_are_themselves(capsys, tmp_path):
    known = known_polynomials(6, 6)
    paths = write_photographs(tmp_path, photographed(known, UV))
    lines = [f"{path.name} {u} {v}" for path, (u, v) in zip(paths, UV, strict=True)]
    (tmp_path / "series.lp").write_text("\n".join(lines))
    ok(capsys, "ptm", "fit", tmp_path / "series.lp", "--series", 2, "--format", "rgb", "-o", tmp_path / "s.ptm")
    assert np.abs(read_ptm(tmp_path / "s.ptm").polynomials().coefficients - known).max() < 0.02


def test_compare_with_the_photographs_that_were_fitted(capsys, tmp_path, lp):
    assert run("ptm", "fit", lp, "-o", tmp_path / "a.ptm", "--format", "rgb", "--quiet") == 0
    found = json_of(capsys, "ptm", "compare", tmp_path / "a.ptm", lp, "--json")
    assert found["psnr_db"] > 45 and len(found["per_light"]) == 30
    assert set(found["per_light"][0]) == {"photograph", "lu", "lv", "psnr_db"}
    assert found["per_light"][4]["photograph"] == "image04.png"
    table = ok(capsys, "ptm", "compare", tmp_path / "a.ptm", lp).splitlines()
    assert len(table) == 32 and float(table[-1].split()[-1]) == pytest.approx(found["psnr_db"], abs=0.01)


def test_compare_of_a_linear_fit_is_in_stored_values(capsys, tmp_path, lp):
    assert run("ptm", "fit", lp, "-o", tmp_path / "a.ptm", "--format", "rgb", "--linear", "--quiet") == 0
    assert json_of(capsys, "ptm", "compare", tmp_path / "a.ptm", lp, "--json")["psnr_db"] > 30


def test_robust_fit_of_the_sample(capsys, tmp_path):
    assert run("ptm", "fit", ROSETTE, "-o", tmp_path / "a.ptm", "--robust", "--quiet") == 0
    assert json_of(capsys, "ptm", "compare", tmp_path / "a.ptm", ROSETTE, "--json")["psnr_db"] > 15


def test_direct_at_a_photographs_light_is_the_photograph(capsys, tmp_path, lp, pictures):
    u, v = read_lp(lp).directions[5, :2].tolist()
    said = ok(capsys, "ptm", "direct", lp, "--light", f"{u},{v}", "-o", tmp_path / "d.png")
    assert "image05.png 100%" in said
    np.testing.assert_array_equal(pixels(tmp_path / "d.png"), pictures[5])


def test_capture_of_a_mesh_can_be_fitted(capsys, tmp_path):
    lp = tmp_path / "knot.lp"
    said = ok(capsys, "ptm", "capture", SAMPLES / "knot.stl", "-o", lp, "--size", 48, "--dome", "fibonacci:20")
    assert "20 photographs of 48x48" in said
    assert len(read_lp(lp).photographs) == 20
    assert run("ptm", "fit", lp, "-o", tmp_path / "knot.ptm", "--quiet") == 0


def test_capture_of_a_height_picture_brightens_toward_the_light(capsys, tmp_path):
    slope = np.tile(np.arange(0, 256, 8, np.uint8), (16, 1))
    (heights,) = write_photographs(tmp_path, [slope])
    lights = "rings:45x4"
    ok(capsys, "ptm", "capture", heights, "-o", tmp_path / "s.lp", "--dome", lights, "--depth", 16, "--no-bounce")
    # The slope rises to the right, so that it faces left: bright under the light from the left, the third of four.
    right, left = pixels(tmp_path / "s_0.png"), pixels(tmp_path / "s_2.png")
    assert left[8, 16].mean() > right[8, 16].mean() + 40


def test_capture_keeps_the_picture_that_it_photographs(capsys, tmp_path):
    (heights,) = write_photographs(tmp_path, [np.zeros((16, 16), np.uint8)], name="dome_")
    before = heights.read_bytes()
    flags = "-o", tmp_path / "dome.lp", "--dome", "rings:45x12", "--force"
    error = refused(capsys, "ptm", "capture", heights, *flags)[1]
    assert "dome_00.png: would be replaced by a photograph" in error
    assert heights.read_bytes() == before


def test_lights_of_a_ball_become_a_capture_set(capsys, tmp_path):
    from tests.unit.bake.test_chrome_ball import BALL, drawn_ball

    truth = np.array([[0.5, 0, 0.866], [0, 0.6, 0.8], [-0.4, -0.3, 0.866]])
    truth /= np.linalg.norm(truth, axis=1, keepdims=True)
    balls = [np.rint(drawn_ball(light).clip(0, 1) * 255).astype(np.uint8) for light in truth]
    paths = write_photographs(tmp_path, balls, name="ball")
    circle = f"{BALL.x},{BALL.y},{BALL.radius}"
    ok(capsys, "ptm", "lights", *paths, "--circle", circle, "-o", tmp_path / "ball.lp")
    found = read_lp(tmp_path / "ball.lp")
    assert [path.name for path in found.photographs] == [path.name for path in paths]
    assert (found.directions * truth).sum(axis=1).min() > np.cos(np.radians(1.5))
    objects = write_photographs(tmp_path, balls, name="object")
    naming = [part for path in objects for part in ("--of", path)]
    ok(capsys, "ptm", "lights", *paths, "--circle", circle, "-o", tmp_path / "object.lp", *naming)
    assert [path.name for path in read_lp(tmp_path / "object.lp").photographs] == [path.name for path in objects]


@pytest.mark.parametrize(
    ("flags", "code", "word"),
    [
        (("--format", "hsh"), 2, "lrgb"),
        (("--space", "lab", "--format", "lum"), 2, "principal"),
        (("--space", "principal"), 2, "expected --format lum"),
        (("--series", 3), 2, "1 or 2"),
        (("--series", 1, "--view"), 2, "--view"),
        (("--jpeg", 0), 2, "1 to 100"),
        (("--jpeg", 90, "--format", "lum"), 2, "lum"),
        (("--workers", 0), 2, "workers"),
    ],
)
def test_wrong_flags_of_fit_are_one_line(capsys, tmp_path, lp, flags, code, word):
    found, said = refused(capsys, "ptm", "fit", lp, "-o", tmp_path / "a.ptm", *flags)
    assert found == code and word in said
    assert not (tmp_path / "a.ptm").exists()


def test_fit_keeps_an_existing_file_without_force(capsys, tmp_path, lp):
    output = tmp_path / "a.ptm"
    output.write_bytes(b"mine")
    assert "--force" in refused(capsys, "ptm", "fit", lp, "-o", output)[1]
    assert output.read_bytes() == b"mine"
    assert run("ptm", "fit", lp, "-o", output, "--force", "--quiet") == 0
    assert read_ptm(output).size == (32, 24)


def test_bad_capture_sets_are_one_line_and_leave_nothing(capsys, tmp_path, lp):
    output = tmp_path / "a.ptm"
    ring = LIGHTS.copy()
    ring[:, :2] /= np.linalg.norm(ring[:, :2], axis=1, keepdims=True) * np.sqrt(2)
    ring[:, 2] = np.sqrt(0.5)
    lines = lp.read_text().splitlines()
    names = [line.split()[0] for line in lines[1:]]
    bad = tmp_path / "bad.lp"
    bad.write_text("30\n" + "".join(f"{n} {x} {y} {z}\n" for n, (x, y, z) in zip(names, ring, strict=True)))
    said = refused(capsys, "ptm", "fit", bad, "-o", output)[1]
    assert "bad.lp" in said and "condition number" in said and "45 degrees" in said
    bad.write_text("\n".join(["5", *lines[1:6]]))
    assert "at least 6" in refused(capsys, "ptm", "fit", bad, "-o", output)[1]
    damaged = tmp_path / "image07.png"
    whole = damaged.read_bytes()
    damaged.write_bytes(whole[: len(whole) // 2])
    assert "image07.png" in refused(capsys, "ptm", "fit", lp, "-o", output)[1]
    Image.new("RGB", (24, 32)).save(damaged)
    assert "24x32; expected 32x24" in refused(capsys, "ptm", "fit", lp, "-o", output)[1]
    assert not output.exists() and not list(tmp_path.glob(".impostor-*"))


def test_compare_of_another_size_is_refused(capsys, tmp_path, lp):
    assert run("ptm", "fit", ROSETTE, "-o", tmp_path / "a.ptm", "--quiet") == 0
    assert "128x128" in refused(capsys, "ptm", "compare", tmp_path / "a.ptm", lp)[1]


def test_compare_of_a_series_with_lights_is_refused(capsys, tmp_path, lp):
    series = tmp_path / "series.ptm"
    write_ptm(quantise(Polynomials(known_polynomials(24, 32), parameters="series")), series)
    assert "image series" in refused(capsys, "ptm", "compare", series, lp)[1]


@pytest.mark.parametrize("light", ["1", "a,b", "0.1,0.2,0.3", "nan,0", "50,50"])
def test_a_light_that_is_no_light_is_refused(capsys, tmp_path, lp, light):
    assert refused(capsys, "ptm", "direct", lp, "--light", light, "-o", tmp_path / "d.png")[0] == 2


def test_lights_that_fit_would_refuse_are_not_written(capsys, tmp_path):
    from tests.unit.bake.test_chrome_ball import BALL, drawn_ball

    lights = np.array([[0.5, 0, 0.866], [0.8, 0, -0.6]])
    lights /= np.linalg.norm(lights, axis=1, keepdims=True)
    balls = [np.rint(drawn_ball(light).clip(0, 1) * 255).astype(np.uint8) for light in lights]
    front, behind = write_photographs(tmp_path, balls, name="ball")
    circle, output = f"{BALL.x},{BALL.y},{BALL.radius}", tmp_path / "a.lp"
    said = refused(capsys, "ptm", "lights", front, behind, "--circle", circle, "-o", output)[1]
    assert f"{behind}: light's z" in said and "in front" in said
    said = refused(capsys, "ptm", "lights", front, "--circle", circle, "-o", output, "--of", tmp_path / "none.png")[1]
    assert "none.png: does not exist" in said
    said = refused(capsys, "ptm", "lights", front, front, "--circle", circle, "-o", output)[1]
    assert "ball00.png: given twice" in said
    assert not output.exists()


@pytest.mark.parametrize(
    ("subject", "flags", "message"),
    [
        ("heights", ("--size", 64), "--size: given with"),
        ("heights", ("--from", "top"), "--from: given with"),
        ("heights", ("--up", "z"), "--up: given with"),
        ("knot", ("--depth", 8), "--depth: given with"),
        ("knot", ("--albedo", "a.png"), "--albedo: given with"),
        ("knot", ("--size", 0), "--size: 0 texels; expected 16 to"),
        ("heights", ("--dome", "rings:95x3"), "--dome: 'rings:95x3': elevation 95 degrees; expected 0 to 90"),
        ("heights", ("--dome", "fibonacci:9:95"), "--dome: 'fibonacci:9:95': elevation 95"),
        ("heights", ("--dome", "fibonacci:0"), "--dome: 'fibonacci:0': 0 lights"),
        ("heights", ("--dome", "rings:0x8"), "--dome: lowest z is 0; expected above 0"),
        ("heights", ("--jpeg", 101), "--jpeg: 101; expected 1 to 100"),
        ("heights", ("--gloss", "1,0"), "--gloss: 1,0; expected a strength of 0 or more, a shininess above 0"),
        ("row", (), "row00.png: heights of shape (1, 16); expected sides of 2 to"),
    ],
)
def test_flags_that_capture_has_no_use_for_are_refused(capsys, tmp_path, subject, flags, message):
    (heights,) = write_photographs(tmp_path, [np.zeros((16, 16), np.uint8)])
    (row,) = write_photographs(tmp_path, [np.zeros((1, 16), np.uint8)], name="row")
    given = {"heights": heights, "row": row, "knot": SAMPLES / "knot.stl"}[subject]
    assert message in refused(capsys, "ptm", "capture", given, "-o", tmp_path / "a.lp", *flags)[1]
    assert not (tmp_path / "a.lp").exists()


def test_fit_without_a_terminal_prints_no_bar(tmp_path):
    done = subprocess.run(
        [COMMAND, "ptm", "fit", ROSETTE, "-o", tmp_path / "a.ptm"], capture_output=True, text=True, check=True
    )
    assert done.stderr == "" and done.stdout.count("\n") == 1


@needs_data
@pytest.mark.parametrize(("material", "least"), [("Object1/material1", 29.1), ("Object1/material4", 34.6)])
def test_synthetic_objects_under_lights_that_were_not_fitted(capsys, tmp_path, material, least):
    folder = SYNTHETIC / material
    assert run("ptm", "fit", folder / "Dome" / "dirs.lp", "-o", tmp_path / "a.ptm", "--quiet") == 0
    found = json_of(capsys, "ptm", "compare", tmp_path / "a.ptm", folder / "Test" / "dirs.lp", "--json")
    assert found["psnr_db"] > least and len(found["per_light"]) == 20


@needs_data
def test_hp_fitters_own_photographs_give_hp_fitters_pictures(tmp_path):
    source = DATA / "rti" / "hp_fitter_8x5"
    shutil.copytree(source, tmp_path / "hp")
    assert run("ptm", "fit", tmp_path / "hp" / "reference_8x5.lp", "-o", tmp_path / "a.ptm", "--quiet") == 0
    ours, theirs = read_ptm(tmp_path / "a.ptm").polynomials(), read_ptm(source / "reference_8x5.ptm").polynomials()
    lights = read_lp(source / "reference_8x5.lp").directions[:, :2]
    difference = [evaluate(ours, *light) - evaluate(theirs, *light) for light in lights]
    assert np.sqrt(np.mean(np.square(difference))) < 0.05
