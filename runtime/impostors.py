"""The impostor pass: fans drawn as quads from the tile cache, one draw call for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.environment.reflection import Reflection
from impostor.environment.room import Room
from impostor.fan import Fan
from impostor.lighting import Gloss
from runtime.environments import RoomTable
from runtime.fan_textures import FanTextures
from runtime.gl_state import CallerState, set_state
from runtime.gpu import InstanceBuffer, load_program, set_uniforms
from runtime.instances import Instances, Quads, Viewer, quads_toward
from runtime.lights import LightTable
from runtime.lod import Levels
from runtime.relighting import Relighter, ShownTiles, light_is_everywhere_alike
from runtime.tiles import CacheFull, CellIndex, LastTiles, TileCache, TileIndex, key_levels, shared_side, tile_keys

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
SHARE_DTYPE = np.dtype([("fan_share", "f4")])
# Corners are cut where that spares so many texels of the relit tile: small triangles cost more than they spare.
SPARED_TEXELS = 800
# As triangle strips: corner of the covered rectangle; 1 where it is cut along y, 0 along x.
RECTANGLE = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], "f4")
OCTAGON = np.array([(x, y, along) for y, sides in ((0, (0, 1)), (1, (1, 0))) for along in sides for x in (0, 1)], "f4")
ALPHA_CUTOFF = 1 / 32
STATISTICS = ("instances", "fading", "triangles_spared", "tiles", "relit", "coarser")
# A tile may be drawn this much larger than it is before the next finer mip level is relit.
MAGNIFICATION = 1.2


@dataclass
class Batch:
    """Instances that share a fan, the fan's textures, and the instances' levels where they have a mesh, too."""

    instances: Instances
    textures: FanTextures
    levels: Levels | None = None
    _last_tiles: LastTiles | None = field(default=None, init=False)

    @property
    def key(self) -> tuple[object, ...]:
        """Equal while the instances look the same to the same viewer."""
        return (id(self.textures), *self.instances.key, self.levels and self.levels.key)

    def seen_by(self, viewer: Viewer) -> Quads:
        """The instances that show some of their fan in the picture."""
        quads = quads_toward(self.instances, viewer.eye, viewer)
        shares = self.shares_of(quads)
        return quads if (shares == 1).all() else quads.take(shares != 0)

    def shares_of(self, quads: Quads) -> NDArray[np.float32]:
        """The part (N,) of each one's pixels that shows the fan; below 0, from the other end of the dither."""
        shares = self.instances.shares[quads.index]
        return shares if self.levels is None else shares * self.levels.fan_share[quads.index]

    def last_tiles(self, index: TileIndex) -> LastTiles:
        """What each copy showed last of the tiles in an index."""
        if self._last_tiles is None or self._last_tiles.index is not index:
            self._last_tiles = LastTiles(index, len(self.instances))
        return self._last_tiles

    @cached_property
    def blank_rows(self) -> NDArray[np.float32]:
        """QUAD_DTYPE records of every view at every level, (levels x views, 27): for a scale of 1, and no place yet."""
        return np.concatenate([_blank_rows(self.textures.fan, level) for level in range(self.textures.levels)])


class _Drawing:
    """Quads in one draw call: whole fans, or with the shader of a crossfade some of each one's pixels."""

    def __init__(self, ctx: moderngl.Context, fragment: str, corners: Sequence[moderngl.Buffer]):
        self.program = load_program(ctx, "impostor.vert", fragment)
        self.quads, self._shares = InstanceBuffer(ctx, QUAD_DTYPE), InstanceBuffer(ctx, SHARE_DTYPE)
        instances = [(self.quads.buffer, "3f 3f 3f 3f 4f 4f 3f 4f/i", *(QUAD_DTYPE.names or ()))]
        if "fan_share" in self.program:
            instances.append((self._shares.buffer, "1f/i", "fan_share"))
        self.rectangles, self.octagons = (
            ctx.vertex_array(self.program, [(each, "3f", "corner"), *instances]) for each in corners
        )
        self.shape, self._count = self.rectangles, 0

    def write(self, quads: NDArray[np.void], shares: NDArray[np.float32], viewer: Viewer, cache_side: int) -> None:
        """Take QUAD_DTYPE records and the fan's share of each."""
        self._count = len(quads)
        if not len(quads):
            return
        self.quads.write(quads)
        if "fan_share" in self.program:
            self._shares.write(shares.view(SHARE_DTYPE))
        self.shape = self.octagons if quads["corner_cuts"].any() else self.rectangles
        set_uniforms(
            self.program,
            clip_from_world=viewer.clip_from_world,
            cache_size=(cache_side, cache_side),
            tiles=0,
            tile_depth=1,
            alpha_cutoff=ALPHA_CUTOFF,
        )

    def render(self) -> None:
        """Draw what was written."""
        if self._count:
            self.shape.render(moderngl.TRIANGLE_STRIP, instances=self._count)

    def release(self) -> None:
        """Free everything."""
        for resource in (self.rectangles, self.octagons, self.quads, self._shares, self.program):
            resource.release()


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
        Of the last draw: `instances` drawn, those of them that were `fading`, `triangles_spared` because a fan was
        drawn whole where there was a mesh, `tiles` the instances needed, `relit` tiles, `coarser` mip levels that a
        full cache forced.
    """

    def __init__(self, ctx: moderngl.Context, cache_side: int = 4096):
        self._ctx, self._cache_side = ctx, cache_side
        self._cache: TileCache | None = None
        self._relighter = Relighter(ctx)
        self._corners = [ctx.buffer(each) for each in (RECTANGLE, OCTAGON)]
        names = ("impostor.frag", "impostor_fading.frag")
        self._whole, self._fading = (_Drawing(ctx, name, self._corners) for name in names)
        self._indexes: dict[tuple[int, Gloss, Reflection | None], TileIndex] = {}
        self._cells = CellIndex()
        self._rooms: tuple[Room, ...] = ()
        self._frame: tuple[object, ...] | None = None
        self._shown: list[ShownTiles] = []
        self._normals_for: NDArray[np.float64] | None = None
        self.statistics = dict.fromkeys(STATISTICS, 0)

    def draw(
        self,
        state: CallerState,
        batches: Sequence[Batch],
        viewer: Viewer,
        lights: LightTable,
        rooms: RoomTable,
        output: str = "lit",
    ) -> None:
        """Draw all batches, far to near, blended over what is there and depth-tested against it.

        `rooms` holds those of the lights, where they have any. `output` is "lit", "albedo" (the same, under a light
        table that is plain white) or "normal".
        """
        if output == "normal" or self._normals_for is not None:
            # Normals turn with the viewer, so nothing lit before can be kept.
            self.forget()
        self._normals_for = viewer.view_from_world[:3, :3] if output == "normal" else None
        self._rooms, self._cells.side = lights.rooms, shared_side(lights.rooms)
        frame = (viewer.key, self._cells.side, *(batch.key for batch in batches))
        if frame != self._frame:
            # Where nothing has moved, the last frame's quads are this one's.
            self._frame = None
            self._arrange(batches, viewer)
            self._frame = frame
        cache = self._cache
        if cache is None or not self.statistics["instances"]:
            return
        self.statistics["relit"] = self._relighter.relight(self._shown, lights, rooms, cache, self._normals_for)
        state.bind_target()
        set_state(depth_test=True, depth_write=True, blend=(moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA))
        cache.color.use(0)
        cache.depth.use(1)
        self._whole.render()
        self._fading.render()

    def forget(self) -> None:
        """Drop every relit tile."""
        self._frame = None
        self._shown.clear()
        self._indexes.clear()
        self._cells.clear()
        if self._cache is not None:
            self._cache.clear()

    def _arrange(self, batches: Sequence[Batch], viewer: Viewer) -> None:
        """Find the quads of a frame and places for their tiles, and upload the quads, far to near."""
        self._shown = []
        self.statistics = dict.fromkeys(STATISTICS, 0)
        seen = [(batch, batch.seen_by(viewer)) for batch in batches]
        seen = [(batch, quads) for batch, quads in seen if len(quads)]
        if not seen:
            return
        self._place(seen, viewer)
        assert self._cache is not None
        shares = [batch.shares_of(quads) for batch, quads in seen]
        for (batch, _), each in zip(seen, shares, strict=True):
            if batch.levels is not None:
                whole = int(np.count_nonzero(each == 1))
                self.statistics["triangles_spared"] += whole * batch.levels.buffers.triangle_count
        # Rows of plain numbers: NumPy moves records field by field.
        ends = np.cumsum([len(quads) for _, quads in seen])
        rows = np.empty((ends[-1], QUAD_DTYPE.itemsize // 4), np.float32)
        for tiles, (batch, _), part in zip(self._shown, seen, np.split(rows, ends[:-1]), strict=True):
            _write_rows(batch, tiles, part)
        order = _ascending(np.concatenate([viewer.nearness(quads.center) for _, quads in seen]))
        records, share = rows.take(order, axis=0).view(QUAD_DTYPE)[:, 0], np.concatenate(shares).take(order)
        fading = np.flatnonzero(share < 1)
        # Far to near stays the order: from the farthest copy in a crossfade on, all go through its shader.
        first = int(fading[0]) if len(fading) else len(records)
        self._whole.write(records[:first], share[:first], viewer, self._cache.side)
        self._fading.write(records[first:], share[first:], viewer, self._cache.side)
        self.statistics["instances"], self.statistics["fading"] = len(records), len(fading)
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

    def _tiles(self, cache: TileCache, batch: Batch, quads: Quads, levels: NDArray[np.intp]) -> ShownTiles:
        fan, gloss, reflection = batch.textures, batch.instances.gloss, batch.instances.reflection
        index = self._indexes.setdefault((id(fan), gloss, reflection), TileIndex())
        cells = 0 if light_is_everywhere_alike(self._rooms, reflection) else self._cells.numbers(quads.origin)
        keys = tile_keys(batch.instances.yaws[quads.index], quads.view, levels, cells)
        last = batch.last_tiles(index)
        changed = last.changed(quads.index, keys)
        if len(changed):
            copies, keys = quads.index[changed], keys[changed]
            last.remember(copies, keys, _find_or_place(index, cache, keys, fan.size))
        entries = last.entries(quads.index)
        one_quad = np.full(len(index.places), -1)
        one_quad[entries] = np.arange(len(entries))
        return ShownTiles(fan, gloss, index, quads, levels, entries, one_quad[one_quad >= 0], reflection)

    def release(self) -> None:
        """Free everything this pass made."""
        for part in (self._whole, self._fading, *self._corners, self._relighter):
            part.release()
        if self._cache is not None:
            self._cache.release()
            self._cache = None


def _levels(batch: Batch, quads: Quads, viewer: Viewer) -> NDArray[np.intp]:
    """The coarsest mip level (N,) whose tile is not magnified by more than MAGNIFICATION on screen."""
    side = 2 * batch.instances.fan.views.radius[quads.view] * quads.scale * viewer.pixels_per_metre(quads.origin)
    ratio = batch.textures.size * MAGNIFICATION / np.maximum(side, 1e-3)
    return np.clip(np.floor(np.log2(ratio)), 0, batch.textures.levels - 1).astype(np.intp)


def _find_or_place(index: TileIndex, cache: TileCache, keys: NDArray[np.int64], size: int) -> NDArray[np.intp]:
    """Entries (N,) of some tiles of a fan of some size; those that are not there get a place."""
    entries = index.find(keys)
    missing = np.flatnonzero(entries < 0)
    if len(missing):
        fresh = np.unique(keys[missing])
        index.add(fresh, cache.place((size >> key_levels(fresh)).tolist()))
        entries[missing] = index.find(keys[missing])
    return entries


def _write_rows(batch: Batch, tiles: ShownTiles, rows: NDArray[np.float32]) -> None:
    """Fill rows (N, 27) with QUAD_DTYPE records."""
    fan, quads = tiles.textures.fan, tiles.quads
    # Any mode but the first choice writes straight to where it is told.
    batch.blank_rows.take(tiles.levels * len(fan.views) + quads.view, axis=0, out=rows, mode="clip")
    reach = fan.views.radius.take(quads.view)[:, None]
    rows[:, :3], rows[:, 3:6], rows[:, 6:9] = quads.center, quads.right * reach, quads.up * reach
    # Depth along the view's back counts toward the eye as far as the two agree.
    along = (quads.back * quads.toward_eye).sum(axis=1)
    rows[:, 9:12] = quads.toward_eye * along[:, None]
    rows[:, 20:23] = tiles.index.places.take(tiles.of_quads, axis=0)
    # One column at a time: over rows this short, NumPy takes three times as long.
    for depth in rows.T[23:]:
        depth *= quads.scale


def _blank_rows(fan: Fan, level: int) -> NDArray[np.float32]:
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
    records = np.zeros(len(fan.views), QUAD_DTYPE)
    records["rectangle"] = inside * (2 / fan.size) - 1
    records["corner_cuts"] = cuts * (spared > SPARED_TEXELS)[:, None]
    records["depth"] = np.stack([low - offset, high - low, -slope_right * reach, -slope_up * reach], axis=-1)
    return records.view(np.float32).reshape(len(records), -1)


def _ascending(values: NDArray[np.float32]) -> NDArray[np.intp]:
    """A stable argsort in a quarter of the time that `np.argsort` takes: NumPy sorts 16 bits digit by digit."""
    bits = values.view(np.int32)
    # Of negative floats the bits count down.
    bits = bits ^ (bits >> 31 & 0x7FFFFFFF)
    order = bits.astype(np.uint16).argsort(kind="stable")
    return order.take((bits >> 16).astype(np.int16).take(order).argsort(kind="stable"))
