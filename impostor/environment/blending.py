"""Which rooms light a point and which one it mirrors. The GPU path must equal this one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment.room import Room
from impostor.errors import SettingsError

EDGE = 0.1
"""A room fades out beyond its walls over this part of the way from its middle to them."""


def diffuse_weights(rooms: Sequence[Room], points: ArrayLike) -> NDArray[np.float64]:
    """How much of each room's diffuse light reaches points of the world.

    A room of some size claims what is inside whole, and what is further outside than `EDGE` not at all, smoothly
    between. Far rooms share evenly what is left. Without far rooms the claims are scaled to a sum of 1, and a point
    outside all rooms takes the nearest whole.

    Parameters
    ----------
    rooms : sequence of Room
        At least one.
    points : array_like, (..., 3) float
        World space.

    Returns
    -------
    ndarray, (..., R) float64
        They sum to 1.

    Raises
    ------
    SettingsError
        No room.

    References
    ----------
    Bjorke, "Image-Based Lighting", GPU Gems 19, section 19.4: between several diffuse maps, light is interpolated.
    """
    points, far = np.asarray(points, np.float64), _far(rooms)
    claims = np.stack([_claim(room, points) for room in rooms], axis=-1)
    total = claims.sum(axis=-1, keepdims=True)
    if far.any():
        claims /= np.maximum(total, 1)
        return np.where(far, np.maximum(1 - total, 0) / far.sum(), claims)
    nearest = np.eye(len(rooms))[_nearest(rooms, points)]
    return np.where(total > 0, claims / np.where(total > 0, total, 1), nearest)


def mirrored_room(rooms: Sequence[Room], points: ArrayLike) -> NDArray[np.intp]:
    """The room that points of the world mirror.

    The first room of some size that contains the point, else the first far one, else the nearest, whose `outside`
    colour shows.

    Parameters
    ----------
    rooms : sequence of Room
        At least one.
    points : array_like, (..., 3) float
        World space.

    Returns
    -------
    ndarray, (...) intp
        Places in `rooms`.

    Raises
    ------
    SettingsError
        No room.
    """
    points, far = np.asarray(points, np.float64), _far(rooms)
    inside = np.stack([room.contains(points) for room in rooms], axis=-1) & ~far
    otherwise = far.argmax() if far.any() else _nearest(rooms, points)
    return np.where(inside.any(axis=-1), inside.argmax(axis=-1), otherwise)


def _far(rooms: Sequence[Room]) -> NDArray[np.bool_]:
    """Which rooms are far, (R,) bool."""
    if not rooms:
        raise SettingsError("rooms", "none; expected at least one")
    return np.array([room.shape == "far" for room in rooms])


def _claim(room: Room, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """1 inside and at the walls of a room to 0 outside, with a continuous slope; 0 where it is far."""
    if room.shape == "far":
        return np.zeros(points.shape[:-1])
    local = room.in_room(points)
    depth = 1 + EDGE - (np.linalg.norm(local, axis=-1, keepdims=True) if room.shape == "sphere" else np.abs(local))
    share = np.clip(depth / EDGE, 0, 1)
    return np.prod(share**2 * (3 - 2 * share), axis=-1)


def _nearest(rooms: Sequence[Room], points: NDArray[np.float64]) -> NDArray[np.intp]:
    """The room whose walls are fewest metres away, of rooms that are not far."""
    return np.stack([_metres_away(room, points) for room in rooms], axis=-1).argmin(axis=-1)


def _metres_away(room: Room, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """From points outside to the walls, exact unless an ellipsoid; 0 inside."""
    local = room.in_room(points)
    if room.shape == "sphere":
        beyond = local * (1 - 1 / np.maximum(np.linalg.norm(local, axis=-1, keepdims=True), 1))
    else:
        beyond = np.maximum(np.abs(local) - 1, 0)
    return np.linalg.norm(beyond * np.linalg.norm(room.world_from_room[:3, :3], axis=0), axis=-1)  # type: ignore[index]
