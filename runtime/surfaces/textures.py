"""PTMs on the GPU: coefficients packed so that a pixel needs few fetches, with mip levels."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.errors import SettingsError
from impostor.ptm.convert import converted
from impostor.ptm.mipmaps import halve
from impostor.ptm.quantise import Ptm
from impostor.ptm.shading import AMBIENT_WEIGHTS
from runtime.gl.programs import set_uniforms
from runtime.gl.uploads import check_texture_size

KINDS = ("lrgb", "rgb")
PAIRS = [0, 1, 2, 3, 4, 5, 4, 5]  # coefficients as RGB textures hold them: a0..a3, and a4, a5 of two channels


class PtmTextures:
    """A PTM as the shaders read it.

    LRGB takes two fetches: the polynomial carries the brightness of the colour, the sum of red, green and blue, and
    two of the colour's parts of that sum stand beside it; 16 bits a channel, 16 bytes a texel. RGB takes five with
    the PTM's own bytes, 20 a texel. LUM is turned to RGB, in 16 bits. Mip levels add a third.

    Parameters
    ----------
    ctx : moderngl.Context
    ptm : Ptm
    anisotropy : float

    Attributes
    ----------
    kind : {"lrgb", "rgb"}
        Which shaders read it.

    Raises
    ------
    SettingsError
        A PTM whose parameters are not a light's direction.
    GpuError
        The GPU cannot hold a texture of that size.
    """

    def __init__(self, ctx: moderngl.Context, ptm: Ptm, anisotropy: float):
        if ptm.parameters != "light":
            raise SettingsError("PTM surface", f"parameters are {ptm.parameters!r}; expected a PTM of light directions")
        self.ptm, self.size = ptm, ptm.size
        check_texture_size(ctx, "PTM", *self.size)
        self.kind = "lrgb" if ptm.format == "LRGB" else "rgb"
        self.anisotropy = anisotropy
        if ptm.format == "LRGB":
            packed = _packed_lrgb(ptm)
            self._low, self._scale = _span(packed)
            levels = _lrgb_levels(packed)
            self.textures = self._upload(ctx, 2, (_codes(texels, self._low, self._scale) for texels in levels))
        else:
            codes, low, scale = (ptm.coefficients, _low(ptm), ptm.scale) if ptm.format == "RGB" else _rgb_from_lum(ptm)
            self._low, self._scale = low[PAIRS], scale[PAIRS]
            self.textures = self._upload(ctx, 5, _rgb_levels(codes))

    def _upload(
        self, ctx: moderngl.Context, count: int, levels: Iterator[NDArray[np.unsignedinteger]]
    ) -> list[moderngl.Texture]:
        """Textures of four channels each from levels (H, W, 4 * count)."""
        first = next(levels)
        dtype = "f1" if first.dtype == np.uint8 else "nu2"
        textures = [ctx.texture(self.size, 4, _channels(first, n).tobytes(), dtype=dtype) for n in range(count)]
        for texture in textures:
            texture.build_mipmaps()
            texture.filter, texture.anisotropy = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR), self.anisotropy
        for level, texels in enumerate(levels, 1):
            # The driver's own levels are rounded anew on each, and not always to the nearest.
            for n, texture in enumerate(textures):
                texture.write(_channels(texels, n).tobytes(), level=level)
        return textures

    def bind(self, program: moderngl.Program, *, repeat: bool) -> None:
        """Bind the textures from unit 0 on, and give the program their scale."""
        for unit, texture in enumerate(self.textures):
            texture.repeat_x = texture.repeat_y = repeat
            texture.use(unit)
            set_uniforms(program, **{f"ptm_{unit}": unit})
        set_uniforms(program, ptm_scale=self._scale, ptm_low=self._low)
        set_uniforms(program, on_curve=self.ptm.curve == "srgb")

    def release(self) -> None:
        """Free the textures."""
        for texture in self.textures:
            texture.release()
        self.textures.clear()


def _packed_lrgb(ptm: Ptm) -> NDArray[np.float32]:
    """(H, W, 8): a0..a5 times the sum of red, green and blue; red's and green's part of that sum."""
    assert ptm.color is not None
    total = ptm.color.sum(axis=-1, dtype=np.float32)[..., None]
    packed = np.empty((*ptm.coefficients.shape[:2], 8), np.float32)
    np.subtract(ptm.coefficients[:, :, 0], ptm.bias.astype(np.float32), out=packed[..., :6])
    packed[..., :6] *= (ptm.scale / 255).astype(np.float32)
    packed[..., :6] *= total / 255
    packed[..., 6:] = np.where(total > 0, ptm.color[..., :2] / np.maximum(total, 1), 1 / 3)
    return packed


def _lrgb_levels(texels: NDArray[np.float32]) -> Iterator[NDArray[np.float32]]:
    """Mip levels of a packed LRGB PTM: means of the polynomials; of the colours, the brighter ones giving more.

    `impostor.ptm.mipmaps` finds the nearest product of a polynomial and a colour instead, in five times the time.
    """
    yield texels
    while max(texels.shape[:2]) > 1:
        weight = np.maximum(texels[..., :6] @ AMBIENT_WEIGHTS.astype(np.float32), 1e-6)[..., None]
        halved = halve(np.concatenate([texels[..., :6], texels[..., 6:] * weight, weight], axis=-1))
        texels = halved[..., :8]
        texels[..., 6:] /= halved[..., 8:]
        yield texels


def _low(ptm: Ptm) -> NDArray[np.float64]:
    """What a coefficient of byte 0 is worth."""
    return -ptm.bias * ptm.scale / 255


def _rgb_from_lum(ptm: Ptm) -> tuple[NDArray[np.uint16], NDArray[np.float64], NDArray[np.float64]]:
    """A LUM PTM as three polynomials: codes (H, W, 3, 6), and what code 0 and the whole span are worth."""
    coefficients = converted(ptm.polynomials(), "RGB").coefficients
    low, span = _span(coefficients)
    return _codes(coefficients, low, span), low, span


def _rgb_levels(codes: NDArray[np.unsignedinteger]) -> Iterator[NDArray[np.unsignedinteger]]:
    """Mip levels (H, W, 20) of codes (H, W, 3, 6), in the order of `ptm_rgb.glsl`."""
    red, green, blue = np.moveaxis(codes, 2, 0)
    order = (red[..., :4], red[..., 4:], green[..., 4:], green[..., :4], blue[..., :4], blue[..., 4:], blue[..., 4:])
    first = np.concatenate(order, axis=-1)
    yield first
    means = first
    while max(means.shape[:2]) > 1:
        # A part at a time: in floats the first level would be four times as large.
        means = np.concatenate([halve(_channels(means, n).astype(np.float32)) for n in range(5)], axis=-1)
        yield np.rint(means).astype(codes.dtype)


def _channels(texels: NDArray[Any], n: int) -> NDArray[Any]:
    """Those of texture n."""
    return np.ascontiguousarray(texels[..., 4 * n : 4 * n + 4])


def _span(texels: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least value of each channel, and from there to the greatest."""
    flat = texels.reshape(-1, texels.shape[-1])
    low, high = flat.min(axis=0).astype(float), flat.max(axis=0).astype(float)
    return low, np.maximum(high - low, 1e-6)


def _codes(texels: NDArray[np.float32], low: NDArray[np.float64], span: NDArray[np.float64]) -> NDArray[np.uint16]:
    """16-bit fractions of the span."""
    codes = (texels - low.astype(np.float32)) * (65535 / span).astype(np.float32)
    codes += np.float32(0.5)
    return np.clip(codes, 0, 65535, out=codes).astype(np.uint16)
