"""The overdraw view: how many quads of impostors lie over each pixel."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from runtime.gl.programs import load_program, set_uniforms
from runtime.gl.state import CallerState, set_state
from runtime.gl.uploads import CORNERS, InstanceBuffer
from runtime.instances.instances import Instances
from runtime.instances.quads import quads_toward
from runtime.viewing.viewer import Viewer

QUAD_DTYPE = np.dtype([("center", "f4", (3,)), ("right", "f4", (3,)), ("up", "f4", (3,)), ("rectangle", "f4", (4,))])


class OverdrawPass:
    """Adds up the covered rectangles of instances in the caller's framebuffer.

    One layer is dark red, 8 are full red, 24 yellow, 72 white.

    Parameters
    ----------
    ctx : moderngl.Context
    """

    def __init__(self, ctx: moderngl.Context):
        self._program = load_program(ctx, "overdraw.vert", "overdraw.frag")
        self._corners, self._quads = ctx.buffer(CORNERS), InstanceBuffer(ctx, QUAD_DTYPE)
        instances = (self._quads.buffer, "3f 3f 3f 4f/i", *(QUAD_DTYPE.names or ()))
        self._array = ctx.vertex_array(self._program, [(self._corners, "2f", "corner"), instances])

    def draw(self, state: CallerState, fans: Sequence[Instances], viewer: Viewer) -> None:
        """Add every quad that the viewer sees to what is there, hidden or not."""
        records = [_records(instances, viewer) for instances in fans]
        quads = np.concatenate(records) if records else np.zeros(0, QUAD_DTYPE)
        if not len(quads):
            return
        self._quads.write(quads)
        state.bind_target()
        set_state(blend=(moderngl.ONE, moderngl.ONE))
        set_uniforms(self._program, clip_from_world=viewer.clip_from_world)
        self._array.render(moderngl.TRIANGLE_STRIP, instances=len(quads))

    def release(self) -> None:
        """Free everything this pass made."""
        for resource in (self._array, self._corners, self._quads, self._program):
            resource.release()


def _records(instances: Instances, viewer: Viewer) -> NDArray[np.void]:
    fan, quads = instances.fan, quads_toward(instances, viewer.eye, viewer)
    records = np.zeros(len(quads), QUAD_DTYPE)
    reach = fan.views.radius[quads.view][:, None]
    records["center"], records["right"], records["up"] = quads.center, quads.right * reach, quads.up * reach
    left, top, right, bottom = fan.covered_rectangles[quads.view].T
    records["rectangle"] = np.stack([left, fan.size - bottom, right, fan.size - top], axis=-1) * (2 / fan.size) - 1
    return records
