"""Light into pictures: the colormap pass writes the 225 entries, the relight pass sends tiles through them."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.normal_code import BYTE_TO_NORMAL
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
SPAN_DTYPE = np.dtype([("first", "f4"), ("end", "f4")])
TILE_DTYPE = np.dtype([("place", "f4", (4,)), ("part", "f4", (4,)), ("origin", "f4", (3,))])
CORNERS = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], np.float32)


class ColormapPass:
    """Evaluates colormaps on the GPU, one texture row each; equals `impostor.lighting.colormap`.

    Attributes
    ----------
    texture : moderngl.Texture
        (512, rows) float32 RGBA: linear entries 0-255 multiply the albedo, 256-511 are added
        on top; of a fan with one albedo, 0-255 are the finished colours on the sRGB curve, and the rest is not used.
    """

    ROWS = 1024

    def __init__(self, ctx: moderngl.Context):
        self._program = load_program(ctx, "colormap.vert", "colormap.frag")
        self._normals = ctx.texture((256, 1), 4, _padded_normals().tobytes(), dtype="f4")
        self.texture = ctx.texture((512, self.ROWS), 4, dtype="f4")
        self._rows = ctx.texture((ROW_DTYPE.itemsize // 16, self.ROWS), 4, dtype="f4")
        for texture in (self.texture, self._normals, self._rows):
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._target = ctx.framebuffer([self.texture])
        self._corners = ctx.buffer(CORNERS)
        self._spans = InstanceBuffer(ctx, SPAN_DTYPE)
        layout = [(self._corners, "2f", "corner"), (self._spans.buffer, "2f/i", "span")]
        self._array = ctx.vertex_array(self._program, layout)

    def write(self, rows: NDArray[np.void], lights: LightTable, normals_for: NDArray[np.float64] | None = None) -> None:
        """Fill the rows named in a ROW_DTYPE array; changes the bound framebuffer and texture units 0 to 2.

        With `normals_for`, a viewer's (3, 3) rotation from world to view, the entries are that viewer's normals as
        n / 2 + 1/2 instead of light.
        """
        rows = rows[np.argsort(rows["row"])]
        # Neighbouring rows are one rectangle: a rasteriser that works on blocks of pixels wastes most of a thin one.
        runs = np.split(rows, np.flatnonzero(np.diff(rows["row"]) != 1) + 1)
        for run in runs:
            self._rows.write(run.tobytes(), viewport=(0, int(run["row"][0]), self._rows.width, len(run)))
        self._spans.write(np.array([(run["row"][0], run["row"][-1] + 1) for run in runs], SPAN_DTYPE))
        self._target.use()
        set_state()
        self._normals.use(0)
        lights.bind(self._program, unit=1)
        self._rows.use(2)
        show_normals = normals_for is not None
        set_uniforms(
            self._program,
            byte_to_normal=0,
            rows=2,
            row_count=self.ROWS,
            columns=256 if rows["albedo"][:, 3].all() else 512,
            show_normals=show_normals,
            view_from_world=normals_for if show_normals else np.eye(3),
        )
        self._array.render(moderngl.TRIANGLE_STRIP, instances=len(runs))

    def release(self) -> None:
        """Free everything this pass made."""
        for resource in (
            self._array,
            self._rows,
            self._spans,
            self._corners,
            self._target,
            self.texture,
            self._normals,
        ):
            resource.release()
        self._program.release()


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
