"""What lights the ground: how much of it comes from each light, from rooms, and from all around."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment.blending import diffuse_weights
from impostor.environment.bright_lights import bright_lights
from impostor.environment.colormap import diffuse_light
from impostor.environment.environment import Environment
from impostor.environment.light_cut import in_world
from impostor.environment.room import Room
from impostor.lighting import DirectionalLight, LocalLight
from impostor.shadow_projection import Ground, casts_shadow

LEAST_SHARE = 0.02
"""Of the ground's light; a shadow that a room casts with less is not seen."""


class Caster(NamedTuple):
    """A light that casts shadows."""

    light: DirectionalLight
    share: NDArray[np.float64]
    """Its part (3,) of the linear light on the ground."""


class GroundLight(NamedTuple):
    """The light on the ground."""

    casters: list[Caster]
    even: NDArray[np.float64]
    """The part (3,) of it that comes from all around: ambient light, and rooms but for their casters."""


class BrightLights:
    """The brightest lights of rooms: found once for each environment, turned and exposed with its room."""

    def __init__(self):
        self._held: dict[tuple[Environment, int], list[DirectionalLight]] = {}

    def of(self, rooms: Sequence[Room], count: int) -> list[list[DirectionalLight]]:
        """The `count` brightest of each room; what other rooms had is forgotten."""
        if not count:
            return [[] for _ in rooms]
        wanted = {(room.environment, count) for room in rooms}
        self._held = {key: self._held[key] if key in self._held else bright_lights(*key) for key in wanted}
        return [in_world(self._held[room.environment, count], room) for room in rooms]


def room_diffuse(room: Room, normal: NDArray[np.floating]) -> NDArray[np.float64]:
    """Diffuse light (3,) of a room on a surface with this normal."""
    toward = room.environment_from_world @ normal
    return room.exposure * diffuse_light(room.environment, toward).astype(np.float64)


def ground_light(
    lights: Sequence[DirectionalLight],
    ambient: ArrayLike,
    rooms: Sequence[Room],
    room_lights: Sequence[Sequence[DirectionalLight]],
    at: NDArray[np.floating],
    ground: Ground,
    lamps: Sequence[LocalLight] = (),
) -> GroundLight:
    """Whose light the ground shows.

    Parameters
    ----------
    lights : sequence of DirectionalLight
    ambient : array_like, (3,) float
    rooms : sequence of Room
        Several are weighted for `at`.
    room_lights : sequence of sequence of DirectionalLight
        The brightest lights of each room, whose light is a part of the room's.
    at : ndarray, (3,) float
        A point of the ground, metres.
    ground : Ground
    lamps : sequence of LocalLight
        They cast nothing here; all of the ground counts as lit by them as it is at `at`.
    """
    own = [(light, _given(light, ground)) for light in lights]
    around, of_rooms = np.array(np.broadcast_to(np.asarray(ambient, float), (3,))), []
    weights = diffuse_weights(rooms, at) if len(rooms) else ()
    for room, bright, weight in zip(rooms, room_lights, weights, strict=True):
        diffuse = weight * room_diffuse(room, ground.normal)
        around += diffuse
        # Together they are never more than the room.
        parts = [weight * _given(light, ground) for light in bright]
        most = np.minimum(1, diffuse / np.maximum(_sum(parts), 1e-9))
        of_rooms += [(light, part * most) for light, part in zip(bright, parts, strict=True)]
    others = [part for _, part in own] + [_of_lamp(lamp, at, ground) for lamp in lamps]
    total = np.maximum(around + _sum(others), 1e-9)
    of_rooms = [(light, part) for light, part in of_rooms if np.max(part / total) > LEAST_SHARE]
    casters = [
        Caster(light, part / total)
        for light, part in (*own, *of_rooms)
        if casts_shadow(light.toward, ground) and part.any()
    ]
    return GroundLight(casters, np.maximum(around - _sum([part for _, part in of_rooms]), 0) / total)


def _given(light: DirectionalLight, ground: Ground) -> NDArray[np.float64]:
    """What a light gives the ground, (3,)."""
    return max(float(ground.normal @ light.toward), 0.0) * np.array(light.color)


def _of_lamp(lamp: LocalLight, at: NDArray[np.floating], ground: Ground) -> NDArray[np.float64]:
    """What a lamp gives the ground at a point, (3,)."""
    apart = np.array(lamp.position) - at
    distance = max(float(np.linalg.norm(apart)), 1e-9)
    return max(float(ground.normal @ apart), 0.0) / distance / max(distance, lamp.radius) ** 2 * np.array(lamp.color)


def _sum(parts: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    return np.sum([np.zeros(3), *parts], axis=0)
