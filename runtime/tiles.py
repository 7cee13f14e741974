"""The tile cache: relit tiles kept until the lights or the view change, at the size the screen needs."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from runtime.gpu import check_texture_size


class CacheFull(Exception):
    """More tiles were asked for than the cache has room for."""


class TileCache:
    """One pair of textures that holds relit tiles of many sizes.

    The texture is divided into pages; a page holds tiles of one size. Places are handed out and never taken back one
    by one: when nothing is left, the cache is emptied and this frame's tiles are relit.

    Parameters
    ----------
    ctx : moderngl.Context
    side : int
        Texels on each side of the cache; it takes 6 bytes a texel.
    page : int
        Side of the largest tile; a power of two that divides `side`.

    Attributes
    ----------
    color : moderngl.Texture
        sRGB-encoded, premultiplied.
    depth : moderngl.Texture
        16-bit normalised.
    """

    def __init__(self, ctx: moderngl.Context, side: int, page: int):
        check_texture_size(ctx, "tile cache", side, side)
        self.side, self.page = side, page
        self.color = ctx.texture((side, side), 4)
        self.color.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self.depth = ctx.texture((side, side), 1, dtype="nu2", alignment=2)
        self.depth.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.target = ctx.framebuffer([self.color, self.depth])
        self.clear()

    def clear(self) -> None:
        """Forget every tile."""
        self._places: dict[tuple[Any, ...], tuple[int, int, int]] = {}
        self._pages_used = 0
        self._open: dict[int, tuple[int, int]] = {}

    def places(self, keys: list[tuple[Any, ...]], sizes: list[int]) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
        """Where the tiles with these keys lie, making room for those that are new.

        Parameters
        ----------
        keys : list of tuple
            Whatever tells two relit tiles apart.
        sizes : list of int
            Side of each tile in texels.

        Returns
        -------
        places : ndarray, (N, 3) int32
            x, y and side in the cache.
        new : ndarray, (N,) bool
            True where the tile has no picture yet.

        Raises
        ------
        CacheFull
            The new tiles do not fit; those already placed stay.
        """
        found = [self._places.get(key) for key in keys]
        new = np.array([place is None for place in found], bool)
        for index in np.flatnonzero(new):
            found[index] = self._place(sizes[index])
        for index in np.flatnonzero(new):
            self._places[keys[index]] = found[index]  # type: ignore[assignment]
        return np.array(found, np.int32).reshape(-1, 3), new

    def _place(self, size: int) -> tuple[int, int, int]:
        cell = 1 << max(size - 1, 0).bit_length()
        page, used = self._open.get(cell, (-1, 0))
        per_row = self.page // cell
        if page < 0 or used == per_row * per_row:
            pages_per_row = self.side // self.page
            if self._pages_used == pages_per_row**2:
                raise CacheFull
            page, used = self._pages_used, 0
            self._pages_used += 1
        self._open[cell] = (page, used + 1)
        pages_per_row = self.side // self.page
        x = page % pages_per_row * self.page + used % per_row * cell
        y = page // pages_per_row * self.page + used // per_row * cell
        return x, y, size

    def release(self) -> None:
        """Free the textures."""
        for resource in (self.target, self.color, self.depth):
            resource.release()
