"""A scene's files while a walk goes on: what has changed in them, once every fan that they ask for is there."""

from __future__ import annotations

from typing import NamedTuple

from impostor.files.scene_watcher import SceneWatcher
from impostor.scene import Scene
from runtime.stage.baking import Bakery, unbaked


class Change(NamedTuple):
    """A scene whose fans are all there, and the names of the `impostor.scene.PARTS` in which it differs."""

    scene: Scene
    parts: frozenset[str]


class SceneChanges:
    """Watches a scene, and bakes what it is missing while the walk goes on.

    Parameters
    ----------
    watcher : SceneWatcher
    quiet : bool
        Say only what goes wrong.

    Attributes
    ----------
    message : str
        Why the scene as its files have it cannot be shown; empty where it can.
    """

    def __init__(self, watcher: SceneWatcher, quiet: bool = False):
        self._watcher, self._quiet = watcher, quiet
        self._waiting: Change | None = None
        self._bakery: Bakery | None = None
        self.message = ""

    @property
    def baking(self) -> str:
        """What is being baked; empty where nothing is."""
        current = None if self._bakery is None else self._bakery.current
        return "" if current is None else str(current.model)

    def poll(self) -> Change | None:
        """What has changed since the last call and can be shown now."""
        scene = self._watcher.poll()
        self.message = self._watcher.message or self.message
        if scene is not None:
            parts = self._watcher.parts | (self._waiting.parts if self._waiting else frozenset())
            self.stop()
            self.message, self._waiting = "", Change(scene, parts)
            self._bakery = Bakery(unbaked(scene), self._quiet)
        if self._waiting is None or self._bakery is None or not self._bakery.poll():
            return None
        change, failed = self._waiting, self._bakery.failed
        self._waiting, self._bakery = None, None
        if failed:
            self.message = "a fan could not be baked; the scene stays as it was"
            return None
        return change

    def stop(self) -> None:
        """Stop what is being baked."""
        if self._bakery is not None:
            self._bakery.stop()
        self._waiting, self._bakery = None, None
