"""Reading and writing `.ptm` files. PTM.md, beside this file, is the normative text."""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from impostor.checks import check_type
from impostor.errors import PtmFileError, SettingsError
from impostor.files.output import atomic_output, check_output
from impostor.files.ptm_header import (
    LARGEST_SIDE,
    PLANES,
    Header,
    Trailer,
    header_bytes,
    parse_header,
    parse_trailer,
    trailer_bytes,
)
from impostor.files.ptm_planes import decode_planes, encode_planes
from impostor.paths import check_path
from impostor.ptm.polynomials import RGB_FROM_YCRCB, TERMS
from impostor.ptm.quantise import WHITE, Ptm

FilePath = str | os.PathLike[str]


def read_ptm(path: FilePath) -> Ptm:
    """Read a `.ptm` file whole.

    Parameters
    ----------
    path : path-like
        PTM_1.1 or PTM_1.2; RGB, LRGB, LUM, JPEG_RGB or JPEG_LRGB.

    Returns
    -------
    Ptm
        Row 0 is the top. `curve` and `parameters` are "srgb" and "light" where the file does not say.

    Raises
    ------
    PtmFileError
        Anything in the file is not as PTM.md says. Nothing is allocated on the word of the header alone.
    """
    check_path(path)
    data = _file_bytes(path)
    header = parse_header(data, path)
    trailer = parse_trailer(data, header.body + header.body_bytes, path)
    coefficients, color, chroma = _planes_body(data, header, path) if header.planes else _raw_body(data, header)
    matrix = None
    if chroma is not None:
        matrix = RGB_FROM_YCRCB.copy() if header.matrix is None else _from_bytes(header.matrix)
    return Ptm(coefficients, header.scale, header.bias, color, chroma, matrix, trailer.curve, trailer.parameters)


def read_header(path: FilePath) -> tuple[Header, Trailer]:
    """Read what a `.ptm` file says of itself, and decode no texel.

    Raises
    ------
    PtmFileError
        As `read_ptm`, as far as can be told without the texels.
    """
    data = _file_bytes(path)
    header = parse_header(data, path)
    return header, parse_trailer(data, header.body + header.body_bytes, path)


def validate_ptm(path: FilePath) -> list[str]:
    """What is wrong with a `.ptm` file: no line, or the one that `read_ptm` would raise."""
    try:
        read_ptm(path)
    except PtmFileError as error:
        return [str(error)]
    return []


def write_ptm(
    ptm: Ptm,
    path: FilePath,
    *,
    compression: Literal["jpeg"] | None = None,
    quality: int = 95,
    predict: bool = True,
    force: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> int:
    """Write a PTM; the same one gives the same bytes on the same machine.

    Parameters
    ----------
    ptm : Ptm
    path : path-like
    compression : {None, "jpeg"}
        None keeps every byte. "jpeg" makes one JPEG of each plane; there is no such format for LUM.
    quality : int
        Of JPEG, 1..100.
    predict : bool
        Allow a plane to be stored as its difference from another. Some viewers do not read that.
    force : bool
        Replace an existing file.
    progress : callable, optional
        Called with planes compressed and planes in all.

    Returns
    -------
    int
        Size of the file in bytes.

    Raises
    ------
    OutputError
        The file exists, or cannot be written.
    SettingsError
        No `.ptm` file can hold the PTM, or a choice is not one of those above.
    """
    check_type("ptm", ptm, Ptm)
    check_output(path, force)
    if max(ptm.size) > LARGEST_SIDE:
        raise SettingsError(path, f"PTM is {ptm.size[0]} x {ptm.size[1]}; expected sides up to {LARGEST_SIDE}")
    if compression not in (None, "jpeg"):
        raise SettingsError("compression", f"{compression!r}; expected None or 'jpeg'")
    check_quality(quality)
    parts = _raw_parts(ptm) if compression is None else _jpeg_parts(ptm, quality, predict, progress)
    checksum = 0
    for part in parts:
        checksum = zlib.crc32(part, checksum)
    parts.append(trailer_bytes(Trailer(checksum, ptm.curve, ptm.parameters, f"impostor {_tool_version()}")))
    with atomic_output(path, force) as temporary:
        with open(temporary, "wb") as file:
            file.writelines(parts)
        return temporary.stat().st_size


def check_quality(quality: int, where: str = "quality") -> None:
    """Refuse what is no quality of a JPEG.

    Raises
    ------
    SettingsError
    """
    if not 1 <= quality <= 100:
        raise SettingsError(where, f"{quality}; expected 1 to 100")


def _file_bytes(path: FilePath) -> bytes:
    try:
        if not Path(path).is_file():
            raise PtmFileError(path, "is a directory or no ordinary file" if Path(path).exists() else "does not exist")
        return Path(path).read_bytes()
    except OSError as error:
        raise PtmFileError(path, f"cannot be read: {error.strerror}; expected a file that can") from error


def _raw_body(
    data: bytes, header: Header
) -> tuple[NDArray[np.uint8], NDArray[np.uint8] | None, NDArray[np.uint8] | None]:
    """Coefficients, color and chroma of a file without compression."""
    body = np.frombuffer(data, np.uint8, header.body_bytes, header.body)
    shape = header.height, header.width
    if header.format == "RGB":
        return np.ascontiguousarray(body.reshape(3, *shape, TERMS)[:, ::-1].transpose(1, 2, 0, 3)), None, None
    if header.format == "LRGB" and header.version == "PTM_1.2":
        coefficients, rest = np.split(body, [TERMS * shape[0] * shape[1]])
        return coefficients.reshape(*shape, 1, TERMS)[::-1].copy(), rest.reshape(*shape, 3)[::-1].copy(), None
    texels = body.reshape(*shape, -1)[::-1]
    coefficients, rest = texels[..., None, :TERMS].copy(), texels[..., TERMS:].copy()
    return (coefficients, rest, None) if header.format == "LRGB" else (coefficients, None, rest)


def _planes_body(
    data: bytes, header: Header, path: FilePath
) -> tuple[NDArray[np.uint8], NDArray[np.uint8] | None, None]:
    """Coefficients and color of a file of JPEG planes."""
    planes = decode_planes(data, header.body, header.planes, (header.width, header.height), path)
    count = TERMS if header.format == "JPEG_LRGB" else len(planes)
    texels = np.stack(planes[:count], axis=-1)[::-1]
    coefficients = np.ascontiguousarray(texels.reshape(*texels.shape[:2], -1, TERMS))
    return coefficients, np.stack(planes[count:], axis=-1)[::-1].copy() if planes[count:] else None, None


def _raw_parts(ptm: Ptm) -> list[bytes]:
    """Header and body of a file without compression."""
    width, height = ptm.size
    matrix = None
    if ptm.rgb_from_luma is not None and not np.array_equal(ptm.rgb_from_luma, RGB_FROM_YCRCB):
        matrix = _to_bytes(ptm.rgb_from_luma)
    header = header_bytes(Header("PTM_1.2", ptm.format, width, height, ptm.scale, ptm.bias, matrix))
    coefficients = ptm.coefficients[::-1]
    if ptm.color is not None:
        return [header, coefficients.tobytes(), ptm.color[::-1].tobytes()]
    if ptm.chroma is not None:
        return [header, np.concatenate([coefficients[:, :, 0], ptm.chroma[::-1]], axis=-1).tobytes()]
    return [header, coefficients.transpose(2, 0, 1, 3).tobytes()]


def _jpeg_parts(ptm: Ptm, quality: int, predict: bool, progress: Callable[[int, int], None] | None) -> list[bytes]:
    """Header and body of a file of JPEG planes."""
    name = f"JPEG_{ptm.format}"
    if name not in PLANES:
        raise SettingsError("compression", f"'jpeg' for {ptm.format}; expected RGB or LRGB")
    width, height = ptm.size
    texels = ptm.coefficients.reshape(height, width, -1)
    if ptm.color is not None:
        texels = np.concatenate([texels, ptm.color], axis=-1)
    planes = [np.ascontiguousarray(texels[::-1, :, plane]) for plane in range(texels.shape[2])]
    encoded = encode_planes(planes, quality, predict, progress)
    entries = tuple(plane.entry for plane in encoded)
    header = Header("PTM_1.2", name, width, height, ptm.scale, ptm.bias, None, quality, entries)
    return [header_bytes(header), *(part for plane in encoded for part in (plane.jpeg, plane.side))]


def _from_bytes(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Three rows for values 0..1 of a 4 x 4 matrix for values 0..255."""
    return np.column_stack([matrix[:3, :3], matrix[:3, 3] / WHITE])


def _to_bytes(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.vstack([np.column_stack([matrix[:, :3], matrix[:, 3] * WHITE]), [0, 0, 0, 1]])


def _tool_version() -> str:
    try:
        return version("impostor")
    except PackageNotFoundError:  # used from its sources, not installed
        return "(not installed)"
