"""Which tiles are relit in a frame, and with how few colormaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.lighting import Gloss
from runtime.fan_textures import FanTextures
from runtime.instances import Quads
from runtime.lights import LightTable
from runtime.relight import ROW_DTYPE, TILE_DTYPE, ColormapPass, RelightPass
from runtime.tiles import TileCache, TileIndex

# While lights change from frame to frame, so many texels are relit in each; what is left of them follows.
TEXELS_A_FRAME = 1 << 17
# Linear light that a tile may lack or have too much of while it waits: 0.6 degrees of a white light.
LARGEST_ERROR = 0.01
# Beyond so many tiles of a fan, those turned alike to the lights but for so much share a colormap.
EXACT_ROWS = 256
SHARED_TURN = np.radians(0.5)


@dataclass(frozen=True, eq=False)
class ShownTiles:
    """The tiles that copies of one fan show in a frame.

    Parameters
    ----------
    textures : FanTextures
    gloss : Gloss
    index : TileIndex
    of_quads : ndarray, (N,) intp
        Entry in the index of every quad's tile.
    entries : ndarray, (M,) intp
        The distinct ones.
    quads : Quads
        One that shows each of them.
    levels : ndarray, (M,) intp
        Their mip levels.
    """

    textures: FanTextures
    gloss: Gloss
    index: TileIndex
    of_quads: NDArray[np.intp]
    entries: NDArray[np.intp]
    quads: Quads
    levels: NDArray[np.intp]

    @property
    def versions(self) -> NDArray[np.int64]:
        """The lights' version that each tile shows; -1 for a new one."""
        return self.index.versions[self.entries]

    @property
    def texels(self) -> NDArray[np.int64]:
        """Of each tile."""
        return np.square(self.index.places[self.entries, 2].astype(np.int64))


class Relighter:
    """Keeps the tiles of a cache lit as the lights are.

    Parameters
    ----------
    ctx : moderngl.Context
    """

    def __init__(self, ctx: moderngl.Context):
        self._colormaps, self._relight = ColormapPass(ctx), RelightPass(ctx)

    def relight(
        self,
        shown: Sequence[ShownTiles],
        lights: LightTable,
        cache: TileCache,
        normals_for: NDArray[np.float64] | None = None,
    ) -> int:
        """Relight tiles that are new or stale; returns how many.

        New ones, and those off by more than LARGEST_ERROR, at once; of the others the worst, up to TEXELS_A_FRAME.
        With `normals_for`, a viewer's (3, 3) rotation from world to view, tiles show its normals instead of light.
        """
        count = 0
        for tiles, chosen in zip(shown, due_tiles(shown, lights), strict=True):
            # Batches of one fan share tiles: another may have relit some by now.
            chosen = chosen & (tiles.versions != lights.version)
            new = tiles.versions < 0
            for part in (np.flatnonzero(chosen & new), np.flatnonzero(chosen & ~new)):
                for start in range(0, len(part), self._colormaps.ROWS):
                    self._relight_some(tiles, part[start : start + self._colormaps.ROWS], lights, cache, normals_for)
            tiles.index.versions[tiles.entries[chosen]] = lights.version
            count += int(np.count_nonzero(chosen))
        return count

    def _relight_some(
        self,
        tiles: ShownTiles,
        chosen: NDArray[np.intp],
        lights: LightTable,
        cache: TileCache,
        normals_for: NDArray[np.float64] | None,
    ) -> None:
        """Relight some of a fan's tiles, either all of them new or none."""
        fan, entries, levels = tiles.textures, tiles.entries[chosen], tiles.levels[chosen]
        views, bases = tiles.quads.view[chosen], tiles.quads.basis[chosen]
        new = bool(tiles.index.versions[entries[0]] < 0)
        firsts, row_of_tile = distinct_turns(bases)
        rows = np.zeros(len(firsts), ROW_DTYPE)
        rows["row"], rows["basis"] = np.arange(len(rows)), bases[firsts]
        rows["albedo"], rows["gloss"] = fan.albedo, (tiles.gloss.strength, tiles.gloss.shininess)
        self._colormaps.write(rows, lights, normals_for)
        work = np.zeros(len(chosen), TILE_DTYPE)
        work["place"][:, :3], work["place"][:, 3] = tiles.index.places[entries], levels
        work["origin"][:, :2], work["origin"][:, 2] = fan.tile_origins(views, levels), row_of_tile
        # A new tile is drawn whole, because another may lie beneath.
        work["part"][:, 2:] = work["place"][:, 2:3]
        if not new:
            covered = fan.fan.covered_rectangles[views]
            work["part"][:, :2] = np.maximum((covered[:, :2] >> levels[:, None]) - 1, 0)
            reach = (covered[:, 2:] - 1 >> levels[:, None]) + 2
            work["part"][:, 2:] = np.minimum(reach, work["part"][:, 2:])
        self._relight.draw(fan, work, self._colormaps.texture, cache, normals=normals_for is not None, depth=new)

    def release(self) -> None:
        """Free everything."""
        self._colormaps.release()
        self._relight.release()


def due_tiles(shown: Sequence[ShownTiles], lights: LightTable) -> list[NDArray[np.bool_]]:
    """Which of each fan's tiles to relight now, (M,) bool each."""
    versions = [tiles.versions for tiles in shown]
    stale = [each != lights.version for each in versions]
    if not any(each.any() for each in stale):
        return stale
    texels = [tiles.texels for tiles in shown]
    if sum(int(each[which].sum()) for each, which in zip(texels, stale, strict=True)) <= TEXELS_A_FRAME:
        return stale
    errors = np.concatenate([lights.change_since(each) for each in versions])
    sizes = np.concatenate(texels)
    order = np.argsort(-errors, kind="stable")
    due = errors > LARGEST_ERROR
    due[order] |= (np.cumsum(sizes[order]) <= TEXELS_A_FRAME) & (errors[order] > 0)
    return np.split(due, np.cumsum([len(each) for each in versions])[:-1])


def distinct_turns(bases: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Bases that are turned differently to the lights.

    Parameters
    ----------
    bases : ndarray, (N, 3, 3) float64
        Right, up and back; right is level.

    Returns
    -------
    firsts : ndarray, (K,) intp
        One of each kind.
    kinds : ndarray, (N,) intp
        Each one's place among those.
    """
    if len(bases) <= EXACT_ROWS:
        return np.arange(len(bases)), np.arange(len(bases))
    azimuth = np.arctan2(-bases[:, 0, 2], bases[:, 0, 0])
    elevation = np.arctan2(bases[:, 2, 1], bases[:, 1, 1])
    bins = np.rint(np.stack([azimuth, elevation]) / (2 * SHARED_TURN)).astype(np.int64)
    _, firsts, kinds = np.unique((bins[0] << 32) + bins[1], return_index=True, return_inverse=True)
    return firsts, kinds
