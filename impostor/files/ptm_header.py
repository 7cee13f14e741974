"""The head of a `.ptm` file, and the trailer that this tool adds. PTM.md, beside this file, is the normative text."""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from os import PathLike

import msgspec
import numpy as np
from numpy.typing import NDArray

from impostor.errors import PtmFileError
from impostor.ptm.polynomials import TERMS, Curve, Parameters
from impostor.ptm.quantise import LARGEST_SCALE, WHITE

VERSIONS = ("PTM_1.1", "PTM_1.2")
PREFIX = "PTM_FORMAT_"
PLANES = {"JPEG_LRGB": 9, "JPEG_RGB": 18}
TEXEL_BYTES = {"RGB": 18, "LRGB": 9, "LUM": 8}
REFUSED = {
    "PTM_LUT": "look-up tables",
    "PTM_C_LUT": "look-up tables",
    "JPEGLS_RGB": "JPEG-LS",
    "JPEGLS_LRGB": "JPEG-LS",
}
LARGEST_SIDE = 65535
LARGEST_TOKEN = 128
# A baseline JPEG spends at least a bit on the first and a bit on the end of each 8x8 block.
TEXELS_PER_JPEG_BYTE = 256
SIDE_RECORD = np.dtype([("index", ">u4"), ("value", "u1")])
TRAILER = b"IMPOSTOR_PTM_TRAILER "
TRAILER_VERSION = 1
LARGEST_TRAILER = 4096

_TOKEN = re.compile(rb"[ \t\r\n]*([!-~]+)")
_LINE_END = re.compile(rb"[ \t\r]*\n")
_INTEGER = re.compile(rb"[-+]?[0-9]{1,10}")
_NUMBER = re.compile(rb"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]{1,3})?")


@dataclass(frozen=True)
class PlaneEntry:
    """What the header says of one JPEG plane: its place among the planes to decode, reference plane and sizes."""

    rank: int
    reference: int = -1
    inverted: bool = False
    jpeg_bytes: int = 0
    side_bytes: int = 0


@dataclass(frozen=True, eq=False)
class Header:
    """Everything before the body of a `.ptm` file; `body` is the byte where that begins."""

    version: str
    format: str
    width: int
    height: int
    scale: NDArray[np.float64]
    bias: NDArray[np.int64]
    matrix: NDArray[np.float64] | None = None
    quality: int = 0
    planes: tuple[PlaneEntry, ...] = ()
    body: int = 0

    @property
    def body_bytes(self) -> int:
        """Length of the body."""
        if self.planes:
            return sum(plane.jpeg_bytes + plane.side_bytes for plane in self.planes)
        return self.width * self.height * TEXEL_BYTES[self.format]


class Trailer(msgspec.Struct, forbid_unknown_fields=True):
    """What the header has no room for, and a check of all bytes before the trailer."""

    crc32: int
    curve: Curve = "srgb"
    parameters: Parameters = "light"
    tool: str = ""


class _Tokens:
    """The header's words, one after the other."""

    def __init__(self, data: bytes, path: str | PathLike[str]):
        self.data, self.path, self.position = data, path, 0

    def word(self, name: str) -> bytes:
        found = _TOKEN.match(self.data, self.position, self.position + LARGEST_TOKEN)
        if found is None:
            raise self.error(name, f"missing at byte {self.position}", "a word of ASCII")
        self.position = found.end()
        return found[1]

    def numbers(self, name: str, count: int) -> NDArray[np.float64]:
        values = []
        for place in _places(name, count):
            word = self.word(place)
            if not _NUMBER.fullmatch(word) or not np.isfinite(float(word)):
                raise self.error(place, word.decode("ascii"), "a number")
            values.append(float(word))
        return np.array(values)

    def integers(self, name: str, count: int, least: int, most: int) -> list[int]:
        values = []
        for place in _places(name, count):
            word = self.word(place)
            if not _INTEGER.fullmatch(word) or not least <= int(word) <= most:
                raise self.error(place, word.decode("ascii"), f"a whole number from {least} to {most}")
            values.append(int(word))
        return values

    def end_line(self) -> None:
        found = _LINE_END.match(self.data, self.position)
        if found is None:
            raise self.error("the last line", f"does not end at byte {self.position}", "a line feed before the body")
        self.position = found.end()

    def error(self, name: str, value: str, expected: str) -> PtmFileError:
        return PtmFileError(self.path, f"header: {name}: {value[:60]}; expected {expected}")


def _places(name: str, count: int) -> list[str]:
    return [name] if count == 1 else [f"{name} {index}" for index in range(count)]


def parse_header(data: bytes, path: str | PathLike[str]) -> Header:
    """Read the header of a whole `.ptm` file, and hold what it says against the file's length.

    Parameters
    ----------
    data : bytes
        The file.
    path : path-like
        For messages.

    Raises
    ------
    PtmFileError
    """
    tokens = _Tokens(data, path)
    version = tokens.word("version").decode("ascii")
    if version not in VERSIONS:
        what = f"version {version}" if version.startswith("PTM_") else f"it begins with {version[:20]!r}"
        raise PtmFileError(path, f"{what}; expected {' or '.join(VERSIONS)}")
    name = tokens.word("format").decode("ascii")
    kind = name.removeprefix(PREFIX)
    if kind in REFUSED:
        raise PtmFileError(path, f"format {name}: {REFUSED[kind]} are not read; expected {_readable()}")
    if not name.startswith(PREFIX) or kind not in TEXEL_BYTES | PLANES:
        raise PtmFileError(path, f"format {name[:60]}; expected {_readable()}")
    (width,), (height,) = (tokens.integers(name, 1, 1, LARGEST_SIDE) for name in ("width", "height"))
    scale = tokens.numbers("scale", TERMS)
    if not ((scale >= 0) & (scale <= LARGEST_SCALE)).all():
        raise tokens.error("scale", str(scale.tolist()), f"numbers from 0 to {LARGEST_SCALE:g}")
    bias = np.array(tokens.integers("bias", TERMS, 0, WHITE))
    quality, planes = _plane_table(tokens, PLANES[kind]) if kind in PLANES else (0, ())
    tokens.end_line()
    header = Header(version, kind, width, height, scale, bias, None, quality, planes, tokens.position)
    if kind == "LUM" and not _ends_well(data, header):
        header = _with_matrix(header, tokens)
    _check_length(data, header, path)
    return header


def header_bytes(header: Header) -> bytes:
    """The text of a header; its numbers read back as the same ones."""
    lines = [header.version, PREFIX + header.format, str(header.width), str(header.height)]
    lines += [" ".join(_decimal(value) for value in header.scale), _joined(header.bias)]
    if header.matrix is not None:
        lines += [" ".join(_decimal(value) for value in header.matrix.ravel())]
    if header.planes:
        zeros = [0] * len(header.planes)
        columns = zip(
            *(
                (int(plane.inverted), plane.rank, plane.reference, plane.jpeg_bytes, plane.side_bytes)
                for plane in header.planes
            ),
            strict=True,
        )
        inverted, *others = columns
        lines += [str(header.quality), *map(_joined, (inverted, zeros, zeros, *others))]
    return ("\n".join(lines) + "\n").encode("ascii")


def parse_trailer(data: bytes, end: int, path: str | PathLike[str]) -> Trailer:
    """What stands after the body of a `.ptm` file.

    Parameters
    ----------
    data : bytes
        The file.
    end : int
        Where the body ends.
    path : path-like
        For messages.

    Returns
    -------
    Trailer
        What holds for files of other tools, where there is none.

    Raises
    ------
    PtmFileError
        Something else stands there, the trailer is of a newer version, or the bytes before it were altered.
    """
    text = data[end : end + LARGEST_TRAILER]
    if not text.strip() and end + len(text) == len(data):
        return Trailer(0)
    if not text.startswith(TRAILER):
        raise PtmFileError(path, f"{len(data) - end} bytes after the body; expected the end of the file")
    version, _, fields = text.removeprefix(TRAILER).partition(b" ")
    if version != b"%d" % TRAILER_VERSION:
        raise PtmFileError(path, f"trailer: version {version[:20]!r}; expected {TRAILER_VERSION}")
    try:
        trailer = msgspec.json.decode(fields, type=Trailer)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise PtmFileError(path, f"trailer: {error}") from None
    if trailer.crc32 != zlib.crc32(memoryview(data)[:end]):
        raise PtmFileError(path, "the file is altered: its bytes are not those that its trailer was written for")
    return trailer


def trailer_bytes(trailer: Trailer) -> bytes:
    """The trailer's text."""
    return TRAILER + b"%d " % TRAILER_VERSION + msgspec.json.encode(trailer) + b"\n"


def _decimal(value: float) -> str:
    return np.format_float_positional(value, unique=True, trim="0")


def _joined(values: Iterable[int]) -> str:
    return " ".join(str(value) for value in values)


def _ends_well(data: bytes, header: Header) -> bool:
    """Whether the file, or all of it but white space or a trailer, ends where the header says."""
    end = header.body + header.body_bytes
    return end <= len(data) and (data.startswith(TRAILER, end) or not data[end : end + LARGEST_TRAILER].strip())


def _with_matrix(header: Header, tokens: _Tokens) -> Header:
    """The header with the color matrix that stands before the body of some LUM files, where one does."""
    start = tokens.position
    try:
        matrix = tokens.numbers("color matrix", 16).reshape(4, 4)
        tokens.end_line()
    except PtmFileError:
        tokens.position = start
        return header
    return replace(header, matrix=matrix, body=tokens.position)


def _check_length(data: bytes, header: Header, path: str | PathLike[str]) -> None:
    """Nothing is decoded, and no memory taken, before the file holds what its header promises."""
    found = len(data) - header.body
    if found < header.body_bytes:
        size = f"{header.width} x {header.height} {header.format}"
        raise PtmFileError(path, f"body: {found} bytes; expected {header.body_bytes} for {size}")
    texels = header.width * header.height
    for index, plane in enumerate(header.planes):
        if texels > plane.jpeg_bytes * TEXELS_PER_JPEG_BYTE:
            place = f"plane {index}: {plane.jpeg_bytes} bytes"
            raise PtmFileError(path, f"{place} cannot hold the {texels} texels of {header.width} x {header.height}")
        if plane.side_bytes % SIDE_RECORD.itemsize:
            raise PtmFileError(
                path, f"plane {index}: {plane.side_bytes} bytes of side information; expected 5 a record"
            )


def _readable() -> str:
    return f"{PREFIX}RGB, LRGB, LUM, JPEG_RGB or JPEG_LRGB"


def _plane_table(tokens: _Tokens, count: int) -> tuple[int, tuple[PlaneEntry, ...]]:
    """Compression parameter and entries of all planes."""
    (quality,) = tokens.integers("compression parameter", 1, 0, 2**31)
    transforms = tokens.integers("transform", count, 0, 3)
    if max(transforms) > 1:
        raise tokens.error("transform", f"{max(transforms)}: motion compensation is not read", "0 or 1")
    for axis in "xy":
        tokens.integers(f"motion vector {axis}", count, -LARGEST_SIDE, LARGEST_SIDE)
    order = tokens.integers("order", count, 0, count - 1)
    if sorted(order) != list(range(count)):
        raise tokens.error("order", str(order), f"every number from 0 to {count - 1} once")
    references = tokens.integers("reference plane", count, -1, count - 1)
    jpeg_bytes = tokens.integers("plane size", count, 1, 2**31)
    side_bytes = tokens.integers("side information size", count, 0, 2**31)
    for plane, reference in enumerate(references):
        if reference >= 0 and order[reference] >= order[plane]:
            raise tokens.error(
                "reference plane", f"{reference} for plane {plane}, which is decoded first", "one decoded before"
            )
    entries = zip(order, references, transforms, jpeg_bytes, side_bytes, strict=True)
    return quality, tuple(PlaneEntry(rank, ref, bool(turn), size, side) for rank, ref, turn, size, side in entries)
