"""Marks: where each light is kept from a receiver, as one viewer sees it.

The marks are textures of our own, one light a channel, and do what a stencil would: overlapping strips mark a pixel
once. moderngl makes no framebuffer with a stencil, so few callers have one; and all lights are marked before the
receiver is darkened, so that each takes away just the light it gave. The channel of a light with a softness holds how
much of it is hidden. Contact shadows have a channel as if they were one light more.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.fan import Fan
from impostor.lighting import DirectionalLight
from impostor.shadow_projection import Ground
from runtime.gl.state import clear_color, set_state
from runtime.gl.uploads import CORNERS, InstanceBuffer, check_texture_size
from runtime.lights.contact_settings import ContactShadows
from runtime.meshes.copies import MeshCopies
from runtime.shadows.bounds import covered_cells
from runtime.shadows.casters import Casters
from runtime.shadows.contact import ContactPass
from runtime.shadows.meshes import MeshShadowPass
from runtime.shadows.soft_light import penumbra_pixels, points_affordable, points_needed, source_rim
from runtime.shadows.soft_marks import Mask, SoftMarks
from runtime.shadows.strips import StripPass
from runtime.viewing.viewer import Viewer

CHANNELS = 4
CELL_DTYPE = np.dtype([("cell", "f4", (2,))])


class Mark(NamedTuple):
    """What is marked in one channel, and its part (3,) of the linear light on the receiver."""

    source: DirectionalLight | ContactShadows
    share: NDArray[np.float64]

    @property
    def key(self) -> tuple[object, ...]:
        """Equal for two whose marks are the same."""
        if isinstance(self.source, ContactShadows):
            return ("contact", self.source.reach)
        soft = self.source.softness
        return (self.source.toward, soft, float(self.share.max()) if soft else 0.0)


class Marks:
    """The marks on one receiver.

    Marks of four lights stand in each picture, pictures on top of each other in one texture.

    Parameters
    ----------
    ctx : moderngl.Context

    Attributes
    ----------
    texture : moderngl.Texture
        Once there are some. Marks lie on the corners of pixels, so that one bilinear fetch averages the four around a
        pixel's centre.
    cells : ndarray, (N,) CELL_DTYPE
        Of the picture: those that hold marks.
    frame : tuple, optional
        Equal for frames that hold the same marks.
    """

    memory_kind = "shadow marks"

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self.texture: moderngl.Texture | None = None
        self.target: moderngl.Framebuffer | None = None
        self.cells = np.zeros(0, CELL_DTYPE)
        self.frame: tuple[object, ...] | None = None

    def fit(self, viewer: Viewer, lights: int) -> moderngl.Framebuffer:
        """A framebuffer for so many lights.

        Raises
        ------
        GpuError
            The GPU has no textures of that size.
        """
        width, height = viewer.size
        pictures, channels = -(-lights // CHANNELS), 1 if lights == 1 else CHANNELS
        size = (width + 1, (height + 1) * pictures)
        held = None if self.texture is None else (self.texture.size, self.texture.components)
        if self.target is None or held != (size, channels):
            self.release()
            check_texture_size(self._ctx, f"shadows of {lights} lights", *size)
            self.texture = self._ctx.texture(size, channels)
            self.texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            self.texture.repeat_x = self.texture.repeat_y = False
            self.target = self._ctx.framebuffer([self.texture])
        return self.target

    def release(self) -> None:
        """Free what is on the GPU."""
        for resource in (self.target, self.texture):
            if resource is not None:
                resource.release()
        self.target = self.texture = self.frame = None


class MarkPass:
    """Draws marks.

    Parameters
    ----------
    ctx : moderngl.Context
    """

    memory_kind = "shadow marks"

    def __init__(self, ctx: moderngl.Context):
        self._strips, self._meshes, self._contacts = StripPass(ctx), MeshShadowPass(ctx), ContactPass(ctx)
        self._corners, self._cells = ctx.buffer(CORNERS), InstanceBuffer(ctx, CELL_DTYPE)
        self._soft_marks = SoftMarks(ctx, self._corners, self._cells.buffer)

    def draw(
        self, on: Marks, sources: Sequence[Mark], casters: Sequence[Casters], viewer: Viewer, ground: Ground
    ) -> None:
        """Mark where each light is kept from a receiver, and find the cells of the picture that hold marks."""
        width, height = viewer.size
        target = on.fit(viewer, len(sources))
        target.use()
        set_state(color_mask=(True, True, True, True))
        clear_color()
        on_corners = np.diag([width / (width + 1), height / (height + 1), 1.0, 1.0]) @ viewer.clip_from_world
        hulls = []
        for index, mark in enumerate(sources):
            first_row = index // CHANNELS * (height + 1)
            target.viewport = 0, first_row, width + 1, height + 1
            mask = _channel_mask(index % CHANNELS)
            set_state(color_mask=mask)
            if isinstance(mark.source, ContactShadows):
                standing = [each for each in casters if each.stand]
                hulls += self._contacts.draw(standing, on_corners, viewer, ground, mark.source)
                continue
            for part in (self._strips, self._meshes):
                part.begin(on_corners, mark.source, ground)
            if mark.source.softness:
                hulls += self._mark_soft(target, casters, viewer, mark, ground, first_row, mask)
            else:
                hulls += self._mark_hard(casters, mark.source, ground)
        on.cells = _cells(hulls, viewer)

    def _mark_hard(
        self, casters: Sequence[Casters], light: DirectionalLight, ground: Ground
    ) -> list[NDArray[np.float64]]:
        """Draw shadows into the bound channel; gives their hulls."""
        hulls = []
        for each in casters:
            chosen, hull = each.shadows([light])
            if len(chosen):
                self._drawing(each).draw(each.copies, chosen, light, ground)
                hulls.append(hull)
        return hulls

    def _mark_soft(
        self,
        target: moderngl.Framebuffer,
        casters: Sequence[Casters],
        viewer: Viewer,
        mark: Mark,
        ground: Ground,
        first_row: int,
        channel: Mask,
    ) -> list[NDArray[np.float64]]:
        """Draw how much of a light is hidden into the bound channel; gives the hulls of the shadows."""
        light, casting = mark.source, []
        assert isinstance(light, DirectionalLight)
        rim = source_rim(light, ground)
        for each in casters:
            chosen, hull = each.shadows(rim)
            if len(chosen):
                penumbra = penumbra_pixels(each.corners[chosen], light, ground, viewer)
                most = points_affordable(each.triangles * len(chosen))
                casting.append((each, chosen, points_needed(penumbra, float(mark.share.max()), most), hull))
        soft = [
            (each, chosen[points > 1], points[points > 1], hull[points > 1])
            for each, chosen, points, hull in casting
            if (points > 1).any()
        ]
        if soft:
            self._resolve_soft(target, soft, viewer, light, ground, first_row, channel)
        for each, chosen, points, _ in casting:
            if (points == 1).any():
                self._drawing(each).draw(each.copies, chosen[points == 1], light, ground)
        return [hull for *_, hull in casting]

    def _resolve_soft(
        self,
        target: moderngl.Framebuffer,
        casting: Sequence[tuple[Casters, NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]],
        viewer: Viewer,
        light: DirectionalLight,
        ground: Ground,
        first_row: int,
        channel: Mask,
    ) -> None:
        """Draw copies that cast from several points each: casters, which copies, from how many, and their hulls."""
        width, height = viewer.size
        self._soft_marks.begin(width + 1, height + 1)
        pixels = height / 2 * abs(viewer.clip_from_view[1, 1])
        for each, chosen, points, _ in casting:
            set_state(merge_bits=True)
            self._drawing(each).draw_soft(each.copies, chosen, light, ground, points, pixels)
        target.use()
        cells = _cells([hull for *_, hull in casting], viewer)
        self._cells.write(cells)
        squash = abs(float(viewer.view_from_world[2, :3] @ ground.normal))
        self._soft_marks.resolve(channel, first_row, len(cells), squash)

    def _drawing(self, casters: Casters) -> Any:
        return self._meshes if isinstance(casters.copies, MeshCopies) else self._strips

    def forget(self, fan: Fan) -> None:
        """Free what was made for a fan."""
        self._strips.forget(fan)
        self._contacts.forget(fan)

    def release(self) -> None:
        """Free everything this pass made."""
        for part in (self._strips, self._meshes, self._contacts, self._soft_marks, self._corners, self._cells):
            part.release()


def _channel_mask(channel: int) -> Mask:
    return channel == 0, channel == 1, channel == 2, channel == 3


def _cells(hulls: Sequence[NDArray[np.float64]], viewer: Viewer) -> NDArray[np.void]:
    """The cells of the picture that shadows may touch."""
    cells = [covered_cells(hull, *viewer.size) for hull in hulls]
    found = np.unique(np.concatenate(cells), axis=0) if cells else np.zeros((0, 2))
    records = np.zeros(len(found), CELL_DTYPE)
    records["cell"] = found
    return records
