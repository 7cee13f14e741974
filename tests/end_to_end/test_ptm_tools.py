"""`impostor ptm` for someone who has a PTM: look, draw, convert, film, tile."""

from dataclasses import replace

import av
import numpy as np
import pytest
from PIL import Image

from impostor.files.ptm_file import read_ptm, write_ptm
from impostor.ptm import evaluate, quantise
from tests.end_to_end.commands import json_of, ok, run
from tests.ptms import matt_bumps, random_ptm


@pytest.fixture
def bumps(tmp_path):
    path = tmp_path / "bumps.ptm"
    write_ptm(quantise(matt_bumps()[1]), path)
    return path


def failed(capsys, *arguments):
    """The exit code and the one line of a command that does not do what it is asked."""
    code, error = run(*arguments), capsys.readouterr().err.strip()
    assert len(error.splitlines()) == 1
    return code, error


def picture(path):
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def test_info_and_validate(capsys, bumps, tmp_path):
    found = json_of(capsys, "ptm", "info", bumps, "--json")
    assert (found["format"], found["width"], found["height"], found["curve"]) == ("LRGB", 64, 48, "srgb")
    assert json_of(capsys, "info", bumps, "--json") == found
    assert "LRGB" in ok(capsys, "ptm", "info", bumps)
    assert "sound" in ok(capsys, "validate", bumps)
    (tmp_path / "cut.ptm").write_bytes(bumps.read_bytes()[:500])
    code, error = failed(capsys, "validate", bumps, tmp_path / "cut.ptm")
    assert code == 1 and "cut.ptm" in error


def test_render_draws_what_the_polynomials_say(capsys, bumps, tmp_path):
    ok(capsys, "ptm", "render", bumps, "-o", tmp_path / "a.png", "--light=0.5,-0.25")
    expected = evaluate(read_ptm(bumps).polynomials(), 0.5, -0.25)
    np.testing.assert_allclose(picture(tmp_path / "a.png"), expected * 255, atol=0.51)


def test_render_of_light_is_on_the_srgb_curve(capsys, tmp_path):
    ptm = random_ptm(curve="linear")
    write_ptm(ptm, tmp_path / "a.ptm")
    ok(capsys, "ptm", "render", tmp_path / "a.ptm", "-o", tmp_path / "a.png")
    value = evaluate(ptm.polynomials(), 0, 0)
    expected = np.where(value < 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(picture(tmp_path / "a.png"), expected * 255, atol=0.52)


def test_normals_and_albedo_and_highlights(capsys, bumps, tmp_path):
    ok(capsys, "ptm", "render", bumps, "-o", tmp_path / "n.png", "--output", "normal")
    expected = (matt_bumps()[0] / 2 + 0.5) * 255
    assert np.abs(picture(tmp_path / "n.png") - expected).mean() < 4
    ok(capsys, "ptm", "render", bumps, "-o", tmp_path / "plain.png", "--light=0.4,0.1")
    ok(capsys, "ptm", "render", bumps, "-o", tmp_path / "shiny.png", "--light=0.4,0.1", "--specular", "0.5,30")
    ok(capsys, "ptm", "render", bumps, "-o", tmp_path / "albedo.png", "--output", "albedo")
    plain, shiny, albedo = (picture(tmp_path / f"{name}.png").astype(int) for name in ("plain", "shiny", "albedo"))
    assert (shiny >= plain).all() and (shiny > plain + 40).any()
    assert (albedo >= plain - 1).all()


@pytest.mark.parametrize("kind", ["rgb", "lrgb", "lum"])
def test_convert_keeps_the_picture(capsys, bumps, tmp_path, kind):
    ok(capsys, "ptm", "convert", bumps, tmp_path / "b.ptm", "--format", kind)
    there = read_ptm(tmp_path / "b.ptm")
    assert there.format == kind.upper()
    difference = evaluate(there.polynomials(), 0.3, 0.2) - evaluate(read_ptm(bumps).polynomials(), 0.3, 0.2)
    # Luma keeps a mean chroma, which a texel of another color does not quite have under every light.
    assert np.sqrt(np.square(difference).mean()) < (0.08 if kind == "lum" else 0.01)


def test_a_compressed_copy_is_smaller_and_comes_back(capsys, bumps, tmp_path):
    ok(capsys, "ptm", "convert", bumps, tmp_path / "small.ptm", "--jpeg", 80)
    ok(capsys, "ptm", "convert", bumps, tmp_path / "bare.ptm", "--jpeg", 80, "--no-prediction")
    ok(capsys, "ptm", "convert", tmp_path / "small.ptm", tmp_path / "raw.ptm")
    small, bare, raw = (tmp_path / f"{name}.ptm" for name in ("small", "bare", "raw"))
    assert small.stat().st_size <= bare.stat().st_size < raw.stat().st_size == bumps.stat().st_size
    assert json_of(capsys, "ptm", "info", bare, "--json")["planes_predicted"] == 0


def test_a_copy_over_its_source_says_both_sizes(capsys, bumps, tmp_path):
    before = bumps.stat().st_size
    said = ok(capsys, "ptm", "convert", bumps, bumps, "--format", "rgb", "--force")
    assert f"({before / 1e6:.2f} MB)" in said and f"(RGB, {bumps.stat().st_size / 1e6:.2f} MB)" in said
    assert f"{before / 1e6:.2f}" != f"{bumps.stat().st_size / 1e6:.2f}"


def test_a_viewers_direction_is_a_unit_vector_too(capsys, tmp_path):
    write_ptm(quantise(replace(matt_bumps()[1], parameters="view")), tmp_path / "view.ptm")
    code, error = failed(capsys, "ptm", "render", tmp_path / "view.ptm", "-o", tmp_path / "a.png", "--light=3,3")
    assert code == 2 and "lu² + lv² at most 1" in error


def test_a_video_shows_the_light_going_round(capsys, bumps, tmp_path):
    ok(capsys, "ptm", "relight-video", bumps, "-o", tmp_path / "a.mp4", "--seconds", 1, "--rate", 8)
    with av.open(tmp_path / "a.mp4") as video:
        frames = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
    assert len(frames) == 8 and frames[0].shape == (48, 64, 3)
    across = np.cos(np.radians(40))
    polynomials = read_ptm(bumps).polynomials()
    for index, light in ((0, (0, across)), (2, (across, 0))):
        # Video blurs noise: means of 8 x 8 pixels are compared.
        expected, found = (
            each.mean(axis=-1).reshape(6, 8, 8, 8).mean(axis=(1, 3))
            for each in (evaluate(polynomials, *light) * 255, frames[index])
        )
        assert np.abs(found - expected).max() < 6


def test_a_synthesised_ptm_has_the_size_asked_for(capsys, bumps, tmp_path):
    ok(capsys, "ptm", "synthesise", bumps, "-o", tmp_path / "a.ptm", "--size", "80x96", "--patch", 24, "--seed", 3)
    assert read_ptm(tmp_path / "a.ptm").size == (80, 96)
    again = tmp_path / "b.ptm"
    ok(capsys, "ptm", "synthesise", bumps, "-o", again, "--size", "80x96", "--patch", 24, "--seed", 3)
    assert again.read_bytes() == (tmp_path / "a.ptm").read_bytes()


def test_a_small_ptm_is_quilted_from_smaller_patches(capsys, tmp_path):
    write_ptm(random_ptm(size=(40, 30)), tmp_path / "small.ptm")
    ok(capsys, "ptm", "synthesise", tmp_path / "small.ptm", "-o", tmp_path / "a.ptm", "--size", "64x48")
    assert read_ptm(tmp_path / "a.ptm").size == (64, 48)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["render", "{ptm}", "-o", "a.png", "--light", "1"], "--light"),
        (["render", "{ptm}", "-o", "a.png", "--light", ""], "--light"),
        (["render", "{ptm}", "-o", "a.png", "--light=0.9,0.9"], "lu² + lv² at most 1"),
        (["render", "{ptm}", "-o", "a.png", "--light", "nan,0"], "--light"),
        (["render", "{ptm}", "-o", "a.jpg"], "expected a name that ends in '.png'"),
        (["render", "{ptm}", "-o", "a.png", "--output", "depth"], "lit, normal, albedo"),
        (
            ["render", "{ptm}", "-o", "a.png", "--output", "normal", "--light=0.5,0"],
            "--light: given with --output normal",
        ),
        (["render", "{ptm}", "-o", "a.png", "--output", "albedo", "--gain", "2"], "--gain: given with --output albedo"),
        (["render", "{ptm}", "-o", "a.png", "--specular", "-1,3"], "--specular"),
        (["render", "{ptm}", "-o", "a.png", "--gain", "nan"], "--gain: nan; expected a finite number"),
        (["relight-video", "{ptm}", "-o", "a.mp4", "--gain", "inf"], "--gain: inf"),
        (["convert", "{ptm}", "b.ptm", "--format", "hsh"], "rgb, lrgb or lum"),
        (["convert", "{ptm}", "b.ptm", "--jpeg", "0"], "1 to 100"),
        (["convert", "{ptm}", "b.ptm", "--format", "lum", "--jpeg", "90"], "LRGB or RGB"),
        (["convert", "{ptm}", "b.ptm", "--no-prediction"], "--jpeg"),
        (["convert", "nothing.ptm", "b.ptm"], "nothing.ptm"),
        (["relight-video", "{ptm}", "-o", "a.mp4", "--seconds", "-1"], "--seconds"),
        (["relight-video", "{ptm}", "-o", "a.mp4", "--rate", "0"], "--rate"),
        (["synthesise", "{ptm}", "-o", "b.ptm", "--size", "big"], "--size"),
        (["synthesise", "{ptm}", "-o", "b.ptm", "--patch", "0"], "--patch"),
        (["synthesise", "{ptm}", "-o", "b.ptm", "--seed", "-1", "--size", "64x64", "--patch", "24"], "--seed"),
        (["synthesise", "{ptm}", "-o", "b.ptm", "--size", "65536x64"], "65535"),
        (
            ["synthesise", "{ptm}", "-o", "b.ptm", "--size", "8192x4096"],
            "--size: 8192x4096; expected at most 16,777,216",
        ),
    ],
)
def test_what_cannot_be_done_is_one_line_and_writes_nothing(capsys, bumps, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    code, error = failed(capsys, "ptm", *[part.format(ptm=bumps) for part in arguments])
    assert code in (1, 2) and message in error
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bumps.ptm"]


@pytest.mark.parametrize("parameters", ["series", "view"])
def test_what_needs_light_directions_refuses_a_ptm_without(capsys, tmp_path, parameters):
    ptm = tmp_path / "other.ptm"
    write_ptm(random_ptm(parameters=parameters), ptm)
    for flags in (("--output", "normal"), ("--output", "albedo"), ("--specular", "0.5,30"), ("--gain", "2")):
        code, error = failed(capsys, "ptm", "render", ptm, "-o", tmp_path / "a.png", *flags)
        assert code == 2 and "other.ptm" in error and "expected light directions" in error and flags[0] in error
    code, error = failed(capsys, "ptm", "relight-video", ptm, "-o", tmp_path / "a.mp4")
    assert code == 2 and "expected light directions" in error
    assert list(tmp_path.iterdir()) == [ptm]
    ok(capsys, "ptm", "render", ptm, "-o", tmp_path / "a.png", "--light=0.3,0.3")


def test_a_series_takes_parameters_that_are_no_light(capsys, tmp_path):
    write_ptm(random_ptm(parameters="series"), tmp_path / "a.ptm")
    ok(capsys, "ptm", "render", tmp_path / "a.ptm", "-o", tmp_path / "a.png", "--light=1,1")


def test_info_says_what_other_codings_lose(capsys, bumps):
    found = json_of(capsys, "ptm", "info", bumps, "--json", "--coding")
    assert 30 < found["shift_scheme_db"] < 60 and 25 < found["codebook_db"] < 60
    assert found["codebook_bytes_per_texel"] < found["bytes_per_texel"]
    assert "shift scheme db" in ok(capsys, "ptm", "info", bumps, "--coding")
    assert "shift_scheme_db" not in json_of(capsys, "ptm", "info", bumps, "--json")


def test_an_output_that_exists_stays(capsys, bumps, tmp_path):
    (tmp_path / "a.png").write_text("mine")
    code, error = failed(capsys, "ptm", "render", bumps, "-o", tmp_path / "a.png")
    assert code == 1 and "--force" in error
    assert (tmp_path / "a.png").read_text() == "mine"
