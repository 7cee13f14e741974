"""The impostor pass: fans drawn as quads from the tile cache, one draw call for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from runtime.fan_textures import FanTextures
from runtime.gl_state import CallerState, set_state
from runtime.gpu import load_program, set_uniforms
from runtime.instances import Instances, Quads, Viewer, quads_toward
from runtime.lights import LightTable
from runtime.relight import CORNERS, ROW_DTYPE, TILE_DTYPE, ColormapPass, InstanceBuffer, RelightPass
from runtime.tiles import CacheFull, TileCache

QUAD_DTYPE = np.dtype(
    [
        ("center", "f4", (3,)),
        ("right", "f4", (3,)),
        ("up", "f4", (3,)),
        ("toward_eye", "f4", (3,)),
        ("rectangle", "f4", (4,)),
        ("place", "f4", (3,)),
        ("depth", "f4", (4,)),
    ]
)
ALPHA_CUTOFF = 1 / 32
# A tile may be drawn this much larger than it is before the next finer mip level is relit.
MAGNIFICATION = 1.2


@dataclass
class Batch:
    """Instances that share a fan, and the fan's textures."""

    instances: Instances
    textures: FanTextures


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
        self._corners, self._quads = ctx.buffer(CORNERS), InstanceBuffer(ctx, QUAD_DTYPE)
        names = QUAD_DTYPE.names or ()
        self._array = ctx.vertex_array(
            self._program,
            [(self._corners, "2f", "corner"), (self._quads.buffer, "3f 3f 3f 3f 4f 3f 4f/i", *names)],
        )
        self._lit: dict[object, int] = {}
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
        self.statistics = dict.fromkeys(("instances", "tiles", "relit", "coarser"), 0)
        seen = [(batch, _seen_quads(batch, viewer)) for batch in batches]
        seen = [(batch, quads) for batch, quads in seen if len(quads)]
        if not seen:
            return
        cache = self._cache_for([batch for batch, _ in seen])
        placed = self._place(cache, seen, viewer, lights)
        records = np.concatenate(
            [_records(batch, quads, places) for (batch, quads), places in zip(seen, placed, strict=True)]
        )
        order = np.argsort(-(records["center"] @ _sight(viewer)), kind="stable")
        self._quads.write(records[order])
        state.bind_target()
        set_state(depth_test=True, depth_write=True, blend=(moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA))
        cache.color.use(0)
        cache.depth.use(1)
        set_uniforms(
            self._program,
            clip_from_world=viewer.clip_from_world,
            cache_size=(cache.side, cache.side),
            tiles=0,
            tile_depth=1,
            alpha_cutoff=ALPHA_CUTOFF,
        )
        self._array.render(moderngl.TRIANGLE_STRIP, instances=len(records))
        self.statistics["instances"] = len(records)

    def forget(self) -> None:
        """Drop every relit tile."""
        if self._cache is not None:
            self._cache.clear()
            self._lit.clear()

    def _cache_for(self, batches: Sequence[Batch]) -> TileCache:
        largest = 1 << max(max(batch.textures.size for batch in batches) - 1, 255).bit_length()
        if self._cache is None or self._cache.page < largest:
            if self._cache is not None:
                self._cache.release()
            self._cache = TileCache(self._ctx, max(self._cache_side, largest), largest)
            self._lit.clear()
        return self._cache

    def _place(
        self, cache: TileCache, seen: list[tuple[Batch, Quads]], viewer: Viewer, lights: LightTable
    ) -> list[NDArray[np.int32]]:
        """Find or relight a tile for every quad; when the cache is full, empty it, then go to coarser tiles."""
        wanted = [_levels(batch, quads, viewer) for batch, quads in seen]
        for coarser in range(16):
            levels = [
                np.minimum(level + coarser, batch.textures.levels - 1)
                for level, (batch, _) in zip(wanted, seen, strict=True)
            ]
            self.statistics["coarser"] = coarser
            try:
                return self._relit(cache, seen, levels, lights)
            except CacheFull:
                cache.clear()
                self._lit.clear()
            try:
                return self._relit(cache, seen, levels, lights)
            except CacheFull:
                cache.clear()
                self._lit.clear()
        raise CacheFull

    def _relit(
        self, cache: TileCache, seen: list[tuple[Batch, Quads]], levels: list[NDArray[np.intp]], lights: LightTable
    ) -> list[NDArray[np.int32]]:
        result, work = [], []
        for (batch, quads), level in zip(seen, levels, strict=True):
            fan = batch.textures
            yaw = batch.instances.yaws[quads.index].astype(np.float32).view(np.int32).astype(np.int64)
            packed = yaw << 32 | quads.view << 8 | level
            unique, first, inverse = np.unique(packed, return_index=True, return_inverse=True)
            identity = (id(fan), batch.instances.gloss)
            keys = [(identity, key) for key in unique.tolist()]
            places, new = cache.places(keys, (fan.size >> level[first]).tolist())
            stale = np.array([self._lit.get(key) != lights.version for key in keys], bool) | new
            self.statistics["tiles"] += len(keys)
            if stale.any():
                chosen = np.flatnonzero(stale)
                work.append((batch, quads.take(first[chosen]), level[first[chosen]], places[chosen]))
                self._lit.update((keys[index], lights.version) for index in chosen)
            result.append(places[inverse])
        for item in work:
            self._relight_tiles(cache, lights, *item)
        return result

    def _relight_tiles(
        self,
        cache: TileCache,
        lights: LightTable,
        batch: Batch,
        quads: Quads,
        levels: NDArray[np.intp],
        places: NDArray[np.int32],
    ) -> None:
        fan = batch.textures
        self.statistics["relit"] += len(quads)
        for start in range(0, len(quads), self._colormaps.ROWS):
            part = slice(start, start + self._colormaps.ROWS)
            count = len(quads.index[part])
            rows = np.zeros(count, ROW_DTYPE)
            rows["row"], rows["basis"] = np.arange(count), quads.basis[part]
            rows["albedo"] = fan.albedo
            rows["gloss"] = batch.instances.gloss.strength, batch.instances.gloss.shininess
            self._colormaps.write(rows, lights, self._normals_for)
            tiles = np.zeros(count, TILE_DTYPE)
            tiles["place"][:, :3], tiles["place"][:, 3] = places[part], levels[part]
            tiles["origin"][:, :2] = fan.tile_origins(quads.view[part], levels[part])
            tiles["origin"][:, 2] = rows["row"]
            self._relight.draw(fan, tiles, self._colormaps.texture, cache, normals=self._normals_for is not None)

    def release(self) -> None:
        """Free everything this pass made."""
        for resource in (self._array, self._quads, self._corners, self._program, self._colormaps, self._relight):
            resource.release()
        if self._cache is not None:
            self._cache.release()
            self._cache = None


def _seen_quads(batch: Batch, viewer: Viewer) -> Quads:
    quads = quads_toward(batch.instances, viewer.eye)
    radius = batch.instances.fan.views.radius.max() * np.sqrt(2) * quads.scale
    return quads.take(viewer.sees(quads.origin, radius))


def _levels(batch: Batch, quads: Quads, viewer: Viewer) -> NDArray[np.intp]:
    """The coarsest mip level (N,) whose tile is not magnified by more than MAGNIFICATION on screen."""
    side = 2 * batch.instances.fan.views.radius[quads.view] * quads.scale * viewer.pixels_per_metre(quads.origin)
    ratio = batch.textures.size * MAGNIFICATION / np.maximum(side, 1e-3)
    return np.clip(np.floor(np.log2(ratio)), 0, batch.textures.levels - 1).astype(np.intp)


def _records(batch: Batch, quads: Quads, places: NDArray[np.int32]) -> NDArray[np.void]:
    fan = batch.instances.fan
    records = np.zeros(len(quads), QUAD_DTYPE)
    reach = fan.views.radius[quads.view][:, None]
    records["center"], records["right"], records["up"] = quads.center, quads.right * reach, quads.up * reach
    # Depth along the view's back counts toward the eye as far as the two agree.
    along = np.einsum("ni,ni->n", quads.basis[:, 2], quads.toward_eye)
    records["toward_eye"] = quads.toward_eye * along[:, None]
    left, top, right, bottom = fan.covered_rectangles[quads.view].T
    # One texel of the relit tile more on every side, for the filter.
    border = fan.size // np.maximum(places[:, 2], 1)
    edges = np.stack([left - border, fan.size - bottom - border, right + border, fan.size - top + border], axis=-1)
    records["rectangle"] = np.clip(edges, 0, fan.size) * (2 / fan.size) - 1
    records["place"] = places
    low, high = fan.views.depth_range[quads.view].T
    offset, slope_right, slope_up = fan.views.plane[quads.view].T
    depth = np.stack([low - offset, high - low, -slope_right * reach[:, 0], -slope_up * reach[:, 0]], axis=-1)
    records["depth"] = depth * quads.scale[:, None]
    return records


def _sight(viewer: Viewer) -> NDArray[np.float64]:
    """The direction (3,) in which things get farther away."""
    return -viewer.view_from_world[2, :3]
