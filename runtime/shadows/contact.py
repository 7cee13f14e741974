"""Contact shadows: the darkening around the feet of what stands on or near the ground."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.fan import Fan
from impostor.shadow_projection import Ground
from impostor.views import rotation_about_y
from runtime.gl.programs import load_program, set_uniforms
from runtime.gl.state import set_state
from runtime.gl.uploads import CORNERS, InstanceBuffer
from runtime.lights.contact_settings import ContactShadows
from runtime.meshes.buffers import MeshBuffers
from runtime.meshes.copies import MeshCopies
from runtime.shadows.bounds import in_view
from runtime.shadows.casters import Casters
from runtime.shadows.footprints import LIFTS, SIDE, Footprint, fan_footprint, model_footprint
from runtime.shadows.strips import CastingFan
from runtime.viewing.viewer import Viewer

ONE, ONE_MINUS_SOURCE_COLOR = 1, 0x0301
CONTACT_DTYPE = np.dtype(
    [("origin", "f4", (3,)), ("along_u", "f4", (3,)), ("along_v", "f4", (3,)), ("lift", "f4"), ("rows", "f4", (4, 4))]
)
TURNS = 12  # steps of the up direction between which a mesh keeps its footprint
MOST_FOOTPRINTS = 64  # of one mesh, each turned another way


class _Placed(NamedTuple):
    """Copies that share a footprint."""

    footprint: Footprint
    texture: moderngl.Texture
    which: NDArray[np.intp]
    """(N,): of all copies."""
    positions: NDArray[np.float64]
    """(N, 3): of the model's origin."""
    axes: NDArray[np.float64]
    """(N, 3, 3): rows of one metre of the model along u, up and v."""
    rows: NDArray[np.floating]
    """(N, 4, 4): from the ground to where the viewer sees it."""


class ContactPass:
    """Draws how much light is kept from the ground around the feet of objects, one draw call a fan or turned mesh.

    Parameters
    ----------
    ctx : moderngl.Context
    """

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self._program = load_program(ctx, "contact_shadow.vert", "contact_shadow.frag")
        self._corners, self._records = ctx.buffer(CORNERS), InstanceBuffer(ctx, CONTACT_DTYPE)
        names = ("origin", "along_u", "along_v", "lift", "row0", "row1", "row2", "row3")
        layout = [(self._corners, "2f", "corner"), (self._records.buffer, "3f 3f 3f 1f 4f 4f 4f 4f/i", *names)]
        self._array = ctx.vertex_array(self._program, layout)
        self._held: dict[tuple[object, ...], tuple[Fan | MeshBuffers, Footprint, moderngl.Texture]] = {}
        self._reach = 0.0

    def draw(
        self,
        groups: Sequence[Casters],
        clip_from_world: NDArray[np.float64],
        viewer: Viewer,
        ground: Ground,
        settings: ContactShadows,
    ) -> list[NDArray[np.float64]]:
        """Draw into the bound channel, where several meet by what each leaves of the light; gives the hulls.

        Parameters
        ----------
        groups : sequence of Casters
        clip_from_world : ndarray, (4, 4) float64
            Of the channel.
        viewer : Viewer
        ground : Ground
        settings : ContactShadows
        """
        hulls = []
        if settings.reach != self._reach:
            self._drop(list(self._held))
            self._reach = settings.reach
        set_uniforms(self._program, clip_from_world=clip_from_world, footprint=0)
        self._keep_meshes([group.copies.buffers for group in groups if isinstance(group.copies, MeshCopies)])
        for group in groups:
            for placed in self._placed(group.copies, ground, settings.reach):
                records = _records(placed, ground)
                hull = _hulls(records, viewer.clip_from_world)
                near = group.in_front[placed.which] & (records["lift"] < 1)
                chosen = np.flatnonzero(near & in_view(hull))
                if len(chosen):
                    set_state(blend=(ONE, ONE_MINUS_SOURCE_COLOR))
                    placed.texture.use(0)
                    self._records.write(records[chosen])
                    self._array.render(moderngl.TRIANGLE_STRIP, instances=len(chosen))
                    hulls.append(hull[chosen])
        return hulls

    def _placed(self, copies: CastingFan | MeshCopies, ground: Ground, reach: float) -> Iterator[_Placed]:
        """One at a time: the footprint of one may push out that of another, which is drawn by then."""
        if isinstance(copies, CastingFan):
            fan, index = copies.instances.fan, copies.seen.index
            held = self._footprint((id(fan),), fan, partial(fan_footprint, fan, reach))
            axes = copies.seen.scale[:, None, None] * rotation_about_y(copies.instances.yaws[index]).swapaxes(1, 2)
            positions, every = copies.instances.positions[index], np.arange(len(index))
            yield _Placed(*held, every, positions, axes, copies.records["rows"])
            return
        linear = copies.world_from_model[:, :3, :3]
        up = ground.normal @ linear
        turns, of_each = np.unique(
            np.rint(up / np.linalg.norm(up, axis=1)[:, None] * TURNS), axis=0, return_inverse=True
        )
        for number, turn in enumerate(turns):
            which, axes = np.flatnonzero(of_each.ravel() == number), _axes_about(turn)
            make = partial(model_footprint, copies.buffers.model, axes, reach)
            held = self._footprint((id(copies.buffers), *turn.tolist()), copies.buffers, make)
            turned = (linear[which] @ axes.T).swapaxes(1, 2)
            rows = np.broadcast_to(np.eye(4), (len(which), 4, 4))
            yield _Placed(*held, which, copies.world_from_model[which, :3, 3], turned, rows)

    def _footprint(
        self, key: tuple[object, ...], owner: Fan | MeshBuffers, make: Callable[[], Footprint]
    ) -> tuple[Footprint, moderngl.Texture]:
        """A footprint and its texture, made when first asked for."""
        if key not in self._held:
            mine = [other for other, held in self._held.items() if held[0] is owner]
            if len(mine) >= MOST_FOOTPRINTS:
                self._drop(mine)
            footprint = make()
            texture = self._ctx.texture((SIDE, SIDE), LIFTS, footprint.hidden.tobytes())
            texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            texture.repeat_x = texture.repeat_y = False
            self._held[key] = owner, footprint, texture
        return self._held[key][1:]

    def _drop(self, keys: Iterable[tuple[object, ...]]) -> None:
        for key in keys:
            self._held.pop(key)[2].release()

    def _keep_meshes(self, buffers: Sequence[MeshBuffers]) -> None:
        """Free what was made for other meshes."""
        kept = {id(each) for each in buffers}
        self._drop(
            [key for key, held in self._held.items() if isinstance(held[0], MeshBuffers) and id(held[0]) not in kept]
        )

    def forget(self, fan: Fan) -> None:
        """Free what was made for a fan."""
        self._drop([key for key, held in self._held.items() if held[0] is fan])

    def release(self) -> None:
        """Free everything this pass made."""
        self._drop(list(self._held))
        for part in (self._array, self._corners, self._records, self._program):
            part.release()


def _records(placed: _Placed, ground: Ground) -> NDArray[np.void]:
    """The rectangles on the ground, (N,) CONTACT_DTYPE."""
    footprint, (u, up, v) = placed.footprint, placed.axes.swapaxes(0, 1)
    base = placed.positions + footprint.base * up
    middle = (footprint.low + footprint.high) / 2
    height = (base + middle[0] * u + middle[1] * v) @ ground.normal - ground.offset
    records = np.zeros(len(base), CONTACT_DTYPE)
    records["lift"] = np.maximum(height, 0) / (footprint.reach * np.linalg.norm(up, axis=1))
    corner = base + footprint.low[0] * u + footprint.low[1] * v
    records["origin"] = corner - (corner @ ground.normal - ground.offset)[:, None] * ground.normal
    size = footprint.high - footprint.low
    records["along_u"], records["along_v"] = (
        length * (axis - (axis @ ground.normal)[:, None] * ground.normal)
        for length, axis in zip(size, (u, v), strict=True)
    )
    records["rows"] = placed.rows
    return records


def _hulls(records: NDArray[np.void], clip_from_world: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners (N, 4, 4) of the rectangles as they are seen, clip space."""
    corners = np.ones((len(records), 4, 4))
    for corner, (u, v) in enumerate(CORNERS.tolist()):
        corners[:, corner, :3] = records["origin"] + u * records["along_u"] + v * records["along_v"]
    return corners @ (clip_from_world @ records["rows"].astype(float)).swapaxes(1, 2)


def _axes_about(up: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors u, up and v, (3, 3): about +Y they are +X, +Y and +Z."""
    aside = np.eye(3)[2 if abs(up[2]) < 0.9 * np.linalg.norm(up) else 0]
    u = np.cross(up, aside)
    axes = np.stack([u, up, np.cross(u, up)])
    return axes / np.linalg.norm(axes, axis=1)[:, None]
