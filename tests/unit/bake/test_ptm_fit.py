"""Fits recover known polynomials, whatever the photographs are stored as, and refuse lights that cannot tell."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from bake import half_chroma, one_pass
from bake.design import ONE_PARAMETER, make_design
from bake.dome import ring_dome
from bake.photographs import PhotographError, decoded, open_photographs
from bake.ptm import fit_ptm, light_parameters
from impostor.errors import SettingsError
from impostor.files.lp_file import CaptureSet
from impostor.ptm.polynomials import evaluate
from impostor.srgb import linear_from_srgb
from tests.captures import LIGHTS, known_polynomials, photographed, write_photographs

UV = LIGHTS[:, :2]


def fit(folder, pictures, parameters=UV, suffix=".png", **settings):
    return fit_ptm(open_photographs(write_photographs(folder, pictures, suffix)), parameters, **settings)


def test_rgb_recovers_the_polynomials_of_every_channel(tmp_path):
    known = known_polynomials()
    found = fit(tmp_path, photographed(known, UV), format="rgb")
    assert (found.format, found.size, found.curve, found.parameters) == ("RGB", (7, 5), "srgb", "light")
    assert np.abs(found.coefficients - known).max() < 0.01


def test_more_photographs_than_a_batch_equal_plain_least_squares(tmp_path):
    rng = np.random.default_rng(1)
    pictures = rng.integers(0, 256, (30, 9, 8, 3)).astype(np.uint8)
    design = make_design(UV)
    expected = np.linalg.lstsq(design.matrix, pictures.reshape(30, -1) / 255, rcond=None)[0].reshape(6, 9, 8, 3)
    found = fit(tmp_path, pictures, format="rgb")
    np.testing.assert_allclose(np.moveaxis(found.coefficients, -1, 0), expected, atol=2e-5)


@pytest.mark.parametrize("format", ["rgb", "lrgb", "lum"])
def test_any_number_of_threads_gives_the_same_bits(tmp_path, monkeypatch, format):
    monkeypatch.setattr(one_pass, "BLOCK", 32)
    photographs = open_photographs(
        write_photographs(tmp_path, np.random.default_rng(1).integers(0, 256, (30, 20, 17, 3)).astype(np.uint8))
    )
    one, *others = (fit_ptm(photographs, UV, format=format, workers=workers) for workers in (1, 2, 3, 7))
    for other in others:
        for name in ("coefficients", "color", "chroma"):
            np.testing.assert_array_equal(getattr(other, name), getattr(one, name))


def smooth_pictures(height, width, count=30):
    """Colour and light that change slowly, so that little is lost by colour of half the size; (N, H, W, 3) uint8."""
    across = np.linspace(0, 3, width)[None, :, None] + np.linspace(0, 2, height)[:, None, None] + np.array([0, 1, 2])
    known = 0.12 * np.sin(across[..., None] * np.arange(1, 7)) + np.array([0, 0, 0, 0, 0, 0.5])
    return photographed(known, UV[:count])


@pytest.mark.parametrize("format", ["rgb", "lrgb", "lum"])
@pytest.mark.parametrize("orientation", [1, 6])
def test_jpegs_with_colour_of_half_the_size_are_fitted_as_what_they_decode_to(tmp_path, format, orientation):
    exif = Image.Exif()
    exif[0x0112] = orientation
    paths = [tmp_path / f"{number:02d}.jpg" for number in range(30)]
    for path, picture in zip(paths, smooth_pictures(24, 38), strict=True):
        Image.fromarray(picture).save(path, quality=90, exif=exif)
    photographs = open_photographs(paths)
    assert photographs.half_chroma
    found = fit_ptm(photographs, UV, format=format)
    same = fit_ptm(replace(photographs, half_chroma=False), UV, format=format)
    assert found.size == same.size == ((38, 24) if orientation == 1 else (24, 38))
    for light in UV[::7]:
        assert np.abs(evaluate(found, *light) - evaluate(same, *light)).max() < 1.5 / 255


def test_any_number_of_threads_gives_the_same_bits_of_jpegs(tmp_path, monkeypatch):
    monkeypatch.setattr(one_pass, "BLOCK", 32)
    monkeypatch.setattr(half_chroma, "BLOCK", 80)
    photographs = open_photographs(write_photographs(tmp_path, smooth_pictures(24, 38), ".jpg"))
    one, *others = (fit_ptm(photographs, UV, format="lrgb", workers=workers) for workers in (1, 2, 7))
    for other in others:
        for name in ("coefficients", "color"):
            np.testing.assert_array_equal(getattr(other, name), getattr(one, name))


@pytest.mark.parametrize(
    ("size", "settings"),
    [((24, 37), {}), ((24, 38), {"subsampling": 0}), ((24, 38), {"subsampling": 1}), ((24, 38), {"keep_rgb": True})],
)
def test_other_jpegs_are_fitted_as_red_green_and_blue(tmp_path, size, settings):
    path = tmp_path / "a.jpg"
    Image.fromarray(smooth_pictures(*size, 1)[0]).save(path, **settings)
    assert not open_photographs([path]).half_chroma


def test_a_jpeg_whose_end_is_missing_is_refused_by_name(tmp_path):
    paths = write_photographs(tmp_path, smooth_pictures(24, 38), ".jpg")
    paths[7].write_bytes(paths[7].read_bytes()[:-200])
    with pytest.raises(PhotographError, match=r"image07\.jpg"):
        fit_ptm(open_photographs(paths), UV)


@pytest.mark.parametrize("batch", [1, 4, 7, 30])
def test_photographs_decoded_ahead_come_each_once_and_whole(tmp_path, batch):
    pictures = np.random.default_rng(0).integers(0, 256, (30, 3, 4, 3)).astype(np.uint8)
    photographs = open_photographs(write_photographs(tmp_path, pictures))
    seen = []
    with ThreadPoolExecutor(3) as pool:
        for indices, pixels in decoded(photographs, pool, batch):
            assert len(indices) <= batch
            np.testing.assert_array_equal(pixels, pictures[indices])
            seen.extend(indices.tolist())
    assert seen == list(range(30))


def test_lrgb_of_one_colour_times_light_is_exact(tmp_path):
    luminance = known_polynomials(channels=1)
    color = np.random.default_rng(2).uniform(0.2, 1, (5, 7, 3))
    found = fit(tmp_path, photographed(luminance * color[..., None], UV), format="lrgb")
    for light in UV[::7]:
        expected = photographed(luminance * color[..., None], [light])[0] / 255
        assert np.abs(evaluate(found, *light) - expected).max() < 0.01
    assert found.color.max() <= 1 and found.color.min() >= 0


def test_lrgb_is_the_best_single_polynomial_with_a_constant_colour(tmp_path):
    pictures = np.random.default_rng(3).integers(0, 256, (30, 6, 6, 3)).astype(np.uint8)
    rgb, lrgb = (fit(tmp_path, pictures, format=name) for name in ("rgb", "lrgb"))
    terms = make_design(UV).matrix
    wanted = np.einsum("hwct,nt->hwnc", rgb.coefficients, terms)
    product = np.einsum("hwt,hwc,nt->hwnc", lrgb.coefficients[:, :, 0], lrgb.color, terms)
    left, strengths, right = np.linalg.svd(wanted, full_matrices=False)
    best = np.einsum("hwn,hw,hwc->hwnc", left[..., 0], strengths[..., 0], right[..., 0, :])
    assert np.sum((product - wanted) ** 2) < 1.02 * np.sum((best - wanted) ** 2)


@pytest.mark.parametrize("space", ["ycbcr", "principal"])
def test_lum_of_gray_light_on_coloured_texels(tmp_path, space):
    luma = known_polynomials(channels=1)
    tint = np.random.default_rng(4).uniform(-0.1, 0.1, (5, 7, 3, 1)) * [0, 0, 0, 0, 0, 1]
    pictures = photographed(luma + tint, UV)
    found = fit(tmp_path, pictures, format="lum", space=space)
    assert found.format == "LUM"
    for index in (0, 13, 29):
        assert np.abs(evaluate(found, *UV[index]) - pictures[index] / 255).max() < 0.01


def test_principal_axes_follow_a_coloured_light_where_ycbcr_cannot(tmp_path):
    light = np.array([1.0, 0.4, 0.1])
    pictures = photographed(known_polynomials(channels=1) * light[:, None], UV)
    errors = {}
    for space in ("ycbcr", "principal"):
        found = fit(tmp_path, pictures, format="lum", space=space)
        errors[space] = np.mean([np.square(evaluate(found, *UV[k]) - pictures[k] / 255).mean() for k in range(30)])
    assert errors["principal"] < errors["ycbcr"] / 10


def test_linear_fits_light_and_says_so(tmp_path):
    pictures = photographed(known_polynomials(), UV)
    found = fit(tmp_path, pictures, format="rgb", curve="linear")
    assert found.curve == "linear"
    light = linear_from_srgb(pictures.reshape(30, -1) / 255)
    expected = np.linalg.lstsq(make_design(UV).matrix, light, rcond=None)[0]
    np.testing.assert_allclose(np.moveaxis(found.coefficients, -1, 0).reshape(6, -1), expected, atol=1e-4)


@pytest.mark.parametrize(("suffix", "white"), [(".png", 255), (".png", 65535), (".tif", 65535), (".tga", 255)])
def test_gray_photographs_of_8_and_16_bits(tmp_path, suffix, white):
    known = known_polynomials(channels=1)
    pictures = photographed(known, UV, white)[..., 0]
    found = fit(tmp_path, pictures, suffix=suffix, format="lrgb")
    precision = 0.01 if white == 255 else 1e-4
    assert np.abs(found.coefficients - known).max() < precision
    assert (found.color == 1).all()
    assert fit(tmp_path, pictures, suffix=suffix, format="rgb").coefficients.shape == (5, 7, 3, 6)


def test_jpeg_decodes_into_the_picture_that_pillow_shows(tmp_path):
    path = tmp_path / "a.jpg"
    picture = np.random.default_rng(0).integers(0, 256, (150, 40, 3)).astype(np.uint8)
    Image.fromarray(picture).save(path)
    np.testing.assert_array_equal(open_photographs([path]).decode(0), np.asarray(Image.open(path)))


def test_exif_orientation_turns_every_photograph_as_the_first(tmp_path):
    picture = np.random.default_rng(0).integers(0, 256, (4, 6, 3)).astype(np.uint8)
    paths = []
    for number, orientation in enumerate((6, 6, 1)):
        exif = Image.Exif()
        exif[0x0112] = orientation
        paths.append(tmp_path / f"{number}.png")
        Image.fromarray(picture).save(paths[-1], exif=exif)
    photographs = open_photographs(paths)
    assert photographs.size == (4, 6)
    for index in range(3):
        np.testing.assert_array_equal(photographs.decode(index), np.rot90(picture, -1))


def test_series_of_one_parameter_leaves_the_other_terms_out(tmp_path):
    values = np.linspace(-1, 1, 9)
    known = known_polynomials()
    known[..., [1, 2, 4]] = 0
    parameters = np.column_stack([values, np.zeros(9)])
    found = fit(
        tmp_path, photographed(known, parameters), parameters, format="rgb", terms=ONE_PARAMETER, meaning="series"
    )
    assert found.parameters == "series"
    assert np.abs(found.coefficients - known).max() < 0.01
    assert (found.coefficients[..., [1, 2, 4]] == 0).all()


def test_condition_number_is_that_of_the_terms():
    design = make_design(UV)
    assert design.condition == pytest.approx(np.linalg.cond(design.matrix))
    assert design.condition < 20


LINE = np.column_stack([np.linspace(-0.9, 0.9, 12), np.full(12, 0.1)])


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        (LINE, "on a line"),
        (ring_dome([(np.radians(45), 24)])[:, :2], "one elevation, about 45 degrees"),
        (ring_dome([(np.radians(45), 24)])[:, :2] + np.random.default_rng(0).normal(0, 1e-4, (24, 2)), "condition"),
        (UV[:5], "5 different lights"),
        (np.tile(UV[:5], (4, 1)), "5 different lights"),
        (np.full((8, 2), np.nan), "finite"),
    ],
)
def test_lights_that_cannot_tell_polynomials_apart_are_refused(parameters, reason):
    with pytest.raises(SettingsError, match=reason) as refusal:
        make_design(parameters)
    assert "\n" not in str(refusal.value)


def test_a_refused_ring_says_its_number():
    with pytest.raises(SettingsError, match=r"condition number [\d.]+e\+\d+; expected below 1000"):
        make_design(ring_dome([(np.radians(30), 24)])[:, :2])


def test_light_from_behind_is_refused_by_name(tmp_path):
    capture = CaptureSet((tmp_path / "a.jpg", tmp_path / "b.jpg"), np.array([[0, 0, 1.0], [0.6, 0, -0.8]]))
    with pytest.raises(SettingsError, match=r"b\.jpg.*-0\.8"):
        light_parameters(capture)


def test_sizes_that_differ_are_refused_before_decoding(tmp_path):
    paths = write_photographs(tmp_path, [np.zeros((4, 5, 3), np.uint8), np.zeros((5, 4, 3), np.uint8)])
    with pytest.raises(PhotographError, match=r"image01\.png: is 4x5; expected 5x4"):
        open_photographs(paths)


def test_header_of_a_giant_is_refused(tmp_path):
    path = tmp_path / "giant.pgm"
    path.write_bytes(b"P5 60000 60000 255\n" + b"\0" * 64)
    with pytest.raises(PhotographError, match=r"giant\.pgm"):
        open_photographs([path])


def test_a_truncated_jpeg_is_one_line_with_its_name(tmp_path):
    rng = np.random.default_rng(0)
    paths = write_photographs(tmp_path, rng.integers(0, 256, (8, 64, 64, 3)).astype(np.uint8), ".jpg")
    paths[5].write_bytes(paths[5].read_bytes()[:1500])
    with pytest.raises(PhotographError, match=r"image05\.jpg: cannot be decoded") as refusal:
        fit_ptm(open_photographs(paths), UV[:8])
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("content", [b"", b"not a picture", b"\xff\xd8\xff\xe0" + b"\0" * 40])
def test_what_is_no_picture_is_refused(tmp_path, content):
    path = tmp_path / "x.jpg"
    path.write_bytes(content)
    with pytest.raises(PhotographError, match=r"x\.jpg"):
        open_photographs([path])


def test_unknown_choices_are_refused(tmp_path):
    for wrong in ({"format": "hsh"}, {"curve": "gamma"}, {"space": "lab"}, {"workers": 0}):
        with pytest.raises(SettingsError, match=next(iter(wrong))):
            fit(tmp_path, photographed(known_polynomials(), UV), **wrong)
