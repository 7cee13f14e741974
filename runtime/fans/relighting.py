"""Which tiles are relit in a frame, and with how few colormaps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.environment.blending import diffuse_weights, mirrored_room
from impostor.environment.reflection import Reflection
from impostor.environment.room import Room
from impostor.lighting import Gloss
from runtime.fans.colormap_pass import PLACE_DTYPE, ROW_DTYPE, ColormapPass, Surroundings
from runtime.fans.relight_pass import TILE_DTYPE, RelightPass
from runtime.fans.textures import FanTextures
from runtime.fans.tiles import GUTTER, TileCache, TileIndex
from runtime.instances.quads import Quads
from runtime.lights.light_table import LightTable
from runtime.rooms.environments import RoomTable

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
    quads : Quads
    levels : ndarray, (N,) intp
        Mip level of every quad's tile.
    of_quads : ndarray, (N,) intp
        Entry in the index of every quad's tile.
    shown_by : ndarray, (M,) intp
        One of the quads that show each tile.
    reflection : Reflection, optional

    Attributes
    ----------
    entries : ndarray, (M,) intp
        Of the tiles in the index.
    """

    textures: FanTextures
    gloss: Gloss
    index: TileIndex
    quads: Quads
    levels: NDArray[np.intp]
    of_quads: NDArray[np.intp]
    shown_by: NDArray[np.intp]
    reflection: Reflection | None = None

    @cached_property
    def entries(self) -> NDArray[np.intp]:
        return self.of_quads.take(self.shown_by)

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
        rooms: RoomTable,
        cache: TileCache,
        normals_for: NDArray[np.float64] | None = None,
    ) -> int:
        """Relight tiles that are new or stale; returns how many.

        New ones, and those off by more than LARGEST_ERROR, at once; of the others the worst, up to TEXELS_A_FRAME.
        `rooms` holds those of the lights, where they have any. With `normals_for`, a viewer's (3, 3) rotation from
        world to view, tiles show its normals instead of light.
        """
        stale, new = [], []
        for tiles, due in zip(shown, due_tiles(shown, lights), strict=True):
            # Batches of one fan share tiles: the first of them relights those.
            due = due & (tiles.versions != lights.version)
            stale.append(np.flatnonzero(due & (tiles.versions >= 0)))
            new.append(np.flatnonzero(due & (tiles.versions < 0)))
            tiles.index.versions[tiles.entries[due]] = lights.version
        for chosen in (stale, new):
            for sheet in _sheets(shown, chosen, self._colormaps.ROWS):
                self._relight_sheet(sheet, chosen is new, lights, rooms, cache, normals_for)
        return sum(map(len, stale)) + sum(map(len, new))

    def _relight_sheet(
        self,
        sheet: Sequence[tuple[ShownTiles, NDArray[np.intp]]],
        new: bool,
        lights: LightTable,
        rooms: RoomTable,
        cache: TileCache,
        normals_for: NDArray[np.float64] | None,
    ) -> None:
        """Relight tiles whose colormaps fit in one texture, either all of them new or none."""
        in_rooms, row_count = bool(lights.rooms) and normals_for is None, 0
        work, rows, places = [], [], []
        for tiles, chosen in sheet:
            quads = tiles.quads.take(tiles.shown_by[chosen])
            firsts, row_of_tile = np.arange(len(quads)), np.arange(len(quads))
            if light_is_everywhere_alike(lights.rooms, tiles.reflection):
                firsts, row_of_tile = distinct_turns(quads.basis)
            work.append(_tile_records(tiles, chosen, quads.view, row_count + row_of_tile, new))
            rows.append(_row_records(tiles, quads.basis[firsts], row_count))
            row_count += len(firsts)
            if in_rooms:
                places.append(_places(quads.take(firsts), lights))
        around = None
        if in_rooms:
            reflection = sheet[0][0].reflection
            points = None if reflection is None else sheet[0][0].textures.points
            around = Surroundings(rooms, np.concatenate(places), reflection, points)
        self._colormaps.write(np.concatenate(rows), lights, normals_for, around)
        for (tiles, _), records in zip(sheet, work, strict=True):
            show_normals = normals_for is not None
            self._relight.draw(tiles.textures, records, self._colormaps.texture, cache, show_normals, depth=new)

    def release(self) -> None:
        """Free everything."""
        self._colormaps.release()
        self._relight.release()


def _sheets(
    shown: Sequence[ShownTiles], chosen: Sequence[NDArray[np.intp]], most: int
) -> Iterator[list[tuple[ShownTiles, NDArray[np.intp]]]]:
    """The chosen tiles, of as many fans together as stay within `most` tiles; of one fan where it mirrors."""
    sheet, free = [], most
    for tiles, which in zip(shown, chosen, strict=True):
        while len(which):
            if sheet and (not free or tiles.reflection or sheet[-1][0].reflection):
                yield sheet
                sheet, free = [], most
            sheet.append((tiles, which[:free]))
            which, free = which[free:], free - len(sheet[-1][1])
    if sheet:
        yield sheet


def _row_records(tiles: ShownTiles, bases: NDArray[np.float64], first: int) -> NDArray[np.void]:
    """ROW_DTYPE records of a fan's colormaps, in rows from `first` on."""
    rows = np.zeros(len(bases), ROW_DTYPE)
    rows["row"] = np.arange(first, first + len(bases))
    rows["basis"], rows["albedo"] = bases, tiles.textures.albedo
    rows["gloss"] = tiles.gloss.strength, tiles.gloss.shininess
    return rows


def _tile_records(
    tiles: ShownTiles, chosen: NDArray[np.intp], views: NDArray[np.intp], rows: NDArray[np.intp], new: bool
) -> NDArray[np.void]:
    """TILE_DTYPE records of some tiles that show these views through these rows of the colormap."""
    fan, levels = tiles.textures, tiles.levels[tiles.shown_by[chosen]]
    work = np.zeros(len(chosen), TILE_DTYPE)
    work["place"][:, :3], work["place"][:, 3] = tiles.index.places[tiles.entries[chosen]], levels
    work["origin"][:, :2], work["origin"][:, 2] = fan.tile_origins(views, levels), rows
    # A new tile is drawn whole, because another may lie beneath.
    work["part"][:, :2], work["part"][:, 2:] = -GUTTER, work["place"][:, 2:3] + GUTTER
    if not new:
        covered = fan.fan.covered_rectangles[views]
        work["part"][:, :2] = (covered[:, :2] >> levels[:, None]) - 1
        work["part"][:, 2:] = (covered[:, 2:] - 1 >> levels[:, None]) + 2
    return work


def due_tiles(shown: Sequence[ShownTiles], lights: LightTable) -> list[NDArray[np.bool_]]:
    """Which of each fan's tiles to relight now, (M,) bool each."""
    versions = [tiles.versions for tiles in shown]
    stale = [each != lights.version for each in versions]
    if not any(each.any() for each in stale):
        return stale
    texels = [tiles.texels for tiles in shown]
    if sum(int(each[which].sum()) for each, which in zip(texels, stale, strict=True)) <= TEXELS_A_FRAME:
        return stale
    errors, sizes = _changes(shown, versions, lights), np.concatenate(texels)
    order = np.argsort(-errors, kind="stable")
    due = errors > LARGEST_ERROR
    due[order] |= (np.cumsum(sizes[order]) <= TEXELS_A_FRAME) & (errors[order] > 0)
    return np.split(due, np.cumsum([len(each) for each in versions])[:-1])


def _changes(
    shown: Sequence[ShownTiles], versions: Sequence[NDArray[np.int64]], lights: LightTable
) -> NDArray[np.float64]:
    """`LightTable.change_since` of the versions of all fans together: once for each reflection, not for each fan."""
    joined, counts = np.concatenate(versions), [len(each) for each in versions]
    changes = np.empty(len(joined))
    for reflection in {tiles.reflection for tiles in shown}:
        which = np.repeat([tiles.reflection == reflection for tiles in shown], counts)
        changes[which] = lights.change_since(joined[which], reflection)
    return changes


def light_is_everywhere_alike(rooms: Sequence[Room], reflection: Reflection | None) -> bool:
    """Whether it makes no difference to the light where a copy stands."""
    return all(room.shape == "far" for room in rooms) or (len(rooms) == 1 and reflection is None)


def _places(quads: Quads, lights: LightTable) -> NDArray[np.void]:
    """What surrounds some quads, as PLACE_DTYPE."""
    places = np.zeros(len(quads), PLACE_DTYPE)
    places["center"], places["scale"], places["view"] = quads.origin, quads.scale, quads.view
    if len(lights.rooms) > 1:
        places["weights"][:, : len(lights.rooms)] = diffuse_weights(lights.rooms, quads.origin)
        places["mirrored"][np.arange(len(places)), mirrored_room(lights.rooms, quads.origin)] = 1
    return places


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
