"""`.ptm` files that lie, end early or are of another kind: one clear line each, and no memory on their word."""

import tracemalloc
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from impostor.errors import PtmFileError
from impostor.files.ptm_file import read_header, read_ptm, write_ptm
from impostor.ptm import quantise
from tests.ptms import matt_bumps, random_ptm

HEAD = "PTM_1.2\nPTM_FORMAT_LRGB\n2\n2\n1 1 1 1 1 1\n0 0 0 0 0 0\n"


def refused(path, data):
    """The message of what reading these bytes raises; it is one line."""
    path.write_bytes(data)
    with pytest.raises(PtmFileError) as caught:
        read_ptm(path)
    message = str(caught.value)
    assert message.startswith(str(path)) and "\n" not in message and len(message) < 400
    return message


def jpeg(size, mode="L", **options):
    file = BytesIO()
    Image.new(mode, size).save(file, "JPEG", **options)
    return file.getvalue()


def planes(width=16, height=8, **changes):
    """A JPEG_LRGB file of equal planes, with lines of its header replaced."""
    plane = changes.pop("plane", jpeg((16, 8)))
    side = changes.pop("side", b"")
    lines = {
        "transforms": "0 " * 9,
        "mvx": "0 " * 9,
        "mvy": "0 " * 9,
        "order": "0 1 2 3 4 5 6 7 8",
        "references": "-1 " * 9,
        "sizes": f"{len(plane)} " * 9,
        "sides": f"{len(side)} " * 9,
    } | changes
    head = f"PTM_1.2\nPTM_FORMAT_JPEG_LRGB\n{width}\n{height}\n1 1 1 1 1 1\n0 0 0 0 0 0\n95\n" + "\n".join(
        lines.values()
    )
    return head.encode() + b"\n" + (plane + side) * 9


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("PTM_1.2", "PTM_1.3", "version PTM_1.3"),
        ("PTM_1.2", "#HSH1.2", "#HSH1.2"),
        ("LRGB", "PTM_LUT", "look-up tables are not read"),
        ("LRGB", "JPEGLS_LRGB", "JPEG-LS are not read"),
        ("LRGB", "HSH", "PTM_FORMAT_HSH"),
        ("LRGB\n2", "LRGB\n0", "width: 0; expected a whole number from 1"),
        ("LRGB\n2", "LRGB\n-2", "width"),
        ("LRGB\n2", "LRGB\n1_0", "width"),
        ("LRGB\n2", "LRGB\n99999999999999999999", "width"),
        ("LRGB\n2", "LRGB\n65535", "body: 36 bytes; expected 1179630"),
        ("1 1 1", "1 nan 1", "scale"),
        ("1 1 1", "1 1e999 1", "scale"),
        ("1 1 1", "1 -1 1", "scale"),
        ("0 0 0", "0 256 0", "bias 1: 256; expected a whole number from 0 to 255"),
        ("0 0 0", "0 0.5 0", "bias"),
        ("0 0\n", "0 0 0\n", "does not end"),
        ("1 1 1", "1" * 200 + " 1 1", "scale"),
    ],
)
def test_headers_that_cannot_be(old, new, expected, tmp_path):
    assert expected in refused(tmp_path / "a.ptm", HEAD.replace(old, new, 1).encode() + bytes(36))


def test_what_is_no_ptm_at_all(tmp_path):
    for data in (b"", b"\0" * 100, b"\xff\xd8\xff\xe0", b"version https://git-lfs", b" \n" * 100000):
        refused(tmp_path / "a.ptm", data)
    for path, problem in ((tmp_path, "directory"), (tmp_path / "none.ptm", "does not exist")):
        with pytest.raises(PtmFileError, match=problem):
            read_ptm(path)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"transforms": "0 2 0 0 0 0 0 0 0"}, "motion compensation is not read"),
        ({"order": "0 1 2 3 4 5 6 7 7"}, "order"),
        ({"order": "0 1 2 3 4 5 6 7 9"}, "order"),
        ({"references": "0 -1 -1 -1 -1 -1 -1 -1 -1"}, "reference plane"),
        ({"references": "1 -1 -1 -1 -1 -1 -1 -1 -1"}, "reference plane: 1 for plane 0"),
        ({"references": "-1 9 -1 -1 -1 -1 -1 -1 -1"}, "reference plane"),
        ({"sizes": "2147483648 " * 9}, "body"),
        ({"sizes": "0 " * 9}, "plane size"),
        ({"sides": "-1 " * 9}, "side information"),
        ({"side": b"\0" * 4}, "expected 5 a record"),
        ({"side": b"\0\0\0\x80\xff"}, "side information for texel 128; expected less than 128"),
        ({"plane": jpeg((16, 16))}, "JPEG is 16 x 16 L; expected 16 x 8 L"),
        ({"plane": jpeg((16, 8), "RGB")}, "16 x 8 RGB"),
        ({"plane": jpeg((16, 8), progressive=True)}, "progressive"),
        ({"plane": b"not a JPEG"}, "plane 0"),
        ({"plane": jpeg((16, 8))[:-40]}, "plane 0"),
        ({"plane": jpeg((16, 8)), "width": 65535, "height": 65535}, "cannot hold the 4294836225 texels"),
    ],
)
def test_planes_that_cannot_be(changes, expected, tmp_path):
    assert expected in refused(tmp_path / "a.ptm", planes(**changes))


def test_planes_as_they_should_be(tmp_path):
    (tmp_path / "a.ptm").write_bytes(planes(side=b"\0\0\0\x0f\xff"))
    assert read_ptm(tmp_path / "a.ptm").coefficients[7, 15].tolist() == [[255] * 6]


def test_no_memory_is_taken_on_the_word_of_a_header(tmp_path):
    liars = [
        planes(width=65535, height=65535),
        HEAD.replace("\n2\n2", "\n65535\n65535").encode(),
        planes(width=256, height=256, plane=jpeg((16, 8))),
    ]
    for data in liars:
        tracemalloc.start()
        refused(tmp_path / "a.ptm", data)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 4_000_000


@pytest.mark.parametrize("format", ["RGB", "LRGB", "LUM"])
def test_every_shorter_file_is_refused(format, tmp_path):
    write_ptm(random_ptm(format, (3, 2)), tmp_path / "a.ptm")
    data = (tmp_path / "a.ptm").read_bytes()
    header, _ = read_header(tmp_path / "a.ptm")
    without_trailer = header.body + header.body_bytes
    for end in set(range(len(data) - 1)) - {without_trailer}:
        refused(tmp_path / "b.ptm", data[:end])
    (tmp_path / "b.ptm").write_bytes(data[:without_trailer])
    assert read_ptm(tmp_path / "b.ptm").format == format


def test_every_shorter_file_of_planes_is_refused(tmp_path):
    write_ptm(quantise(matt_bumps((16, 8))[1]), tmp_path / "a.ptm", compression="jpeg")
    data = (tmp_path / "a.ptm").read_bytes()
    header, _ = read_header(tmp_path / "a.ptm")
    for end in [*range(header.body), *range(header.body, header.body + header.body_bytes, 61)]:
        refused(tmp_path / "b.ptm", data[:end])


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (b"TRAILER 1 ", b"TRAILER 2 ", "version"),
        (b'"srgb"', b'"rec709"', "trailer"),
        (b'{"crc32"', b'{"gamma":2,"crc32"', "trailer"),
        (b'"tool"', b'"tool', "trailer"),
        (b"IMPOSTOR_PTM", b"RESAMPLED_PTM", "after the body"),
    ],
)
def test_trailers_that_are_not_understood(old, new, expected, tmp_path):
    write_ptm(random_ptm(), tmp_path / "a.ptm")
    data = (tmp_path / "a.ptm").read_bytes()
    assert data.count(old) == 1
    assert expected in refused(tmp_path / "a.ptm", data.replace(old, new))


def test_an_altered_body_is_refused(tmp_path):
    write_ptm(random_ptm(), tmp_path / "a.ptm")
    data = bytearray((tmp_path / "a.ptm").read_bytes())
    data[data.index(b"IMPOSTOR") - 1] ^= 1
    assert "altered" in refused(tmp_path / "a.ptm", bytes(data))


def test_bytes_after_the_body_are_not_ignored(tmp_path):
    assert "after the body" in refused(tmp_path / "a.ptm", HEAD.encode() + bytes(36) + b"more")
    (tmp_path / "a.ptm").write_bytes(HEAD.encode() + np.arange(36, dtype=np.uint8).tobytes() + b" \r\n")
    assert read_ptm(tmp_path / "a.ptm").color[0, 1, 2] == 35
