"""By how much rooms that turn or grow brighter change what they light, so that what changes little can wait."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from impostor.environment.colormap import NORMALS, diffuse_light
from impostor.environment.cube import face_directions
from impostor.environment.reflection import Reflection
from impostor.environment.room import Room

DIRECTIONS = face_directions(8).reshape(-1, 3)


class RoomLight(NamedTuple):
    """What a room shines with, looked up all around."""

    place: Hashable
    """Where a room of some size stands, and how; None for a far one."""
    diffuse: NDArray[np.float32]
    """(N, 3) linear light of normals of the world."""
    mirrored: NDArray[np.float32]
    """(K, N, 3): of each level, no brighter than a picture shows."""

    @classmethod
    def of(cls, room: Room) -> RoomLight:
        """The light of a room."""
        toward, environment = DIRECTIONS @ room.environment_from_world.T, room.environment
        steps = np.linspace(0, 1, len(environment.levels))
        mirrored = np.stack([environment.mirrored(toward, roughness) for roughness in steps])
        diffuse = room.exposure * diffuse_light(environment, toward)
        return cls(_place(room), diffuse, np.minimum(room.exposure * mirrored, 1))


def room_change(before: Sequence[RoomLight], now: Sequence[RoomLight], reflection: Reflection | None = None) -> float:
    """The most that the diffuse light of any normal differs, and how much what is mirrored does, as linear light.

    What is mirrored is taken in the root mean square over normals and directions: somewhere an edge always moves.
    Infinite where the number of rooms is another, or one of some size has moved.
    """
    if [room.place for room in before] != [room.place for room in now]:
        return np.inf
    return max((_change(old, new, reflection) for old, new in zip(before, now, strict=True)), default=0.0)


def _change(before: RoomLight, now: RoomLight, reflection: Reflection | None) -> float:
    diffuse = float(np.abs(now.diffuse - before.diffuse).max())
    if reflection is None:
        return diffuse
    if before.mirrored.shape != now.mirrored.shape:
        return np.inf
    level = round(reflection.roughness * (len(now.mirrored) - 1))
    apart = float(np.sqrt(np.mean(np.square(now.mirrored[level] - before.mirrored[level]))))
    part = float(np.sqrt(np.mean(np.square(reflection.fresnel(NORMALS[:, 2])))))
    return (1 - reflection.metal) * diffuse + part * apart


def _place(room: Room) -> Hashable:
    if room.shape == "far":
        return None
    matrix = np.asarray(room.world_from_room).tobytes()
    return room.shape, matrix, room.captured_at, room.stretched, room.outside
