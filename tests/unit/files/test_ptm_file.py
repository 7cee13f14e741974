"""`.ptm` files: what is written is read back, and files of other tools are read as PTM.md says."""

import json
import zlib
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from impostor.errors import OutputError, SettingsError
from impostor.files.lp_file import read_lp
from impostor.files.ptm_file import read_header, read_ptm, write_ptm
from impostor.ptm import evaluate, quantise, relight
from tests.data import DATA, needs_data
from tests.ptms import assert_same, matt_bumps, random_ptm

FORMATS = ["RGB", "LRGB", "LUM"]
HEAD = b"PTM_1.2\nPTM_FORMAT_%s\n2\n2\n1 1 1 1 1 1\n0 0 0 0 0 0\n"


@pytest.fixture(scope="module")
def bumps():
    return quantise(matt_bumps((96, 80))[1])


def psnr(one, other):
    errors = [relight(one.polynomials(), light) - relight(other.polynomials(), light) for light in np.eye(3)]
    return -10 * np.log10(np.mean(np.square(errors)))


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize(("curve", "parameters"), [("srgb", "light"), ("linear", "series")])
def test_what_is_written_is_read_back(format, curve, parameters, tmp_path):
    ptm = random_ptm(format, curve=curve, parameters=parameters)
    assert write_ptm(ptm, tmp_path / "a.ptm") == (tmp_path / "a.ptm").stat().st_size
    assert_same(read_ptm(tmp_path / "a.ptm"), ptm)


def test_a_color_matrix_of_its_own_is_kept(tmp_path):
    ptm = replace(random_ptm("LUM"), rgb_from_luma=np.random.default_rng(0).normal(size=(3, 4)))
    write_ptm(ptm, tmp_path / "a.ptm")
    assert (tmp_path / "a.ptm").read_bytes().split(b"\n")[6].count(b" ") == 15
    read = read_ptm(tmp_path / "a.ptm")
    np.testing.assert_allclose(read.rgb_from_luma, ptm.rgb_from_luma, rtol=1e-15)
    np.testing.assert_array_equal(read.chroma, ptm.chroma)


def test_lrgb_1_2_keeps_colors_apart_and_its_bottom_row_first(tmp_path):
    body = bytes(range(24)) + bytes(range(100, 112))
    (tmp_path / "a.ptm").write_bytes(HEAD % b"LRGB" + body)
    ptm = read_ptm(tmp_path / "a.ptm")
    assert ptm.coefficients[1, 0, 0].tolist() == [0, 1, 2, 3, 4, 5]
    assert ptm.coefficients[0, 1, 0].tolist() == [18, 19, 20, 21, 22, 23]
    assert ptm.color[1].tolist() == [[100, 101, 102], [103, 104, 105]]
    assert (ptm.curve, ptm.parameters) == ("srgb", "light")


def test_lrgb_1_1_keeps_a_texel_together(tmp_path):
    (tmp_path / "a.ptm").write_bytes(HEAD.replace(b"1.2", b"1.1") % b"LRGB" + bytes(range(36)))
    ptm = read_ptm(tmp_path / "a.ptm")
    assert ptm.coefficients[1, 1, 0].tolist() == [9, 10, 11, 12, 13, 14]
    assert ptm.color[0, 0].tolist() == [24, 25, 26]


def test_rgb_is_three_blocks(tmp_path):
    (tmp_path / "a.ptm").write_bytes(HEAD % b"RGB" + bytes(range(72)))
    ptm = read_ptm(tmp_path / "a.ptm")
    assert ptm.coefficients[1, 0].tolist() == [[start + term for term in range(6)] for start in (0, 24, 48)]
    assert ptm.coefficients[0, 1, 2, 5] == 71


def test_lum_has_red_chroma_first_and_a_matrix_only_where_there_is_one(tmp_path):
    body = b"\0\0\0\0\0\x80\xff\x80" * 4
    (tmp_path / "a.ptm").write_bytes(HEAD % b"LUM" + body)
    red = evaluate(read_ptm(tmp_path / "a.ptm").polynomials(), 0, 0)[0, 0]
    np.testing.assert_allclose(red * 255, [255, 128 - 0.714136 * 127, 128], atol=1e-3)
    matrix = b"0 1 0 0 1 0 0 0 1 0 0 -28 0 0 0 1\n"
    (tmp_path / "a.ptm").write_bytes(HEAD % b"LUM" + matrix + body)
    turned = evaluate(read_ptm(tmp_path / "a.ptm").polynomials(), 0, 0)[0, 0]
    np.testing.assert_allclose(turned * 255, [255, 128, 100], atol=1e-3)


@pytest.mark.parametrize(
    "head",
    [
        b"PTM_1.2 \nPTM_FORMAT_LRGB \n2 2 \n1.0 1 1e0 1. +1 1 \n0 0 0 0 0 0 \n",
        b"PTM_1.2\r\nPTM_FORMAT_LRGB\r\n2\r\n2\r\n1 1 1 1 1 1\r\n0 0 0 0 0 0\r\n",
        b"PTM_1.2\nPTM_FORMAT_LRGB\n2 2\n1 1 1 1 1 1 0 0 0 0 0 0\n",
    ],
)
def test_headers_as_they_are_met(head, tmp_path):
    body = b"\n \t\r" + bytes(range(32))  # the body may begin with what looks like the end of a line
    (tmp_path / "a.ptm").write_bytes(head + body)
    assert read_ptm(tmp_path / "a.ptm").coefficients[1, 0, 0].tolist() == [10, 32, 9, 13, 0, 1]


@pytest.mark.parametrize("format", ["RGB", "LRGB"])
@pytest.mark.parametrize("predict", [False, True])
def test_jpeg_planes_are_close_and_small(bumps, format, predict, tmp_path):
    ptm = bumps
    if format == "RGB":
        ptm = replace(bumps, coefficients=bumps.coefficients.repeat(3, axis=2), color=None)
    raw = write_ptm(ptm, tmp_path / "raw.ptm")
    size = write_ptm(ptm, tmp_path / "a.ptm", compression="jpeg", quality=95, predict=predict)
    assert size < raw / 2
    assert psnr(read_ptm(tmp_path / "a.ptm"), ptm) > 38


def test_prediction_makes_smaller_files(bumps, tmp_path):
    rough = np.random.default_rng(0).integers(-20, 20, bumps.coefficients.shape)
    coefficients = (bumps.coefficients * 0.8 + 20 + rough).astype(np.uint8).repeat(3, axis=2)
    rgb = replace(bumps, coefficients=coefficients, color=None)
    alone = write_ptm(rgb, tmp_path / "alone.ptm", compression="jpeg", predict=False)
    predicted = write_ptm(rgb, tmp_path / "predicted.ptm", compression="jpeg")
    assert predicted < 0.6 * alone
    assert psnr(read_ptm(tmp_path / "predicted.ptm"), rgb) > psnr(read_ptm(tmp_path / "alone.ptm"), rgb) - 0.3


def slow_decoder(path):
    """JPEG planes of a file as PTM.md says, a texel at a time."""
    header, _ = read_header(path)
    data, position, decoded, sides = path.read_bytes(), header.body, [], []
    for plane in header.planes:
        jpeg = data[position : position + plane.jpeg_bytes]
        decoded.append(np.asarray(Image.open(BytesIO(jpeg))).ravel().tolist())
        position += plane.jpeg_bytes + plane.side_bytes
        sides.append(data[position - plane.side_bytes : position])
    for index in sorted(range(len(decoded)), key=lambda index: header.planes[index].rank):
        plane, values = header.planes[index], decoded[index]
        for texel, value in enumerate(values):
            if plane.reference >= 0:
                other = decoded[plane.reference][texel]
                values[texel] = (value + (255 - other if plane.inverted else other) - 128) % 256
        for start in range(0, plane.side_bytes, 5):
            values[int.from_bytes(sides[index][start : start + 4], "big")] = sides[index][start + 4]
    return np.array(decoded).reshape(-1, header.height, header.width)[:, ::-1], header


def test_prediction_inversion_and_side_information_are_as_specified(tmp_path):
    random = np.random.default_rng(0)
    y, x = np.mgrid[:40, :48]
    texture = (120 + 60 * np.sin(x / 5) * np.cos(y / 7) + random.normal(0, 12, x.shape)).clip(0, 255)
    spikes = np.where(random.random(x.shape) < 0.01, 255, texture)
    planes = [texture, 255 - texture, texture / 2, spikes, texture, texture, 255 - texture, texture, spikes]
    texels = np.stack(planes, axis=-1).astype(np.uint8)
    ptm = replace(
        random_ptm("LRGB", (48, 40)), coefficients=texels[:, :, None, :6].copy(), color=texels[..., 6:].copy()
    )
    write_ptm(ptm, tmp_path / "a.ptm", compression="jpeg", quality=90)
    decoded, header = slow_decoder(tmp_path / "a.ptm")
    assert any(plane.inverted for plane in header.planes) and any(plane.side_bytes for plane in header.planes)
    read = read_ptm(tmp_path / "a.ptm")
    np.testing.assert_array_equal(np.dstack([read.coefficients[:, :, 0], read.color]), np.moveaxis(decoded, 0, -1))
    error = np.abs(np.dstack([read.coefficients[:, :, 0], read.color]).astype(int) - texels)
    assert error.max() < 30  # nowhere has modulo 256 turned black to white


def test_lum_has_no_jpeg_planes(tmp_path):
    with pytest.raises(SettingsError, match="LUM"):
        write_ptm(random_ptm("LUM"), tmp_path / "a.ptm", compression="jpeg")
    for choice in ({"compression": "jpeg", "quality": 0}, {"compression": "png"}):
        with pytest.raises(SettingsError, match="expected"):
            write_ptm(random_ptm(), tmp_path / "a.ptm", **choice)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("compression", [None, "jpeg"])
def test_the_same_ptm_gives_the_same_bytes(bumps, compression, tmp_path):
    for name in "ab":
        write_ptm(bumps, tmp_path / name, compression=compression)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_an_existing_file_is_kept_unless_forced(tmp_path):
    write_ptm(random_ptm(seed=1), tmp_path / "a.ptm")
    with pytest.raises(OutputError, match="exists"):
        write_ptm(random_ptm(seed=2), tmp_path / "a.ptm")
    assert_same(read_ptm(tmp_path / "a.ptm"), random_ptm(seed=1))
    write_ptm(random_ptm(seed=2), tmp_path / "a.ptm", force=True)
    assert_same(read_ptm(tmp_path / "a.ptm"), random_ptm(seed=2))


def test_the_trailer_is_one_line_of_json_after_the_body(tmp_path):
    write_ptm(random_ptm(curve="linear"), tmp_path / "a.ptm")
    data = (tmp_path / "a.ptm").read_bytes()
    header, _ = read_header(tmp_path / "a.ptm")
    body, trailer = data[: header.body + 7 * 5 * 9], data[header.body + 7 * 5 * 9 :]
    name, version, fields = trailer.split(b" ", 2)
    assert (name, version, trailer[-1:]) == (b"IMPOSTOR_PTM_TRAILER", b"1", b"\n")
    assert json.loads(fields).items() >= {"crc32": zlib.crc32(body), "curve": "linear", "parameters": "light"}.items()


@needs_data
def test_hps_fitters_file_shows_its_photographs():
    folder = DATA / "rti" / "hp_fitter_8x5"
    ptm = read_ptm(folder / "reference_8x5.ptm").polynomials()
    capture = read_lp(folder / "reference_8x5.lp")
    for path, (u, v, _) in zip(capture.photographs, capture.directions, strict=True):
        shown = np.asarray(Image.open(path).convert("RGB")) / 255
        assert np.square(evaluate(ptm, u, v) - shown).mean() < 10**-4.7


@needs_data
def test_hps_compressed_tablet_is_upright_and_lit_from_where_the_light_is():
    file = DATA / "rti" / "tablet1.ptm"
    assert read_header(file)[0].format == "JPEG_LRGB"
    ptm = read_ptm(file).polynomials()
    assert ptm.size == (512, 512) and ptm.format == "LRGB"
    from_left, from_right, from_top = (
        relight(ptm, light).mean(axis=-1) for light in ([-9, 0, 1], [9, 0, 1], [0, 9, 1])
    )
    left, right, top, bottom = (
        np.s_[200:320, 40:60],
        np.s_[200:320, 450:470],
        np.s_[95:105, 150:350],
        np.s_[415:425, 150:350],
    )
    assert from_left[left].mean() > 2 * from_right[left].mean()
    assert from_right[right].mean() > 2 * from_left[right].mean()
    assert from_top[top].mean() > 2 * from_top[bottom].mean()


def test_compressing_counts_its_planes(tmp_path):
    steps = []
    ptm = random_ptm("RGB")
    write_ptm(ptm, tmp_path / "a.ptm", compression="jpeg", progress=lambda done, total: steps.append((done, total)))
    assert steps == [(done, 18) for done in range(1, 19)]
