"""The room pass: rooms as the background of a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment.room import Room
from impostor.errors import SettingsError
from runtime.checks import invertible
from runtime.gl.programs import load_program, set_uniforms
from runtime.gl.state import CallerState, set_state
from runtime.rooms.environments import RoomTable
from runtime.viewing.viewer import Viewer

SHOWN_ON = ("box", "sphere", "cylinder", "plane")
"""What a room can be shown on, all within the cube from -1 to 1: the cylinder stands upright between floor and ceiling,
the plane is the cube's wall toward -z."""
ROUNDNESS = {"sphere": (1, 1, 1), "cylinder": (1, 0, 1)}
"""1 along the axes in which they are round."""
_SIDES = np.array([[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]], np.float32)
PLANE = np.insert(_SIDES, 2, -1, axis=1)
PICTURE = np.insert(_SIDES, 2, 0, axis=1)


class RoomPass:
    """Draws rooms in the caller's framebuffer, seen from inside.

    Parameters
    ----------
    ctx : moderngl.Context
    """

    memory_kind = "rooms"

    def __init__(self, ctx: moderngl.Context):
        corners = {"cube": _cube(), "plane": PLANE, "picture": PICTURE}
        self._buffers = {name: ctx.buffer(np.ascontiguousarray(each, np.float32)) for name, each in corners.items()}
        self._programs: list[moderngl.Program] = []
        self._far = self._array(ctx, "picture", "room_far.vert", "room_far.frag")
        flat = "room.vert", "room_flat.frag"
        round_ = self._array(ctx, "cube", "room.vert", "room_round.frag")
        self._arrays = {
            "box": self._array(ctx, "cube", *flat),
            "plane": self._array(ctx, "plane", *flat),
            "sphere": round_,
            "cylinder": round_,
        }

    def _array(self, ctx: moderngl.Context, buffer: str, *shaders: str) -> moderngl.VertexArray:
        self._programs.append(load_program(ctx, *shaders))
        return ctx.vertex_array(self._programs[-1], [(self._buffers[buffer], "3f", "corner")])

    def draw(self, state: CallerState, rooms: Mapping[int, Room], table: RoomTable, viewer: Viewer) -> None:
        """Draw rooms by their numbers in a table: the first far one behind everything, others as what they are."""
        far = [number for number, room in rooms.items() if room.shape == "far"]
        for number in far[:1]:
            self._draw_far(state, number, table, viewer)
        for number, room in rooms.items():
            if room.shape != "far":
                assert room.world_from_room is not None
                self.draw_on(state, number, table, viewer, room.shape, room.world_from_room)

    def draw_on(
        self,
        state: CallerState,
        number: int,
        table: RoomTable,
        viewer: Viewer,
        shape: str,
        world_from_shape: NDArray[np.float64],
    ) -> None:
        """Draw a table's room of some number on a shape that stands somewhere; depth is tested and written."""
        state.bind_target()
        set_state(depth_test=True, depth_write=True, cull_back=shape != "plane", background=True)
        array = self._arrays[shape]
        table.bind(array.program, 0, first=number)
        set_uniforms(
            array.program,
            clip_from_world=viewer.clip_from_world,
            world_from_shape=world_from_shape,
            eye=tuple(viewer.eye),
        )
        if shape in ROUNDNESS:
            inverse = np.linalg.inv(world_from_shape)
            set_uniforms(array.program, shape_from_world=inverse, roundness=ROUNDNESS[shape])
        array.render(moderngl.TRIANGLES)

    def _draw_far(self, state: CallerState, number: int, table: RoomTable, viewer: Viewer) -> None:
        state.bind_target()
        set_state(depth_test=True, background=True)
        program = self._far.program
        table.bind(program, 0, first=number)
        set_uniforms(program, world_from_clip=np.linalg.inv(viewer.clip_from_world), eye=tuple(viewer.eye))
        self._far.render(moderngl.TRIANGLES)

    def release(self) -> None:
        """Free everything this pass made."""
        arrays = {array.glo: array for array in (*self._arrays.values(), self._far)}.values()
        for resource in (*arrays, *self._programs, *self._buffers.values()):
            resource.release()


def number_of(rooms: Sequence[Room], room: Room) -> int:
    """A room's place among others.

    Raises
    ------
    SettingsError
        A room that is none of them.
    """
    number = next((number for number, each in enumerate(rooms) if each is room), None)
    if number is None:
        raise SettingsError("room", "is not among the renderer's rooms; expected one of them")
    return number


def to_show(
    rooms: Sequence[Room], room: Room, shape: str, world_from_shape: ArrayLike | None
) -> tuple[int, NDArray[np.float64]]:
    """A room's place among others, and where what it is to be shown on stands, (4, 4) float64.

    Raises
    ------
    SettingsError
        A room that is none of them, another shape than those of SHOWN_ON, a matrix without an inverse.
    """
    number = number_of(rooms, room)
    if shape not in SHOWN_ON:
        raise SettingsError("room", f"shown on {shape!r}; expected one of {', '.join(SHOWN_ON)}")
    given = room.world_from_room if world_from_shape is None else world_from_shape
    return number, invertible("room", "world_from_shape", given)


def _cube() -> NDArray[np.float32]:
    """Corners (36, 3) of the triangles of the cube from -1 to 1, counter-clockwise as seen from inside."""
    two = [np.insert(_SIDES[::side], 2, -side, axis=1) for side in (1, -1)]
    return np.concatenate([np.roll(wall, axis, axis=1) for axis in range(3) for wall in two])
