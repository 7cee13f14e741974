"""Strips of fans' silhouettes on the GPU: steps 1 to 5 of the paper's shadow for every copy of a fan at once."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.fan import Fan
from impostor.lighting import DirectionalLight
from impostor.shadow_projection import FEET, LEVEL_CAMERA, Ground, ground_from_sight, strip_points
from impostor.strips import silhouette_strips
from impostor.views import rotation_about_y
from runtime.gl.programs import load_program, set_uniforms
from runtime.gl.uploads import InstanceBuffer
from runtime.instances.instances import Instances
from runtime.instances.quads import Quads, nearest_views, quads_toward
from runtime.shadows.bounds import box_corners
from runtime.shadows.soft_light import point_bits, source_points, step_at_metre
from runtime.viewing.viewer import Viewer

CASTER_DTYPE = np.dtype([("position_scale", "f4", (4,)), ("turn", "f4", (2,)), ("rows", "f4", (4, 4))])
SOFT_DTYPE = np.dtype([*CASTER_DTYPE.descr, ("toward_light", "f4", (3,)), ("step", "f4"), ("points", "u4")])
# Strips are cut from silhouettes whose texels are at most this large on screen.
LARGEST_TEXEL = 1.0  # pixels
SOFTENED_TEXEL = 2.0  # pixels, where many shadows of it are averaged
COARSEST_SIDE = 8  # texels


@dataclass(frozen=True, eq=False)
class CastingFan:
    """The copies of a fan that a viewer sees, as casters.

    Parameters
    ----------
    instances : Instances
    seen : Quads
    records : ndarray, (N,) CASTER_DTYPE
        Placement, and steps 3 to 5 in one matrix.
    pixels_per_texel : ndarray, (N,) float64
        Of the silhouette, on screen; 0 behind the camera.
    """

    instances: Instances
    seen: Quads
    records: NDArray[np.void]
    pixels_per_texel: NDArray[np.float64]

    @classmethod
    def of(
        cls,
        instances: Instances,
        viewer: Viewer,
        ground: Ground,
        fan_share: NDArray[np.float32] | None = None,
        stand: bool = True,
    ) -> CastingFan:
        """Set up for a viewer.

        Copies that are meshes, by their fan's share (N,), cast where their mesh would, and so do copies that do not
        stand on the ground.
        """
        seen = quads_toward(instances, viewer.eye)
        texel = 2 * instances.fan.views.radius.mean() / instances.fan.size * seen.scale
        pixels = texel * viewer.pixels_per_metre(seen.origin)
        records = _records(instances, seen)
        records["rows"] = _to_feet(instances, seen, viewer, ground) if stand else np.eye(4)
        if stand and fan_share is not None:
            share = fan_share.take(seen.index)[:, None, None]
            records["rows"] = share * records["rows"] + (1 - share) * np.eye(4, dtype=np.float32)
        return cls(instances, seen, records, pixels)

    def __len__(self) -> int:
        return len(self.seen)

    @property
    def feet(self) -> float:
        """Metres of a copy of scale 1, above 0; see `shadow_projection.above_feet`."""
        low, high = self.instances.fan.bounds[:, 1]
        # What lies flat is all feet.
        return max(FEET * float(high - low), 1e-6 * self.instances.fan.radius)

    def corners(self) -> NDArray[np.float64]:
        """World-space corners (N, 8, 3) of the copies' bounding boxes."""
        rotation = rotation_about_y(self.instances.yaws[self.seen.index])
        turned = np.einsum("nij,kj->nki", rotation, box_corners(*self.instances.fan.bounds))
        return self.instances.positions[self.seen.index][:, None] + self.seen.scale[:, None, None] * turned

    def levels(self, stretch: float, largest: float) -> NDArray[np.intp]:
        """How often (N,) each silhouette may be halved to texels of so many pixels.

        `stretch` is how much the light lengthens shadows.
        """
        size, most = self.instances.fan.size, 0
        while size >> most + 1 >= COARSEST_SIDE and size % (1 << most + 1) == 0:
            most += 1
        # What is behind the camera may cast its shadow right before it.
        on_screen = np.where(self.pixels_per_texel > 0, self.pixels_per_texel * stretch, largest)
        return np.clip(np.floor(np.log2(largest / on_screen)), 0, most).astype(np.intp)


class StripPass:
    """Draws the shadows of casting fans into the bound framebuffer, one light at a time.

    Parameters
    ----------
    ctx : moderngl.Context
    """

    memory_kind = "shadow strips"

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self._program = load_program(ctx, "shadow_strips.vert", "shadow_strips.frag")
        self._soft_program = load_program(ctx, "shadow_strips_soft.vert", "shadow_strips_soft.frag")
        self._casters, self._soft_casters = InstanceBuffer(ctx, CASTER_DTYPE), InstanceBuffer(ctx, SOFT_DTYPE)
        self._held: dict[tuple[int, int, int], tuple[Fan, _Strips | None]] = {}

    def begin(self, clip_from_world: NDArray[np.float64], light: DirectionalLight, ground: Ground) -> None:
        """Say where the fans that follow cast to."""
        place = {"clip_from_world": clip_from_world, "ground": tuple(ground.plane)}
        set_uniforms(self._program, **place, toward_light=light.toward)
        set_uniforms(self._soft_program, **place)

    def draw(self, fan: CastingFan, chosen: NDArray[np.intp], light: DirectionalLight, ground: Ground) -> None:
        """Draw the strips of some copies, one draw call for all that show the light the same view."""
        keys = _strip_keys(fan, chosen, np.array(light.toward), ground, LARGEST_TEXEL)
        set_uniforms(self._program, feet=fan.feet)
        self._draw_each(fan.instances.fan, keys, fan.records[chosen], soft=False)

    def draw_soft(
        self,
        fan: CastingFan,
        chosen: NDArray[np.intp],
        light: DirectionalLight,
        ground: Ground,
        counts: NDArray[np.intp],
        pixels: float,
    ) -> None:
        """Draw the bits of some copies, each from its own number of points of the light; else as `draw`.

        `pixels` is how many a metre at w = 1 takes.
        """
        keys, records = [], []
        for count in np.unique(counts).tolist():
            copies, step = chosen[counts == count], pixels * step_at_metre(light, ground, count)
            for toward, bits in zip(source_points(light, ground, count), point_bits(count), strict=True):
                keys.append(_strip_keys(fan, copies, toward, ground, SOFTENED_TEXEL))
                record = np.zeros(len(copies), SOFT_DTYPE)
                for name in CASTER_DTYPE.names or ():
                    record[name] = fan.records[name][copies]
                record["toward_light"], record["step"], record["points"] = toward, step, bits
                records.append(record)
        set_uniforms(self._soft_program, feet=fan.feet)
        self._draw_each(fan.instances.fan, np.concatenate(keys), np.concatenate(records), soft=True)

    def _draw_each(self, fan: Fan, keys: NDArray[np.intp], records: NDArray[np.void], soft: bool) -> None:
        order = np.argsort(keys, kind="stable")
        records, casters = records[order], self._soft_casters if soft else self._casters
        keys, first, count = np.unique(keys[order], return_index=True, return_counts=True)
        for key, start, number in zip(keys.tolist(), first.tolist(), count.tolist(), strict=True):
            strips = self._strips(fan, key >> 8, key & 0xFF)
            if strips is not None:
                casters.write(records[start : start + number])
                strips.array(soft).render(moderngl.TRIANGLES, instances=number)

    def _strips(self, fan: Fan, view: int, level: int) -> _Strips | None:
        """The strips of one view, cut when first asked for, or None where its silhouette is empty."""
        key = (id(fan), view, level)
        if key not in self._held:
            silhouette, depth = _halved(fan.silhouette[view], fan.depth[view], level)
            strips = silhouette_strips(silhouette)
            triangles = strips.triangles()
            held = None
            if len(triangles):
                points = strip_points(strips, fan.views[view], depth)
                programs = (self._program, self._casters), (self._soft_program, self._soft_casters)
                held = _Strips(self._ctx, programs, points, triangles)
            self._held[key] = (fan, held)
        return self._held[key][1]

    def forget(self, fan: Fan) -> None:
        """Free the strips of a fan."""
        for key in [key for key, held in self._held.items() if held[0] is fan]:
            strips = self._held.pop(key)[1]
            if strips is not None:
                strips.release()

    def release(self) -> None:
        """Free everything this pass made."""
        for fan in {id(held[0]): held[0] for held in self._held.values()}.values():
            self.forget(fan)
        for part in (self._casters, self._soft_casters, self._program, self._soft_program):
            part.release()


class _Strips:
    """The strips of one view on the GPU, for hard lights and, once there is one, for soft lights."""

    def __init__(
        self,
        ctx: moderngl.Context,
        programs: tuple[tuple[moderngl.Program, InstanceBuffer], ...],
        points: NDArray[np.float64],
        triangles: NDArray[np.int32],
    ):
        self._ctx, self._programs = ctx, programs
        self._points, self._triangles = ctx.buffer(points.astype("f4").tobytes()), ctx.buffer(triangles.tobytes())
        self._arrays: dict[bool, moderngl.VertexArray] = {}

    def array(self, soft: bool) -> moderngl.VertexArray:
        """For one of the programs."""
        if soft not in self._arrays:
            program, casters = self._programs[soft]
            names = ["position_scale", "turn", "row0", "row1", "row2", "row3"] + [
                "toward_light",
                "step_at_metre",
                "points",
            ] * soft
            records = (casters.buffer, "4f 2f 4f 4f 4f 4f" + " 3f 1f 1u" * soft + "/i", *names)
            layout = [(self._points, "3f", "point"), records]
            self._arrays[soft] = self._ctx.vertex_array(program, layout, self._triangles)
        return self._arrays[soft]

    def release(self) -> None:
        for resource in (*self._arrays.values(), self._points, self._triangles):
            resource.release()


def _strip_keys(
    fan: CastingFan, chosen: NDArray[np.intp], toward: NDArray[np.float64], ground: Ground, largest: float
) -> NDArray[np.intp]:
    """Which strips some copies cast toward a light: the nearest view in the upper bits, its level below."""
    toward = toward / np.linalg.norm(toward)
    views = nearest_views(fan.instances, np.append(toward, 0.0), fan.seen.index[chosen])
    return views << 8 | fan.levels(1 / float(ground.normal @ toward), largest)[chosen]


def _halved(
    silhouette: NDArray[np.bool_], depth: NDArray[np.uint16], level: int
) -> tuple[NDArray[np.bool_], NDArray[np.uint16]]:
    """A silhouette and its depth with texels 2^level as large, at the depth of what they hold.

    A texel counts from a quarter of it on: outlines run through texel centres, and so the area stays.
    """
    if level == 0:
        return silhouette, depth
    side = 1 << level
    shape = (len(silhouette) >> level, side, len(silhouette) >> level, side)
    covered = silhouette.reshape(shape).sum(axis=(1, 3))
    total = np.where(silhouette, depth, np.uint16(0)).reshape(shape).sum(axis=(1, 3), dtype=np.uint64)
    return 4 * covered > side * side, (total // np.maximum(covered, 1)).astype(np.uint16)


def _records(instances: Instances, seen: Quads) -> NDArray[np.void]:
    """Placement (N,) CASTER_DTYPE of many instances; their rows are still to be set."""
    casters = np.zeros(len(seen), CASTER_DTYPE)
    yaws = instances.yaws[seen.index]
    casters["position_scale"][:, :3] = instances.positions[seen.index]
    casters["position_scale"][:, 3] = seen.scale
    casters["turn"] = np.stack([np.cos(yaws), np.sin(yaws)], axis=-1)
    return casters


def _to_feet(instances: Instances, seen: Quads, viewer: Viewer, ground: Ground) -> NDArray[np.float64]:
    """`shadow_projection.viewer_ground_from_ground` of many instances at once, (N, 4, 4)."""
    views = instances.fan.views
    plane_from_world = np.zeros((len(seen), 3, 4))
    plane_from_world[:, :, :3] = seen.basis
    plane_from_world[:, :, 3] = -np.einsum("nij,nj->ni", seen.basis, seen.origin)
    if np.isfinite(views.distance):
        eye_distance = views.distance * seen.scale
        plane_from_world[:, :2] *= eye_distance[:, None, None]
        plane_from_world[:, 2] *= -1
        plane_from_world[:, 2, 3] += eye_distance
    else:
        plane_from_world[:, 2] = [0, 0, 0, 1]
    world_from_plane = np.zeros((len(seen), 4, 3))
    # Plane coordinates are world metres here, the quad's axes are for metres of the view.
    right, up = seen.right / seen.scale[:, None], seen.up / seen.scale[:, None]
    world_from_plane[:, :3] = np.stack([right, up, seen.center], axis=-1)
    world_from_plane[:, 3, 2] = 1
    level = np.abs(seen.basis[:, 2] @ ground.normal) < LEVEL_CAMERA
    rows = ground_from_sight(viewer.eye, ground) @ world_from_plane @ plane_from_world
    below = seen.origin - (seen.origin @ ground.normal - ground.offset)[:, None] * ground.normal
    w = np.einsum("ni,ni->n", rows[:, 3, :3], below) + rows[:, 3, 3]
    beyond = w <= 0
    rows /= np.where(beyond, 1, w)[:, None, None]
    rows[level | beyond] = np.eye(4)
    return rows
