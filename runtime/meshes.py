"""The polygon-mesh pass: meshes beside the fans, and the ground truth a fan is measured against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.lighting import Gloss
from impostor.model import Material, Model, Primitive
from runtime.gl_state import CallerState, set_state
from runtime.gpu import SRGB8_ALPHA8, check_texture_size, load_program, set_uniforms
from runtime.instances import Viewer
from runtime.lights import LightTable

ALPHA_MODES = {"OPAQUE": 0, "MASK": 1, "BLEND": 2}
OUTPUTS = {"lit": 0, "albedo": 1, "normal": 2}
VERTEX_DTYPE = np.dtype([("position", "f4", (3,)), ("normal", "f4", (3,)), ("uv", "f4", (2,)), ("tint", "u1", (4,))])


class MeshPart:
    """One primitive on the GPU: its buffers and its texture."""

    def __init__(self, ctx: moderngl.Context, primitive: Primitive, white: moderngl.Texture):
        self.material: Material = primitive.material
        vertices = np.zeros(len(primitive.positions), VERTEX_DTYPE)
        vertices["position"], vertices["normal"] = primitive.positions, primitive.normals
        vertices["uv"] = 0 if primitive.uvs is None else primitive.uvs
        vertices["tint"] = 255 if primitive.colors is None else primitive.colors
        self.vertices = ctx.buffer(vertices.tobytes())
        self.indices = ctx.buffer(np.ascontiguousarray(primitive.triangles, "u4").tobytes())
        self.texture, self._own = white, None
        if self.material.texture is not None:
            height, width = self.material.texture.shape[:2]
            check_texture_size(ctx, self.material.name, width, height)
            pixels = np.ascontiguousarray(self.material.texture).tobytes()
            self._own = self.texture = ctx.texture((width, height), 4, pixels, internal_format=SRGB8_ALPHA8)
            self.texture.build_mipmaps()
            self.texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)

    def release(self) -> None:
        """Free the buffers and the texture."""
        for resource in (self.vertices, self.indices, self._own):
            if resource is not None:
                resource.release()


class MeshBuffers:
    """A model on the GPU, ready for the mesh pass and the mesh's own shadow.

    Parameters
    ----------
    ctx : moderngl.Context
    model : Model
    """

    def __init__(self, ctx: moderngl.Context, model: Model):
        self.model = model
        self._white = ctx.texture((1, 1), 4, b"\xff\xff\xff\xff")
        self.parts = [MeshPart(ctx, primitive, self._white) for primitive in model.primitives]
        self._arrays: dict[int, list[moderngl.VertexArray]] = {}

    def vertex_arrays(self, ctx: moderngl.Context, program: moderngl.Program) -> list[moderngl.VertexArray]:
        """One vertex array a part for a program; attributes that it lacks are passed over."""
        if program.glo not in self._arrays:
            formats = {"position": "3f", "normal": "3f", "uv": "2f", "tint": "4f1"}
            padding = {"position": "12x", "normal": "12x", "uv": "8x", "tint": "4x"}
            layout = " ".join(formats[name] if name in program else padding[name] for name in formats)
            names = [name for name in formats if name in program]
            self._arrays[program.glo] = [
                ctx.vertex_array(program, [(part.vertices, layout, *names)], part.indices) for part in self.parts
            ]
        return self._arrays[program.glo]

    def release(self) -> None:
        """Free everything on the GPU."""
        for arrays in self._arrays.values():
            for array in arrays:
                array.release()
        for part in self.parts:
            part.release()
        self._white.release()


@dataclass
class MeshInstance:
    """One mesh in the world.

    Parameters
    ----------
    buffers : MeshBuffers
    world_from_model : ndarray, (4, 4) float
        Rotation, translation and uniform scale.
    gloss : Gloss
    """

    buffers: MeshBuffers
    world_from_model: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    gloss: Gloss = field(default_factory=Gloss)


class MeshPass:
    """Draws meshes lit per pixel, opaque, depth-tested, in the caller's framebuffer."""

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self._program = load_program(ctx, "mesh.vert", "mesh.frag")

    def draw(
        self,
        state: CallerState,
        meshes: Sequence[MeshInstance],
        viewer: Viewer,
        lights: LightTable,
        output: str = "lit",
    ) -> None:
        """Draw meshes; `output` is "lit", "albedo" or "normal" (view space, n / 2 + 1/2)."""
        state.bind_target()
        lights.bind(self._program, unit=1)
        set_uniforms(
            self._program,
            clip_from_world=viewer.clip_from_world,
            view_from_world=viewer.view_from_world[:3, :3],
            eye=tuple(viewer.eye),
            output_kind=OUTPUTS[output],
        )
        for mesh in meshes:
            set_uniforms(
                self._program,
                world_from_model=np.asarray(mesh.world_from_model),
                gloss=(mesh.gloss.strength, mesh.gloss.shininess),
            )
            draw_parts(self._ctx, mesh.buffers, self._program)

    def release(self) -> None:
        """Free the program."""
        self._program.release()


def draw_parts(ctx: moderngl.Context, buffers: MeshBuffers, program: moderngl.Program, *, depth: bool = True) -> None:
    """Draw every part of a mesh with a program that includes `surface.glsl`."""
    for part, array in zip(buffers.parts, buffers.vertex_arrays(ctx, program), strict=True):
        set_state(depth_test=depth, depth_write=depth, cull_back=depth and not part.material.double_sided)
        part.texture.use(0)
        surface = {
            "base_texture": 0,
            "base_color": part.material.base_color,
            "alpha_mode": ALPHA_MODES[part.material.alpha_mode],
            "alpha_threshold": part.material.alpha_cutoff,
        }
        set_uniforms(program, **{name: value for name, value in surface.items() if name in program})
        array.render(moderngl.TRIANGLES)
