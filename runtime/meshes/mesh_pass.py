"""The polygon-mesh pass: meshes beside the fans, and the ground truth a fan is measured against."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from impostor.environment.reflection import Reflection
from runtime.gl.programs import load_program, set_uniforms
from runtime.gl.state import CallerState
from runtime.gl.uploads import InstanceBuffer
from runtime.lights.light_table import LightTable
from runtime.meshes.buffers import COPY_DTYPE, LIGHTS_UNIT, ROOMS_UNIT, draw_parts
from runtime.meshes.copies import MeshCopies, MeshInstance
from runtime.rooms.environments import RoomTable
from runtime.viewing.viewer import Viewer

OUTPUTS = {"lit": 0, "albedo": 1, "normal": 2}
PROGRAMS = (
    "mesh",
    "mesh_fading",
    "mesh_bump",
    "mesh_room",
    "mesh_rooms",
    "mesh_room_mirrored",
    "mesh_rooms_mirrored",
)


class MeshPass:
    """Draws meshes lit per pixel, opaque, depth-tested, in the caller's framebuffer.

    Attributes
    ----------
    statistics : dict of int
        Of the last draw: `meshes` and `triangles` drawn.
    """

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self._programs = {name: load_program(ctx, "mesh.vert", f"{name}.frag") for name in PROGRAMS}
        self._copies = InstanceBuffer(ctx, COPY_DTYPE)
        self.statistics = {"meshes": 0, "triangles": 0}

    def draw(
        self,
        state: CallerState,
        meshes: Sequence[MeshInstance],
        viewer: Viewer,
        lights: LightTable,
        rooms: RoomTable,
        output: str = "lit",
    ) -> None:
        """Draw meshes; `output` is "lit", "albedo" or "normal" (view space, n / 2 + 1/2)."""
        self.draw_copies(state, MeshCopies.gathered(meshes), viewer, lights, rooms, output)

    def draw_copies(
        self,
        state: CallerState,
        copies: Sequence[MeshCopies],
        viewer: Viewer,
        lights: LightTable,
        rooms: RoomTable,
        output: str = "lit",
    ) -> None:
        """Draw copies that the viewer sees, one draw call for each part of what shares a mesh; else as `draw`."""
        self.statistics = {"meshes": 0, "triangles": 0}
        seen = [group.seen_by(viewer) for group in copies if len(group.world_from_model)]
        state.bind_target()
        parts = [part for group in seen for part in _parts(group, rooms if output == "lit" else None)]
        for name, first in dict.fromkeys((name, first) for name, first, _ in parts):
            program = self._programs[name]
            lights.bind(program, LIGHTS_UNIT)
            if "rooms" in program:
                rooms.bind(program, ROOMS_UNIT, first)
            set_uniforms(
                program,
                clip_from_world=viewer.clip_from_world,
                view_from_world=viewer.view_from_world[:3, :3],
                eye=tuple(viewer.eye),
                output_kind=OUTPUTS[output],
            )
            for each, number, group in parts:
                if (each, number) == (name, first):
                    self._draw_group(program, group)

    def _draw_group(self, program: moderngl.Program, group: MeshCopies) -> None:
        count = len(group.world_from_model)
        set_uniforms(program, gloss=(group.gloss.strength, group.gloss.shininess))
        if "plain_fresnel" in program:
            bump = group.buffers.bump
            set_uniforms(program, plain_fresnel=bump is not None and bump.plain_fresnel)
        if "mirrors" in program:
            _set_reflection(program, group.reflection)
        self._copies.write(group.records())
        draw_parts(self._ctx, group.buffers, program, copies=self._copies, count=count)
        self.statistics["meshes"] += count
        self.statistics["triangles"] += count * group.buffers.triangle_count

    def release(self) -> None:
        """Free the programs and the buffer."""
        for resource in (*self._programs.values(), self._copies):
            resource.release()


def _parts(group: MeshCopies, rooms: RoomTable | None) -> list[tuple[str, int, MeshCopies]]:
    """Copies by the cheapest program that draws them and the first room that it reads."""
    if not len(group.world_from_model):
        return []
    bumped = group.buffers.bumped
    if rooms is None or not len(rooms):
        return [("mesh_bump" if bumped else "mesh" if group.parts is None else "mesh_fading", 0, group)]
    suffix = "_mirrored" if bumped or group.reflection is not None else ""
    if len(rooms) == 1:
        return [(f"mesh_room{suffix}", 0, group)]
    alone = rooms.alone_around(*group.spheres)
    split = [(int(number), group.take(np.flatnonzero(alone == number))) for number in np.unique(alone)]
    return [
        (f"mesh_rooms{suffix}" if number < 0 else f"mesh_room{suffix}", max(number, 0), part) for number, part in split
    ]


def _set_reflection(program: moderngl.Program, reflection: Reflection | None) -> None:
    set_uniforms(program, mirrors=reflection is not None, metal=0.0 if reflection is None else reflection.metal)
    if reflection is not None:
        terms = reflection.strength, reflection.least, reflection.exponent, reflection.roughness
        set_uniforms(program, reflection=terms, any_power=int(reflection.exponent not in (4, 5)))
