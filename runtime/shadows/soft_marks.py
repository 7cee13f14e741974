"""Penumbras: of every place the points of a light's disc that are hidden from it, and how many these are."""

from __future__ import annotations

import moderngl

from runtime.gl.programs import load_program, set_uniforms
from runtime.gl.state import clear_bits, set_state
from runtime.shadows.bounds import CELL

Mask = tuple[bool, bool, bool, bool]


class SoftMarks:
    """A whole number a mark, each bit of which stands for points of one light's disc.

    Hard shadows from all points are drawn over each other into it, each into its own bits, so that what overlaps marks
    a point once; how many bits are set is the part of the light that is hidden.

    Parameters
    ----------
    ctx : moderngl.Context
    corners, cells : moderngl.Buffer
        Of the cells of the picture, as the shadow pass has them.
    """

    def __init__(self, ctx: moderngl.Context, corners: moderngl.Buffer, cells: moderngl.Buffer):
        self._ctx = ctx
        self._program = load_program(ctx, "shadow_resolve.vert", "shadow_resolve.frag")
        layout = [(corners, "2f", "corner"), (cells, "2f/i", "cell")]
        self._array = ctx.vertex_array(self._program, layout)
        self._bits: moderngl.Texture | None = None
        self._target: moderngl.Framebuffer | None = None

    def begin(self, width: int, height: int) -> None:
        """Draw into the bits from here on, of which none is set."""
        if self._bits is None or self._target is None or self._bits.size != (width, height):
            self._release_target()
            self._bits = self._ctx.texture((width, height), 1, dtype="u4")
            self._bits.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._target = self._ctx.framebuffer([self._bits])
        self._target.use()
        self._target.viewport = 0, 0, width, height
        set_state(color_mask=(True, True, True, True))
        clear_bits()
        set_state(merge_bits=True)

    def resolve(self, mask: Mask, first_row: int, count: int, squash: float) -> None:
        """Write the hidden part of the light into some channels of the bound marks.

        Parameters
        ----------
        mask : tuple of bool
            The channels.
        first_row : int
            Of the picture in the bound marks.
        count : int
            Of cells that may hold marks, the first in their buffer.
        squash : float
            Of a circle on the ground as it is seen.
        """
        assert self._bits is not None
        set_state(color_mask=mask)
        self._bits.use(0)
        width, height = self._bits.size
        texel = 2 / width, 2 / height
        set_uniforms(self._program, bits=0, first_row=first_row, squash=squash, side=CELL, texel=texel)
        self._array.render(moderngl.TRIANGLE_STRIP, instances=count)

    def _release_target(self) -> None:
        for resource in (self._target, self._bits):
            if resource is not None:
                resource.release()
        self._target = self._bits = None

    def release(self) -> None:
        """Free everything on the GPU."""
        self._release_target()
        self._array.release()
        self._program.release()
