"""Light into pictures: the colormap pass writes the 225 entries, the relight pass sends tiles through them."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.environment.colormap import SHARPEST
from impostor.environment.reflection import Reflection
from impostor.normal_code import BYTE_TO_NORMAL, CODE_COUNT
from runtime.environments import RoomTable
from runtime.fan_textures import FanTextures
from runtime.gl_state import set_state
from runtime.gpu import InstanceBuffer, load_program, set_uniforms
from runtime.lights import LightTable
from runtime.tiles import TileCache

ROW_DTYPE = np.dtype(
    [
        ("row", "f4"),
        ("basis", "f4", (3, 3)),
        ("albedo", "f4", (4,)),
        ("gloss", "f4", (2,)),
    ]
)
PLACE_DTYPE = np.dtype(
    [
        ("center", "f4", (3,)),
        ("scale", "f4"),
        ("weights", "f4", (4,)),
        ("mirrored", "f4", (4,)),
        ("view", "f4"),
        ("padding", "f4", (3,)),
    ]
)
SPAN_DTYPE = np.dtype([("first", "f4", (2,)), ("end", "f4", (2,))])
TILE_DTYPE = np.dtype([("place", "f4", (4,)), ("part", "f4", (4,)), ("origin", "f4", (3,))])
PROGRAMS = "colormap", *(f"colormap_{around}{how}" for around in ("room", "rooms") for how in ("", "_mirrored"))
CORNERS = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], np.float32)


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What the rows of a colormap have around them.

    Parameters
    ----------
    rooms : RoomTable
        At least one room.
    places : ndarray, (N,) PLACE_DTYPE
        For each row: the view's centre in the world, the instance's scale, each room's part in the diffuse light, 1
        for the room that is mirrored, and the view. One room alone has no parts to be told.
    reflection : Reflection, optional
    points : moderngl.Texture, optional
        `FanTextures.points`, for what mirrors.
    """

    rooms: RoomTable
    places: NDArray[np.void]
    reflection: Reflection | None = None
    points: moderngl.Texture | None = None


class ColormapPass:
    """Evaluates colormaps on the GPU, one texture row each.

    Equals `impostor.lighting.colormap`, and with surroundings `impostor.environment.colormap`.

    Attributes
    ----------
    texture : moderngl.Texture
        (512, rows) float32 RGBA: linear entries 0-255 multiply the albedo, 256-511 are added
        on top; of a fan with one albedo, 0-255 are the finished colours on the sRGB curve, and the rest is not used.
    """

    ROWS = 1024

    def __init__(self, ctx: moderngl.Context):
        self._normals = ctx.texture((256, 1), 4, _padded_normals().tobytes(), dtype="f4")
        # Entries without a normal stay zero.
        self.texture = ctx.texture((512, self.ROWS), 4, bytes(512 * self.ROWS * 16), dtype="f4")
        self._rows = ctx.texture((ROW_DTYPE.itemsize // 16, self.ROWS), 4, dtype="f4")
        self._places = ctx.texture((PLACE_DTYPE.itemsize // 16, self.ROWS), 4, dtype="f4")
        for texture in (self.texture, self._normals, self._rows, self._places):
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._target = ctx.framebuffer([self.texture])
        self._corners = ctx.buffer(CORNERS)
        self._spans = InstanceBuffer(ctx, SPAN_DTYPE)
        self._arrays = {name: self._array(ctx, name) for name in PROGRAMS}

    def _array(self, ctx: moderngl.Context, name: str) -> moderngl.VertexArray:
        layout = [(self._corners, "2f", "corner"), (self._spans.buffer, "4f/i", "span")]
        return ctx.vertex_array(load_program(ctx, "colormap.vert", f"{name}.frag"), layout)

    def write(
        self,
        rows: NDArray[np.void],
        lights: LightTable,
        normals_for: NDArray[np.float64] | None = None,
        surroundings: Surroundings | None = None,
    ) -> None:
        """Fill the rows named in a ROW_DTYPE array; changes the bound framebuffer and texture units 0 to 5.

        With `normals_for`, a viewer's (3, 3) rotation from world to view, the entries are that viewer's normals as
        n / 2 + 1/2 instead of light.
        """
        order = np.argsort(rows["row"])
        rows = rows[order]
        # Neighbouring rows are one rectangle: a rasteriser that works on blocks of pixels wastes most of a thin one.
        runs = np.split(np.arange(len(rows)), np.flatnonzero(np.diff(rows["row"]) != 1) + 1)
        self._upload(self._rows, rows, rows["row"], runs)
        if surroundings is not None:
            self._upload(self._places, surroundings.places[order], rows["row"], runs)
        ends = [(rows["row"][run[0]], rows["row"][run[-1]] + 1) for run in runs]
        self._target.use()
        set_state()
        folded = bool(rows["albedo"][:, 3].all())
        for half in (0,) if folded else (0, 256):
            spans = [((half, first), (half + CODE_COUNT, end)) for first, end in ends]
            self._spans.write(np.array(spans, SPAN_DTYPE))
            name = _program_name(surroundings, half == 0, half > 0 or folded)
            array = self._ready(name, lights, normals_for, surroundings)
            array.render(moderngl.TRIANGLE_STRIP, instances=len(spans))

    def _upload(
        self,
        texture: moderngl.Texture,
        records: NDArray[np.void],
        numbers: NDArray[np.float32],
        runs: list[NDArray[np.intp]],
    ) -> None:
        for run in runs:
            place = (0, int(numbers[run[0]]), texture.width, len(run))
            texture.write(records[run[0] : run[-1] + 1].tobytes(), viewport=place)

    def _ready(
        self,
        name: str,
        lights: LightTable,
        normals_for: NDArray[np.float64] | None,
        surroundings: Surroundings | None,
    ) -> moderngl.VertexArray:
        """A program's vertex array; the program has its uniforms and its textures."""
        program = self._arrays[name].program
        self._normals.use(0)
        lights.bind(program, unit=1)
        self._rows.use(2)
        set_uniforms(program, byte_to_normal=0, rows=2, row_count=self.ROWS)
        if name == "colormap":
            viewer = np.eye(3) if normals_for is None else normals_for
            set_uniforms(program, show_normals=normals_for is not None, view_from_world=viewer)
        elif surroundings is not None:
            surroundings.rooms.bind(program, 3)
            self._places.use(4)
            if "places" in program:
                set_uniforms(program, places=4)
            if surroundings.points is not None and "points" in program:
                surroundings.points.use(5)
                set_uniforms(program, points=5)
            if surroundings.reflection is not None and "reflection" in program:
                _set_reflection(program, surroundings.reflection)
        return self._arrays[name]

    def release(self) -> None:
        """Free everything this pass made."""
        for array in self._arrays.values():
            program = array.program
            array.release()
            program.release()
        self._arrays.clear()
        for resource in (
            self._rows,
            self._places,
            self._spans,
            self._corners,
            self._target,
            self.texture,
            self._normals,
        ):
            resource.release()


class RelightPass:
    """Draws tiles of a fan through their colormap rows into the tile cache."""

    def __init__(self, ctx: moderngl.Context):
        self._corners = ctx.buffer(CORNERS)
        self._tiles = InstanceBuffer(ctx, TILE_DTYPE)
        self._arrays = {name: self._array(ctx, name) for name in ("uniform", "textured", "normal")}

    def _array(self, ctx: moderngl.Context, name: str) -> moderngl.VertexArray:
        layout = [(self._corners, "2f", "corner"), (self._tiles.buffer, "4f 4f 3f/i", "place", "part", "origin")]
        return ctx.vertex_array(load_program(ctx, "relight.vert", f"relight_{name}.frag"), layout)

    def draw(
        self,
        fan: FanTextures,
        tiles: NDArray[np.void],
        colormap: moderngl.Texture,
        cache: TileCache,
        normals: bool = False,
        depth: bool = True,
    ) -> None:
        """Relight a TILE_DTYPE array of tiles; changes the bound framebuffer and texture units 0 to 3.

        With `normals`, the colormap's colours are shown as they are, on every object. Without `depth`, the tiles'
        depth stays what it is.
        """
        array = self._arrays["normal" if normals else "uniform" if fan.one_texture else "textured"]
        self._tiles.write(tiles)
        (cache.target if depth else cache.color_target).use()
        set_state()
        fan.normal.use(0)
        fan.depth.use(1)
        colormap.use(2)
        samplers = {"fan_normal": 0, "fan_depth": 1, "colormap": 2}
        if fan.color is not None and not normals:
            fan.color.use(3)
            samplers["fan_color"] = 3
        set_uniforms(array.program, cache_size=(cache.side, cache.side), **samplers)
        array.render(moderngl.TRIANGLE_STRIP, instances=len(tiles))

    def release(self) -> None:
        """Free everything this pass made."""
        for array in self._arrays.values():
            program = array.program
            array.release()
            program.release()
        self._arrays.clear()
        for resource in (self._tiles, self._corners):
            resource.release()


def _padded_normals() -> NDArray[np.float32]:
    return np.pad(BYTE_TO_NORMAL, ((0, 0), (0, 1))).astype(np.float32)


def _program_name(surroundings: Surroundings | None, multiplies: bool, adds: bool) -> str:
    """The cheapest program for entries that multiply the albedo, or are added, or both."""
    if surroundings is None:
        return "colormap"
    metal = None if surroundings.reflection is None else surroundings.reflection.metal
    mirrored = metal is not None and ((multiplies and metal > 0) or (adds and metal < 1))
    if not (multiplies or mirrored):
        return "colormap"
    return f"colormap_room{'s' * (len(surroundings.rooms) > 1)}{'_mirrored' * mirrored}"


def _set_reflection(program: moderngl.Program, reflection: Reflection) -> None:
    roughness = max(reflection.roughness, SHARPEST)
    terms = reflection.strength, reflection.least, reflection.exponent, roughness
    set_uniforms(program, reflection=terms, metal=reflection.metal, any_power=int(reflection.exponent not in (4, 5)))
