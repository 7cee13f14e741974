"""What the impostor pass needs of each quad, kept while a copy shows the same tile."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from runtime.fans.textures import FanTextures
from runtime.fans.tiles import TileIndex
from runtime.instances.placement import Placement
from runtime.instances.quads import Quads

QUAD_DTYPE = np.dtype(
    [
        ("center", "f4", (3,)),
        ("right", "f4", (3,)),
        ("up", "f4", (3,)),
        ("back", "f4", (3,)),
        ("rectangle", "f4", (4,)),
        ("place", "f4", (3,)),
        ("depth", "f4", (4,)),
    ]
)
QUAD_FORMAT = "3f 3f 3f 3f 4f 3f 4f/i"
WIDTH = QUAD_DTYPE.itemsize // 4


class QuadRecords:
    """The quads that copies of a fan showed last: from frame to frame few copies show another tile.

    A copy has two slots, for the view that it shows and for the one that it may be fading from: its number, and that
    plus the number of copies.

    Parameters
    ----------
    index : TileIndex
        Where the tiles are found.
    textures : FanTextures
    count : int
        Of copies.
    """

    def __init__(self, index: TileIndex, textures: FanTextures, count: int):
        self.index, self._textures = index, textures
        self._keys, self._entries = np.full(2 * count, -1, np.int64), np.zeros(2 * count, np.intp)
        self._rows = np.zeros((2 * count, WIDTH), np.float32)
        self._placement: Placement | None = None
        # How often the copies had moved when each row was written.
        self._moves, self._written = 0, np.full(2 * count, -1)

    def other_tiles(self, slots: NDArray[np.intp], keys: NDArray[np.int64]) -> NDArray[np.intp]:
        """Which of some slots, given by the keys (N,) of their tiles, do not show the tile that they showed last."""
        return np.flatnonzero(self._keys.take(slots) != keys)

    def show(self, slots: NDArray[np.intp], keys: NDArray[np.int64], entries: NDArray[np.intp]) -> None:
        """Take over other tiles (N,), by their entries in the index."""
        self._keys[slots], self._entries[slots], self._written[slots] = keys, entries, -1

    def outdated(self, slots: NDArray[np.intp], placement: Placement) -> NDArray[np.intp]:
        """Which of some slots show other tiles than were written, or may have moved since."""
        if placement is not self._placement:
            self._placement = placement
            self._moves += 1
        return np.flatnonzero(self._written.take(slots) != self._moves)

    def write(self, slots: NDArray[np.intp], quads: Quads, levels: NDArray[np.intp]) -> None:
        """Take over where outdated quads lie."""
        views = self._textures.fan.views
        reach = views.radius.take(quads.view)[:, None]
        rows = np.empty((len(slots), WIDTH), np.float32)
        rows[:, :3], rows[:, 3:6], rows[:, 6:9] = quads.center, quads.right * reach, quads.up * reach
        rows[:, 9:12] = quads.back
        rows[:, 12:16] = self._textures.rectangles.take(levels * len(views) + quads.view, axis=0)
        rows[:, 16:19] = self.index.places.take(self.entries(slots), axis=0)
        rows[:, 19:23] = self._textures.depth_lines.take(quads.view, axis=0) * quads.scale[:, None]
        self._rows[slots], self._written[slots] = rows, self._moves

    def entries(self, slots: NDArray[np.intp]) -> NDArray[np.intp]:
        """Where the tiles of slots stand in the index."""
        return self._entries.take(slots)

    def rows(self, slots: NDArray[np.intp]) -> NDArray[np.float32]:
        """QUAD_DTYPE records of slots, as plain numbers (N, WIDTH)."""
        return self._rows.take(slots, axis=0)
