"""Reading, writing and checking `.fan` files. FORMAT.md, beside this file, is the normative text."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impostor.checks import check_type
from impostor.errors import FanFileError, SettingsError
from impostor.fan import Fan
from impostor.files.fan_archive import FilePath, open_archive, read_entry, write_archive
from impostor.files.fan_layers import decode_layer, encode_layer, largest_png
from impostor.files.fan_manifest import (
    FORMAT,
    MAX_MANIFEST_BYTES,
    VERSION,
    LayerShape,
    Manifest,
    ViewEntry,
    atlas_grid,
    layer_shapes,
    manifest_bytes,
    parse_manifest,
)
from impostor.files.output import atomic_output, check_output
from impostor.normal_code import BACKGROUND, CODE_COUNT


def write_fan(path: FilePath, fan: Fan, force: bool = False) -> int:
    """Write a fan; the same fan gives the same bytes on the same machine.

    Parameters
    ----------
    path : path-like
    fan : Fan
        Kept exactly, texels outside the silhouette included. Lists and tuples in `settings` read back as lists.
    force : bool
        Replace an existing file.

    Returns
    -------
    int
        Size of the file in bytes.

    Raises
    ------
    OutputError
        The file exists, or cannot be written.
    SettingsError
        The fan breaks an invariant, so that it could not be read back.
    """
    check_type("fan", fan, Fan, ", as bake_fan and impostor.load give")
    check_output(path, force)
    for problem in _texel_problems(fan):
        raise SettingsError(fan.name, problem)
    columns, rows = atlas_grid(len(fan.views))
    shapes = layer_shapes(fan.size, columns, rows, len(fan.normal))
    _manifest(fan, shapes, [b""] * len(shapes))  # fails early what would fail after the long work
    with ThreadPoolExecutor(2) as pool:
        images = list(pool.map(encode_layer, _layers(fan), shapes))
    entries = {"manifest.json": _manifest(fan, shapes, images)}
    entries |= {shape.file: image for shape, image in zip(shapes, images, strict=True)}
    with atomic_output(path, force) as temporary:
        write_archive(temporary, entries)
        return temporary.stat().st_size


def read_fan(path: FilePath) -> Fan:
    """Read a fan whole.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    Fan

    Raises
    ------
    FanFileError
        Anything in the file is not as FORMAT.md says. Nothing is allocated on the word of a header alone.
    """
    with open_archive(path) as (archive, manifest):
        shapes = layer_shapes(manifest.size, manifest.columns, manifest.rows, len(manifest.layers) - 3)
        images = [read_entry(archive, shape.file, largest_png(shape), path) for shape in shapes]
    with ThreadPoolExecutor(2) as pool:
        layers = list(pool.map(partial(decode_layer, manifest, path), shapes, manifest.layers, images))
    color, *normal, depth, silhouette = layers
    return Fan(
        manifest.name,
        manifest.layout,
        manifest.cameras(),
        color,
        tuple(normal),
        depth,
        silhouette,
        manifest.source,
        manifest.settings,
        np.array(manifest.bounds),
        manifest.radius,
    )


def read_manifest(path: FilePath) -> Manifest:
    """Read what a `.fan` file says of itself, and decode no pixel.

    Raises
    ------
    FanFileError
        As `read_fan`, as far as can be told without the pixels.
    """
    with open_archive(path) as (_, manifest):
        return manifest


def validate_fan(path: FilePath) -> list[str]:
    """Everything that is wrong with a `.fan` file.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    list of str
        One line for each problem, beginning with the file; empty when there is none. What stops the file from being
        read is found alone; codes that mean nothing and a silhouette that denies the alpha are found together.
    """
    try:
        fan = read_fan(path)
    except FanFileError as error:
        return [str(error)]
    return [f"{os.fspath(path)}: {problem}" for problem in _texel_problems(fan)]


def _texel_problems(fan: Fan) -> Iterator[str]:
    for level, codes in enumerate(fan.normal):
        wrong = (codes >= CODE_COUNT) & (codes != BACKGROUND)
        if wrong.any():
            view, row, column = np.argwhere(wrong)[0]
            value = f"code {codes[view, row, column]} at row {row}, column {column} of view {view}"
            yield f"layer 'normal' level {level}: {value}; expected 0 to {CODE_COUNT - 1}, or {BACKGROUND}"
    wrong = fan.silhouette != (fan.color[..., 3] >= 128)
    if wrong.any():
        view, row, column = np.argwhere(wrong)[0]
        alpha = f"alpha {fan.color[view, row, column, 3]} at row {row}, column {column} of view {view}"
        yield f"layer 'silhouette': {bool(fan.silhouette[view, row, column])} for {alpha}; expected alpha >= 128"


def _manifest(fan: Fan, shapes: list[LayerShape], images: list[bytes]) -> bytes:
    """The manifest's bytes, read back once so that nothing is written that could not be read."""
    try:
        data = manifest_bytes(_manifest_fields(fan, shapes, images))
    except (TypeError, ValueError) as error:
        raise SettingsError(fan.name, f"name, views, source or settings: {error}") from None
    if len(data) > MAX_MANIFEST_BYTES:
        raise SettingsError(fan.name, f"manifest of {len(data)} bytes; expected at most {MAX_MANIFEST_BYTES}")
    parse_manifest(data, fan.name, SettingsError)
    return data


def _manifest_fields(fan: Fan, shapes: list[LayerShape], images: list[bytes]) -> dict[str, Any]:
    views, distance = fan.views, float(fan.views.distance)
    keys = ViewEntry.__struct_fields__
    cameras = zip(*(getattr(views, key).tolist() for key in keys), strict=True)
    columns, rows = atlas_grid(len(views))
    return {
        "format": FORMAT,
        "version": VERSION,
        "tool": f"impostor {_tool_version()}",
        "name": fan.name,
        "layout": fan.layout,
        "size": fan.size,
        "columns": columns,
        "rows": rows,
        "bounds": np.asarray(fan.bounds, float).tolist(),
        "radius": float(fan.radius),
        "distance": None if distance == np.inf else distance,
        "views": [dict(zip(keys, camera, strict=True)) for camera in cameras],
        "layers": [
            {
                "file": shape.file,
                "mode": shape.mode,
                "width": shape.width,
                "height": shape.height,
                "sha256": hashlib.sha256(image).hexdigest(),
            }
            for shape, image in zip(shapes, images, strict=True)
        ],
        "source": fan.source,
        "settings": fan.settings,
    }


def _tool_version() -> str:
    try:
        return version("impostor")
    except PackageNotFoundError:  # used from its sources, not installed
        return "(not installed)"


def _layers(fan: Fan) -> list[NDArray[Any]]:
    return [fan.color, *fan.normal, fan.depth, fan.silhouette]
