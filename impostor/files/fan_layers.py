"""The layers of a `.fan` file: stacks of tiles in memory, PNG atlases in the file."""

from __future__ import annotations

import hashlib
import struct
import zlib
from io import BytesIO
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngImageFile

from impostor.errors import FanFileError
from impostor.files.fan_manifest import LayerEntry, LayerShape, Manifest
from impostor.normal_code import BACKGROUND, palette

# zlib level 5: level 6 takes 1.6 times as long for 3 percent less, measured on depth and colour of real scans.
COMPRESS_LEVEL = 5
# A byte of deflated data holds at most 1032: an image that claims more is a lie, found before anything is allocated.
MAX_DEFLATE_RATIO = 1032
# Bit depth and colour type of the PNG header, bits a texel, and how Pillow names the same.
PNG_MODES = {
    "rgba8": (8, 6, 32, "RGBA"),
    "palette8": (8, 3, 8, "P"),
    "gray16": (16, 0, 16, "I;16"),
    "gray1": (1, 0, 1, "1"),
}


def encode_layer(tiles: NDArray[Any], shape: LayerShape) -> bytes:
    """One layer (V, S, S[, 4]) as the PNG of its atlas; places without a view hold background."""
    columns, rows, size = shape.width // shape.tile, shape.height // shape.tile, shape.tile
    empty = columns * rows - len(tiles)
    if empty:
        background = BACKGROUND if shape.mode == "palette8" else 0
        tiles = np.concatenate([tiles, np.full((empty, *tiles.shape[1:]), background, tiles.dtype)])
    grid = tiles.reshape(rows, columns, *tiles.shape[1:]).swapaxes(1, 2)
    image = Image.fromarray(grid.reshape(rows * size, columns * size, *tiles.shape[3:]))
    if shape.mode == "palette8":
        image.putpalette(palette().tobytes())
    file = BytesIO()
    image.save(file, "PNG", compress_level=COMPRESS_LEVEL)
    return file.getvalue()


def largest_png(shape: LayerShape) -> int:
    """More bytes than any honest PNG of this layer has: its texels without compression, and room for the chunks."""
    return 2 * _raw_bytes(shape) + 65536


def decode_layer(
    manifest: Manifest, path: str | PathLike[str], shape: LayerShape, entry: LayerEntry, png: bytes
) -> NDArray[Any]:
    """One layer's tiles (V, S, S[, 4]) from the PNG of its atlas."""
    if hashlib.sha256(png).hexdigest() != entry.sha256:
        raise FanFileError(path, f"layer {entry.file!r} is altered: its bytes are not those that the manifest names")
    _check_header(png, shape, manifest, path)
    try:
        return _tiles(_pixels(png, shape), shape)[: len(manifest.views)]
    except Exception as error:  # Pillow promises no closed list of exceptions for a damaged image
        raise FanFileError(path, f"layer {entry.file!r} cannot be decoded: {error or type(error).__name__}") from error


def _check_header(png: bytes, shape: LayerShape, manifest: Manifest, path: str | PathLike[str]) -> None:
    depth, color_type, *_ = PNG_MODES[shape.mode]
    if len(png) < 33 or png[:16] != b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR":
        raise FanFileError(path, f"layer {shape.file!r} is not a PNG")
    width, height, *kind = struct.unpack(">2L5B", png[16:29])
    if (width, height) != (shape.width, shape.height):
        tiles = f"{manifest.columns} x {manifest.rows} tiles of {shape.tile}"
        raise FanFileError(
            path, f"layer {shape.file!r} is {width}x{height}; the manifest says {shape.width}x{shape.height} ({tiles})"
        )
    if kind != [depth, color_type, 0, 0, 0]:
        found = f"bit depth {kind[0]}, colour type {kind[1]}, interlace {kind[4]}"
        raise FanFileError(path, f"layer {shape.file!r} has {found}; expected {depth}, {color_type}, 0")
    claimed = _raw_bytes(shape)
    if claimed > len(png) * MAX_DEFLATE_RATIO:
        raise FanFileError(
            path, f"layer {shape.file!r}: {len(png)} bytes cannot hold the {claimed} that its header claims"
        )


def _raw_bytes(shape: LayerShape) -> int:
    """Of the image before compression: its rows, each with the number of its filter."""
    return shape.height * (1 + (shape.width * PNG_MODES[shape.mode][2] + 7) // 8)


def _pixels(png: bytes, shape: LayerShape) -> NDArray[Any]:
    """The atlas (H, W[, 4]) of a PNG whose header has been checked."""
    expected = (shape.width, shape.height), PNG_MODES[shape.mode][3]
    # Not Image.open: its limit on pixels is global, and the size has been checked against stricter ones.
    with PngImageFile(BytesIO(png)) as image:
        if (image.size, image.mode) != expected:  # a second header
            raise ValueError(f"{image.size} {image.mode}; expected {expected}")
        image.load()
        if shape.mode == "gray1":
            packed = np.frombuffer(image.tobytes(), np.uint8).reshape(shape.height, -1)
            pixels = np.unpackbits(packed, axis=1, count=shape.width).view(np.bool_)
        else:
            pixels = np.asarray(image)
    # Pillow leaves 0 where the data ends early without being cut off: only then is there a doubt to settle.
    if not pixels[-1].any() and _inflated_bytes(png) < _raw_bytes(shape):
        raise ValueError("its data ends early")
    return pixels


def _inflated_bytes(png: bytes) -> int:
    """How many bytes the image data of a PNG inflates to, a piece at a time."""
    inflate, position, total = zlib.decompressobj(), 8, 0
    while position < len(png):
        length, kind = struct.unpack(">L4s", png[position : position + 8])
        data = png[position + 8 : position + 8 + length] if kind == b"IDAT" else b""
        while data:
            total += len(inflate.decompress(data, 1 << 20))
            data = inflate.unconsumed_tail
        position += length + 12
    return total


def _tiles(atlas: NDArray[Any], shape: LayerShape) -> NDArray[Any]:
    size, texel = shape.tile, atlas.shape[2:]
    grid = atlas.reshape(shape.height // size, size, shape.width // size, size, *texel).swapaxes(1, 2)
    return grid.copy().reshape(-1, size, size, *texel)
