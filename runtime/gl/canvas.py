"""What a walk is drawn into: a smooth picture, whose colour and depth are textures in the end."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.errors import GpuError, SettingsError
from runtime.gl.uploads import check_texture_size


class Canvas:
    """A multisampled framebuffer and the textures that it is resolved to.

    Parameters
    ----------
    ctx : moderngl.Context
    width, height : int
        Pixels.
    samples : int
        Of every pixel; the GPU's limit holds. 1 is no multisampling.

    Attributes
    ----------
    framebuffer : moderngl.Framebuffer
        To draw into.
    color, depth : moderngl.Texture
        What was drawn, after `resolve`.

    Raises
    ------
    GpuError
        The GPU cannot hold a picture of that size.
    SettingsError
        A picture without pixels.
    """

    memory_kind = "picture"

    def __init__(self, ctx: moderngl.Context, width: int, height: int, samples: int = 1):
        if min(width, height) < 1:
            raise SettingsError("picture", f"{width}x{height} pixels; expected at least 1x1")
        check_texture_size(ctx, "picture", width, height)
        self._ctx, self.size = ctx, (width, height)
        samples = min(samples, ctx.max_samples)
        try:
            self.color, self.depth = ctx.texture(self.size, 4), ctx.depth_texture(self.size)
            self.depth.compare_func = ""
            self._resolved = ctx.framebuffer([self.color], self.depth)
            self._buffers: list[moderngl.Renderbuffer] = []
            self.framebuffer = self._resolved
            if samples > 1:
                color = ctx.renderbuffer(self.size, samples=samples)
                self._buffers = [color, ctx.depth_renderbuffer(self.size, samples=samples)]
                self.framebuffer = ctx.framebuffer(self._buffers[:1], self._buffers[1])
        except moderngl.Error as problem:
            raise GpuError("picture", f"no framebuffer of {width}x{height}: {problem}") from problem

    def clear(self, background: tuple[float, float, float, float]) -> None:
        """Bind the framebuffer and fill it; `background` is sRGB, premultiplied."""
        self.framebuffer.use()
        self.framebuffer.clear(*background, depth=1.0)

    def resolve(self) -> None:
        """Bring what was drawn into the textures."""
        if self.framebuffer is not self._resolved:
            self._ctx.copy_framebuffer(self._resolved, self.framebuffer)

    def use_resolved(self) -> None:
        """Bind the framebuffer of the textures, to draw over the picture pixel by pixel."""
        self._resolved.use()

    def pixels(self) -> NDArray[np.uint8]:
        """The resolved picture, (height, width, 3) uint8, sRGB, row 0 at the top."""
        width, height = self.size
        found = np.frombuffer(self._resolved.read(components=3, alignment=1), np.uint8)
        return found.reshape(height, width, 3)[::-1]

    def release(self) -> None:
        """Free everything."""
        if self._ctx.fbo in (self.framebuffer, self._resolved):
            # moderngl would go on binding the released one.
            (self._ctx.screen or self._ctx.detect_framebuffer(0)).use()
        if self.framebuffer is not self._resolved:
            self.framebuffer.release()
        for resource in (self._resolved, *self._buffers, self.color, self.depth):
            resource.release()
