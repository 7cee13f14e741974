"""The surface pass: meshes textured by Polynomial Texture Maps, lit live."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment.room import Room
from impostor.errors import SettingsError
from impostor.lighting import DirectionalLight, Gloss
from impostor.model import Model
from impostor.ptm.quantise import Ptm
from impostor.ptm.shading import ambient_gain, flat_terms
from impostor.shadow_projection import Ground
from runtime.checks import check_type, numbers
from runtime.gl.programs import load_program, set_uniforms
from runtime.gl.state import CallerState, set_state
from runtime.meshes.mesh_pass import OUTPUTS
from runtime.rooms.as_lights import RoomLights
from runtime.surfaces.buffers import Light, SurfaceBuffers, bind_lights, lights_at
from runtime.surfaces.relit_pictures import MOST_TERMS, RelitPicture, RelitPictures, bind_terms, packed_terms
from runtime.surfaces.textures import KINDS, PtmTextures
from runtime.viewing.viewer import Viewer


@dataclass(eq=False)
class Surface:
    """A mesh in the world that a PTM is laid on.

    Parameters
    ----------
    ptm : Ptm
        Of light directions. Surfaces may share it.
    model : Model
        With texture coordinates; the PTM takes the place of its materials. Seen from both sides alike.
    tiling : tuple of float
        How often the picture repeats along u and v of the texture coordinates.
    world_from_model : ndarray, (4, 4) float
        Rotation, translation and uniform scale; may be changed at any time.
    gloss : Gloss
        Highlight on the normals that the PTM itself gives.

    Raises
    ------
    SettingsError
        A tiling that is not above 0, a matrix of another shape, numbers that are not finite.
    """

    ptm: Ptm
    model: Model
    tiling: tuple[float, float] = (1.0, 1.0)
    world_from_model: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    gloss: Gloss = field(default_factory=Gloss)

    def __post_init__(self):
        check_type("surface", self.ptm, Ptm, ", as read_ptm and quantise give")
        check_type("surface", self.model, Model, ", as impostor.load_model gives")
        tiling = numbers("surface", "tiling", self.tiling, (2,))
        if not (tiling > 0).all():
            raise SettingsError("surface", f"tiling {tuple(self.tiling)}; expected two numbers above 0")
        self.tiling = float(tiling[0]), float(tiling[1])
        self.world_from_model = np.array(self.matrix())

    def matrix(self) -> NDArray[np.float64]:
        """`world_from_model`, checked.

        Raises
        ------
        SettingsError
        """
        matrix = numbers("surface", "world_from_model", self.world_from_model, (4, 4))
        if not abs(np.linalg.det(matrix)) > 0:
            raise SettingsError("surface", "world_from_model has no inverse; expected a matrix that has one")
        return matrix


def rectangle(width: float, height: float) -> Model:
    """A rectangle around the origin that faces +Z, as wide and as high as a whole picture; metres.

    Raises
    ------
    SettingsError
        A side that is not finite or not above 0.
    """
    sides = numbers("rectangle", "width and height", (width, height), (2,))
    if not (sides > 0).all():
        raise SettingsError("rectangle", f"{width:g} x {height:g} m; expected two numbers above 0")
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * (width / 2, height / 2, 1)
    uvs = np.array([[0, 1], [1, 1], [1, 0], [0, 0]])
    normals = np.tile((0.0, 0.0, 1.0), (4, 1))
    return Model.from_arrays(corners, [[0, 1, 2], [0, 2, 3]], normals, uvs=uvs, name="rectangle")


def lying_on(ground: Ground, middle: ArrayLike = (0.0, 0.0, 0.0)) -> NDArray[np.float64]:
    """`world_from_model`, (4, 4), that lays a `rectangle` on the ground at the point nearest to `middle`.

    On level ground the picture's right is +X, and its top lies toward -Z.
    """
    normal, middle = np.asarray(ground.normal, float), np.asarray(middle, float)
    right = np.cross((0.0, 0.0, -1.0), normal) if abs(normal[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    right = right - right @ normal * normal
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right, np.cross(normal, right), normal], axis=1)
    matrix[:3, 3] = middle - (normal @ middle - ground.offset) * normal
    return matrix


class SurfacePass:
    """Draws surfaces with PTMs, opaque and depth-tested, in the caller's framebuffer.

    A flat surface under directional lights is relit once, into a picture with mip levels, when its lights stand
    still, and then costs one plain fetch a pixel. Every other surface is lit pixel by pixel.

    Parameters
    ----------
    ctx : moderngl.Context
    anisotropy : float, optional
        Of all texture filters, 1 being plain trilinear; the GPU's limit holds. Left out, it is 8, but 1 on Mesa's
        software rasteriser, whose anisotropic filter blurs what is seen straight on and takes 2.5 times as long.

    Attributes
    ----------
    statistics : dict of int
        Of the last draw: `surfaces` drawn, `plain` ones of them with one fetch, `relit` pictures made for them.
    """

    memory_kind = "surfaces"

    def __init__(self, ctx: moderngl.Context, anisotropy: float | None = None):
        if anisotropy is None:
            anisotropy = 1.0 if "llvmpipe" in ctx.info["GL_RENDERER"] else 8.0
        self._ctx, self._anisotropy = ctx, min(max(anisotropy, 1.0), ctx.max_anisotropy)
        self._flat = {kind: load_program(ctx, "ptm_flat.vert", f"ptm_flat_{kind}.frag") for kind in KINDS}
        self._lit = {kind: load_program(ctx, "ptm_lit.vert", f"ptm_lit_{kind}.frag") for kind in KINDS}
        self._glossy = {kind: load_program(ctx, "ptm_lit.vert", f"ptm_glossy_{kind}.frag") for kind in KINDS}
        self._plain = load_program(ctx, "ptm_flat.vert", "ptm_relit.frag")
        self._relit = RelitPictures(ctx)
        self._textures: dict[int, PtmTextures] = {}
        self._buffers: dict[int, SurfaceBuffers] = {}
        self._room_lights = RoomLights()
        self.statistics: dict[str, int] = {}

    def prepare(self, surfaces: Sequence[Surface]) -> None:
        """Upload what surfaces need, and free what none of them does.

        Raises
        ------
        SettingsError
            A model without texture coordinates; a PTM that is not of light directions.
        GpuError
            The GPU cannot hold a texture of that size.
        """
        self._relit.keep({id(surface) for surface in surfaces})
        ptms, models = ({id(getattr(each, name)) for each in surfaces} for name in ("ptm", "model"))
        for held, needed in ((self._textures, ptms), (self._buffers, models)):
            for key in held.keys() - needed:
                held.pop(key).release()
        for surface in surfaces:
            if id(surface.model) not in self._buffers:
                self._buffers[id(surface.model)] = SurfaceBuffers(self._ctx, surface.model)
            if id(surface.ptm) not in self._textures:
                self._textures[id(surface.ptm)] = PtmTextures(self._ctx, surface.ptm, self._anisotropy)

    def draw(
        self,
        state: CallerState,
        surfaces: Sequence[Surface],
        viewer: Viewer,
        lights: Sequence[Light],
        ambient: ArrayLike = 0.0,
        output: str = "lit",
        rooms: Sequence[Room] = (),
    ) -> None:
        """Draw surfaces.

        Parameters
        ----------
        state : CallerState
        surfaces : sequence of Surface
            All that there are: what none of them needs is freed.
        viewer : Viewer
        lights : sequence of DirectionalLight or LocalLight
        ambient : array_like, () or (3,) float
        output : {"lit", "albedo", "normal"}
            Albedo is the picture under white ambient light. Normals are the PTM's, in view space, n / 2 + 1/2.
        rooms : sequence of Room
            They light each surface as a few lights do, the same all over it.

        Raises
        ------
        SettingsError, GpuError
            Another output; else as `prepare`.
        """
        if output not in OUTPUTS:
            raise SettingsError("output", f"{output!r}; expected one of {', '.join(OUTPUTS)}")
        if output != "lit":
            lights, ambient, rooms = (), 1.0, ()
        self.prepare(surfaces)
        self._room_lights.keep(rooms)
        spheres = [_sphere(surface) for surface in surfaces]
        seen = {
            each: [*lights, *self._room_lights.at(rooms, at)]
            for each, (at, reach) in zip(surfaces, spheres, strict=True)
            if viewer.sees(at[None], np.array([reach]))[0]
        }
        shaded = {} if output == "normal" else seen
        flat = {surface: self._terms(surface, lit_by, ambient) for surface, lit_by in shaded.items()}
        pictures = self._pictures(flat) if output == "lit" else {}
        state.bind_target()
        set_state(depth_test=True, depth_write=True)
        for surface, lit_by in seen.items():
            picture, terms = pictures.get(surface), flat.get(surface)
            if picture is not None:
                program = self._bind_plain(surface, picture)
            elif terms is not None:
                program = self._bind_flat(surface, terms)
            else:
                program = self._bind_lit(surface, viewer, lit_by, ambient, output == "normal")
            self._draw_mesh(program, surface, viewer)
        self.statistics = {"surfaces": len(seen), "plain": len(pictures), "relit": self._relit.made}

    def _terms(self, surface: Surface, lights: Sequence[Light], ambient: ArrayLike) -> NDArray[np.float32] | None:
        """The pictures that make up the surface's light, or None where it differs from point to point."""
        frame = self._buffers[id(surface.model)].frame
        directional = [light for light in lights if isinstance(light, DirectionalLight)]
        if frame is None or surface.gloss.strength > 0 or len(lights) >= MOST_TERMS or len(directional) < len(lights):
            return None
        turn = surface.matrix()[:3, :3]
        turned = frame @ (turn / np.cbrt(np.linalg.det(turn))).T
        return packed_terms(*flat_terms(turned, directional, ambient, surface.ptm.curve))

    def _pictures(self, flat: dict[Surface, NDArray[np.float32] | None]) -> dict[Surface, RelitPicture]:
        wanted = {
            id(surface): (self._textures[id(surface.ptm)], terms)
            for surface, terms in flat.items()
            if terms is not None
        }
        found = self._relit.update(wanted)
        return {surface: found[id(surface)] for surface in flat if id(surface) in found}

    def _bind_plain(self, surface: Surface, picture: RelitPicture) -> moderngl.Program:
        picture.texture.repeat_x = picture.texture.repeat_y = self._repeats(surface)
        picture.texture.use(0)
        set_uniforms(self._plain, relit=0)
        return self._plain

    def _bind_flat(self, surface: Surface, terms: NDArray[np.float32]) -> moderngl.Program:
        textures = self._textures[id(surface.ptm)]
        program = self._flat[textures.kind]
        textures.bind(program, repeat=self._repeats(surface))
        bind_terms(program, terms)
        return program

    def _bind_lit(
        self, surface: Surface, viewer: Viewer, lights: Sequence[Light], ambient: ArrayLike, normals: bool
    ) -> moderngl.Program:
        textures, glossy = self._textures[id(surface.ptm)], surface.gloss.strength > 0 or normals
        program = (self._glossy if glossy else self._lit)[textures.kind]
        textures.bind(program, repeat=self._repeats(surface))
        bind_lights(program, lights_at(lights, *_sphere(surface)))
        around = ambient_gain(surface.ptm.curve) * np.broadcast_to(np.asarray(ambient, float), (3,))
        set_uniforms(program, ambient=around)
        if glossy:
            set_uniforms(
                program,
                eye=tuple(viewer.eye),
                gloss=(surface.gloss.strength, surface.gloss.shininess),
                show_normals=normals,
                view_from_world=viewer.view_from_world[:3, :3],
            )
        return program

    def _repeats(self, surface: Surface) -> bool:
        """Whether the texture coordinates leave the picture; where they do not, its edges stay apart."""
        reach = self._buffers[id(surface.model)].uv_bounds * surface.tiling
        return bool(reach.min() < -1e-6 or reach.max() > 1 + 1e-6)

    def _draw_mesh(self, program: moderngl.Program, surface: Surface, viewer: Viewer) -> None:
        matrix = surface.matrix()
        set_uniforms(
            program, clip_from_world=viewer.clip_from_world, world_from_model=matrix, tiling=tuple(surface.tiling)
        )
        self._buffers[id(surface.model)].vertex_array(self._ctx, program).render(moderngl.TRIANGLES)

    def release(self) -> None:
        """Free everything this pass made."""
        self.prepare(())
        for part in (*self._flat.values(), *self._lit.values(), *self._glossy.values(), self._plain, self._relit):
            part.release()


def _sphere(surface: Surface) -> tuple[NDArray[np.float64], float]:
    """Middle (3,) and radius of a sphere around the surface, world space."""
    low, high = surface.model.bounds
    matrix = surface.matrix()
    scale = np.cbrt(abs(np.linalg.det(matrix[:3, :3])))
    return matrix[:3, :3] @ ((low + high) / 2) + matrix[:3, 3], float(np.linalg.norm(high - low) / 2 * scale)
