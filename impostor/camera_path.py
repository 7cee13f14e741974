"""Flights: where a camera is between the keys of its path."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from impostor.scene import CameraPath, Vector


class Viewpoint(NamedTuple):
    """Where a camera stands and what it looks at; world space, never equal."""

    eye: Vector
    target: Vector


def camera_at(path: CameraPath, time: float) -> Viewpoint:
    """The camera of a flight.

    Parameters
    ----------
    path : CameraPath
    time : float
        Seconds. Before the first key the camera waits there, after the last it stays.

    Returns
    -------
    Viewpoint
        At a key's time exactly that key. Position and speed are steady in between (Catmull-Rom with the keys' own
        times, whose tangents are those of the parabola through three keys).
    """
    last = len(path.times) - 1
    key = int(np.clip(np.searchsorted(path.times, time, side="right") - 1, 0, last))
    if time <= path.times[key] or key == last:
        return _viewpoint(path.eyes[key], path.targets[key])
    eye, target = (_between(path.times, values, key, time) for values in (path.eyes, path.targets))
    if np.linalg.norm(eye - target) < 1e-6:
        target = eye + path.targets[key] - path.eyes[key]
    return _viewpoint(eye, target)


def _between(times: NDArray[np.float64], values: NDArray[np.float64], key: int, time: float) -> NDArray[np.float64]:
    """Cubic Hermite from one key to the next."""
    length = times[key + 1] - times[key]
    t = (time - times[key]) / length
    start, end = (_tangent(times, values, at) * length for at in (key, key + 1))
    rest = 1 - t
    first, second = rest * rest * (1 + 2 * t), t * t * (3 - 2 * t)
    return first * values[key] + second * values[key + 1] + t * rest * (rest * start - t * end)


def _tangent(times: NDArray[np.float64], values: NDArray[np.float64], key: int) -> NDArray[np.float64]:
    """Speed (3,) at a key."""
    low, high = max(key - 1, 0), min(key + 1, len(times) - 1)
    speeds = np.diff(values[low : high + 1], axis=0) / np.diff(times[low : high + 1])[:, None]
    if high - low < 2:
        return speeds[0]
    before, after = times[key] - times[low], times[high] - times[key]
    return (speeds[0] * after + speeds[1] * before) / (before + after)


def _viewpoint(eye: NDArray[np.float64], target: NDArray[np.float64]) -> Viewpoint:
    eye_x, eye_y, eye_z = eye.tolist()
    x, y, z = target.tolist()
    return Viewpoint((eye_x, eye_y, eye_z), (x, y, z))
