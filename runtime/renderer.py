"""The game-facing interface: fans and meshes in the caller's own OpenGL context, and the order of the passes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import moderngl
import numpy as np
from numpy.typing import ArrayLike

from impostor.environment.reflection import Reflection
from impostor.environment.room import Room
from impostor.errors import GpuError, SettingsError
from impostor.fan import Fan
from impostor.lighting import Gloss
from impostor.model import Model
from impostor.ptm.quantise import Ptm
from impostor.shadow_projection import Ground
from runtime.animation import AnimatedInstances
from runtime.checks import check_type, check_whole, invertible, with_article
from runtime.fans.impostor_pass import ImpostorPass
from runtime.fans.lod import FrameClock, LevelOfDetail, check_same_object
from runtime.fans.settings import FanSettings
from runtime.fans.tiles import TileCache
from runtime.gl.memory import memory_held
from runtime.gl.state import CallerState, preserved_state
from runtime.ground.ground_pass import GroundPass, GroundSurface
from runtime.instances.instances import Instances
from runtime.lights.light_table import LightTable, check_lights
from runtime.lights.settings import LightSettings
from runtime.meshes.bump import Bump
from runtime.meshes.copies import MeshInstance, check_meshes
from runtime.meshes.mesh_pass import OUTPUTS, MeshPass
from runtime.placed import Placed
from runtime.rooms.environments import RoomTable, check_rooms
from runtime.rooms.room_pass import RoomPass, number_of, to_show
from runtime.shadows.shadow_pass import ShadowPass
from runtime.surfaces.surface_pass import Surface, SurfacePass
from runtime.viewing.viewer import Viewer


class ImpostorRenderer(LightSettings, FanSettings):
    """Draws relightable fans, meshes and their shadows into whatever framebuffer the caller has bound.

    Every `draw...` call takes the caller's two camera matrices, (4, 4) column-vector matrices as read on paper, draws
    into the bound framebuffer and viewport, and puts back all OpenGL state. Colours are written on the sRGB curve.

    Parameters
    ----------
    ctx : moderngl.Context
        The caller's; OpenGL 3.3 or newer.
    cache_side : int
        Side of the cache of relit tiles in texels (6 bytes a texel).

    Attributes
    ----------
    lights : sequence of DirectionalLight
        May be replaced or changed in place at any time; the next draw shows it.
    ambient : ndarray, (3,) float64
        Linear light that reaches every normal; set as one number or three. Read-only: replace it.
    local_lights : sequence of LocalLight
        Lamps in the scene; only surfaces with PTMs show their light.
    rooms : sequence of Room
        Surroundings that light fans and meshes and that they mirror, MAX_ROOMS at most. May be replaced or changed in
        place at any time.
    shadow_lights : int
        How many of the brightest lights of each room cast shadows; 0 for none.
    contact_shadows : ContactShadows or None
        Whether `draw_shadows` also darkens the ground around the feet of what stands on it, and how.
    filtered : bool
        Whether fans are filtered when they are drawn. Without, each texel shows as it was lit, and the dither of the
        stored normals is seen.
    view_fade_seconds : float
        The longest that a copy takes from one view of its fan to the next, its pixels dealt out between the two; 0
        switches at once, as does a renderer that is not told the time. See `advance`.

    Examples
    --------
    >>> renderer = ImpostorRenderer(ctx)                                      # doctest: +SKIP
    >>> trees = renderer.add(fan, positions, yaws, scales)                    # doctest: +SKIP
    >>> renderer.draw_shadows(clip_from_view, view_from_world, ground)        # doctest: +SKIP
    >>> renderer.draw(clip_from_view, view_from_world)                        # doctest: +SKIP
    """

    def __init__(self, ctx: moderngl.Context, cache_side: int = 4096):
        super().__init__()
        check_type("ctx", ctx, moderngl.Context, " of moderngl")
        check_whole("cache_side", cache_side, 1, TileCache.largest(ctx))
        self._ctx, self._released = ctx, False
        with preserved_state(ctx):
            self._impostors = ImpostorPass(ctx, cache_side)
            self._mesh_pass, self._ground_pass, self._shadows = MeshPass(ctx), GroundPass(ctx), ShadowPass(ctx)
            self._surface_pass, self._table = SurfacePass(ctx), LightTable(ctx)
            self._room_table, self._room_pass = RoomTable(ctx), RoomPass(ctx)
        self._clock, self._statistics = FrameClock(), self._mesh_pass.statistics
        self._placed = Placed(ctx)

    def add(
        self,
        fan: Fan,
        positions: ArrayLike = (0.0, 0.0, 0.0),
        yaws: ArrayLike = 0.0,
        scales: ArrayLike = 1.0,
        gloss: Gloss | None = None,
        *,
        reflection: Reflection | None = None,
        model: Model | None = None,
        level_of_detail: LevelOfDetail | None = None,
    ) -> Instances:
        """Place copies of a fan; see `Instances`. A fan that was added before shares its textures.

        Parameters
        ----------
        fan, positions, yaws, scales, gloss, reflection
            As `Instances`.
        model : Model, optional
            What the fan was baked from: copies near the camera are drawn as this mesh. Strips of the fan go on casting
            their shadows, where the mesh would.
        level_of_detail : LevelOfDetail, optional
            Where near begins.

        Raises
        ------
        SettingsError
            What `Instances` cannot be made of; a model of another object or turned another way; a level of detail
            without a model.
        """
        self._check_in_use()
        instances = Instances(fan, positions, yaws, scales, gloss, reflection)
        if model is not None:
            check_type("model", model, Model, ", as impostor.load_model gives")
            check_same_object(fan, model)
            if level_of_detail is not None:
                check_type("level_of_detail", level_of_detail, LevelOfDetail)
        elif level_of_detail is not None:
            raise SettingsError(fan.name, "a level of detail without a model; expected the model that was baked")
        self._placed.add(instances, model, level_of_detail)
        return instances

    def add_mesh(
        self,
        model: Model,
        world_from_model: ArrayLike | None = None,
        gloss: Gloss | None = None,
        *,
        reflection: Reflection | None = None,
        bump: Bump | None = None,
    ) -> MeshInstance:
        """Place a polygon mesh.

        Parameters
        ----------
        model : Model
            A model that was added before shares its buffers.
        world_from_model : array_like, (4, 4) float, optional
            Rotation, translation and uniform scale.
        gloss : Gloss, optional
        reflection : Reflection, optional
            What it mirrors of the rooms.
        bump : Bump, optional
            For a model with texture coordinates; in the place of its own normal maps.

        Returns
        -------
        MeshInstance
            Its `world_from_model`, `reflection` and `visible` may be changed at any time.

        Raises
        ------
        SettingsError
            No model; a matrix of another shape, with a number that is not finite, or without an inverse; bumps on a
            model without texture coordinates.
        """
        self._check_in_use()
        check_type("model", model, Model, ", as impostor.load_model gives")
        matrix = np.array(invertible(model.name, "world_from_model", world_from_model))
        if reflection is not None:
            check_type("reflection", reflection, Reflection)
        if bump is not None:
            check_type("bump", bump, Bump)
        mesh = MeshInstance(self._placed.mesh_buffers(model, bump), matrix, gloss or Gloss(), reflection)
        self._placed.meshes.append(mesh)
        return mesh

    def add_surface(
        self,
        ptm: Ptm,
        model: Model,
        tiling: tuple[float, float] = (1.0, 1.0),
        world_from_model: ArrayLike | None = None,
        gloss: Gloss | None = None,
    ) -> Surface:
        """Place a mesh with a PTM on it; see `Surface`. Surfaces with the same PTM or model share what is on the GPU.

        Raises
        ------
        SettingsError
            What a `Surface` cannot be made of; a model without texture coordinates; a PTM not of light directions.
        """
        self._check_in_use()
        matrix = np.eye(4) if world_from_model is None else np.asarray(world_from_model, float)
        surface = Surface(ptm, model, tiling, matrix, gloss or Gloss())
        with preserved_state(self._ctx):
            self._surface_pass.prepare([*self._placed.surfaces, surface])
        self._placed.add_surface(surface)
        return surface

    def remove(self, placed: Instances | MeshInstance | Surface | AnimatedInstances) -> None:
        """Take something away again; what is on the GPU goes with the last that needs it.

        Raises
        ------
        SettingsError
            What is not in this renderer, or not any more.
        """
        self._check_in_use()
        parts = placed.poses if isinstance(placed, AnimatedInstances) else (placed,)
        for part in parts:
            if not self._placed.holds(part):
                expected = "something that was added to this renderer and not taken away since"
                raise SettingsError("remove", f"{with_article(type(placed))}; expected {expected}")
        with preserved_state(self._ctx):
            for fan in (fan for part in parts for fan in self._placed.remove(part)):
                self._impostors.forget()
                self._shadows.forget(fan)
            self._surface_pass.prepare(self._placed.surfaces)
            self._shadows.keep(map(id, self._placed.surfaces))

    def advance(self, seconds: float) -> None:
        """Tell the time that has passed since the last frame, once a frame, before it is drawn.

        The next `draw` chooses the levels of detail for its viewer and carries crossfades on by so much; more draws of
        the same frame, for mirrors or other viewports, show the same levels. In a renderer that is never told the time
        every draw chooses for itself, and levels and views change at once. Infinitely many seconds end all crossfades,
        as after a cut to another camera.

        Parameters
        ----------
        seconds : float
            At least 0.

        Raises
        ------
        SettingsError
            Another number, or none.
        """
        self._clock.advance(seconds)

    def draw(self, clip_from_view: ArrayLike, view_from_world: ArrayLike, output: str = "lit") -> None:
        """Draw every visible instance: far to near, premultiplied and blended; depth is tested and written.

        Copies whose level of detail is the mesh are drawn first; see `advance` for how they become that.
        Draw opaque things and shadows first, so that the edges blend with what is behind them.

        Parameters
        ----------
        clip_from_view, view_from_world : array_like, (4, 4) float
        output : {"lit", "albedo", "normal", "code"}
            Normals are the viewer's, as n / 2 + 1/2. Codes are the fans' normals as they are stored, dithered and each
            in its own view, texel by texel; meshes have none, and are lit.

        Raises
        ------
        SettingsError
            A matrix of another shape, one without an inverse or for row vectors; another output.
        GpuError
            The renderer has been released.
        """
        with self._frame(clip_from_view, view_from_world) as (state, viewer):
            if output not in (*OUTPUTS, "code"):
                raise SettingsError("output", f"{output!r}; expected one of {', '.join(OUTPUTS)}, code")
            of_meshes = "lit" if output == "code" else output
            self._update_lights(of_meshes)
            levels, seconds = self._placed.levels, self._clock.take()
            for each in levels:
                each.update(viewer, seconds)
            near = [copies for each in levels for copies in each.copies()]
            self._mesh_pass.draw_copies(state, near, viewer, self._table, self._room_table, of_meshes)
            self._statistics = self._mesh_pass.statistics
            self._impostors.draw(state, self._placed.batches, viewer, self._table, self._room_table, output, seconds)

    def draw_meshes(self, clip_from_view: ArrayLike, view_from_world: ArrayLike, output: str = "lit") -> None:
        """Draw the meshes that `add_mesh` placed; parameters as `draw`."""
        with self._frame(clip_from_view, view_from_world) as (state, viewer):
            self._update_lights(output)
            self._mesh_pass.draw(state, self._placed.visible_meshes, viewer, self._table, self._room_table, output)

    def draw_rooms(
        self, clip_from_view: ArrayLike, view_from_world: ArrayLike, rooms: Sequence[Room] | None = None
    ) -> None:
        """Draw rooms as background, from inside: the first far one as the sky, others as what they are.

        Depth is tested, so that it does not matter what is drawn first, and written where a room has some size.

        Parameters
        ----------
        clip_from_view, view_from_world : array_like, (4, 4) float
        rooms : sequence of Room, optional
            Those of `rooms` that are to be seen; by default all.

        Raises
        ------
        SettingsError
            No list of rooms; a room that is not among `rooms`.
        """
        shown = self._rooms if rooms is None else rooms
        check_rooms(shown)
        numbered = {number_of(self._rooms, room): room for room in shown}
        with self._frame(clip_from_view, view_from_world) as (state, viewer):
            self._room_table.update(self._rooms)
            self._room_pass.draw(state, numbered, self._room_table, viewer)

    def draw_room_on(
        self,
        clip_from_view: ArrayLike,
        view_from_world: ArrayLike,
        room: Room,
        shape: str,
        world_from_shape: ArrayLike | None = None,
    ) -> None:
        """Draw one of the rooms on something simple: what each point shows is the environment toward it.

        Parameters
        ----------
        clip_from_view, view_from_world : array_like, (4, 4) float
        room : Room
            One of `rooms`.
        shape : {"box", "sphere", "cylinder", "plane"}
            Within the cube from -1 to 1; the cylinder stands upright, the plane is the wall toward -z.
        world_from_shape : array_like, (4, 4) float, optional
            Where it is; the room's `world_from_room` if not told otherwise.

        Raises
        ------
        SettingsError
            A room that is not one of `rooms`, another shape, a matrix without an inverse.
        """
        number, matrix = to_show(self._rooms, room, shape, world_from_shape)
        with self._frame(clip_from_view, view_from_world) as (state, viewer):
            self._room_table.update(self._rooms)
            self._room_pass.draw_on(state, number, self._room_table, viewer, shape, matrix)

    def draw_surfaces(self, clip_from_view: ArrayLike, view_from_world: ArrayLike, output: str = "lit") -> None:
        """Draw the surfaces that `add_surface` placed; parameters as `draw`. Draw shadows after the ground's."""
        with self._frame(clip_from_view, view_from_world) as (state, viewer):
            lights = [*self._lights, *self.local_lights]
            self._surface_pass.draw(state, self._placed.surfaces, viewer, lights, self._ambient, output, self._rooms)

    def draw_ground(
        self, clip_from_view: ArrayLike, view_from_world: ArrayLike, ground: Ground, surface: GroundSurface
    ) -> None:
        """Draw a plane, lit by lights and rooms, for callers who have no ground of their own."""
        check_type("ground", ground, Ground)
        check_type("surface", surface, GroundSurface)
        with self._frame(clip_from_view, view_from_world) as (state, viewer):
            self._update_lights("lit")
            self._ground_pass.draw(state, viewer, self._table, self._room_table, ground, surface)

    def draw_shadows(
        self,
        clip_from_view: ArrayLike,
        view_from_world: ArrayLike,
        ground: Ground | Surface,
        surface: GroundSurface | None = None,
    ) -> None:
        """Darken the ground, or a flat surface, where fans, meshes and other surfaces keep light from it.

        Depth is tested against what is drawn already and not written. Every light that is above the ground casts, with
        a penumbra where it has a softness, and so do the brightest lights of rooms; see `shadow_lights` and
        `contact_shadows`. Local lights cast none; where they light a surface, each is taken to light all of it as it
        does its middle.

        Parameters
        ----------
        clip_from_view, view_from_world : array_like, (4, 4) float
        ground : Ground or Surface
            The plane on which the caller has drawn a ground; or a surface of this renderer, which `draw_surfaces` has
            drawn.
        surface : GroundSurface, optional
            What `draw_ground` has drawn: shadows fade out where it does.

        Raises
        ------
        SettingsError
            A surface that is not flat, or not in this renderer; a `GroundSurface` for one.
        """
        receiver = self._placed.receiver(ground)
        if surface is not None:
            check_type("surface", surface, GroundSurface)
            if receiver.mesh is not None:
                raise SettingsError("surface", "given for shadows on a Surface; expected it with a Ground")
        with self._frame(clip_from_view, view_from_world) as (state, viewer):
            self._shadows.draw(state, self._placed.casting(), viewer, self, receiver, surface)

    @contextmanager
    def _frame(self, clip_from_view: ArrayLike, view_from_world: ArrayLike) -> Iterator[tuple[CallerState, Viewer]]:
        """The caller's state, put back at the end, and the viewer; what may have become impossible is refused."""
        self._check_in_use()
        check_lights(self._lights)
        check_rooms(self._rooms)
        check_meshes(self._placed.meshes)
        with preserved_state(self._ctx) as state:
            yield state, Viewer.from_matrices(clip_from_view, view_from_world, state.viewport)

    def _check_in_use(self) -> None:
        if self._released:
            raise GpuError("ImpostorRenderer", "has been released; expected one that is in use")

    def _update_lights(self, output: str) -> None:
        if output not in OUTPUTS:
            raise SettingsError("output", f"{output!r}; expected one of {', '.join(OUTPUTS)}")
        if output == "albedo":
            self._table.update((), 1.0)
        else:
            self._table.update(self.lights, self.ambient, self._rooms)
        self._room_table.update(self._rooms)

    @property
    def statistics(self) -> dict[str, int]:
        """Of the last `draw`.

        `instances` drawn as fans; `meshes` drawn for copies near the camera, and their `triangles`; copies that are
        `fading`, and so counted in both; `triangles_spared` by fans of copies that have a mesh; `tiles`, `relit` tiles,
        and mip levels lost to a full cache (`coarser`).
        """
        return {**self._impostors.statistics, **self._statistics}

    @property
    def memory(self) -> dict[str, int]:
        """Bytes that are held on the GPU, by kind; see `runtime.gl.memory.memory_held`."""
        self._check_in_use()
        return memory_held(self)

    def release(self) -> None:
        """Free everything on the GPU; the context stays the caller's."""
        self._placed.release()
        self._released = True
        passes = self._impostors, self._mesh_pass, self._ground_pass, self._shadows, self._surface_pass
        for part in (*passes, self._room_pass, self._table, self._room_table):
            part.release()
