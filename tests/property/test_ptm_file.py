"""What holds for every PTM that is written, and for every file that is not one."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impostor.errors import PtmFileError
from impostor.files.ptm_file import read_header, read_ptm, write_ptm
from impostor.ptm import quantise
from tests.ptms import assert_same, random_polynomials, random_ptm

seeds = st.integers(0, 2**32 - 1)
formats = st.sampled_from(["RGB", "LRGB", "LUM"])
curves = st.sampled_from(["srgb", "linear"])
meanings = st.sampled_from(["light", "view", "series"])
sizes = st.tuples(st.integers(1, 9), st.integers(1, 9))


@pytest.fixture(scope="module")
def folder():
    with TemporaryDirectory() as name:
        yield Path(name)


@given(formats, sizes, seeds, curves, meanings, st.integers(-20, 20))
def test_a_rounded_ptm_is_read_back_as_it_was(folder, format, size, seed, curve, meaning, exponent):
    polynomials = random_polynomials(format, size, seed, curve, meaning)
    polynomials.coefficients[...] *= np.float32(10.0**exponent)
    ptm = quantise(polynomials)
    write_ptm(ptm, folder / "a.ptm", force=True)
    assert_same(read_ptm(folder / "a.ptm"), ptm)


@settings(max_examples=20, deadline=None)
@given(st.sampled_from(["RGB", "LRGB"]), sizes, seeds, st.integers(1, 100), st.booleans())
def test_jpeg_planes_of_noise_are_read_back_near_what_they_were(folder, format, size, seed, quality, predict):
    ptm = random_ptm(format, size, seed)
    write_ptm(ptm, folder / "a.ptm", compression="jpeg", quality=quality, predict=predict, force=True)
    read = read_ptm(folder / "a.ptm")
    assert read.size == ptm.size and read.format == format
    if quality == 100:
        assert np.abs(read.coefficients.astype(int) - ptm.coefficients).max() <= 3


@pytest.fixture(scope="module")
def written(folder):
    """Bytes, start and end of the body of one file of each format."""
    files = {}
    for format in ("RGB", "LRGB", "LUM", "JPEG_LRGB"):
        ptm = random_ptm(format.removeprefix("JPEG_"), (8, 8))
        write_ptm(ptm, folder / format, compression="jpeg" if format.startswith("JPEG") else None)
        header, _ = read_header(folder / format)
        files[format] = ((folder / format).read_bytes(), header.body, header.body + header.body_bytes)
    return files


@given(st.sampled_from(["RGB", "LRGB", "LUM", "JPEG_LRGB"]), st.booleans(), st.data())
@settings(max_examples=400, deadline=None)
def test_a_file_with_bytes_changed_is_refused_or_read(written, folder, format, with_trailer, data):
    """With the trailer, whatever changes before it is found."""
    original, start, end = written[format]
    content = bytearray(original if with_trailer else original[:end])
    # Half of the changes are in the header, which is where lies can do harm.
    limit = start if data.draw(st.booleans()) else end
    places = data.draw(st.dictionaries(st.integers(0, limit - 1), st.integers(1, 255), min_size=1, max_size=4))
    for place, change in places.items():
        content[place] ^= change
    (folder / "b.ptm").write_bytes(content)
    try:
        read_ptm(folder / "b.ptm")
    except PtmFileError as error:
        assert "\n" not in str(error)
    else:
        assert not with_trailer


words = st.sampled_from(
    [
        "PTM_1.2",
        "PTM_FORMAT_LRGB",
        "PTM_FORMAT_JPEG_RGB",
        "8",
        "0",
        "-1",
        "1e9",
        "65535",
        "4294967296",
        "nan",
        "\n",
        " ",
    ]
)


@given(st.lists(words, max_size=60))
def test_words_in_any_order_are_refused(folder, lines):
    (folder / "c.ptm").write_text("PTM_1.2\nPTM_FORMAT_LUM\n" + " ".join(lines) + "\n")
    try:
        ptm = read_ptm(folder / "c.ptm")
    except PtmFileError:
        return
    assert ptm.size[0] * ptm.size[1] * 8 <= len(" ".join(lines))
