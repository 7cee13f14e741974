"""Where the fan of a model lies that is baked on demand: one file for each model, as it is now, and bake settings."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from functools import lru_cache
from os import PathLike
from pathlib import Path
from urllib.parse import unquote

from impostor.scene import BakeSettings

CACHE_FOLDER = "baked_fans"
CACHE_VERSION = "1"
LARGEST_TEXT = 1 << 28
_URI = re.compile(rb'"uri"\s*:\s*"((?:[^"\\]|\\.){1,1000})"')
_REFERENCES = {
    ".gltf": _URI,
    ".obj": re.compile(rb"^[ \t]*mtllib[ \t]+([^\r\n]{1,1000})", re.MULTILINE),
    ".mtl": re.compile(rb"^[ \t]*(?:map_\w+|bump|disp|decal|refl|norm)[ \t]+([^\r\n]{1,1000})", re.MULTILINE),
    ".dae": re.compile(rb"<init_from>(?:\s*<ref>)?\s*([^<]{1,1000}?)\s*<"),
    ".ply": re.compile(rb"^comment TextureFile ([^\r\n]{1,1000})", re.MULTILINE),
}


def baked_fan_path(
    scene_folder: str | PathLike[str], model: str | PathLike[str], settings: BakeSettings | None = None
) -> Path:
    """Where the fan of a model belongs.

    Parameters
    ----------
    scene_folder : path-like
    model : path-like
        A file that exists.
    settings : BakeSettings, optional

    Returns
    -------
    Path
        In `baked_fans` beside the scene; in the user's cache where that folder cannot be written. Another name as
        soon as the settings, the model, or a material or picture that it names, change.

    Raises
    ------
    OSError
        The model cannot be read.
    """
    digest = hashlib.sha256(CACHE_VERSION.encode())
    digest.update(json.dumps(asdict(settings or BakeSettings()), sort_keys=True).encode())
    folder = Path(os.path.realpath(model)).parent
    for path in model_files(model):
        digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + _file_hash(path, _stamp(path)))
    name = f"{Path(model).stem[:60]}-{digest.hexdigest()[:16]}.fan"
    beside = Path(os.path.realpath(scene_folder)) / CACHE_FOLDER
    if (beside / name).is_file() or os.access(beside if beside.is_dir() else beside.parent, os.W_OK | os.X_OK):
        return beside / name
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "impostor" / CACHE_FOLDER / name


def model_files(model: str | PathLike[str]) -> tuple[Path, ...]:
    """A model file, and those files of its folder that it names: buffers, materials, pictures.

    Raises
    ------
    OSError
        One of them cannot be read.
    """
    path = Path(os.path.realpath(model))
    found = {path: None}
    for reference in _references(path, _stamp(path)):
        found[reference] = None
        found |= dict.fromkeys(_references(reference, _stamp(reference)))
    return tuple(found)


def _stamp(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_mtime_ns, status.st_size


@lru_cache(maxsize=1024)
def _file_hash(path: Path, stamp: tuple[int, int]) -> bytes:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").digest()


@lru_cache(maxsize=1024)
def _references(path: Path, stamp: tuple[int, int]) -> tuple[Path, ...]:
    suffix = path.suffix.lower()
    if suffix == ".glb":
        names = _URI.findall(_glb_json(path))
    elif suffix in _REFERENCES:
        with open(path, "rb") as file:
            names = _REFERENCES[suffix].findall(file.read(LARGEST_TEXT))
    else:
        names = []
    return tuple(dict.fromkeys(_beside(path, names)))


def _glb_json(path: Path) -> bytes:
    with open(path, "rb") as file:
        head = file.read(20)
        return file.read(min(int.from_bytes(head[12:16], "little"), LARGEST_TEXT))


def _beside(path: Path, names: Iterable[bytes]) -> Iterator[Path]:
    """Files below a file's folder that its references mean: percent-encoded or not, behind options or not."""
    for name in names:
        text = name.decode("utf-8", "replace").strip().replace("\\", "/")
        for meant in (text, unquote(text), *text.split()[-1:]):
            file = Path(os.path.realpath(path.parent / meant)) if "\0" not in meant else path
            try:
                if file != path and file.is_relative_to(path.parent) and file.is_file():
                    yield file
                    break
            except OSError:  # a name that no file can have, as of a picture inside the file
                continue
