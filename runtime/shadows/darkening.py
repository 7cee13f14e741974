"""Darkening: the light that marks keep from a receiver, taken from what the caller has drawn of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import moderngl
import numpy as np

from runtime.gl.programs import load_program, set_uniforms
from runtime.gl.state import CallerState, set_state
from runtime.gl.uploads import CORNERS, InstanceBuffer
from runtime.ground.ground_pass import GroundSurface, metres_from_screen
from runtime.meshes.buffers import COPY_DTYPE
from runtime.shadows.bounds import CELL
from runtime.shadows.marks import CELL_DTYPE, CHANNELS, Mark, Marks
from runtime.shadows.receiver import Receiver
from runtime.viewing.viewer import Viewer

MOST_LIGHTS = 32  # that are marked together, as the shader's array has it
ZERO, SOURCE_COLOR = 0x0000, 0x0300
# What rounding may have put the ground nearer by, where it is drawn as one rectangle of kilometres.
NEARER = -1.0, -4.0
EVERYWHERE = {"metres_from_screen": np.diag([0.0, 0.0, 1.0]), "fade": (1.0, 2.0)}
"""Uniforms of `shadow_fade.glsl` where nothing fades: every place is the middle."""


class DarkeningPass:
    """Multiplies the picture of a receiver by the light that is left.

    Parameters
    ----------
    ctx : moderngl.Context
    """

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self._corners, self._cells = ctx.buffer(CORNERS), InstanceBuffer(ctx, CELL_DTYPE)
        self._copies = InstanceBuffer(ctx, COPY_DTYPE)
        cells = [(self._corners, "2f", "corner"), (self._cells.buffer, "2f/i", "cell")]
        names = ("shadow_darken.frag", "shadow_darken_fading.frag", "shadow_darken_many.frag")
        self._programs = [load_program(ctx, "shadow_darken.vert", name) for name in names]
        self._few_lights, self._fading, self._many_lights = (ctx.vertex_array(each, cells) for each in self._programs)
        self._on_meshes = [load_program(ctx, "shadow_darken_mesh.vert", names[index]) for index in (0, 2)]

    def draw(
        self,
        state: CallerState,
        marks: Marks,
        sources: Sequence[Mark],
        receiver: Receiver,
        viewer: Viewer,
        surface: GroundSurface | None = None,
    ) -> None:
        """Darken the caller's framebuffer; depth is tested against what is drawn, and not written.

        Parameters
        ----------
        state : CallerState
        marks : Marks
        sources : sequence of Mark
            Whose light it is.
        receiver : Receiver
        viewer : Viewer
        surface : GroundSurface, optional
            Shadows on the ground fade where it does.
        """
        plane = receiver.ground.plane @ np.linalg.inv(viewer.clip_from_world)
        if marks.texture is None or not len(marks.cells) or abs(plane[2]) < 1e-12 * np.abs(plane).max():
            return
        state.bind_target()
        set_state(depth_test=True, blend=(ZERO, SOURCE_COLOR), polygon_offset=NEARER)
        marks.texture.use(0)
        if receiver.mesh is not None:
            self._darken_mesh(receiver, sources, viewer)
            return
        array = self._few_lights if surface is None else self._fading
        if len(sources) > CHANNELS:
            array = self._many_lights
        if array is not self._few_lights:
            set_uniforms(array.program, **_fading(viewer, receiver, surface))
        width, height = viewer.size
        set_uniforms(
            array.program,
            # Depth of the ground is linear in x and y on the screen.
            ground_depth=tuple(-plane[[0, 1, 3]] / plane[2]),
            cell_size=(2 * CELL / width, 2 * CELL / height),
            **_lights(sources, viewer),
        )
        self._cells.write(marks.cells)
        array.render(moderngl.TRIANGLE_STRIP, instances=len(marks.cells))

    def _darken_mesh(self, receiver: Receiver, sources: Sequence[Mark], viewer: Viewer) -> None:
        assert receiver.mesh is not None
        program = self._on_meshes[len(sources) > CHANNELS]
        set_uniforms(program, clip_from_world=viewer.clip_from_world, **_lights(sources, viewer))
        if len(sources) > CHANNELS:
            set_uniforms(program, fade=EVERYWHERE["fade"])
        self._copies.write(receiver.mesh.records())
        for array in receiver.mesh.buffers.vertex_arrays(self._ctx, program, self._copies):
            array.render(moderngl.TRIANGLES, instances=1)

    def release(self) -> None:
        """Free everything this pass made."""
        arrays = self._few_lights, self._fading, self._many_lights
        for part in (*arrays, *self._programs, *self._on_meshes, self._corners, self._cells, self._copies):
            part.release()


def _lights(sources: Sequence[Mark], viewer: Viewer) -> dict[str, Any]:
    """Uniforms of what was marked: where in the texture, and whose part of the light."""
    many, shares = len(sources) > CHANNELS, np.array([mark.share for mark in sources])
    room = (MOST_LIGHTS if many else CHANNELS) - len(shares)
    pictures = {"pictures": -(-len(sources) // CHANNELS), "rows": viewer.size[1] + 1} if many else {}
    return {
        "marks": 0,
        "mark_origin": viewer.viewport[:2],
        "share": np.concatenate([shares, np.zeros((room, 3))]),
        **pictures,
    }


def _fading(viewer: Viewer, receiver: Receiver, surface: GroundSurface | None) -> dict[str, Any]:
    if surface is None:
        return EVERYWHERE
    return {"metres_from_screen": metres_from_screen(viewer, receiver.ground, surface), "fade": surface.fade}
