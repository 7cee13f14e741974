"""A scene on the GPU: what it is made of, loaded, placed, drawn in order, and exchanged piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count
from typing import Any

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment import Environment
from impostor.errors import ImpostorError
from impostor.lighting import DirectionalLight
from impostor.model import Model
from impostor.ptm.quantise import Ptm
from impostor.scene import Placement, Scene, SceneGround, SceneMesh, SceneSurface, Subject
from impostor.srgb import srgb_from_linear
from runtime.fans.leaning import leaning
from runtime.fans.lod import LevelOfDetail
from runtime.gl.canvas import Canvas
from runtime.gl.state import preserved_state
from runtime.instances.instances import Instances
from runtime.instances.quads import quads_toward
from runtime.lights.contact_settings import ContactShadows
from runtime.meshes.copies import MeshInstance
from runtime.renderer import ImpostorRenderer
from runtime.stage.assets import Assets, Shelf
from runtime.stage.ground import GREY, ground_surface, under
from runtime.stage.overdraw import OverdrawPass
from runtime.stage.rooms import StageRooms, environments_of
from runtime.surfaces.surface_pass import Surface, lying_on, rectangle
from runtime.viewing.cameras import Camera
from runtime.viewing.viewer import Viewer

VIEWS = ("lit", "albedo", "normals", "depth", "overdraw", "codes")
DARK = (0.1, 0.1, 0.1)
DIM = 0.15  # light on what has no normal codes, where they are shown
ALWAYS_MESH = LevelOfDetail(mesh_above_px=0.0)
ALWAYS_FAN = LevelOfDetail(mesh_above_px=np.inf, elevation_above_px=np.inf)
UNSEEN = (0.0, 0.0, 0.0, 0.0)
NEAREST = 0.1  # metres, where the scene does not say


@dataclass
class Copies:
    """The copies of one placement: as the scene wants them, and for a split screen as fans and as meshes."""

    placement: Placement
    shown: Instances
    fans: Instances
    meshes: Instances | None = None

    @property
    def all(self) -> list[Instances]:
        """Each of them once."""
        return list({id(each): each for each in (self.shown, self.fans, self.meshes) if each is not None}.values())

    def show(self, which: str) -> None:
        """Make one visible: "shown", "fans" or "meshes", or "none"; what has no mesh stays a fan."""
        chosen = None if which == "none" else getattr(self, which) or self.fans
        for each in self.all:
            each.visible = each is chosen

    def place(self, placement: Placement) -> None:
        """Move them to where as many copies stand now."""
        self.placement = placement
        for each in self.all:
            each.positions, each.yaws, each.scales = placement.positions, placement.yaws, placement.scales


class Stage:
    """Draws a scene.

    Parameters
    ----------
    ctx : moderngl.Context
    scene : Scene
        Every file that it names is there.

    Attributes
    ----------
    scene : Scene
    renderer : ImpostorRenderer
    statistics : dict of int
        Of the last picture, as `ImpostorRenderer.statistics`.

    Raises
    ------
    ImpostorError
        A file that cannot be read; what the renderer refuses.
    """

    def __init__(self, ctx: moderngl.Context, scene: Scene):
        self._ctx, self.scene = ctx, scene
        self._assets = Assets()
        self._ground_texture: NDArray[np.uint8] | None = None
        self._lights: Sequence[DirectionalLight] = ()
        self._rooms = StageRooms()
        self._ambient: ArrayLike = 0.0
        self._background = (*GREY, 1.0)
        self._triangle_counts: dict[Subject, int] = {}
        self.renderer = ImpostorRenderer(ctx)
        self.statistics = self.renderer.statistics
        self._overdraw = OverdrawPass(ctx)
        self._copies: Shelf[Copies] = Shelf(self._remove_copies)
        self._meshes: Shelf[MeshInstance] = Shelf(self.renderer.remove)
        self._surfaces: Shelf[Surface] = Shelf(self.renderer.remove)
        self._floors: Shelf[Surface] = Shelf(self.renderer.remove)
        try:
            self.change(scene)
        except BaseException:
            self.release()
            raise

    def change(self, scene: Scene) -> None:
        """Show another scene: what is the same in both stays as it is, and files that have changed are read again.

        Raises
        ------
        ImpostorError
            As for the first scene. Then nothing is changed.
        """
        texture = None if scene.ground is None or scene.ground.texture is None else scene.ground.texture
        ground_texture = None if texture is None else self._assets.picture(texture)
        environments = environments_of(scene, self._assets)
        keys = {self._key(placement): placement for placement in scene.instances}
        exchanges: list[tuple[Shelf[Any], Mapping[Hashable, Callable[[], Any]]]] = [
            (self._copies, {key: partial(self._add_copies, placement) for key, placement in keys.items()}),
            (self._meshes, self._wanted_meshes(scene)),
            (self._surfaces, self._wanted_surfaces(scene)),
            (self._floors, self._wanted_floor(scene.ground)),
        ]
        try:
            for shelf, wanted in exchanges:
                shelf.add(wanted)
        except BaseException:
            for shelf, _ in exchanges:
                shelf.undo()
            raise
        for shelf, wanted in exchanges:
            shelf.keep(wanted)
        for key, placement in keys.items():
            self._copies.things[key].place(placement)
        self.scene, self._ground_texture = scene, ground_texture
        self._rooms.change(scene, environments)
        self._sphere = self._bounds()
        self._assets.forget_unused()

    def light(
        self,
        lights: Sequence[DirectionalLight],
        ambient: ArrayLike,
        background: tuple[float, float, float],
        room_yaws: Sequence[float] | None = None,
        sky: Environment | None = None,
    ) -> None:
        """Set what the scene is lit by; the background is linear, the yaws of its rooms are radians.

        `sky` is what its rooms show that are the sky.
        """
        if room_yaws is not None:
            self._rooms.turn(room_yaws, sky)
        self._lights, self._ambient = lights, ambient
        red, green, blue = srgb_from_linear(np.asarray(background, float)).tolist()
        self._background = red, green, blue, 1.0

    def prepare_split(self) -> None:
        """Load the meshes for a split screen.

        Raises
        ------
        ImpostorError
            A model that cannot be read, or that is not what its fan shows.
        """
        for copies in self._copies.things.values():
            subject = copies.placement.subject
            if subject.model is None or copies.meshes is not None:
                continue
            model, add = self._assets.model(subject.model, subject.up), partial(self._add, copies.placement)
            copies.meshes = add(model, ALWAYS_MESH)
            if copies.placement.lod:
                copies.fans = add(model, ALWAYS_FAN)

    def draw(
        self, canvas: Canvas, camera: Camera, view: str = "lit", shadows: bool = True, split: float | None = None
    ) -> None:
        """Draw a picture; `canvas` is resolved then.

        Parameters
        ----------
        canvas : Canvas
        camera : Camera
        view : {"lit", "albedo", "normals", "depth", "overdraw", "codes"}
            "depth" draws the lit picture, whose depth can then be shown; "codes" the fans' stored normals, as
            `ImpostorRenderer.draw` does, and all else in the dark.
        shadows : bool
        split : float, optional
            Everything left of this part of the width is drawn as meshes, everything right of it as fans. Wants
            `prepare_split` first.
        """
        if view == "overdraw":
            self._draw_overdraw(canvas, camera)
            return
        renderer, matrices = self.renderer, camera.matrices
        output = "normal" if view == "normals" else "lit"
        # White light from everywhere shows the albedo, of a ground as of everything else.
        lit = view in ("lit", "depth")
        flat = DIM if view == "codes" else 1.0
        renderer.lights, renderer.ambient = (self._lights, self._ambient) if lit else ((), flat)
        renderer.shadow_lights = self.scene.shadow_lights
        contact = self.scene.contact_shadow
        renderer.contact_shadows = ContactShadows(contact) if contact > 0 else None
        if lit and self._rooms.uncaptured:
            self._capture_rooms()
        renderer.rooms = self._rooms.all if lit else ()
        self._show("shown" if split is None else "fans")
        canvas.clear({"normals": (*GREY, 1.0), "codes": (*DARK, 1.0)}.get(view, self._background))
        if lit and self._rooms.visible:
            renderer.draw_rooms(*matrices, self._rooms.visible)
        self._draw_beneath(camera, output, shadows and lit)
        of_fans = "code" if view == "codes" else output
        if split is None:
            renderer.draw(*matrices, of_fans)
            self.statistics = renderer.statistics
        else:
            self._draw_split(canvas, camera, of_fans, round(split * canvas.size[0]))
        canvas.resolve()

    def _draw_beneath(self, camera: Camera, output: str, shadows: bool) -> None:
        """Draw what is there before the instances: the ground, surfaces, meshes, and all shadows on them.

        Shadows on the ground come before what lies on it: drawn later they would be seen through it from afar.
        """
        renderer, matrices, ground = self.renderer, camera.matrices, self.scene.ground
        self._lay_floor(camera)
        if ground is not None and ground.ptm is None:
            self._draw_ground(ground, camera, output, shadows)
        renderer.draw_surfaces(*matrices, output)
        renderer.draw_meshes(*matrices, output)
        if shadows:
            if ground is not None and ground.ptm is not None:
                renderer.draw_shadows(*matrices, ground.plane)
            for wall in self._surfaces.things.values():
                renderer.draw_shadows(*matrices, wall)

    def _draw_ground(self, ground: SceneGround, camera: Camera, output: str, shadows: bool) -> None:
        background = self._background
        if any(room.shape == "far" for room in self._rooms.visible):
            background = UNSEEN
        surface = ground_surface(ground, self._ground_texture, camera, background, output)
        if ground.visible:
            self.renderer.draw_ground(*camera.matrices, ground.plane, surface)
        if shadows:
            self.renderer.draw_shadows(*camera.matrices, ground.plane, surface)

    def _capture_rooms(self) -> None:
        """Take the pictures of the rooms that show the scene itself, as it is lit now, without what mirrors."""
        renderer = self.renderer
        renderer.rooms = self._rooms.all
        for copies in self._copies.things.values():
            copies.show("shown" if copies.placement.reflection is None else "none")
        for mesh in self._meshes.things.values():
            mesh.visible = mesh.reflection is None

        def draw(clip_from_view: NDArray[np.float64], view_from_world: NDArray[np.float64]) -> None:
            camera = Camera(clip_from_view, view_from_world)
            self._ctx.fbo.clear(*self._background)
            renderer.draw_rooms(*camera.matrices, self._rooms.visible)
            self._draw_beneath(camera, "lit", True)
            renderer.draw(*camera.matrices)

        try:
            self._rooms.capture(self._ctx, draw, lambda eye: self.range_from(eye)[1])
        finally:
            for mesh in self._meshes.things.values():
                mesh.visible = True
        # The captures have chosen levels of detail for their own cameras; the picture chooses anew.
        renderer.advance(np.inf)

    def leaning(self, camera: Camera, size: tuple[int, int]) -> dict[str, float]:
        """Fans without a mesh to be in their stead that are seen from far beside their views; see `leaning`."""
        viewer = Viewer.from_matrices(*camera.matrices, (0, 0, *size))
        return leaning((each.shown for each in self._copies.things.values() if not each.placement.lod), viewer)

    def triangles_not_drawn(self, camera: Camera, size: tuple[int, int]) -> int:
        """Of all meshes whose fans are seen in a picture of `size` pixels.

        The models are loaded for their number of triangles; what cannot be loaded is not counted.
        """
        spared = self.statistics.get("triangles_spared", 0)
        viewer = Viewer.from_matrices(*camera.matrices, (0, 0, *size))
        for copies in self._copies.things.values():
            subject = copies.placement.subject
            if subject.model is not None and not copies.placement.lod:
                seen = len(quads_toward(copies.shown, viewer.eye, viewer))
                spared += seen * self._triangles(subject)
        return spared

    def _triangles(self, subject: Subject) -> int:
        if subject not in self._triangle_counts and subject.model is not None:
            try:
                self._triangle_counts[subject] = self._assets.model(subject.model, subject.up).triangle_count
            except ImpostorError:
                self._triangle_counts[subject] = 0
        return self._triangle_counts[subject]

    def range_from(self, eye: NDArray[np.float64]) -> tuple[float, float]:
        """Metres to the near and the far plane, so that the eye sees everything."""
        given = self.scene.camera
        middle, radius = self._sphere
        far = float(np.linalg.norm(eye - middle)) + radius
        if self.scene.ground is not None:
            plane = self.scene.ground.plane
            far = max(far, float(np.hypot(plane.normal @ eye - plane.offset, self.scene.ground.reach * np.sqrt(2))))
        near = NEAREST if given.near is None else given.near
        far = 1.01 * far + 1 if given.far is None else given.far
        return min(near, far / 2), max(far, 2 * near) if given.far is None else far

    def _bounds(self) -> tuple[NDArray[np.float64], float]:
        """Middle (3,) and radius of a sphere around everything but the ground."""
        points = [np.array([self.scene.camera.target])]
        reach = 0.0
        for copies in self._copies.things.values():
            points.append(copies.shown.positions)
            fan = copies.shown.fan
            size = float(np.abs(fan.bounds).max()) * np.sqrt(3)
            reach = max(reach, size * float(copies.shown.scales.max(initial=0)))
        for placed in (*self._meshes.things.values(), *self._surfaces.things.values()):
            model = placed.buffers.model if isinstance(placed, MeshInstance) else placed.model
            corners = np.append(model.bounds, np.ones((2, 1)), axis=1)
            points.append((corners @ placed.world_from_model.T)[:, :3])
            reach = max(reach, float(np.ptp(points[-1], axis=0).max()))
        found = np.concatenate([*points, self._rooms.corners()])
        middle = (found.min(axis=0) + found.max(axis=0)) / 2
        return middle, float(np.linalg.norm(found - middle, axis=1).max()) + reach

    def _show(self, which: str) -> None:
        for copies in self._copies.things.values():
            copies.show(which)

    def _draw_split(self, canvas: Canvas, camera: Camera, output: str, column: int) -> None:
        width, height = canvas.size
        canvas.framebuffer.scissor = column, 0, width - column, height
        self.renderer.draw(*camera.matrices, output)
        fans = self.renderer.statistics
        self._show("meshes")
        canvas.framebuffer.scissor = 0, 0, column, height
        self.renderer.draw(*camera.matrices, output)
        meshes = self.renderer.statistics
        canvas.framebuffer.scissor = None  # type: ignore[assignment]
        self.statistics = {**fans, "meshes": meshes["meshes"], "triangles": meshes["triangles"]}

    def _lay_floor(self, camera: Camera) -> None:
        """A ground with a PTM is a surface, which goes with the eye."""
        ground = self.scene.ground
        if ground is not None:
            for floor in self._floors.things.values():
                floor.world_from_model = lying_on(ground.plane, under(ground, camera))

    def _draw_overdraw(self, canvas: Canvas, camera: Camera) -> None:
        canvas.clear((0.0, 0.0, 0.0, 1.0))
        with preserved_state(self._ctx) as state:
            viewer = Viewer.from_matrices(*camera.matrices, state.viewport)
            self._show("shown")
            self._overdraw.draw(state, [copies.shown for copies in self._copies.things.values()], viewer)
        canvas.resolve()

    def _key(self, placement: Placement) -> Hashable:
        """Equal for placements that differ in nothing but where their copies stand."""
        subject, fan = placement.subject, self._assets.fan(placement.subject.fan)
        model = self._assets.model(subject.model, subject.up) if placement.lod and subject.model else None
        return subject, placement.gloss, placement.reflection, placement.lod, len(placement), id(fan), id(model)

    def _add_copies(self, placement: Placement) -> Copies:
        subject = placement.subject
        model = self._assets.model(subject.model, subject.up) if placement.lod and subject.model else None
        shown = self._add(placement, model)
        return Copies(placement, shown, shown)

    def _add(
        self, placement: Placement, model: Model | None, level_of_detail: LevelOfDetail | None = None
    ) -> Instances:
        return self.renderer.add(
            self._assets.fan(placement.subject.fan),
            placement.positions,
            placement.yaws,
            placement.scales,
            placement.gloss,
            reflection=placement.reflection,
            model=model,
            level_of_detail=level_of_detail,
        )

    def _remove_copies(self, copies: Copies) -> None:
        for each in copies.all:
            self.renderer.remove(each)

    def _wanted_meshes(self, scene: Scene) -> Mapping[Hashable, Callable[[], MeshInstance]]:
        wanted: dict[Hashable, Callable[[], MeshInstance]] = {}
        for mesh in scene.meshes:
            model = self._assets.model(mesh.model, mesh.up)
            wanted[_free(wanted, mesh, model)] = partial(self._add_mesh, mesh, model)
        return wanted

    def _add_mesh(self, mesh: SceneMesh, model: Model) -> MeshInstance:
        return self.renderer.add_mesh(model, mesh.world_from_model, mesh.gloss, reflection=mesh.reflection)

    def _wanted_surfaces(self, scene: Scene) -> Mapping[Hashable, Callable[[], Surface]]:
        wanted: dict[Hashable, Callable[[], Surface]] = {}
        for surface in scene.surfaces:
            ptm = self._assets.ptm(surface.ptm)
            wanted[_free(wanted, surface, ptm)] = partial(self._add_surface, surface, ptm)
        return wanted

    def _wanted_floor(self, ground: SceneGround | None) -> Mapping[Hashable, Callable[[], Surface]]:
        if ground is None or ground.ptm is None or not ground.visible:
            return {}
        ptm = self._assets.ptm(ground.ptm)
        return {(ground, id(ptm)): partial(self._add_floor, ground, ptm)}

    def _add_surface(self, surface: SceneSurface, ptm: Ptm) -> Surface:
        model = rectangle(surface.width, surface.height)
        return self.renderer.add_surface(ptm, model, surface.tiling, surface.world_from_model, surface.gloss)

    def _add_floor(self, ground: SceneGround, ptm: Ptm) -> Surface:
        side, tiling = 2 * ground.reach, 2 * ground.reach / ground.tile
        return self.renderer.add_surface(ptm, rectangle(side, side), (tiling, tiling), lying_on(ground.plane))

    def release(self) -> None:
        """Free everything on the GPU."""
        self.renderer.release()
        self._overdraw.release()


def _free(taken: Mapping[Hashable, object], thing: Hashable, made_of: object) -> Hashable:
    """A key for one more thing, which may be there several times."""
    return next(key for number in count() if (key := (thing, id(made_of), number)) not in taken)
