"""The tile cache: relit tiles kept until the lights or the view change, at the size the screen needs."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.environment.room import Room
from runtime.gpu import check_texture_size

# Copies in one cube of this part of the smallest room's smallest side share tiles: they are at most 1.4 % of it apart.
CELL = 1 / 128
VIEW_BITS, LEVEL_BITS = 11, 4


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
        self.color_target = ctx.framebuffer([self.color])
        self.clear()

    def clear(self) -> None:
        """Give every place back."""
        self._pages_used = 0
        self._open: dict[int, tuple[int, int]] = {}

    def place(self, sizes: list[int]) -> NDArray[np.int32]:
        """Make room for tiles; which tile is where is for a `TileIndex` to know.

        Parameters
        ----------
        sizes : list of int
            Side of each tile in texels.

        Returns
        -------
        ndarray, (N, 3) int32
            x, y and side in the cache.

        Raises
        ------
        CacheFull
            They do not all fit; tiles placed before stay where they are.
        """
        return np.array([self._place(size) for size in sizes], np.int32).reshape(-1, 3)

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
        for resource in (self.target, self.color_target, self.color, self.depth):
            resource.release()


class TileIndex:
    """Which tiles of one fan are in the cache, found by number for many at once.

    Attributes
    ----------
    places : ndarray, (M, 3) int32
        x, y and side in the cache of every tile, in the order in which they were added.
    versions : ndarray, (M,) int64
        What each tile's picture was made with; below 0 as long as it has none.
    """

    def __init__(self):
        self._keys, self._entries = np.empty(0, np.int64), np.empty(0, np.intp)
        self.places, self.versions = np.empty((0, 3), np.int32), np.empty(0, np.int64)

    def find(self, keys: NDArray[np.int64]) -> NDArray[np.intp]:
        """Where tiles stand in `places`; -1 for those that are not there.

        Parameters
        ----------
        keys : ndarray, (N,) int64

        Returns
        -------
        ndarray, (N,) intp
        """
        if not len(self._keys):
            return np.full(len(keys), -1, np.intp)
        at = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        return np.where(self._keys[at] == keys, self._entries[at], -1)

    def add(self, keys: NDArray[np.int64], places: NDArray[np.int32]) -> None:
        """Take in tiles (N,) that are not there yet and their places (N, 3)."""
        order = np.argsort(keys)
        entries = np.arange(len(self.places), len(self.places) + len(keys))
        at = np.searchsorted(self._keys, keys[order])
        self._keys = np.insert(self._keys, at, keys[order])
        self._entries = np.insert(self._entries, at, entries[order])
        self.places = np.concatenate([self.places, places])
        self.versions = np.concatenate([self.versions, np.full(len(keys), -1)])


class LastTiles:
    """The tiles that copies of a fan showed last: from frame to frame few copies show another one.

    Parameters
    ----------
    index : TileIndex
    count : int
        Of copies.
    """

    def __init__(self, index: TileIndex, count: int):
        self.index = index
        self._keys, self._entries = np.full(count, -1, np.int64), np.zeros(count, np.intp)

    def __len__(self) -> int:
        return len(self._keys)

    def changed(self, copies: NDArray[np.intp], keys: NDArray[np.int64]) -> NDArray[np.intp]:
        """Which of some copies, given by the keys (N,) of their tiles, do not show the tile that they showed last."""
        return np.flatnonzero(self._keys.take(copies) != keys)

    def remember(self, copies: NDArray[np.intp], keys: NDArray[np.int64], entries: NDArray[np.intp]) -> None:
        """Take over the tiles of copies that show others than before."""
        self._keys[copies], self._entries[copies] = keys, entries

    def entries(self, copies: NDArray[np.intp]) -> NDArray[np.intp]:
        """Where the tiles of copies stand in the index."""
        return self._entries.take(copies)


class CellIndex:
    """Numbers the cubes of space in which copies of a fan share tiles.

    Attributes
    ----------
    side : float
        Of a cube, metres.
    """

    def __init__(self):
        self.side = 1.0
        self._known = TileIndex()

    def numbers(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Of the cubes that points (N, 3) of the world lie in, (N,)."""
        cells = np.floor(points / self.side).astype(np.int64) & 0x1FFFFF
        keys = cells[:, 0] << 42 | cells[:, 1] << 21 | cells[:, 2]
        fresh = np.unique(keys[self._known.find(keys) < 0])
        self._known.add(fresh, np.zeros((len(fresh), 3), np.int32))
        return self._known.find(keys).astype(np.int64)

    def clear(self) -> None:
        """Forget them all."""
        self._known = TileIndex()


def shared_side(rooms: Sequence[Room]) -> float:
    """Side of the cubes in which copies may share tiles, in metres; infinite where all rooms are far."""
    sides = [np.linalg.norm(np.asarray(room.world_from_room)[:3, :3], axis=0).min() for room in rooms]
    near = [2 * CELL * float(side) for side, room in zip(sides, rooms, strict=True) if room.shape != "far"]
    return min(near, default=np.inf)


def tile_keys(
    yaws: NDArray[np.float64], views: NDArray[np.intp], levels: NDArray[np.intp], cells: NDArray[np.int64] | int
) -> NDArray[np.int64]:
    """Numbers (N,) of tiles that look different; beyond 131,072 cells, some share them."""
    keys = np.asarray(cells, np.int64) << 32 | yaws.astype(np.float32).view(np.uint32)
    return (keys << VIEW_BITS | views) << LEVEL_BITS | levels


def key_levels(keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """The levels (N,) that `tile_keys` was given."""
    return keys & (1 << LEVEL_BITS) - 1
