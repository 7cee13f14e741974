"""Lights on the GPU, for every pass that shades."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment.reflection import Reflection
from impostor.environment.room import Room
from impostor.errors import SettingsError
from impostor.lighting import DirectionalLight
from runtime.gl.programs import set_uniforms
from runtime.gl.uploads import check_texture_size
from runtime.rooms.changes import RoomLight, room_change

REMEMBERED = 256  # versions


def check_lights(lights: Sequence[DirectionalLight]) -> None:
    """Refuse what is not a sequence of lights.

    Raises
    ------
    SettingsError
    """
    if not isinstance(lights, Sequence) or isinstance(lights, str):
        raise SettingsError("lights", f"a {type(lights).__name__}; expected a list of DirectionalLight")
    for number, light in enumerate(lights):
        if not isinstance(light, DirectionalLight):
            raise SettingsError("lights", f"number {number} is a {type(light).__name__}; expected a DirectionalLight")


class LightTable:
    """Any number of directional lights and an ambient colour, as the texture that `lights.glsl` reads.

    Attributes
    ----------
    count : int
    ambient : tuple of float
    rooms : tuple of Room
        What is around, which is not in the texture.
    version : int
        Grows whenever the lights or the rooms change; what was lit with an older version is stale.
    """

    memory_kind = "colormaps"

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self._held: tuple[object, ...] | None = None
        self._texture = ctx.texture((2, 1), 4, dtype="f4")
        self.count = 0
        self.ambient = (0.0, 0.0, 0.0)
        self.rooms: tuple[Room, ...] = ()
        self.version = 0
        self._past: dict[int, tuple[NDArray[Any], ...]] = {}
        self._past_rooms: dict[int, tuple[RoomLight, ...]] = {}

    def update(self, lights: Sequence[DirectionalLight], ambient: ArrayLike, rooms: Sequence[Room] = ()) -> None:
        """Take over the lights of this frame; nothing is written when they are those of the last one."""
        red, green, blue = np.broadcast_to(np.asarray(ambient, float), (3,)).tolist()
        wanted = (tuple(lights), (red, green, blue), tuple(room.key for room in rooms))
        if wanted == self._held:
            return
        check_texture_size(self._ctx, f"{len(lights)} lights", 2, len(lights))
        rows = np.zeros((max(len(lights), 1), 2, 4), np.float32)
        for row, light in zip(rows, lights, strict=False):
            row[0, :3], row[1, :3] = light.toward, light.color
        if self._texture.height != len(rows):
            self._texture.release()
            self._texture = self._ctx.texture((2, len(rows)), 4, dtype="f4")
        self._texture.write(rows.tobytes())
        self._texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._held, self.count, self.ambient = wanted, len(lights), (red, green, blue)
        self.rooms = tuple(rooms)
        self.version += 1
        self._past[self.version] = rows[: len(lights), 0, :3], rows[: len(lights), 1, :3], np.array(self.ambient)
        self._past_rooms[self.version] = tuple(RoomLight.of(room) for room in rooms)
        for past in (self._past, self._past_rooms):
            past.pop(self.version - REMEMBERED, None)

    def change_since(self, versions: NDArray[np.int64], reflection: Reflection | None = None) -> NDArray[np.float64]:
        """By how much what was lit with some versions (N,) can be off now, as linear light (N,).

        A bound of the diffuse part of lights, and what `room_change` finds of surfaces with that reflection; infinite
        where the number of lights was another or the version is forgotten.
        """
        distinct, of_each = np.unique(versions, return_inverse=True)
        return np.array([self._change(int(version), reflection) for version in distinct])[of_each]

    def _change(self, version: int, reflection: Reflection | None) -> float:
        of_lights = _change(self._past.get(version), self._past[self.version])
        if np.isinf(of_lights):
            return of_lights
        return of_lights + room_change(self._past_rooms[version], self._past_rooms[self.version], reflection)

    def bind(self, program: moderngl.Program, unit: int) -> None:
        """Give a program that includes `lights.glsl` its uniforms."""
        self._texture.use(unit)
        set_uniforms(program, lights=unit, light_count=self.count)
        if "ambient" in program:  # a program of highlights has none
            set_uniforms(program, ambient=self.ambient)

    def release(self) -> None:
        """Free the texture."""
        self._texture.release()


def _change(before: tuple[NDArray[Any], ...] | None, now: tuple[NDArray[Any], ...]) -> float:
    """The most that the diffuse light of any normal differs between two versions."""
    if before is None or len(before[0]) != len(now[0]):
        return np.inf
    turned = np.linalg.norm(now[0] - before[0], axis=1) @ now[1]
    brighter = np.abs(now[1] - before[1]).sum(axis=0) + np.abs(now[2] - before[2])
    return float(np.max(turned + brighter))
