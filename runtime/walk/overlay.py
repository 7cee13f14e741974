"""What lies over the picture: text, the divider of a split screen, and the view of distances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from runtime.gl.programs import load_program, set_uniforms
from runtime.gl.state import preserved_state, set_state
from runtime.gl.uploads import CORNERS

PAPER, INK = (14, 17, 22, 190), (240, 240, 236, 255)
PADDING, LEADING = 0.6, 1.35  # in font sizes

Row = str | tuple[str, str]
"""A line of text, or what stands in two columns."""


@dataclass(frozen=True)
class Panel:
    """Text on a dark, translucent ground.

    Parameters
    ----------
    rows : tuple of str or (str, str)
    place : tuple of float
        In the picture: (0, 0) is its top left, (1, 1) its bottom right.
    offset : tuple of int
        Pixels from there.
    anchor : tuple of float, optional
        What of the panel lies there, likewise; as `place` if left out. A panel never leaves the picture.
    """

    rows: tuple[Row, ...]
    place: tuple[float, float] = (0.0, 0.0)
    offset: tuple[int, int] = (0, 0)
    anchor: tuple[float, float] | None = None


def panel_picture(rows: Sequence[Row], font_size: int) -> NDArray[np.uint8]:
    """Text as a picture.

    Parameters
    ----------
    rows : sequence of str or (str, str)
    font_size : int
        Pixels.

    Returns
    -------
    ndarray, (H, W, 4) uint8
        sRGB, premultiplied by alpha.
    """
    font = ImageFont.load_default(font_size)
    padding, step = round(PADDING * font_size), round(LEADING * font_size)
    columns = [row for row in rows if not isinstance(row, str)]
    gap = max((font.getlength(left) for left, _ in columns), default=0) + 1.2 * font_size
    widths = [gap + font.getlength(row[1]) if not isinstance(row, str) else font.getlength(row) for row in rows]
    size = round(max(widths, default=0)) + 2 * padding, step * len(rows) + 2 * padding
    image = Image.new("RGBA", size, PAPER)
    draw = ImageDraw.Draw(image)
    for number, row in enumerate(rows):
        parts = [(0.0, row)] if isinstance(row, str) else [(0.0, row[0]), (gap, row[1])]
        for across, text in parts:
            draw.text((padding + across, padding + number * step), text, INK, font)
    pixels = np.asarray(image, np.float32)
    pixels = np.concatenate([pixels[..., :3] * (pixels[..., 3:] / 255), pixels[..., 3:]], axis=-1)
    return np.rint(pixels).astype(np.uint8)


class Overlay:
    """Draws over whatever the bound framebuffer shows, and leaves the OpenGL state as it was.

    Parameters
    ----------
    ctx : moderngl.Context
    """

    memory_kind = "picture"

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self._program = load_program(ctx, "overlay.vert", "overlay.frag")
        self._distance_program = load_program(ctx, "overlay.vert", "distance.frag")
        self._corners = ctx.buffer(CORNERS)
        self._array, self._distance_array = (
            ctx.vertex_array(program, [(self._corners, "2f", "corner")])
            for program in (self._program, self._distance_program)
        )
        self._white = ctx.texture((1, 1), 4, b"\xff\xff\xff\xff")
        self._black = ctx.texture((1, 1), 4, b"\x00\x00\x00\xff")
        self._texts: dict[tuple[int, tuple[Row, ...]], moderngl.Texture] = {}

    def draw_panels(self, size: tuple[int, int], panels: Sequence[Panel], font_size: int) -> None:
        """Draw text; a picture of each panel is kept while it is shown.

        Parameters
        ----------
        size : tuple of int
            Of the picture, pixels.
        panels : sequence of Panel
        font_size : int
            Pixels.
        """
        wanted = {(font_size, panel.rows): panel for panel in panels}
        for key in self._texts.keys() - wanted:
            self._texts.pop(key).release()
        for key, panel in wanted.items():
            if key not in self._texts:
                pixels = panel_picture(panel.rows, font_size)
                self._texts[key] = self._ctx.texture(pixels.shape[1::-1], 4, pixels.tobytes())
                self._texts[key].filter = moderngl.NEAREST, moderngl.NEAREST
            texture = self._texts[key]
            left, top = (
                max(min(round(place * whole - anchor * part) + offset, whole - part), 0)
                for place, anchor, whole, part, offset in zip(
                    panel.place, panel.anchor or panel.place, size, texture.size, panel.offset, strict=True
                )
            )
            self._rectangle(texture, size, (left, top, *texture.size))

    def draw_divider(self, size: tuple[int, int], column: int) -> None:
        """Draw a vertical line whose left edge is at a column of pixels."""
        height = size[1]
        self._rectangle(self._black, size, (column - 1, 0, 4, height))
        self._rectangle(self._white, size, (column, 0, 2, height))
        self._rectangle(self._black, size, (column - 5, height // 2 - 19, 12, 38))
        self._rectangle(self._white, size, (column - 4, height // 2 - 18, 10, 36))

    def draw_picture(self, size: tuple[int, int], picture: moderngl.Texture) -> None:
        """Fill the framebuffer with what OpenGL drew into a texture."""
        self._rectangle(picture, size, (0, 0, *size), bottom_up=True)

    def draw_distances(
        self, size: tuple[int, int], depth: moderngl.Texture, clip_from_view: NDArray[np.float64], half_grey: float
    ) -> None:
        """Fill the framebuffer with greys: white at the eye, half grey so many metres away, black far off.

        `depth` is a perspective camera's, whose projection is `clip_from_view`, (4, 4) float64.
        """
        with preserved_state(self._ctx):
            set_state()
            depth.use(0)
            set_uniforms(
                self._distance_program,
                depth=0,
                unproject=(clip_from_view[2, 2], clip_from_view[2, 3]),
                half_grey=half_grey,
                screen=size,
                rectangle=(0, 0, *size),
            )
            self._distance_array.render(moderngl.TRIANGLE_STRIP)

    def _rectangle(
        self,
        texture: moderngl.Texture,
        size: tuple[int, int],
        rectangle: tuple[float, float, float, float],
        bottom_up: bool = False,
    ) -> None:
        with preserved_state(self._ctx):
            set_state(blend=(moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA))
            texture.use(0)
            set_uniforms(self._program, picture=0, bottom_up=bottom_up, screen=size, rectangle=rectangle)
            self._array.render(moderngl.TRIANGLE_STRIP)

    def release(self) -> None:
        """Free everything."""
        for texture in self._texts.values():
            texture.release()
        self._texts.clear()
        for resource in (self._array, self._distance_array, self._corners, self._white, self._black):
            resource.release()
        for program in (self._program, self._distance_program):
            program.release()
