"""`impostor environment info` and `convert`, as a user types them."""

import numpy as np
import pytest

from impostor.environment import Environment
from impostor.files.environment_file import read_environment, write_environment
from tests.data import DATA, SAMPLES, needs_data
from tests.end_to_end.commands import json_of, ok, pixels, run

MEADOW = SAMPLES / "environments" / "meadow.exr"
STUDY = SAMPLES / "environments" / "study.exr"


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The meadow with faces of 32 texels, as a panorama."""
    path = tmp_path_factory.mktemp("small") / "meadow.exr"
    assert run("environment", "convert", MEADOW, path, "--size", 32, "--quiet") == 0
    return path


def refused(capsys, code, *arguments):
    """The one line on standard error of a command that must fail."""
    assert run(*arguments) == code
    out, err = capsys.readouterr()
    assert out == "" and err.startswith("impostor: ") and err.count("\n") == 1
    return err


def test_info_says_where_the_light_comes_from(capsys):
    said = json_of(capsys, "environment", "info", MEADOW, "--json", "--lights", 2)
    assert said["file"] == str(MEADOW) and said["kind"] == "panorama, 768x384" and said["face_size"] == 256
    sun = said["lights"][0]
    for place in (said["brightest_direction"], sun):
        assert place["azimuth_deg"] == pytest.approx(128, abs=1)
        assert place["elevation_deg"] == pytest.approx(36, abs=1)
    assert 0.3 < sun["softness_deg"] < 1.5
    # Of the light of all directions, the sun gives pi * 2.4: the script's number.
    assert sun["share_percent"] == pytest.approx(100 * 2.24 / (4 * said["mean_luminance"]), rel=0.05)
    assert said["largest_luminance"] > 5000 and 10 < said["stops"] < 25
    assert 0 < said["harmonics_error_percent"] < 20
    assert len(said["lights"]) == 2


def test_an_even_panorama_has_no_brightest_direction(capsys, tmp_path):
    write_environment(tmp_path / "even.exr", Environment("even", np.full((6, 8, 8, 3), 0.7)))
    said = json_of(capsys, "environment", "info", tmp_path / "even.exr", "--json")
    assert said["brightest_direction"] is None and said["lights"] == []


def test_info_for_people_has_a_line_for_each_light(capsys, small):
    said = ok(capsys, "environment", "info", small)
    assert "panorama, 128x64" in said and "light 1  " in said and "brightest direction" in said and "{" not in said


def test_exposure_and_flips_count(capsys, small):
    plain = json_of(capsys, "environment", "info", small, "--json")
    turned = json_of(capsys, "environment", "info", small, "--json", "--exposure", 2, "--mirrored", "--flip-y")
    assert turned["mean_luminance"] == pytest.approx(2 * plain["mean_luminance"], rel=1e-3)
    assert turned["brightest_direction"]["azimuth_deg"] == pytest.approx(180 - 128, abs=3)
    assert turned["brightest_direction"]["elevation_deg"] == pytest.approx(-36, abs=3)


def test_the_picture_marks_the_sun_and_lights_balls_from_its_side(capsys, small, tmp_path):
    ok(capsys, "environment", "info", small, "-o", tmp_path / "a.png", "--lights", 1)
    picture = pixels(tmp_path / "a.png")
    assert picture.shape == (832, 1024, 3)
    red = (picture[:512] * (1, -0.5, -0.5)).sum(axis=2) > 100
    row, column = np.argwhere(red).mean(axis=0)
    assert (row, column) == pytest.approx((512 * (90 - 36) / 180, 1024 * (360 - 128) / 360), abs=6)
    matt = picture[512:, 10:330].mean(axis=2)
    assert matt[100, 230] > 1.15 * matt[220, 60]
    mirror = picture[512:, 352:672]
    assert mirror[230, 160, 1] > mirror[230, 160, 2] and mirror[60, 160, 2] > mirror[60, 160, 0]


def test_convert_there_and_back(capsys, small, tmp_path):
    said = ok(capsys, "environment", "convert", small, tmp_path / "six")
    assert f"{small} (panorama, 128x64) -> {tmp_path / 'six'} (six faces, 32x32" in said
    said = ok(capsys, "environment", "convert", tmp_path / "six", tmp_path / "back.hdr")
    assert "(six faces, 32x32) -> " in said and "(panorama, 128x64" in said
    before, after = read_environment(small).diffuse, read_environment(tmp_path / "back.hdr").diffuse
    assert after == pytest.approx(before, abs=0.02 * float(before.max()))
    ok(
        capsys,
        "environment",
        "convert",
        tmp_path / "six",
        tmp_path / "m_*.png",
        "--size",
        8,
        "--exposure",
        0.5,
        "--quiet",
    )
    assert read_environment(tmp_path / "m_*.png").size == 8


def test_converting_twice_with_a_flip_gives_the_same(tmp_path, small):
    for source, output in ((small, "a"), (tmp_path / "a", "b")):
        assert run("environment", "convert", source, tmp_path / output, "--mirrored", "--flip-y", "--quiet") == 0
    assert np.array_equal(read_environment(tmp_path / "b").faces, read_environment(small).faces)


def test_outputs_are_not_replaced_unasked(capsys, small, tmp_path):
    (tmp_path / "a.png").write_bytes(b"mine")
    assert "exists already" in refused(capsys, 1, "environment", "info", small, "-o", tmp_path / "a.png")
    assert "exists already" in refused(capsys, 1, "environment", "convert", small, tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes() == b"mine"
    ok(capsys, "environment", "convert", small, tmp_path / "a.png", "--force", "--quiet")
    assert pixels(tmp_path / "a.png").shape == (64, 128, 3)


@pytest.mark.parametrize(
    ("code", "arguments", "said"),
    [
        (1, ("info", "none.hdr"), "none.hdr: does not exist"),
        (1, ("info", STUDY, "-o", "a.jpg"), "a.jpg: ends in '.jpg'; expected a name that ends in '.png'"),
        (2, ("info", STUDY, "--lights", 0), "--lights: 0; expected 1 to 16"),
        (2, ("convert", STUDY, "a.hdr", "--size", 100), "--size: 100; expected a power of two"),
        (2, ("convert", STUDY, "a.hdr", "--exposure", -1), "--exposure: -1; expected a number above 0"),
        (2, ("info", STUDY, "--exposure", 1e39), "--exposure: 1e+39 makes radiance infinite; expected at most"),
        (1, ("convert", STUDY, "*_*.png"), "*_*.png: has more than one *; expected one"),
        (1, ("convert", STUDY, "a.jpg"), "a.jpg: ends in '.jpg'; expected a name that ends in .hdr, .exr, .png"),
    ],
)
def test_problems_are_one_line(capsys, tmp_path, monkeypatch, code, arguments, said):
    monkeypatch.chdir(tmp_path)
    assert said in refused(capsys, code, "environment", *arguments)
    assert not list(tmp_path.iterdir())


@needs_data
def test_a_real_cube_map_is_described(capsys, tmp_path):
    said = ok(capsys, "environment", "convert", DATA / "env" / "cube_Bridge2", tmp_path / "a.exr", "--size", 64)
    assert "(six faces, 1024x1024) -> " in said
    said = json_of(capsys, "environment", "info", tmp_path / "a.exr", "--json", "--lights", 1)
    assert abs(abs(said["brightest_direction"]["azimuth_deg"]) - 180) < 30  # the low sun is in front
