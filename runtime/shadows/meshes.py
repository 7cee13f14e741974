"""Shadows of polygon meshes on the GPU: all copies of a mesh pressed onto the ground at once."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.lighting import DirectionalLight
from impostor.shadow_projection import Ground
from runtime.gl.programs import load_program, set_uniforms
from runtime.gl.uploads import InstanceBuffer
from runtime.meshes.buffers import COPY_DTYPE, draw_parts
from runtime.meshes.copies import MeshCopies
from runtime.shadows.bounds import box_corners
from runtime.shadows.soft_light import MOST_POINTS, source_points, step_at_metre


def mesh_corners(meshes: MeshCopies) -> NDArray[np.float64]:
    """World-space corners (N, 8, 3) of the copies' bounding boxes, which have no height where the model is flat."""
    corners, matrices = box_corners(*meshes.buffers.model.bounds), meshes.world_from_model
    normal, point, _, flat = meshes.buffers.plane
    if flat:
        corners = corners - ((corners - point) @ normal)[:, None] * normal
    return corners @ matrices[:, :3, :3].swapaxes(1, 2) + matrices[:, None, :3, 3]


class MeshShadowPass:
    """Draws the shadows of meshes into the bound framebuffer, one light at a time.

    Parameters
    ----------
    ctx : moderngl.Context
    """

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self._program = load_program(ctx, "shadow_mesh.vert", "shadow_mesh.frag")
        self._soft_program = load_program(ctx, "shadow_mesh_soft.vert", "shadow_mesh_soft.frag")
        self._copies = InstanceBuffer(ctx, COPY_DTYPE)

    def begin(self, clip_from_world: NDArray[np.float64], light: DirectionalLight, ground: Ground) -> None:
        """Say where the meshes that follow cast to."""
        place = {"clip_from_world": clip_from_world, "ground": tuple(ground.plane)}
        set_uniforms(self._program, **place, toward_light=light.toward)
        set_uniforms(self._soft_program, **place)

    def draw(self, meshes: MeshCopies, chosen: NDArray[np.intp], light: DirectionalLight, ground: Ground) -> None:
        """Draw some copies, one draw call for each part."""
        self._copies.write(meshes.records()[chosen])
        draw_parts(self._ctx, meshes.buffers, self._program, depth=False, copies=self._copies, count=len(chosen))

    def draw_soft(
        self,
        meshes: MeshCopies,
        chosen: NDArray[np.intp],
        light: DirectionalLight,
        ground: Ground,
        counts: NDArray[np.intp],
        pixels: float,
    ) -> None:
        """Draw the bits of some copies, each from its own number of points of the light.

        `pixels` is how many a metre at w = 1 takes.
        """
        records = meshes.records()[chosen]
        for count in np.unique(counts).tolist():
            toward = np.zeros((MOST_POINTS, 3))
            toward[:count] = source_points(light, ground, count)
            step = pixels * step_at_metre(light, ground, count)
            set_uniforms(self._soft_program, count=count, toward_points=toward.ravel(), step_at_metre=step)
            copies = np.repeat(records[counts == count], count)
            self._copies.write(copies)
            draw_parts(
                self._ctx,
                meshes.buffers,
                self._soft_program,
                depth=False,
                copies=self._copies,
                count=len(copies),
                merge_bits=True,
            )

    def release(self) -> None:
        """Free the programs and the buffer."""
        for part in (self._program, self._soft_program, self._copies):
            part.release()
