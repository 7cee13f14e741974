"""Tables "environment", "environment_rewrite" and "environment_quality": fans and meshes lit by a whole panorama."""

from __future__ import annotations

from functools import cache, partial
from pathlib import Path

import moderngl
import numpy as np

from benchmarks.scenes import AMBIENT, Field, MeshField, lights
from benchmarks.tables import Bar, Row, Table
from benchmarks.timing import alternate
from benchmarks.workbench import DATA, SAMPLES, Workbench, say
from impostor.environment import Environment, Reflection, Room
from impostor.environment.blending import diffuse_weights, mirrored_room
from impostor.environment.colormap import environment_colormap, surface_points
from impostor.fan import Fan
from impostor.files.environment_file import read_environment
from impostor.model import Model
from impostor.views import ring_bases
from runtime.compare import MESH_SAMPLES, Pair, between_cameras, errors
from runtime.fans.colormap_pass import PLACE_DTYPE, ROW_DTYPE, ColormapPass, Surroundings
from runtime.fans.textures import FanTextures
from runtime.gl.offscreen import Offscreen
from runtime.lights.light_table import LightTable
from runtime.renderer import ImpostorRenderer
from runtime.rooms.environments import RoomTable
from runtime.viewing.cameras import Camera

PANORAMA = DATA / "env" / "royal_esplanade_1k.hdr"
SURFACES = {
    "matt": None,
    "lacquer": Reflection(),
    "glossy": Reflection(roughness=0.3),
    "rough": Reflection(roughness=0.6),
    "rough metal": Reflection(least=0.9, roughness=0.5, metal=1),
    "polished metal": Reflection(least=0.9, roughness=0.25, metal=1),
    "mirror metal": Reflection(least=0.95, metal=1),
}
CAMERAS = 8


@cache
def panorama() -> Environment:
    """A photographed panorama of 1024x512, or a painted one in its place."""
    return read_environment(PANORAMA if PANORAMA.is_file() else SAMPLES / "environments" / "meadow.exr", size=256)


def panorama_name() -> str:
    """Its file's."""
    return Path(panorama().name).name


def run_frames(bench: Workbench) -> Table:
    """Frames of 100 objects under one light and in a panorama, as fans and as meshes; nothing changes."""
    columns = {"fans_ms": "fans, ms", "fans_ratio": "of one light", "meshes_ms": "meshes, ms", "meshes_ratio": "of one"}
    table = Table("environment", "100 objects of 60 pixels, lit by a light or by a panorama", columns)
    kinds = {"light": None, "matt": None, "lacquer": SURFACES["lacquer"], "metal": SURFACES["rough metal"]}
    fields = [Field(bench.ctx, bench.fan("bunny"), 100, 60) for _ in kinds]
    meshes = [MeshField(field, bench.model("bunny")) for field in fields]
    for (name, reflection), field, mesh in zip(kinds.items(), fields, meshes, strict=True):
        for renderer in (field.renderer, mesh._renderer):
            renderer.lights, renderer.ambient = (lights(1), AMBIENT) if name == "light" else ((), 0)
            renderer.rooms = () if name == "light" else [Room.far(panorama())]
        field.renderer._placed.batches[0].instances.reflection = reflection
        for each in mesh._placed:
            each.reflection = reflection
    of_fans = alternate(*(field.impostors for field in fields), ctx=bench.ctx)
    of_meshes = alternate(*(partial(mesh.meshes, 100) for mesh in meshes), ctx=bench.ctx, repeats=3, warm_up=1)
    for index, name in enumerate(kinds):
        values = {
            "fans_ms": of_fans.median(index) * 1e3,
            "fans_ratio": of_fans.ratio(index, 0),
            "meshes_ms": of_meshes.median(index) * 1e3,
            "meshes_ratio": of_meshes.ratio(index, 0),
        }
        label = "one light" if name == "light" else f"{panorama_name()}, {name}"
        table.rows.append(Row(name, label, values, () if name == "light" else (Bar("fans_ratio", "<", 1.05),)))
    for each in (*meshes, *fields):
        each.release()
    table.notes.append("Nothing moves, so the colormaps are written and the tiles are lit. Without shadows.")
    return table


def run_rewrite(bench: Workbench) -> Table:
    """225 entries a row, filled from the surroundings: on the GPU and in NumPy."""
    columns = {"rows": "rows", "gpu_ms": "GPU path, ms", "numpy_ms": "NumPy, ms"}
    table = Table("environment_rewrite", "Filling the colormap from the surroundings: one row for each object", columns)
    far, box = Room.far(panorama()), Room.box(panorama(), (12, 6, 12))
    cases = {
        "far, matt": ([far], None),
        "far, lacquer": ([far], SURFACES["lacquer"]),
        "box, lacquer": ([box], SURFACES["lacquer"]),
        "box and far, lacquer": ([box, far], SURFACES["lacquer"]),
    }
    colormaps, light_table, rooms = ColormapPass(bench.ctx), LightTable(bench.ctx), RoomTable(bench.ctx)
    fan = bench.fan("bunny")
    textures, points = FanTextures(bench.ctx, fan), surface_points(fan)
    for name, (around, reflection) in cases.items():
        light_table.update((), 0, around)
        rooms.update(around)
        for count in (1, 100, 1000):
            rows, places = _rows(fan, around, count)
            surroundings = Surroundings(rooms, places, reflection, textures.points)
            of_views = points[places["view"].astype(int)]
            jobs = (
                partial(colormaps.write, rows, light_table, surroundings=surroundings),
                partial(environment_colormap, rows["basis"], places["center"], around, reflection, of_views),
            )
            gpu, numpy = (alternate(job, ctx=ctx) for job, ctx in zip(jobs, (bench.ctx, None), strict=True))
            bars = {1: (Bar("numpy_ms", "<", 2.0),), 1000: (Bar("gpu_ms", "<", 20.0),)}.get(count, ())
            values = {"rows": count, "gpu_ms": gpu.median(0) * 1e3, "numpy_ms": numpy.median(0) * 1e3}
            table.rows.append(Row(f"{name}/{count}", f"{name}, {count:,} row{'s' * (count > 1)}", values, bars))
    for each in (textures, rooms, light_table, colormaps):
        each.release()
    table.notes.append(f"Rows of 2 x 225 entries, of a fan of more than one albedo; {panorama_name()}.")
    return table


def _rows(fan: Fan, rooms: list[Room], count: int):
    """Rows and places of objects anywhere in the box, each turned another way."""
    rows, places = np.zeros(count, ROW_DTYPE), np.zeros(count, PLACE_DTYPE)
    rows["row"], rows["basis"] = np.arange(count), ring_bases(count, np.radians(15))
    random = np.random.default_rng(1)
    centers = random.uniform((-5, -2, -5), (5, 2, 5), (count, 3))
    places["center"], places["scale"], places["view"] = centers, 1, random.integers(0, len(fan.views), count)
    places["weights"][:, : len(rooms)] = diffuse_weights(rooms, centers)
    places["mirrored"][np.arange(count), mirrored_room(rooms, centers)] = 1
    return rows, places


def run_quality(bench: Workbench) -> Table:
    """A fan in its surroundings against the mesh in the same."""
    columns = {"at_views_db": "at the views, dB", "between_db": "between them, dB"}
    table = Table(
        "environment_quality", "Picture error against the mesh, lit per pixel by the same surroundings", columns
    )
    for key in ("bunny", "helmet"):
        say(f"environment_quality: {bench.subject(key).path.name}")
        fan = bench.fan(key)
        x, y, z = fan.bounds.mean(axis=0).tolist()
        wide, radius = 8 * fan.radius, fan.radius
        room = Room.box(panorama(), (wide, 5 * radius, wide), (x, y + radius, z))
        pictures = _Pictures(bench.ctx, fan, bench.model(key))
        for place, around in (("far", Room.far(panorama())), ("box", room)):
            for name, reflection in SURFACES.items():
                pictures.place(around, reflection)
                values = {"at_views_db": pictures.psnr(True), "between_db": pictures.psnr(False)}
                label = f"{bench.subject(key).label}, {place}, {name}"
                table.rows.append(Row(f"{key}/{place}/{name}", label, values))
        pictures.release()
    table.notes.append(
        f"Means over {CAMERAS} orthographic cameras at the fan's elevation, at the tiles' own size, over the pixels "
        f"that mesh or impostor touch, in {panorama_name()}: far, or as a box eight radii wide, five high. No lights."
    )
    return table


class _Pictures:
    """A fan and its mesh in one room, through the same cameras."""

    def __init__(self, ctx: moderngl.Context, fan: Fan, model: Model):
        self._fan, self._model = fan, model
        self._renderers = ImpostorRenderer(ctx), ImpostorRenderer(ctx)
        self._targets = Offscreen(ctx, fan.size, fan.size), Offscreen(ctx, fan.size, fan.size, MESH_SAMPLES)
        self._placed = self._renderers[0].add(fan), self._renderers[1].add_mesh(model)

    def place(self, room: Room, reflection: Reflection | None) -> None:
        """In another room, with another surface."""
        for renderer, placed in zip(self._renderers, self._placed, strict=True):
            renderer.lights, renderer.ambient, renderer.rooms = (), 0, [room]
            placed.reflection = reflection

    def psnr(self, at_views: bool) -> float:
        """Mean over cameras that stand at views of the fan, or between them."""
        views, elevation = len(self._fan.views), float(np.arcsin(self._fan.views.basis[0, 2, 1]))
        exactly = (np.arange(CAMERAS) * views // CAMERAS * (2 * np.pi / views)).tolist()
        azimuths = exactly if at_views else between_cameras(self._fan, CAMERAS)
        return float(np.mean([errors(self._pair(azimuth, elevation))[0] for azimuth in azimuths]))

    def _pair(self, azimuth: float, elevation: float) -> Pair:
        camera = Camera.orthographic(self._model.bounds.mean(axis=0), self._model.radius, azimuth, elevation)
        fans, meshes = self._renderers
        shown, truth = self._targets
        truth.clear()
        meshes.draw_meshes(*camera.matrices)
        shown.clear()
        fans.draw(*camera.matrices)
        return Pair(truth.color(), shown.color())

    def release(self) -> None:
        """Free everything on the GPU."""
        for each in (*self._renderers, *self._targets):
            each.release()
