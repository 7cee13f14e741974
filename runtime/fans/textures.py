"""A fan on the GPU: three atlases with mip levels, and the numbers the passes need."""

from __future__ import annotations

from functools import cached_property

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.environment.colormap import surface_points
from impostor.fan import Fan
from impostor.files.fan_manifest import atlas_grid
from impostor.srgb import linear_from_srgb, srgb_from_linear
from runtime.gl.uploads import SRGB8_ALPHA8, check_texture_size, tiles_to_atlas

LINEAR_FROM_BYTE = linear_from_srgb(np.arange(256) / 255).astype(np.float32)


class FanTextures:
    """The layers of one fan as textures.

    Parameters
    ----------
    ctx : moderngl.Context
    fan : Fan

    Attributes
    ----------
    normal : moderngl.Texture
        Red is the normal code over 255, green the coverage; one mip level for each level of the fan.
    color : moderngl.Texture or None
        sRGB, premultiplied by coverage; None where the fan has one albedo.
    depth : moderngl.Texture
        16-bit normalised, level 0 only.
    """

    memory_kind = "fans"

    def __init__(self, ctx: moderngl.Context, fan: Fan):
        self._ctx, self.fan = ctx, fan
        self.size = fan.size
        # OpenGL rounds a level's size down, which tears tiles apart whose size is odd.
        self.levels = 1
        while self.levels < len(fan.normal) and fan.size % (1 << self.levels) == 0:
            self.levels += 1
        self.columns, rows = atlas_grid(len(fan.views))
        width, height = self.columns * fan.size, rows * fan.size
        check_texture_size(ctx, fan.name, width, height)
        coverage = fan.color[..., 3]
        self.normal = ctx.texture((width, height), 2)
        self.normal.build_mipmaps(max_level=max(self.levels - 1, 1))
        for level, codes in enumerate(fan.normal[: self.levels]):
            self.normal.write(tiles_to_atlas(np.stack([codes, coverage], axis=-1)).tobytes(), level=level)
            coverage = _halved(coverage)
        self.normal.filter = (moderngl.NEAREST_MIPMAP_NEAREST, moderngl.NEAREST)
        self.depth = ctx.texture((width, height), 1, tiles_to_atlas(fan.depth).tobytes(), dtype="nu2", alignment=2)
        self.depth.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.color = None
        self.albedo = np.ones(4, np.float32)
        if fan.uniform_albedo is None:
            pixels = tiles_to_atlas(_premultiplied(fan.color)).tobytes()
            self.color = ctx.texture((width, height), 4, pixels, internal_format=SRGB8_ALPHA8)
            self.color.build_mipmaps()
            self.albedo[3] = 0
        else:
            self.albedo[:3] = LINEAR_FROM_BYTE[fan.uniform_albedo]

    @property
    def one_texture(self) -> bool:
        """Whether the colormap holds finished colours (the paper's uniform-albedo path)."""
        return self.color is None

    @cached_property
    def points(self) -> moderngl.Texture:
        """Of a fan that mirrors its surroundings: `surface_points`, a row for each view."""
        texels = np.pad(surface_points(self.fan), ((0, 0), (0, 0), (0, 1)))
        texture = self._ctx.texture(texels.shape[1::-1], 4, texels.tobytes(), dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return texture

    @cached_property
    def rectangles(self) -> NDArray[np.float64]:
        """What each view covers of its tile at each level, (levels x views, 4): left, bottom, right, top of -1 to 1."""
        left, top, right, bottom = self.fan.covered_rectangles.T
        edges = np.stack([left, self.size - bottom, right, self.size - top], axis=-1)
        # One texel more on every side, for the filter.
        borders = np.multiply.outer(1 << np.arange(self.levels), (-1, -1, 1, 1))
        return np.clip(edges + borders[:, None], 0, self.size).reshape(-1, 4) * (2 / self.size) - 1

    @cached_property
    def depth_lines(self) -> NDArray[np.float64]:
        """How far in front of each view's quad its surface lies, for a scale of 1, (V, 4): metres at depth 0, from
        there to depth 1, and what one unit of the tile's x and y adds; the tile reaches from -1 to 1."""
        views = self.fan.views
        low, high = views.depth_range.T
        offset, slope_right, slope_up = views.plane.T
        return np.stack([low - offset, high - low, -slope_right * views.radius, -slope_up * views.radius], axis=-1)

    def tile_origins(self, views: NDArray[np.integer], levels: NDArray[np.integer]) -> NDArray[np.int64]:
        """First texel (N, 2) of each view's tile in the atlas at its mip level."""
        grid = np.stack([views % self.columns, views // self.columns], axis=-1)
        return grid * (self.size >> levels)[:, None]

    def release(self) -> None:
        """Free the textures."""
        for texture in (self.normal, self.depth, self.color, self.__dict__.pop("points", None)):
            if texture is not None:
                texture.release()


def _halved(coverage: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The next mip level of a coverage stack (V, S, S): means of 2 x 2 texels, an odd last row or column left out."""
    count, size = coverage.shape[:2]
    half = size // 2
    even = coverage[:, : half * 2, : half * 2].astype(np.uint16)
    total = even[:, ::2, ::2] + even[:, 1::2, ::2] + even[:, ::2, 1::2] + even[:, 1::2, 1::2]
    return ((total + 2) >> 2).astype(np.uint8).reshape(count, half, half)


def _premultiplied(color: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Colour (V, S, S, 4) times its coverage in linear light, so that mip levels of the edge come out right."""
    result = color * (color[..., 3:] > 0)
    edge = (color[..., 3] > 0) & (color[..., 3] < 255)
    texels = color[edge]
    linear = LINEAR_FROM_BYTE[texels[:, :3]] * (texels[:, 3:].astype(np.float32) / 255)
    result[edge, :3] = np.round(srgb_from_linear(linear) * 255).astype(np.uint8)
    return result
