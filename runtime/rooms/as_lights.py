"""Rooms as directional lights, for surfaces that know only lights."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from impostor.environment.blending import diffuse_weights
from impostor.environment.environment import Environment
from impostor.environment.light_cut import in_world, light_cut
from impostor.environment.room import Room
from impostor.lighting import DirectionalLight

LIGHTS_OF_A_ROOM = 16
LEAST_SHARE = 1 / 255


class RoomLights:
    """What rooms shine with as a few lights; each environment is cut once."""

    def __init__(self):
        self._cuts: dict[Environment, list[DirectionalLight]] = {}

    def at(self, rooms: Sequence[Room], point: ArrayLike) -> list[DirectionalLight]:
        """The lights of all rooms that reach a point (3,) of the world."""
        if not rooms:
            return []
        shares = diffuse_weights(rooms, point).tolist()
        return [
            light
            for room, share in zip(rooms, shares, strict=True)
            if share > LEAST_SHARE
            for light in in_world(self._cut(room.environment), room, share)
        ]

    def keep(self, rooms: Sequence[Room]) -> None:
        """Forget the environments that are in none of these rooms."""
        environments = {room.environment for room in rooms}
        self._cuts = {each: cut for each, cut in self._cuts.items() if each in environments}

    def _cut(self, environment: Environment) -> list[DirectionalLight]:
        if environment not in self._cuts:
            self._cuts[environment] = light_cut(environment, LIGHTS_OF_A_ROOM)
        return self._cuts[environment]
