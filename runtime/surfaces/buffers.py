"""What the surface pass reads beside its textures: meshes with tangents, and lights far and near."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.lighting import DirectionalLight, LocalLight
from impostor.model import Model
from runtime.gl.programs import set_uniforms
from runtime.meshes.tangents import tangent_mesh

MOST_LIGHTS = 48  # as the shader's array has it
FAINTEST = 1e-4  # linear light; the darkest code but black is three times that
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


def lights_at(lights: Sequence[Light], middle: NDArray[np.float64], radius: float) -> list[Light]:
    """The lights that can be seen to reach into a sphere; the MOST_LIGHTS strongest where there are more.

    Parameters
    ----------
    lights : sequence of DirectionalLight or LocalLight
    middle : ndarray, (3,) float
    radius : float
        Metres.
    """
    strongest = np.array([max(light.color) for light in lights], float)
    for index, light in enumerate(lights):
        if isinstance(light, LocalLight):
            distance = max(float(np.linalg.norm(np.array(light.position) - middle)) - radius, light.radius)
            strongest[index] /= distance**2
    order = np.argsort(-strongest, kind="stable")[:MOST_LIGHTS]
    return [lights[index] for index in order if strongest[index] > FAINTEST]


def bind_lights(program: moderngl.Program, lights: Sequence[Light]) -> None:
    """Give a program that includes `ptm_lights.glsl` its lights, MOST_LIGHTS at most."""
    rows = np.zeros((MOST_LIGHTS, 2, 4), np.float32)
    for row, light in zip(rows, lights, strict=False):
        row[0] = (*light.toward, 0.0) if isinstance(light, DirectionalLight) else (*light.position, light.radius)
        row[1, :3] = light.color
    set_uniforms(program, lights=rows.ravel(), light_count=len(lights))
