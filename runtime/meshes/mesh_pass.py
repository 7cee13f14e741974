"""The polygon-mesh pass: meshes beside the fans, and the ground truth a fan is measured against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.environment.reflection import Reflection
from impostor.lighting import Gloss
from impostor.model import Material, Model, Primitive
from runtime.checks import LARGEST, bounded, check_type
from runtime.gl.programs import load_program, set_uniforms
from runtime.gl.state import CallerState, set_state
from runtime.gl.uploads import SRGB8_ALPHA8, InstanceBuffer, check_texture_size
from runtime.instances.dither import WHOLE
from runtime.lights.light_table import LightTable
from runtime.meshes.bump import Bump, BumpTexture, with_tangents
from runtime.rooms.environments import RoomTable
from runtime.viewing.viewer import Viewer

ALPHA_MODES = {"OPAQUE": 0, "MASK": 1, "BLEND": 2}
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
LIGHTS_UNIT, BUMP_UNIT, ROOMS_UNIT = 1, 2, 3  # texture units beside the base texture's
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


@dataclass
class MeshInstance:
    """One mesh in the world.

    Parameters
    ----------
    buffers : MeshBuffers
    world_from_model : ndarray, (4, 4) float
        Rotation, translation and uniform scale.
    gloss : Gloss
    reflection : Reflection, optional
        What it mirrors where there are rooms.
    visible : bool
        Whether it is drawn, and casts a shadow.
    """

    buffers: MeshBuffers
    world_from_model: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    gloss: Gloss = field(default_factory=Gloss)
    reflection: Reflection | None = None
    visible: bool = True


def check_meshes(meshes: Sequence[MeshInstance]) -> None:
    """Refuse a `world_from_model` that has become none that can be drawn, and a `reflection` that is none.

    Raises
    ------
    SettingsError
    """
    try:
        matrices = np.array([mesh.world_from_model for mesh in meshes], float)
    except (TypeError, ValueError):
        matrices = np.empty(0)
    if len(meshes) and (matrices.shape != (len(meshes), 4, 4) or not (np.abs(matrices) < LARGEST).all()):
        for mesh in meshes:
            bounded(mesh.buffers.model.name, "world_from_model", mesh.world_from_model, (4, 4))
    for mesh in meshes:
        if mesh.reflection is not None:
            check_type("reflection", mesh.reflection, Reflection)


@dataclass(frozen=True, eq=False)
class MeshCopies:
    """Copies of one mesh that are drawn together.

    Parameters
    ----------
    buffers : MeshBuffers
    gloss : Gloss
    world_from_model : ndarray, (N, 4, 4) float64
        Affine.
    parts : ndarray, (N, 2) float32, optional
        Of the dither, from and to: which pixels of each copy are drawn, in a crossfade.
    reflection : Reflection, optional
    """

    buffers: MeshBuffers
    gloss: Gloss
    world_from_model: NDArray[np.float64]
    parts: NDArray[np.float32] | None = None
    reflection: Reflection | None = None

    @classmethod
    def gathered(cls, meshes: Sequence[MeshInstance]) -> list[MeshCopies]:
        """Meshes that share buffers, gloss and reflection, put together."""
        groups: dict[tuple[int, Gloss, Reflection | None], list[MeshInstance]] = {}
        for mesh in meshes:
            groups.setdefault((id(mesh.buffers), mesh.gloss, mesh.reflection), []).append(mesh)
        return [
            cls(
                group[0].buffers,
                group[0].gloss,
                np.array([mesh.world_from_model for mesh in group], float),
                reflection=group[0].reflection,
            )
            for group in groups.values()
        ]

    def seen_by(self, viewer: Viewer) -> MeshCopies:
        """Those whose bounding sphere touches the view frustum, near to far."""
        centers, radii = self.spheres
        seen = np.flatnonzero(viewer.sees(centers, radii))
        return self.take(seen[np.argsort(-(centers[seen] @ viewer.view_from_world[2, :3]), kind="stable")])

    @property
    def spheres(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Middles (N, 3) and radii (N,) of the copies' bounding spheres, world space."""
        model, turned = self.buffers.model, self.world_from_model[:, :3, :3]
        centers = turned @ model.bounds.mean(axis=0) + self.world_from_model[:, :3, 3]
        # The largest row of its product with itself bounds how a matrix stretches, exactly where axes stay at right
        # angles.
        stretch = np.abs(turned.swapaxes(1, 2) @ turned).sum(axis=2).max(axis=1)
        return centers, model.radius * np.sqrt(stretch)

    def take(self, index: NDArray[np.intp]) -> MeshCopies:
        """Some of them."""
        parts = None if self.parts is None else self.parts[index]
        return MeshCopies(self.buffers, self.gloss, self.world_from_model[index], parts, self.reflection)

    def records(self) -> NDArray[np.void]:
        """As (N,) COPY_DTYPE: they place the buffers' positions."""
        placed = self.world_from_model[:, :3].copy()
        placed[:, :, 3] += placed[:, :, :3] @ self.buffers.origin
        rows = np.zeros((len(placed), COPY_DTYPE.itemsize // 4), np.float32)
        rows[:, :12] = placed.reshape(-1, 12)
        rows[:, 12:14] = WHOLE if self.parts is None else self.parts
        return rows.view(COPY_DTYPE)[:, 0]


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


def _set_bumps(program: moderngl.Program, bumps: BumpTexture | None) -> None:
    set_uniforms(program, bump_picture=BUMP_UNIT, bumps=bumps is not None)
    if bumps is not None:
        bumps.texture.use(BUMP_UNIT)
        set_uniforms(program, bump_weights=bumps.weights)


def _set_reflection(program: moderngl.Program, reflection: Reflection | None) -> None:
    set_uniforms(program, mirrors=reflection is not None, metal=0.0 if reflection is None else reflection.metal)
    if reflection is not None:
        terms = reflection.strength, reflection.least, reflection.exponent, reflection.roughness
        set_uniforms(program, reflection=terms, any_power=int(reflection.exponent not in (4, 5)))


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
        part.texture.use(0)
        surface = {
            "base_texture": 0,
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
