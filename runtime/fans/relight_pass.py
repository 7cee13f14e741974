"""The relight pass: tiles of a fan drawn through their colormap rows into the tile cache."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from runtime.fans.textures import FanTextures
from runtime.fans.tiles import TileCache
from runtime.gl.programs import load_program, set_uniforms
from runtime.gl.state import set_state
from runtime.gl.uploads import CORNERS, InstanceBuffer

TILE_DTYPE = np.dtype([("place", "f4", (4,)), ("part", "f4", (4,)), ("origin", "f4", (3,))])


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
