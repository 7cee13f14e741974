"""Hot reload: a scene that follows its files."""

from __future__ import annotations

import os
from collections.abc import Iterable
from os import PathLike
from pathlib import Path

from impostor.errors import SceneFileError
from impostor.files.scene_document import Document
from impostor.files.scene_file import read_scene
from impostor.scene import Scene, changed_parts

Stamp = tuple[int, int, int] | None


class SceneWatcher:
    """Looks, when asked, whether a scene's files have changed.

    Parameters
    ----------
    path : path-like

    Attributes
    ----------
    scene : Scene
        The last one that could be read.
    parts : frozenset of str
        In what that differs from the one before: names of `impostor.scene.PARTS`, also where only the content of a
        file that the part is made of is new.
    changed_files : frozenset of Path
        Which of its files were written, appeared or vanished.
    message : str
        Why the files as they are now cannot be read, on one line; empty where they can.

    Raises
    ------
    SceneFileError
        The scene cannot be read at the beginning.
    """

    def __init__(self, path: str | PathLike[str]):
        self._path = path
        self.parts: frozenset[str] = frozenset()
        self.changed_files: frozenset[Path] = frozenset()
        self.message = ""
        self._written: frozenset[Path] = frozenset()
        document = Document(path)
        self.scene = read_scene(document)
        self._stamps = _stamps(document.sought)

    def poll(self) -> Scene | None:
        """The scene as it is now if anything in it changed since the last call, else None.

        Cheap enough for every picture: the files' times and sizes tell. A file that cannot be read, or is half
        written, leaves the scene as it was and says so in `message`.
        """
        now = _stamps(self._stamps)
        written = frozenset(path for path, stamp in now.items() if stamp != self._stamps[path])
        if not written:
            return None
        self._stamps = now
        self._written |= written  # what failed reads were about, too
        document = Document(self._path)
        try:
            scene = read_scene(document)
        except SceneFileError as error:
            self.message = str(error)
            return None
        finally:
            self._stamps |= _stamps(document.sought - now.keys())
        needed = [files.get(path, frozenset()) for path in self._written for files in (self.scene.files, scene.files)]
        self.parts = changed_parts(self.scene, scene).union(*needed)
        self.changed_files, self._written = self._written, frozenset()
        self.scene, self.message = scene, ""
        return scene if self.parts else None


def _stamps(paths: Iterable[Path]) -> dict[Path, Stamp]:
    return {path: _stamp(path) for path in paths}


def _stamp(path: Path) -> Stamp:
    """What changes when a file is written; None where there is none."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino
