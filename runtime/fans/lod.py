"""Level of detail: which copies of a fan are drawn as their mesh, and the crossfade between the two."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impostor.errors import SettingsError
from impostor.fan import Fan
from impostor.model import Model
from impostor.views import rotation_about_y
from runtime.instances.dither import WHOLE, rest_of
from runtime.instances.instances import Instances
from runtime.instances.placement import Placement
from runtime.meshes.buffers import MeshBuffers
from runtime.meshes.copies import MeshCopies
from runtime.viewing.viewer import Viewer

# How far, in parts of the fan's radius, a mesh may reach beyond the object that was baked, or stay behind it.
LARGEST_MISMATCH = 0.1


@dataclass(frozen=True)
class LevelOfDetail:
    """When a copy is drawn as its mesh, and how long it takes to become it.

    The size of a copy is the longest side of its bounding box on screen, at the copy's distance from the eye: turning
    the camera changes no level.

    Parameters
    ----------
    mesh_above_px : float
        Pixels from which on a copy is a mesh, wherever the camera stands. The tile size that the fan was baked with,
        256 if not told otherwise, is where a fan begins to blur. May be infinite.
    elevation_off_deg : float
        Degrees that the camera's elevation, as seen from the copy, may be away from the nearest one in the fan.
        Farther off, the fan shows the copy from a wrong height, and a mesh is preferred ...
    elevation_above_px : float
        ... from that many pixels on.
    hysteresis : float
        A mesh becomes a fan again where size or elevation have fallen below what made it a mesh by this factor. At
        least 1, which is none.
    fade_seconds : float
        Length of a crossfade.

    Raises
    ------
    SettingsError
        A number out of its range.
    """

    mesh_above_px: float = 256.0
    elevation_off_deg: float = 15.0
    elevation_above_px: float = 64.0
    hysteresis: float = 1.25
    fade_seconds: float = 0.4

    def __post_init__(self):
        ranges = {
            "mesh_above_px": (0.0, math.inf, "at least 0 pixels"),
            "elevation_off_deg": (0.0, 180.0, "0 to 180 degrees"),
            "elevation_above_px": (0.0, math.inf, "at least 0 pixels"),
            "hysteresis": (1.0, 1e9, "a factor of at least 1"),
            "fade_seconds": (0.0, 1e9, "at least 0 seconds"),
        }
        for name, (low, high, expected) in ranges.items():
            value = getattr(self, name)
            if not isinstance(value, int | float | np.number) or not low <= value <= high:
                raise SettingsError("level of detail", f"{name} is {value!r}; expected {expected}")


class FrameClock:
    """Time that passes between frames, as the caller tells it, so that a recorded flight is the same every time."""

    def __init__(self):
        self._told = False
        self._seconds: float | None = math.inf

    def advance(self, seconds: float) -> None:
        """Begin another frame, so many seconds after the last; infinitely many end every crossfade.

        Raises
        ------
        SettingsError
            No number, or a negative one.
        """
        if not isinstance(seconds, int | float | np.number) or not seconds >= 0:
            raise SettingsError("advance", f"{seconds!r} seconds; expected a number that is at least 0")
        self._seconds = float(seconds) + (self._seconds or 0.0 if self._told else 0.0)
        self._told = True

    def take(self) -> float | None:
        """Seconds to catch up with: None within a frame; infinitely many for a caller who never tells the time."""
        seconds = self._seconds
        if self._told:
            self._seconds = None
        return seconds


class ScreenSize:
    """How large copies of a fan are on screen, and from how far beside its views they are seen.

    Parameters
    ----------
    fan : Fan
    """

    def __init__(self, fan: Fan):
        self._size = float(np.ptp(fan.bounds, axis=0).max())
        self._elevations = np.unique(np.arcsin(np.clip(fan.views.basis[:, 2, 1], -1, 1)).round(6))

    def seen(self, viewer: Viewer, placement: Placement) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Size in pixels, and how far the viewer is from the fan's elevations in radians: (N,) each."""
        toward = viewer.eye[:3, None] - viewer.eye[3] * placement.middles
        distance = np.maximum(np.sqrt(np.square(toward).sum(axis=0)), 1e-12)
        # Clip w per metre of depth; of an orthographic camera w is the same everywhere.
        per_metre = np.linalg.norm(viewer.clip_from_world[3, :3])
        w = per_metre * distance if viewer.eye[3] else np.abs(viewer.clip_from_world[3, 3])
        focal = viewer.viewport[3] / 2 * abs(viewer.clip_from_view[1, 1])
        elevation = np.arcsin(np.clip(toward[1] / distance, -1, 1))
        # Half way between two elevations the other one becomes the nearest.
        nearest = np.searchsorted((self._elevations[1:] + self._elevations[:-1]) / 2, elevation)
        off = np.abs(self._elevations[nearest] - elevation)
        return self._size * placement.scales * focal / w, off


class Levels:
    """The level of every copy of a fan, kept from frame to frame.

    Parameters
    ----------
    instances : Instances
    buffers : MeshBuffers
        The mesh that was baked.
    settings : LevelOfDetail

    Attributes
    ----------
    as_mesh : ndarray, (N,) bool
        What each copy is, or fades to.
    fan_share : ndarray, (N,) float32
        The part of each copy's pixels that shows the fan: 0 for a mesh, 1 for a fan. The mesh shows the others.
    """

    def __init__(self, instances: Instances, buffers: MeshBuffers, settings: LevelOfDetail):
        self.instances, self.buffers, self.settings = instances, buffers, settings
        self.as_mesh, self.fan_share = np.zeros(len(instances), bool), np.ones(len(instances), np.float32)
        self._screen_size, self._chosen = ScreenSize(instances.fan), False

    @property
    def key(self) -> bytes:
        """Equal while every copy shows as much of its fan."""
        return self.fan_share.tobytes()

    def update(self, viewer: Viewer, seconds: float | None) -> None:
        """Choose levels for a viewer and carry crossfades on.

        What the viewer does not see changes at once, as does everything that is chosen for the first time.

        Parameters
        ----------
        viewer : Viewer
        seconds : float or None
            Since the last choice, from `FrameClock.take`. None keeps everything as it is.
        """
        if seconds is None and self._chosen:
            return
        placement = self.instances.placement
        self.as_mesh = self._wanted(*self._screen_size.seen(viewer, placement)) & (placement.radii > 0)
        target = np.where(self.as_mesh, np.float32(0), np.float32(1))
        if seconds is None or not self._chosen or seconds >= self.settings.fade_seconds:
            self.fan_share = target
        else:
            step = np.float32(seconds / self.settings.fade_seconds)
            share = self.fan_share + np.clip(target - self.fan_share, -step, step)
            self.fan_share = np.where(viewer.sees(placement.middles.T, placement.radii), share, target)
        self._chosen = True

    def copies(self) -> list[MeshCopies]:
        """What is drawn as meshes: whole ones, and those in a crossfade with what is left to their fan."""
        instances, share = self.instances, self.fan_share
        near = np.flatnonzero(instances.visible & (share < 1) & (instances.shares != 0))
        parts = rest_of(instances.shares[near], instances.shares[near] * share[near])
        whole = (parts == WHOLE).all(axis=1)
        return [
            MeshCopies(self.buffers, instances.gloss, _world_from_model(instances, index), part, instances.reflection)
            for index, part in ((near[whole], None), (near[~whole], parts[~whole]))
            if len(index)
        ]

    def _wanted(self, size: NDArray[np.float64], off: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which copies (N,) are to be meshes; what is one already stays one for longer."""
        settings = self.settings
        slack = np.where(self.as_mesh, settings.hysteresis, 1.0)
        size, off = size * slack, off * slack
        above = off > np.radians(settings.elevation_off_deg)
        return (size >= settings.mesh_above_px) | (above & (size >= settings.elevation_above_px))


def check_same_object(fan: Fan, model: Model) -> None:
    """Refuse a mesh that is not the one the fan shows, or not as large or not turned the same way.

    Raises
    ------
    SettingsError
    """
    apart = float(np.abs(model.bounds - fan.bounds).max())
    if apart > LARGEST_MISMATCH * fan.radius:
        problem = f"model {model.name!r} and the fan's object have bounds that are {apart:.3g} m apart"
        raise SettingsError(fan.name, f"{problem}; expected the model that was baked, with the same up axis and units")


def _world_from_model(instances: Instances, index: NDArray[np.intp]) -> NDArray[np.float64]:
    """Matrices (N, 4, 4) of some copies."""
    matrices = np.zeros((len(index), 4, 4))
    matrices[:, :3, :3] = rotation_about_y(instances.yaws[index]) * instances.scales[index, None, None]
    matrices[:, :3, 3], matrices[:, 3, 3] = instances.positions[index], 1
    return matrices
