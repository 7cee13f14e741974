"""What the surface pass reads beside its textures: meshes with tangents, and lights far and near."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from impostor.lighting import DirectionalLight
from impostor.local_light import LocalLight
from impostor.model import Model
from runtime.gpu import check_texture_size, set_uniforms
from runtime.tangents import tangent_mesh

Light = DirectionalLight | LocalLight
VERTEX_DTYPE = np.dtype([("position", "f4", (3,)), ("uv", "f4", (2,)), ("normal", "f4", (3,)), ("tangent", "f4", (4,))])


class SurfaceBuffers:
    """A model with its tangents on the GPU.

    Parameters
    ----------
    ctx : moderngl.Context
    model : Model

    Attributes
    ----------
    frame : ndarray, (3, 3) float64, or None
        Rows tangent, binormal, normal of a model that has but one of each.
    uv_bounds : ndarray, (2, 2) float32
        Least and greatest texture coordinates.
    """

    def __init__(self, ctx: moderngl.Context, model: Model):
        self.model = model
        mesh = tangent_mesh(model)
        vertices = np.zeros(len(mesh.positions), VERTEX_DTYPE)
        vertices["position"], vertices["normal"] = mesh.positions, mesh.normals
        vertices["uv"], vertices["tangent"] = mesh.uvs, mesh.tangents
        self.frame = mesh.frame
        self.uv_bounds = np.stack([mesh.uvs.min(axis=0), mesh.uvs.max(axis=0)])
        self._vertices = ctx.buffer(vertices.tobytes())
        self._indices = ctx.buffer(np.ascontiguousarray(mesh.triangles).tobytes())
        self._arrays: dict[int, moderngl.VertexArray] = {}

    def vertex_array(self, ctx: moderngl.Context, program: moderngl.Program) -> moderngl.VertexArray:
        """The mesh for a program; one for flat surfaces takes no normals and tangents."""
        if program.glo not in self._arrays:
            names = VERTEX_DTYPE.names or ()
            layout, names = ("3f 2f 3f 4f", names) if "tangent" in program else ("3f 2f 28x", names[:2])
            self._arrays[program.glo] = ctx.vertex_array(program, [(self._vertices, layout, *names)], self._indices)
        return self._arrays[program.glo]

    def release(self) -> None:
        """Free everything on the GPU."""
        for array in self._arrays.values():
            array.release()
        for resource in (self._vertices, self._indices):
            resource.release()


class SurfaceLights:
    """Any number of directional and local lights, as the texture that `ptm_lights.glsl` reads."""

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self._held: tuple[Light, ...] = ()
        self._texture = ctx.texture((2, 1), 4, dtype="f4")
        self._texture.filter = (moderngl.NEAREST, moderngl.NEAREST)

    def update(self, lights: Sequence[Light]) -> None:
        """Take over the lights of this frame; nothing is written when they are those of the last one."""
        if tuple(lights) == self._held:
            return
        check_texture_size(self._ctx, f"{len(lights)} lights", 2, len(lights))
        rows = np.zeros((max(len(lights), 1), 2, 4), np.float32)
        for row, light in zip(rows, lights, strict=False):
            row[0] = (*light.toward, 0.0) if isinstance(light, DirectionalLight) else (*light.position, light.radius)
            row[1, :3] = light.color
        if self._texture.height != len(rows):
            self._texture.release()
            self._texture = self._ctx.texture((2, len(rows)), 4, dtype="f4")
            self._texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._texture.write(rows.tobytes())
        self._held = tuple(lights)

    def bind(self, program: moderngl.Program, unit: int) -> None:
        """Give a program that includes `ptm_lights.glsl` the lights."""
        self._texture.use(unit)
        set_uniforms(program, lights=unit, light_count=len(self._held))

    def release(self) -> None:
        """Free the texture."""
        self._texture.release()
