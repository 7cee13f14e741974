"""The impostor pass: fans drawn as quads from the tile cache, one draw call for all of them."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.environment.reflection import Reflection
from impostor.environment.room import Room
from impostor.lighting import Gloss
from runtime.fans.batch import Batch, Shown
from runtime.fans.quad_records import QUAD_DTYPE, QUAD_FORMAT
from runtime.fans.relighting import Relighter, ShownTiles, light_is_everywhere_alike
from runtime.fans.tiles import CacheFull, CellIndex, TileCache, TileIndex, key_levels, shared_side, tile_keys
from runtime.gl.programs import load_program, set_uniforms
from runtime.gl.state import CallerState, set_state
from runtime.gl.uploads import CORNERS, InstanceBuffer
from runtime.instances.quads import Quads, UnturnedQuads
from runtime.instances.view_fades import VIEW_FADE_SECONDS
from runtime.lights.light_table import LightTable
from runtime.rooms.environments import RoomTable
from runtime.viewing.viewer import Viewer

PART_DTYPE = np.dtype([("part", "f4", (2,))])
ALPHA_CUTOFF = 1 / 32
STATISTICS = ("instances", "fading", "triangles_spared", "tiles", "relit", "coarser")
# A tile may be drawn this much larger than it is before the next finer mip level is relit.
MAGNIFICATION = 1.2


class _Drawing:
    """Quads in one draw call: whole fans, or with the shader of a crossfade some of each one's pixels."""

    def __init__(self, ctx: moderngl.Context, fragment: str, corners: moderngl.Buffer):
        self.program = load_program(ctx, "impostor.vert", fragment)
        self.quads, self._parts = InstanceBuffer(ctx, QUAD_DTYPE), InstanceBuffer(ctx, PART_DTYPE)
        content = [(corners, "2f", "corner"), (self.quads.buffer, QUAD_FORMAT, *(QUAD_DTYPE.names or ()))]
        if "part" in self.program:
            content.append((self._parts.buffer, "2f/i", "part"))
        self.array, self.count = ctx.vertex_array(self.program, content), 0

    def write(self, quads: NDArray[np.float32], parts: NDArray[np.float32], viewer: Viewer, cache_side: int) -> None:
        """Take QUAD_DTYPE records and the part of the dither that each keeps."""
        self.count = len(quads)
        if not len(quads):
            return
        self.quads.write(quads)
        if "part" in self.program:
            self._parts.write(parts)
        set_uniforms(
            self.program,
            clip_from_world=viewer.clip_from_world,
            eye=viewer.eye,
            cache_size=(cache_side, cache_side),
            tiles=0,
            tile_depth=1,
            alpha_cutoff=ALPHA_CUTOFF,
        )

    def render(self) -> None:
        """Draw what was written."""
        if self.count:
            self.array.render(moderngl.TRIANGLE_STRIP, instances=self.count)

    def release(self) -> None:
        """Free everything."""
        for resource in (self.array, self.quads, self._parts, self.program):
            resource.release()


class ImpostorPass:
    """Draws batches of instances in the caller's framebuffer.

    Parameters
    ----------
    ctx : moderngl.Context
    cache_side : int
        Side of the tile cache in texels, its tiles' gutters left out; 4096 takes 99 MiB of GPU memory.

    Attributes
    ----------
    view_fade_seconds : float
        The longest that a copy fades from one view to the next.
    filtered : bool
        Whether tiles are filtered when they are drawn, which smooths the dither of their normals.
    statistics : dict of int
        Of the last draw: `instances` drawn, those of them that were `fading`, `triangles_spared` because a fan was
        drawn whole where there was a mesh, `tiles` the instances needed, `relit` tiles, `coarser` mip levels that a
        full cache forced.
    """

    def __init__(self, ctx: moderngl.Context, cache_side: int = 4096):
        self._ctx, self._cache_side = ctx, cache_side
        self._cache: TileCache | None = None
        self._relighter = Relighter(ctx)
        self._corners = ctx.buffer(CORNERS)
        names = ("impostor.frag", "impostor_fading.frag")
        self._whole, self._fading = (_Drawing(ctx, name, self._corners) for name in names)
        self._indexes: dict[tuple[int, Gloss, Reflection | None], TileIndex] = {}
        self._cells = CellIndex()
        self._rooms: tuple[Room, ...] = ()
        self._frame: tuple[object, ...] | None = None
        self._lit: tuple[object, ...] | None = None
        self._tiles: list[ShownTiles] = []
        self._normals_for: NDArray[np.float64] | None = None
        self._codes = False
        self.view_fade_seconds, self.filtered = VIEW_FADE_SECONDS, True
        self.statistics = dict.fromkeys(STATISTICS, 0)

    def draw(
        self,
        state: CallerState,
        batches: Sequence[Batch],
        viewer: Viewer,
        lights: LightTable,
        rooms: RoomTable,
        output: str = "lit",
        seconds: float | None = None,
    ) -> None:
        """Draw all batches, far to near, blended over what is there and depth-tested against it.

        `seconds` have passed since the last frame; None is another look at the same one, which changes no fade.
        `rooms` holds those of the lights, where they have any. `output` is "lit", "albedo" (the same, under a light
        table that is plain white), "normal" or "code".
        """
        self._codes = output == "code"
        normals_for = np.eye(3) if self._codes else viewer.view_from_world[:3, :3] if output == "normal" else None
        if normals_for is not None or self._normals_for is not None:
            # Normals turn with the viewer, so nothing lit before can be kept.
            self.forget()
        self._normals_for = normals_for
        self._rooms, self._cells.side = lights.rooms, shared_side(lights.rooms)
        frame = (viewer.key, self._cells.side, *(batch.key for batch in batches))
        if frame != self._frame:
            # Where nothing has moved, the last frame's quads are this one's.
            self._frame = None
            self._arrange(batches, viewer, seconds)
            self._frame = frame
        elif seconds:
            for batch in batches:
                batch.fades.rest(seconds)
        cache = self._cache
        if cache is None or not self.statistics["instances"]:
            return
        self.statistics["relit"] = 0
        if self._lit != (self._frame, lights.version):
            self.statistics["relit"] = self._relighter.relight(self._tiles, lights, rooms, cache, self._normals_for)
            # Tiles that wait their turn are asked for again.
            waiting = any((tiles.versions != lights.version).any() for tiles in self._tiles)
            self._lit = None if waiting else (self._frame, lights.version)
        state.bind_target()
        set_state(depth_test=True, depth_write=True, blend=(moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA))
        smooth = moderngl.LINEAR if self.filtered and not self._codes else moderngl.NEAREST
        if cache.color.filter != (smooth, smooth):
            cache.color.filter = smooth, smooth
        cache.color.use(0)
        cache.depth.use(1)
        self._whole.render()
        self._fading.render()

    def forget(self) -> None:
        """Drop every relit tile."""
        self._frame = self._lit = None
        self._tiles.clear()
        self._indexes.clear()
        self._cells.clear()
        if self._cache is not None:
            self._cache.clear()

    def _arrange(self, batches: Sequence[Batch], viewer: Viewer, seconds: float | None) -> None:
        """Find the quads of a frame and places for their tiles, and upload the quads, far to near."""
        self._tiles = []
        self.statistics = dict.fromkeys(STATISTICS, 0)
        seen = [(batch, batch.shown_to(viewer, seconds, self.view_fade_seconds)) for batch in batches]
        seen = [(batch, shown) for batch, shown in seen if len(shown)]
        if not seen:
            return
        self._place(seen, viewer)
        assert self._cache is not None
        # Rows of plain numbers: NumPy moves records field by field.
        parts = np.concatenate([shown.parts for _, shown in seen])
        rows = np.concatenate([batch.rows(shown) for batch, shown in seen])
        order = _ascending(viewer.nearness(rows[:, :3]))
        rows, parts = rows.take(order, axis=0), parts.take(order, axis=0)
        fading = np.flatnonzero(parts[:, 1] - parts[:, 0] < 1)
        # Far to near stays the order: from the farthest copy in a crossfade on, all go through its shader.
        first = int(fading[0]) if len(fading) else len(rows)
        self._whole.write(rows[:first], parts[:first], viewer, self._cache.side)
        self._fading.write(rows[first:], parts[first:], viewer, self._cache.side)
        self._count(seen)

    def _count(self, seen: Sequence[tuple[Batch, Shown]]) -> None:
        """Fill the statistics of a frame."""
        for batch, shown in seen:
            count = len(batch.instances)
            whole = shown.parts[:, 1] - shown.parts[:, 0] == 1
            again = int(np.count_nonzero(shown.slots >= count))
            self.statistics["instances"] += len(shown) - again
            self.statistics["fading"] += len(shown) - again - int(np.count_nonzero(whole))
            if batch.levels is not None:
                alone = batch.levels.fan_share.take(shown.quads.index[: len(shown) - again]) == 1
                self.statistics["triangles_spared"] += (
                    int(np.count_nonzero(alone)) * batch.levels.buffers.triangle_count
                )
        self.statistics["tiles"] = sum(len(tiles.entries) for tiles in self._tiles)

    def _cache_for(self, batches: Sequence[Batch], side: int) -> TileCache:
        side = max(side, TileCache.side_for(max(batch.textures.size for batch in batches)))
        if self._cache is None or self._cache.capacity < side:
            self.forget()
            if self._cache is not None:
                self._cache.release()
                self._cache = None
            self._cache = TileCache(self._ctx, side)
        return self._cache

    def _place(self, seen: list[tuple[Batch, Shown]], viewer: Viewer) -> None:
        """Find places for every batch's tiles.

        When the cache is full it is emptied; when that is not enough, tiles get coarser, and in the end it grows.
        """
        batches = [batch for batch, _ in seen]
        wanted = [_levels(batch, shown.quads, viewer) for batch, shown in seen]
        coarsest = max(batch.textures.levels for batch in batches)
        cache = self._cache_for(batches, self._cache_side)
        while True:
            for coarser in (each for each in range(coarsest) for _ in range(2)):
                self.statistics["coarser"] = coarser
                try:
                    self._tiles = [
                        self._find_tiles(cache, batch, shown, np.minimum(level + coarser, batch.textures.levels - 1))
                        for level, (batch, shown) in zip(wanted, seen, strict=True)
                    ]
                except CacheFull:
                    self.forget()
                else:
                    return
            cache = self._cache_for(batches, 2 * cache.capacity)

    def _find_tiles(self, cache: TileCache, batch: Batch, shown: Shown, levels: NDArray[np.intp]) -> ShownTiles:
        fan, instances, quads = batch.textures, batch.instances, shown.quads
        index = self._indexes.setdefault((id(fan), instances.gloss, instances.reflection), TileIndex())
        alike = light_is_everywhere_alike(self._rooms, instances.reflection)
        cells = 0 if alike else self._cells.numbers(quads.origin)
        keys = tile_keys(instances.yaws.take(quads.index), quads.view, levels, cells)
        records = batch.records_with(index)
        other = records.other_tiles(shown.slots, keys)
        if len(other):
            records.show(shown.slots[other], keys[other], _find_or_place(index, cache, keys[other], fan.size))
        due = records.outdated(shown.slots, quads.placement)
        if len(due):
            records.write(shown.slots[due], quads.take(due), levels[due])
        entries = records.entries(shown.slots)
        one_quad = np.full(len(index.places), -1)
        one_quad[entries] = np.arange(len(entries))
        shown_by = one_quad[one_quad >= 0]
        if self._codes:
            quads = UnturnedQuads(quads.placement, quads.index, quads.view)
        return ShownTiles(fan, instances.gloss, index, quads, levels, entries, shown_by, instances.reflection)

    def release(self) -> None:
        """Free everything this pass made."""
        for part in (self._whole, self._fading, self._corners, self._relighter):
            part.release()
        if self._cache is not None:
            self._cache.release()
            self._cache = None


def _levels(batch: Batch, quads: Quads, viewer: Viewer) -> NDArray[np.intp]:
    """The coarsest mip level (N,) whose tile is not magnified by more than MAGNIFICATION on screen."""
    radius = batch.instances.fan.views.radius.take(quads.view)
    side = 2 * radius * quads.scale * viewer.pixels_per_metre(quads.middle)
    ratio = batch.textures.size * MAGNIFICATION / np.maximum(side, 1e-3)
    return np.clip(np.floor(np.log2(ratio)), 0, batch.textures.levels - 1).astype(np.intp)


def _find_or_place(index: TileIndex, cache: TileCache, keys: NDArray[np.int64], size: int) -> NDArray[np.intp]:
    """Entries (N,) of some tiles of a fan of some size; those that are not there get a place."""
    entries = index.find(keys)
    missing = np.flatnonzero(entries < 0)
    if len(missing):
        fresh = np.unique(keys[missing])
        index.add(fresh, cache.place(size >> key_levels(fresh)))
        entries[missing] = index.find(keys[missing])
    return entries


def _ascending(values: NDArray[np.float32]) -> NDArray[np.intp]:
    """A stable argsort in a quarter of the time that `np.argsort` takes: NumPy sorts 16 bits digit by digit."""
    bits = values.view(np.int32)
    # Of negative floats the bits count down.
    bits = bits ^ (bits >> 31 & 0x7FFFFFFF)
    order = bits.astype(np.uint16).argsort(kind="stable")
    return order.take((bits >> 16).astype(np.int16).take(order).argsort(kind="stable"))
