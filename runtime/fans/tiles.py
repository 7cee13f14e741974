"""The tile cache: relit tiles kept until the lights or the view change, at the size the screen needs."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment.room import Room
from runtime.gl.uploads import check_texture_size

# Copies in one cube of this part of the smallest room's smallest side share tiles: they are at most 1.4 % of it apart.
CELL = 1 / 128
GUTTER = 1  # texels around each tile
SPARE = 64  # one in so many texels of a side is for gutters
VIEW_BITS, LEVEL_BITS = 11, 4


class CacheFull(Exception):
    """More tiles were asked for than the cache has room for."""


class TileCache:
    """One pair of textures that holds relit tiles of many sizes.

    The texture is divided into shelves; a shelf holds tiles of one size. Around each tile its edge is there once more,
    so that a filter needs no clamping. Places are handed out and never taken back one by one: when nothing is left, the
    cache is emptied and this frame's tiles are relit.

    Parameters
    ----------
    ctx : moderngl.Context
    side : int
        A power of two, at least `side_for` the largest tile: in a square of so many texels tiles would fit without
        their gutters.

    Attributes
    ----------
    side : int
        Texels on each side of the textures; they take 6 bytes a texel.
    color : moderngl.Texture
        sRGB-encoded, premultiplied.
    depth : moderngl.Texture
        16-bit normalised.
    """

    memory_kind = "tile cache"

    def __init__(self, ctx: moderngl.Context, side: int):
        self.capacity, self.side = side, side + side // SPARE
        check_texture_size(ctx, "tile cache", self.side, self.side)
        self.color = ctx.texture((self.side, self.side), 4)
        self.color.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self.depth = ctx.texture((self.side, self.side), 1, dtype="nu2", alignment=2)
        self.depth.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.target = ctx.framebuffer([self.color, self.depth])
        self.color_target = ctx.framebuffer([self.color])
        self.clear()

    @staticmethod
    def side_for(size: int) -> int:
        """The least `side` of a cache that holds tiles of some size."""
        return max(1 << (size + 2 * GUTTER - 1).bit_length(), 256)

    @staticmethod
    def largest(ctx: moderngl.Context) -> int:
        """The largest `side` that the GPU can hold."""
        limit = ctx.info["GL_MAX_TEXTURE_SIZE"]
        # As much as the spare texels may take, and what rounding leaves.
        return next(side for side in range(limit * SPARE // (SPARE + 1) + 1, 0, -1) if side + side // SPARE <= limit)

    def clear(self) -> None:
        """Give every place back."""
        self._top = 0
        self._open: dict[int, tuple[int, int]] = {}

    def place(self, sizes: ArrayLike) -> NDArray[np.int32]:
        """Make room for tiles; which tile is where is for a `TileIndex` to know.

        Parameters
        ----------
        sizes : array_like, (N,) int
            Side of each tile in texels.

        Returns
        -------
        ndarray, (N, 3) int32
            x, y and side in the cache, gutters left out.

        Raises
        ------
        CacheFull
            They do not all fit; tiles placed before stay where they are.
        """
        return np.array([self._place(size) for size in np.asarray(sizes).tolist()], np.int32).reshape(-1, 3)

    def _place(self, size: int) -> tuple[int, int, int]:
        cell = size + 2 * GUTTER
        shelf, used = self._open.get(size, (0, 0))
        if used % (self.side // cell) == 0:
            if self._top + cell > self.side:
                raise CacheFull
            shelf, used = self._top, 0
            self._top += cell
        self._open[size] = shelf, used + 1
        return used * cell + GUTTER, shelf + GUTTER, size

    def release(self) -> None:
        """Free the textures."""
        for resource in (self.target, self.color_target, self.color, self.depth):
            resource.release()


class TileIndex:
    """Which tiles of one fan are in the cache, found by number.

    Attributes
    ----------
    places : ndarray, (M, 3) int32
        x, y and side in the cache of every tile, in the order in which they were added.
    versions : ndarray, (M,) int64
        What each tile's picture was made with; below 0 as long as it has none.
    """

    def __init__(self):
        self._entries: dict[int, int] = {}
        self._places, self._versions = np.empty((64, 3), np.int32), np.full(64, -1)

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def places(self) -> NDArray[np.int32]:
        return self._places[: len(self)]

    @property
    def versions(self) -> NDArray[np.int64]:
        return self._versions[: len(self)]

    def find(self, keys: NDArray[np.int64]) -> NDArray[np.intp]:
        """Where tiles stand in `places`; -1 for those that are not there.

        Parameters
        ----------
        keys : ndarray, (N,) int64

        Returns
        -------
        ndarray, (N,) intp
        """
        entries = self._entries
        return np.array([entries.get(key, -1) for key in keys.tolist()], np.intp)

    def add(self, keys: NDArray[np.int64], places: NDArray[np.int32]) -> None:
        """Take in tiles (N,) that are not there yet and their places (N, 3)."""
        first, end = len(self), len(self) + len(keys)
        if end > len(self._versions):
            # Room for twice as many: most frames add a few.
            self._places = np.resize(self._places, (2 * end, 3))
            self._versions = np.concatenate([self.versions, np.full(2 * end - first, -1)])
        self._places[first:end] = places
        self._entries.update(zip(keys.tolist(), range(first, end), strict=True))


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
