"""A framebuffer of our own: pictures without a window."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.errors import GpuError, SettingsError
from runtime.gl.uploads import check_texture_size


class Offscreen:
    """A colour and depth buffer that may be supersampled.

    Parameters
    ----------
    ctx : moderngl.Context
    width, height : int
        Of the picture, in pixels.
    samples : int
        Samples along each side of a pixel: 1, 2, 4 or 8.

    Raises
    ------
    GpuError
        The GPU cannot hold a picture of that size.
    SettingsError
        Another number of samples, or a picture without pixels.
    """

    def __init__(self, ctx: moderngl.Context, width: int, height: int, samples: int = 1):
        if samples not in (1, 2, 4, 8):
            raise SettingsError("samples", f"{samples}; expected 1, 2, 4 or 8")
        if min(width, height) < 1:
            raise SettingsError("picture", f"{width}x{height} pixels; expected at least 1x1")
        check_texture_size(ctx, "picture", width * samples, height * samples)
        self._ctx = ctx
        self.width, self.height, self._level = width, height, samples.bit_length() - 1
        size = (width * samples, height * samples)
        try:
            self._color = ctx.texture(size, 4)
            if self._level:
                # Mip levels allotted after the framebuffer is made leave it drawing into the texture's old storage.
                self._color.build_mipmaps(max_level=self._level)
            self._depth = ctx.depth_texture(size)
            self.framebuffer = ctx.framebuffer([self._color], self._depth)
        except moderngl.Error as problem:
            raise GpuError("picture", f"no framebuffer of {size[0]}x{size[1]}: {problem}") from problem

    def clear(self, background: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)) -> None:
        """Bind the framebuffer and fill it; `background` is sRGB, premultiplied."""
        self.framebuffer.use()
        self.framebuffer.clear(*background, depth=1.0)

    def clear_depth(self) -> None:
        """Bind the framebuffer and let what is drawn next cover all that is there."""
        self.framebuffer.color_mask = (False, False, False, False)
        self.framebuffer.clear(depth=1.0)
        self.framebuffer.color_mask = (True, True, True, True)
        self.framebuffer.use()

    def color(self) -> NDArray[np.uint8]:
        """The picture, (height, width, 4) uint8, sRGB and premultiplied alpha, row 0 at the top."""
        if self._level:
            self._color.build_mipmaps(max_level=self._level)
        pixels = np.frombuffer(self._color.read(level=self._level), np.uint8)
        return pixels.reshape(self.height, self.width, 4)[::-1]

    def depth(self) -> NDArray[np.float32]:
        """The nearest depth in each pixel, (height, width) float32 in OpenGL's 0..1, 1 where nothing is drawn."""
        side = 1 << self._level
        samples = np.frombuffer(self._depth.read(), np.float32)
        blocks = samples.reshape(self.height, side, self.width, side)
        return blocks.min(axis=(1, 3))[::-1]

    def release(self) -> None:
        """Free the buffers."""
        if self._ctx.fbo is self.framebuffer:
            # moderngl would go on binding the released one.
            (self._ctx.screen or self._ctx.detect_framebuffer(0)).use()
        for resource in (self.framebuffer, self._color, self._depth):
            resource.release()
