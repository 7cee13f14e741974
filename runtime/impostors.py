"""The impostor pass: fans drawn as quads from the tile cache, one draw call for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.fan import Fan
from impostor.lighting import Gloss
from runtime.fan_textures import FanTextures
from runtime.gl_state import CallerState, set_state
from runtime.gpu import InstanceBuffer, load_program, set_uniforms
from runtime.instances import Instances, Quads, Viewer, quads_toward
from runtime.lights import LightTable
from runtime.relight import ROW_DTYPE, TILE_DTYPE, ColormapPass, RelightPass
from runtime.tiles import CacheFull, TileCache, TileIndex

QUAD_DTYPE = np.dtype(
    [
        ("center", "f4", (3,)),
        ("right", "f4", (3,)),
        ("up", "f4", (3,)),
        ("toward_eye", "f4", (3,)),
        ("rectangle", "f4", (4,)),
        ("corner_cuts", "f4", (4,)),
        ("place", "f4", (3,)),
        ("depth", "f4", (4,)),
    ]
)
# Corners are cut where that spares so many texels of the relit tile: small triangles cost more than they spare.
SPARED_TEXELS = 800
# As triangle strips: corner of the covered rectangle; 1 where it is cut along y, 0 along x.
RECTANGLE = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], "f4")
OCTAGON = np.array([(x, y, along) for y, sides in ((0, (0, 1)), (1, (1, 0))) for along in sides for x in (0, 1)], "f4")
ALPHA_CUTOFF = 1 / 32
# A tile may be drawn this much larger than it is before the next finer mip level is relit.
MAGNIFICATION = 1.2


@dataclass
class Batch:
    """Instances that share a fan, and the fan's textures."""

    instances: Instances
    textures: FanTextures

    @cached_property
    def constants(self) -> NDArray[np.float32]:
        """What QUAD_DTYPE holds of every view at every level, (levels x views, 12): the last four for a scale of 1."""
        return np.concatenate([_constants(self.textures.fan, level) for level in range(self.textures.levels)])


@dataclass(frozen=True, eq=False)
class _Tiles:
    """The tiles that a batch shows in a frame.

    Parameters
    ----------
    batch : Batch
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

    batch: Batch
    index: TileIndex
    of_quads: NDArray[np.intp]
    entries: NDArray[np.intp]
    quads: Quads
    levels: NDArray[np.intp]


class ImpostorPass:
    """Draws batches of instances in the caller's framebuffer.

    Parameters
    ----------
    ctx : moderngl.Context
    cache_side : int
        Side of the tile cache in texels; 4096 takes 96 MiB of GPU memory.

    Attributes
    ----------
    statistics : dict of int
        Of the last draw: `instances` drawn, `tiles` they needed, `relit` tiles, `coarser` mip levels that a full
        cache forced.
    """

    def __init__(self, ctx: moderngl.Context, cache_side: int = 4096):
        self._ctx, self._cache_side = ctx, cache_side
        self._cache: TileCache | None = None
        self._program = load_program(ctx, "impostor.vert", "impostor.frag")
        self._colormaps, self._relight = ColormapPass(ctx), RelightPass(ctx)
        self._quads, self._corners = (
            InstanceBuffer(ctx, QUAD_DTYPE),
            [ctx.buffer(each) for each in (RECTANGLE, OCTAGON)],
        )
        names = QUAD_DTYPE.names or ()
        instances = (self._quads.buffer, "3f 3f 3f 3f 4f 4f 3f 4f/i", *names)
        self._rectangles, self._octagons = (
            ctx.vertex_array(self._program, [(corners, "3f", "corner"), instances]) for corners in self._corners
        )
        self._shape = self._rectangles
        self._indexes: dict[tuple[int, Gloss], TileIndex] = {}
        self._frame: tuple[object, ...] | None = None
        self._shown: list[_Tiles] = []
        self._normals_for: NDArray[np.float64] | None = None
        self.statistics: dict[str, int] = {}

    def draw(
        self, state: CallerState, batches: Sequence[Batch], viewer: Viewer, lights: LightTable, output: str = "lit"
    ) -> None:
        """Draw all batches, far to near, blended over what is there and depth-tested against it.

        `output` is "lit", "albedo" (the same, under a light table that is plain white) or "normal".
        """
        if output == "normal" or self._normals_for is not None:
            # Normals turn with the viewer, so nothing lit before can be kept.
            self.forget()
        self._normals_for = viewer.view_from_world[:3, :3] if output == "normal" else None
        frame = (viewer.key, *((id(batch.textures), *batch.instances.key) for batch in batches))
        if frame != self._frame:
            # Where nothing has moved, the last frame's quads are this one's.
            self._frame = None
            self._arrange(batches, viewer)
            self._frame = frame
        self.statistics["relit"] = sum(self._relight_stale(tiles, lights) for tiles in self._shown)
        cache, count = self._cache, self.statistics["instances"]
        if cache is None or not count:
            return
        state.bind_target()
        set_state(depth_test=True, depth_write=True, blend=(moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA))
        cache.color.use(0)
        cache.depth.use(1)
        self._shape.render(moderngl.TRIANGLE_STRIP, instances=count)

    def forget(self) -> None:
        """Drop every relit tile."""
        self._frame = None
        self._shown.clear()
        self._indexes.clear()
        if self._cache is not None:
            self._cache.clear()

    def _arrange(self, batches: Sequence[Batch], viewer: Viewer) -> None:
        """Find the quads of a frame and places for their tiles, and upload the quads, far to near."""
        self._shown = []
        self.statistics = dict.fromkeys(("instances", "tiles", "relit", "coarser"), 0)
        seen = [(batch, quads_toward(batch.instances, viewer.eye, viewer)) for batch in batches]
        seen = [(batch, quads) for batch, quads in seen if len(quads)]
        if not seen:
            return
        self._place(seen, viewer)
        # Rows of plain numbers: NumPy moves records field by field.
        rows = np.concatenate([_rows(tiles, quads) for tiles, (_, quads) in zip(self._shown, seen, strict=True)])
        rows = rows.take(np.argsort(rows[:, :3] @ -_sight(viewer).astype(np.float32), kind="stable"), axis=0)
        records = rows.view(QUAD_DTYPE)[:, 0]
        self._quads.write(records)
        self._shape = self._octagons if records["corner_cuts"].any() else self._rectangles
        assert self._cache is not None
        set_uniforms(
            self._program,
            clip_from_world=viewer.clip_from_world,
            cache_size=(self._cache.side, self._cache.side),
            tiles=0,
            tile_depth=1,
            alpha_cutoff=ALPHA_CUTOFF,
        )
        self.statistics["instances"] = len(records)
        self.statistics["tiles"] = sum(len(tiles.entries) for tiles in self._shown)

    def _cache_for(self, batches: Sequence[Batch], side: int) -> TileCache:
        page = 1 << max(max(batch.textures.size for batch in batches) - 1, 255).bit_length()
        side = max(side, page)
        if self._cache is None or self._cache.page < page or self._cache.side < side:
            self.forget()
            if self._cache is not None:
                self._cache.release()
                self._cache = None
            self._cache = TileCache(self._ctx, side, page)
        return self._cache

    def _place(self, seen: list[tuple[Batch, Quads]], viewer: Viewer) -> None:
        """Find places for every batch's tiles.

        When the cache is full it is emptied; when that is not enough, tiles get coarser, and in the end it grows.
        """
        batches = [batch for batch, _ in seen]
        wanted = [_levels(batch, quads, viewer) for batch, quads in seen]
        coarsest = max(batch.textures.levels for batch in batches)
        cache = self._cache_for(batches, self._cache_side)
        while True:
            for coarser in (each for each in range(coarsest) for _ in range(2)):
                self.statistics["coarser"] = coarser
                try:
                    self._shown = [
                        self._tiles(cache, batch, quads, np.minimum(level + coarser, batch.textures.levels - 1))
                        for level, (batch, quads) in zip(wanted, seen, strict=True)
                    ]
                except CacheFull:
                    self.forget()
                else:
                    return
            cache = self._cache_for(batches, 2 * cache.side)

    def _tiles(self, cache: TileCache, batch: Batch, quads: Quads, levels: NDArray[np.intp]) -> _Tiles:
        fan = batch.textures
        owner = id(fan), batch.instances.gloss
        index = self._indexes.setdefault(owner, TileIndex())
        yaw = batch.instances.yaws[quads.index].astype(np.float32).view(np.int32).astype(np.int64)
        keys = yaw << 32 | quads.view << 8 | levels
        entries = index.find(keys)
        if (entries < 0).any():
            missing = np.flatnonzero(entries < 0)
            fresh, first = np.unique(keys[missing], return_index=True)
            sizes = (fan.size >> levels[missing[first]]).tolist()
            index.add(fresh, cache.place(sizes))
            entries = index.find(keys)
        one_quad = np.full(len(index.places), -1)
        one_quad[entries] = np.arange(len(entries))
        distinct = np.flatnonzero(one_quad >= 0)
        chosen = one_quad[distinct]
        return _Tiles(batch, index, entries, distinct, quads.take(chosen), levels[chosen])

    def _relight_stale(self, tiles: _Tiles, lights: LightTable) -> int:
        """Relight what was lit otherwise or not at all; returns how many tiles that were."""
        assert self._cache is not None
        versions = tiles.index.versions[tiles.entries]
        stale, new = versions != lights.version, versions < 0
        for chosen in (np.flatnonzero(new), np.flatnonzero(stale & ~new)):
            for start in range(0, len(chosen), self._colormaps.ROWS):
                self._relight_tiles(tiles, chosen[start : start + self._colormaps.ROWS], lights)
        tiles.index.versions[tiles.entries] = lights.version
        return int(np.count_nonzero(stale))

    def _relight_tiles(self, tiles: _Tiles, chosen: NDArray[np.intp], lights: LightTable) -> None:
        """Relight some of a frame's tiles, either all of them new or none."""
        assert self._cache is not None
        fan, gloss = tiles.batch.textures, tiles.batch.instances.gloss
        entries, levels, views = tiles.entries[chosen], tiles.levels[chosen], tiles.quads.view[chosen]
        new = bool(tiles.index.versions[entries[0]] < 0)
        rows = np.zeros(len(chosen), ROW_DTYPE)
        rows["row"], rows["basis"] = np.arange(len(chosen)), tiles.quads.basis[chosen]
        rows["albedo"], rows["gloss"] = fan.albedo, (gloss.strength, gloss.shininess)
        self._colormaps.write(rows, lights, self._normals_for)
        work = np.zeros(len(chosen), TILE_DTYPE)
        work["place"][:, :3], work["place"][:, 3] = tiles.index.places[entries], levels
        work["origin"][:, :2], work["origin"][:, 2] = fan.tile_origins(views, levels), rows["row"]
        # A new tile is drawn whole, because another may lie beneath.
        work["part"][:, 2:] = work["place"][:, 2:3]
        if not new:
            covered = fan.fan.covered_rectangles[views]
            work["part"][:, :2] = np.maximum((covered[:, :2] >> levels[:, None]) - 1, 0)
            reach = (covered[:, 2:] - 1 >> levels[:, None]) + 2
            work["part"][:, 2:] = np.minimum(reach, work["part"][:, 2:])
        show_normals = self._normals_for is not None
        self._relight.draw(fan, work, self._colormaps.texture, self._cache, normals=show_normals, depth=new)

    def release(self) -> None:
        """Free everything this pass made."""
        for resource in (self._rectangles, self._octagons, self._quads, *self._corners, self._program):
            resource.release()
        for part in (self._colormaps, self._relight):
            part.release()
        if self._cache is not None:
            self._cache.release()
            self._cache = None


def _levels(batch: Batch, quads: Quads, viewer: Viewer) -> NDArray[np.intp]:
    """The coarsest mip level (N,) whose tile is not magnified by more than MAGNIFICATION on screen."""
    side = 2 * batch.instances.fan.views.radius[quads.view] * quads.scale * viewer.pixels_per_metre(quads.origin)
    ratio = batch.textures.size * MAGNIFICATION / np.maximum(side, 1e-3)
    return np.clip(np.floor(np.log2(ratio)), 0, batch.textures.levels - 1).astype(np.intp)


def _rows(tiles: _Tiles, quads: Quads) -> NDArray[np.float32]:
    """QUAD_DTYPE records as rows (N, 27)."""
    fan, places = tiles.batch.textures.fan, tiles.index.places[tiles.of_quads]
    rows = np.empty((len(quads), QUAD_DTYPE.itemsize // 4), np.float32)
    reach = fan.views.radius[quads.view][:, None]
    rows[:, :3], rows[:, 3:6], rows[:, 6:9] = quads.center, quads.right * reach, quads.up * reach
    # Depth along the view's back counts toward the eye as far as the two agree.
    along = np.einsum("ni,ni->n", quads.basis[:, 2], quads.toward_eye)
    rows[:, 9:12] = quads.toward_eye * along[:, None]
    level = np.log2(fan.size // places[:, 2]).astype(np.intp)
    constants = tiles.batch.constants.take(level * len(fan.views) + quads.view, axis=0)
    rows[:, 12:20], rows[:, 20:23] = constants[:, :8], places
    rows[:, 23:] = constants[:, 8:] * quads.scale[:, None]
    return rows


def _constants(fan: Fan, level: int) -> NDArray[np.float32]:
    left, top, right, bottom = fan.covered_rectangles.T
    # One texel of the relit tile more on every side, for the filter.
    border, side = 1 << level, fan.size >> level
    edges = np.stack([left - border, fan.size - bottom - border, right + border, fan.size - top + border], axis=-1)
    inside = np.clip(edges, 0, fan.size)
    # What the tile's edge takes from a corner is no longer there to be cut.
    taken = np.abs(edges - inside)
    cuts = fan.empty_corners[:, [2, 3, 0, 1]] - taken[:, [0, 2, 0, 2]] - taken[:, [1, 1, 3, 3]]
    cuts = np.maximum(cuts, 0) * (2 / fan.size)
    spared = np.square(cuts).sum(axis=1) / 2 * np.square(side / 2)
    low, high = fan.views.depth_range.T
    offset, slope_right, slope_up = fan.views.plane.T
    reach = fan.views.radius
    depth = np.stack([low - offset, high - low, -slope_right * reach, -slope_up * reach], axis=-1)
    rectangle = inside * (2 / fan.size) - 1
    return np.hstack([rectangle, cuts * (spared > SPARED_TEXELS)[:, None], depth]).astype(np.float32)


def _sight(viewer: Viewer) -> NDArray[np.float64]:
    """The direction (3,) in which things get farther away."""
    return -viewer.view_from_world[2, :3]
