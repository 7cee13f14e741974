"""What a scene is made of: files, read once, and things placed in a renderer, exchanged without a gap."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from impostor.environment import Environment
from impostor.errors import SceneFileError
from impostor.fan import Fan
from impostor.files.fan_file import read_fan
from impostor.files.ptm_file import read_ptm
from impostor.model import Model, load_model
from impostor.ptm.quantise import Ptm

Placed = TypeVar("Placed")


class Assets:
    """Files of a scene, each read once, and again when it has changed."""

    def __init__(self):
        self._held: dict[Hashable, tuple[object, Any]] = {}
        self._used: set[Hashable] = set()

    def fan(self, path: Path) -> Fan:
        """The fan in a file."""
        return self._get(path, read_fan)

    def model(self, path: Path, up: str) -> Model:
        """The model in a file whose up axis is `up`."""
        return self._get(path, lambda file: load_model(file, up=up), up)

    def ptm(self, path: Path) -> Ptm:
        """The PTM in a file."""
        return self._get(path, read_ptm)

    def environment(self, path: Path) -> Environment:
        """The environment in a file, or in a folder of six faces."""
        from impostor.files.environment_file import read_environment

        return self._get(path, read_environment)

    def picture(self, path: Path) -> NDArray[np.uint8]:
        """The picture in a file, (H, W, 4) uint8, sRGB."""
        return self._get(path, _read_picture)

    def _get(self, path: Path, read: Callable[[Path], Any], variant: str = "") -> Any:
        key = path, variant
        self._used.add(key)
        stamp = _stamp(path)
        if key not in self._held or self._held[key][0] != stamp:
            self._held[key] = stamp, read(path)
        return self._held[key][1]

    def forget_unused(self) -> None:
        """Let go of what nobody asked for since the last time."""
        self._held = {key: held for key, held in self._held.items() if key in self._used}
        self._used.clear()


class Shelf(Generic[Placed]):
    """Things in a renderer, by keys that say what they are made of.

    Parameters
    ----------
    remove : callable
        Takes a thing out of the renderer.

    Attributes
    ----------
    things : dict
        In the order in which they were wanted.
    """

    def __init__(self, remove: Callable[[Placed], None]):
        self._remove = remove
        self.things: dict[Hashable, Placed] = {}
        self._added: dict[Hashable, Placed] = {}

    def add(self, wanted: Mapping[Hashable, Callable[[], Placed]]) -> None:
        """Make what is wanted and not there yet."""
        for key, make in wanted.items():
            if key not in self.things:
                self._added[key] = make()

    def undo(self) -> None:
        """Take away again what was added."""
        for thing in self._added.values():
            self._remove(thing)
        self._added.clear()

    def keep(self, wanted: Mapping[Hashable, object]) -> None:
        """Take away what is no longer wanted: after everything was added, so that what both share stays."""
        found = {**self.things, **self._added}
        for key in found.keys() - wanted.keys():
            self._remove(found[key])
        self.things = {key: found[key] for key in wanted}
        self._added.clear()


def _stamp(path: Path) -> object:
    """Equal while a file is unchanged; None where there is none, which is for its reader to say."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size


def _read_picture(path: Path) -> NDArray[np.uint8]:
    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("RGBA"))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise SceneFileError(path, f"is not a picture that can be read: {error}") from error
