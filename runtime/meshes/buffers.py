"""Meshes on the GPU: vertices, textures and bumps, ready for the mesh pass and for the meshes' own shadows."""

from __future__ import annotations

from functools import cached_property

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.model import Material, Model, Primitive
from runtime.gl.programs import set_uniforms
from runtime.gl.state import set_state
from runtime.gl.uploads import SRGB8_ALPHA8, InstanceBuffer, check_texture_size
from runtime.meshes.bump import Bump, BumpTexture, with_tangents
from runtime.meshes.flat import ModelPlane, model_plane

ALPHA_MODES = {"OPAQUE": 0, "MASK": 1, "BLEND": 2}
BASE_UNIT, LIGHTS_UNIT, BUMP_UNIT, ROOMS_UNIT = range(4)  # of textures
VERTEX_DTYPE = np.dtype([("position", "f4", (3,)), ("normal", "f4", (3,)), ("uv", "f4", (2,)), ("tint", "u1", (4,))])
BUMPED_DTYPE = np.dtype([*VERTEX_DTYPE.descr, ("tangent", "f4", (4,)), ("bump_uv", "f4", (2,))])
VERTEX_FORMATS = {"position": ("3f", "12x"), "normal": ("3f", "12x"), "uv": ("2f", "8x"), "tint": ("4f1", "4x")}
BUMPED_FORMATS = {**VERTEX_FORMATS, "tangent": ("4f", "16x"), "bump_uv": ("2f", "8x")}
COPY_DTYPE = np.dtype([("row_0", "f4", (4,)), ("row_1", "f4", (4,)), ("row_2", "f4", (4,)), ("part", "f4", (2,))])
COPY_FORMATS = {"row_0": ("4f", "16x"), "row_1": ("4f", "16x"), "row_2": ("4f", "16x"), "part": ("2f", "8x")}


class MeshPart:
    """One primitive on the GPU: its buffers, its texture and its bumps, which are the model's or else its normal map.

    Its positions are those of the primitive less `origin`.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        primitive: Primitive,
        origin: NDArray[np.float64],
        white: moderngl.Texture,
        bumps: BumpTexture | None = None,
    ):
        self.material: Material = primitive.material
        self.bumps, self._own_bumps = bumps, None
        if bumps is None and self.material.normal_map is not None and primitive.tangents is not None:
            self.bumps = self._own_bumps = BumpTexture(ctx, self.material.normal_map)
        vertices = np.zeros(len(primitive.positions), VERTEX_DTYPE if self.bumps is None else BUMPED_DTYPE)
        if self.bumps is not None:
            vertices["tangent"], vertices["bump_uv"] = primitive.tangents, primitive.normal_uvs
        vertices["position"], vertices["normal"] = primitive.positions - origin, primitive.normals
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
            self.texture.repeat_x, self.texture.repeat_y = (not clamp for clamp in self.material.clamp)
            self.texture.build_mipmaps()
            self.texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)

    def release(self) -> None:
        """Free the buffers and the textures."""
        for resource in (self.vertices, self.indices, self._own, self._own_bumps):
            if resource is not None:
                resource.release()


class MeshBuffers:
    """A model on the GPU, ready for the mesh pass and the mesh's own shadow.

    Parameters
    ----------
    ctx : moderngl.Context
    model : Model
    bump : Bump, optional

    Attributes
    ----------
    origin : ndarray, (3,) float64
        What the buffers' positions are relative to, in model space: a model that its file has put far away keeps its
        shape in 32 bits about its own middle only.

    Raises
    ------
    SettingsError
        Bumps on a model without texture coordinates.
    """

    memory_kind = "meshes"

    def __init__(self, ctx: moderngl.Context, model: Model, bump: Bump | None = None):
        self.model, self.bump = model, bump
        parts = [part if bump is None else with_tangents(model.name, part) for part in model.primitives]
        far = any(part.positions.dtype == np.float64 for part in parts)
        self.origin = model.bounds.mean(axis=0) if far else np.zeros(3)
        self._bumps = None if bump is None else BumpTexture(ctx, bump)
        self._white = ctx.texture((1, 1), 4, b"\xff\xff\xff\xff")
        self.parts = [MeshPart(ctx, part, self.origin, self._white, self._bumps) for part in parts]
        self._arrays: dict[tuple[int, int | None], list[moderngl.VertexArray]] = {}
        self.triangle_count = model.triangle_count

    @cached_property
    def plane(self) -> ModelPlane:
        """The plane that the model lies in if it is flat."""
        return model_plane(self.model)

    @property
    def bumped(self) -> bool:
        """Whether any part has bumps or a normal map."""
        return any(part.bumps is not None for part in self.parts)

    def vertex_arrays(
        self, ctx: moderngl.Context, program: moderngl.Program, copies: InstanceBuffer | None = None
    ) -> list[moderngl.VertexArray]:
        """One vertex array a part for a program; attributes that it lacks are passed over.

        `copies` holds a COPY_DTYPE record for each instance, for a program that takes them.
        """
        key = program.glo, copies and copies.buffer.glo
        if key not in self._arrays:
            records = [] if copies is None else [(copies.buffer, *_layout(program, COPY_FORMATS, "/i"))]
            self._arrays[key] = []
            for part in self.parts:
                vertices = _layout(program, VERTEX_FORMATS if part.bumps is None else BUMPED_FORMATS)
                array = ctx.vertex_array(program, [(part.vertices, *vertices), *records], part.indices)
                self._arrays[key].append(array)
        return self._arrays[key]

    def release(self) -> None:
        """Free everything on the GPU."""
        for arrays in self._arrays.values():
            for array in arrays:
                array.release()
        for part in self.parts:
            part.release()
        self._white.release()
        if self._bumps is not None:
            self._bumps.release()


def _set_bumps(program: moderngl.Program, bumps: BumpTexture | None) -> None:
    set_uniforms(program, bump_picture=BUMP_UNIT, bumps=bumps is not None)
    if bumps is not None:
        bumps.texture.use(BUMP_UNIT)
        set_uniforms(program, bump_weights=bumps.weights)


def draw_parts(
    ctx: moderngl.Context,
    buffers: MeshBuffers,
    program: moderngl.Program,
    *,
    depth: bool = True,
    copies: InstanceBuffer | None = None,
    count: int = 1,
    merge_bits: bool = False,
) -> None:
    """Draw every part of a mesh, or of `count` copies, with a program that includes `surface.glsl`."""
    for part, array in zip(buffers.parts, buffers.vertex_arrays(ctx, program, copies), strict=True):
        cull_back = depth and not part.material.double_sided
        set_state(depth_test=depth, depth_write=depth, cull_back=cull_back, merge_bits=merge_bits)
        part.texture.use(BASE_UNIT)
        surface = {
            "base_texture": BASE_UNIT,
            "base_color": part.material.base_color,
            "alpha_mode": ALPHA_MODES[part.material.alpha_mode],
            "alpha_threshold": part.material.alpha_cutoff,
        }
        set_uniforms(program, **{name: value for name, value in surface.items() if name in program})
        if "bumps" in program:
            _set_bumps(program, part.bumps)
        array.render(moderngl.TRIANGLES, instances=count)


def _layout(program: moderngl.Program, formats: dict[str, tuple[str, str]], step: str = "") -> list[str]:
    """A buffer's format string and the names of its attributes; those a program lacks are padding."""
    names = [name for name in formats if name in program]
    return [" ".join(used if name in names else unused for name, (used, unused) in formats.items()) + step, *names]
