"""The manifest of a `.fan` file: its schema, what must hold in it, and its bytes. FORMAT.md is the normative text."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from os import PathLike
from typing import Annotated, Any, NamedTuple

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from impostor.errors import FanFileError, ImpostorError
from impostor.fan import MAX_SIZE, MIN_SIZE
from impostor.views import LAYOUTS, MAX_VIEWS, Views

FORMAT = "impostor fan"
VERSION = 1
MAX_TEXELS = 1 << 27  # of all tiles of a layer: 2048 of 256 x 256, or 128 of 1024 x 1024
MAX_MANIFEST_BYTES = 1 << 22
ORTHONORMAL_TOLERANCE = 1e-6  # a basis computed in float32 passes

Vector = tuple[float, float, float]


class ViewEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One camera, as `impostor.views.View` has it; the distance is the manifest's."""

    basis: tuple[Vector, Vector, Vector]
    center: Vector
    radius: Annotated[float, Meta(gt=0)]
    depth_range: tuple[float, float]
    plane: Vector


class LayerEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One image of the archive: an atlas of all tiles of a layer, sizes in texels."""

    file: str
    mode: str
    width: int
    height: int
    sha256: Annotated[str, Meta(pattern="^[0-9a-f]{64}$")]


class Manifest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All that a `.fan` file says besides its pixels.

    Parameters
    ----------
    format : str
        Always "impostor fan".
    version : int
        Of the format; this program writes and reads 1.
    tool : str
        The program and version that wrote the file.
    name : str
    layout : {"ring", "hemisphere", "sphere"}
    size : int
        Side of a tile in texels.
    columns, rows : int
        Of the atlas; view 0 is top left, then along the row.
    distance : float or None
        From every view's centre to its eye, in metres; None when orthographic.
    views : list of ViewEntry
    layers : list of LayerEntry
        Colour, normal levels, depth, silhouette: the order of the archive.
    bounds : tuple
        Lowest and highest coordinates of the object.
    radius : float
        Of the sphere around the middle of the bounds that holds the object.
    source : dict
        `name` and `sha256` of what was baked.
    settings : dict
        What it was baked with.
    """

    format: str
    version: int
    tool: str
    name: str
    layout: str
    size: Annotated[int, Meta(ge=MIN_SIZE, le=MAX_SIZE)]
    columns: Annotated[int, Meta(ge=1, le=MAX_VIEWS)]
    rows: Annotated[int, Meta(ge=1, le=MAX_VIEWS)]
    distance: Annotated[float, Meta(gt=0)] | None
    views: Annotated[list[ViewEntry], Meta(min_length=1, max_length=MAX_VIEWS)]
    layers: Annotated[list[LayerEntry], Meta(min_length=4, max_length=3 + MAX_SIZE.bit_length())]
    bounds: tuple[Vector, Vector]
    radius: Annotated[float, Meta(gt=0)]
    source: dict[str, str]
    settings: dict[str, Any]

    def cameras(self) -> Views:
        """The views as arrays."""
        return Views(
            np.array([view.basis for view in self.views]),
            np.array([view.center for view in self.views]),
            np.array([view.radius for view in self.views]),
            np.array([view.depth_range for view in self.views]),
            math.inf if self.distance is None else self.distance,
            np.array([view.plane for view in self.views]),
        )


class _Header(msgspec.Struct):
    format: str
    version: int


class LayerShape(NamedTuple):
    """What the layer table must say of one image, and the side of its tiles."""

    file: str
    mode: str
    width: int
    height: int
    tile: int


def atlas_grid(count: int) -> tuple[int, int]:
    """Columns and rows for `count` tiles: the fewest empty places among grids up to twice as wide as the square one."""
    square = math.isqrt(count - 1) + 1
    columns = min(range(square, 2 * square + 1), key=lambda columns: -(-count // columns) * columns)
    return columns, -(-count // columns)


def layer_shapes(size: int, columns: int, rows: int, levels: int) -> list[LayerShape]:
    """The images of a fan with tiles of `size` and `levels` levels of normals, in the order of the archive."""
    layers = [
        ("color.png", "rgba8", size),
        *(
            (f"normal_{level}.png" if level else "normal.png", "palette8", max(size >> level, 1))
            for level in range(levels)
        ),
        ("depth.png", "gray16", size),
        ("silhouette.png", "gray1", size),
    ]
    return [LayerShape(file, mode, columns * tile, rows * tile, tile) for file, mode, tile in layers]


def check_version(data: bytes, where: str | PathLike[str], error: type[ImpostorError] = FanFileError) -> None:
    """Raise `error` unless these bytes begin a manifest of a version that this program reads."""
    header = _decode(data, _Header, where, error)
    if header.format != FORMAT:
        raise error(where, f"manifest $.format: {header.format[:40]!r}; expected {FORMAT!r}")
    if header.version > VERSION:
        raise error(where, f"format version {header.version}; this program reads up to {VERSION}")
    if header.version < 1:
        raise error(where, f"manifest $.version: {header.version}; expected 1 to {VERSION}")


def parse_manifest(data: bytes, where: str | PathLike[str], error: type[ImpostorError] = FanFileError) -> Manifest:
    """A manifest from its bytes, with everything checked that needs no pixel.

    Parameters
    ----------
    data : bytes
    where : path-like
        Named in the message.
    error : type
        Raised when something is wrong.

    Returns
    -------
    Manifest
    """
    check_version(data, where, error)
    manifest = _decode(data, Manifest, where, error)
    for problem in _problems(manifest):
        raise error(where, f"manifest {problem}")
    return manifest


def manifest_bytes(fields: dict[str, Any]) -> bytes:
    """JSON with sorted keys and one view or layer a line; floats as the shortest text that reads back exactly.

    Raises
    ------
    TypeError, ValueError
        A value that JSON cannot hold.
    """
    lines = []
    for key in sorted(fields):
        value = fields[key]
        text = "[\n  " + ",\n  ".join(map(_dumps, value)) + "\n ]" if isinstance(value, list) else _dumps(value)
        lines.append(f"{_dumps(key)}: {text}")
    return ("{\n " + ",\n ".join(lines) + "\n}\n").encode()


def _dumps(value: Any) -> str:
    return json.dumps(value, sort_keys=True, allow_nan=False, ensure_ascii=False, default=_plain)


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} {value!r}; expected text, a number, true, false, a list or a dict")


def _decode(data: bytes, kind: type, where: str | PathLike[str], error: type[ImpostorError]) -> Any:
    try:
        return msgspec.json.decode(data.decode(), type=kind)  # msgspec does not check the UTF-8 of what it refuses
    except msgspec.ValidationError as found:
        raise error(where, f"manifest {_readable(str(found), data)}") from None
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as found:
        raise error(where, f"manifest is not JSON: {found}") from None


def _readable(message: str, data: bytes) -> str:
    """msgspec's message with the place first and the value that was found."""
    text, _, place = message.partition(" - at `")
    text, place = text[:1].lower() + text[1:], place.rstrip("`") or "$"
    value = _value_at(place, data) if text.startswith("expected") else ""
    return f"{place}: {value}; {text}" if value else f"{place}: {text}"


def _value_at(place: str, data: bytes) -> str:
    """The beginning of the JSON at a place like `$.views[3].radius`; nothing where that cannot be told."""
    try:
        value = msgspec.json.decode(data)
        for key, index in re.findall(r"\.(\w+)|\[([^]]*)\]", place):
            if index == "...":  # a value of an object: msgspec does not say which
                break
            value = value[key or int(index)]
        return json.dumps(value)[:60]
    except (msgspec.DecodeError, RecursionError, LookupError, TypeError, ValueError):
        return ""  # the file has more wrong with it than what was found first


def _problems(manifest: Manifest) -> Iterator[str]:
    """What the schema cannot say, each as `place: value; expected`."""
    count, size, columns, rows = len(manifest.views), manifest.size, manifest.columns, manifest.rows
    if manifest.layout not in LAYOUTS:
        yield f"$.layout: {manifest.layout[:40]!r}; expected one of {', '.join(LAYOUTS)}"
    if count * size * size > MAX_TEXELS:
        yield f"$.size: {count} views of {size} x {size} texels; expected at most {MAX_TEXELS} texels in all"
    if not (rows - 1) * columns < count <= rows * columns:
        yield f"$.columns, $.rows: {columns} x {rows} tiles; expected {count} views, and no empty row"
    if any(low > high for low, high in zip(*manifest.bounds, strict=True)):
        yield f"$.bounds: {list(map(list, manifest.bounds))}; expected the lowest coordinates first"
    yield from _layer_problems(manifest)
    yield from _camera_problems(manifest.cameras())


def _layer_problems(manifest: Manifest) -> Iterator[str]:
    levels = len(manifest.layers) - 3
    if levels > manifest.size.bit_length():
        yield f"$.layers: {levels} levels of normals; expected at most {manifest.size.bit_length()} for this size"
    shapes = layer_shapes(manifest.size, manifest.columns, manifest.rows, levels)
    for index, (entry, shape) in enumerate(zip(manifest.layers, shapes, strict=True)):
        for key in ("file", "mode", "width", "height"):
            found, expected = getattr(entry, key), getattr(shape, key)
            if found != expected:
                yield f"$.layers[{index}].{key}: {json.dumps(found)[:60]}; expected {json.dumps(expected)}"


def _camera_problems(views: Views) -> Iterator[str]:
    with np.errstate(over="ignore", invalid="ignore"):  # of absurd numbers, which fail the comparison
        products = views.basis @ views.basis.transpose(0, 2, 1)
        orthonormal = np.abs(products - np.eye(3)).max(axis=(1, 2)) <= ORTHONORMAL_TOLERANCE
        right_handed = np.einsum("vi,vi->v", np.cross(views.basis[:, 0], views.basis[:, 1]), views.basis[:, 2]) > 0
    low, high = views.depth_range.T
    for index in _first(~orthonormal):
        yield f"$.views[{index}].basis: {views.basis[index].tolist()}; expected orthonormal rows right, up, back"
    for index in _first(~right_handed):
        yield f"$.views[{index}].basis: {views.basis[index].tolist()}; expected a right-handed basis"
    for index in _first(low >= high):
        yield f"$.views[{index}].depth_range: {low[index]:g}, {high[index]:g}; expected the lower one first"
    for index in _first(views.plane[:, 0] >= views.distance):
        yield f"$.views[{index}].plane: {views.plane[index].tolist()}; expected an offset less than $.distance"
    for index in _first(high >= views.distance):
        yield f"$.distance: {views.distance:g}; expected more than $.views[{index}].depth_range[1], {high[index]:g}"


def _first(wrong: NDArray[np.bool_]) -> list[int]:
    return np.flatnonzero(wrong)[:1].tolist()
