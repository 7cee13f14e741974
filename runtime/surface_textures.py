"""PTMs on the GPU: coefficients packed so that a pixel needs few fetches, with mip levels."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import numpy as np
from numpy.typing import NDArray

from impostor.errors import SettingsError
from impostor.ptm.quantise import Ptm
from impostor.ptm_shading import AMBIENT_WEIGHTS
from runtime.gpu import check_texture_size, set_uniforms

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
        self.ptm = ptm
        height, width = ptm.coefficients.shape[:2]
        check_texture_size(ctx, "PTM", width, height)
        self.size = width, height
        self.kind = "lrgb" if ptm.color is not None else "rgb"
        self.anisotropy = min(anisotropy, ctx.max_anisotropy)
        self.textures: list[moderngl.Texture] = []
        if self.kind == "lrgb":
            self._upload_lrgb(ctx)
        else:
            self._upload_rgb(ctx)
        for texture in self.textures:
            texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
            texture.anisotropy = self.anisotropy

    def _upload_lrgb(self, ctx: moderngl.Context) -> None:
        packed = _packed_lrgb(self.ptm)
        self._low, self._scale = _ranges(packed)
        for level, texels in enumerate(_levels(packed)):
            codes = _codes(texels, self._low, self._scale)
            if level == 0:
                self.textures = [_texture(ctx, np.ascontiguousarray(codes[..., n : n + 4])) for n in (0, 4)]
            else:
                for texture, n in zip(self.textures, (0, 4), strict=True):
                    texture.write(np.ascontiguousarray(codes[..., n : n + 4]).tobytes(), level=level)

    def _upload_rgb(self, ctx: moderngl.Context) -> None:
        ptm = self.ptm
        if ptm.chroma is None:
            codes, scale, low = ptm.coefficients, ptm.scale, -ptm.bias * ptm.scale / 255
        else:
            coefficients = _rgb_from_lum(ptm)
            low, scale = _ranges(coefficients)
            codes = _codes(coefficients, low, scale)
        self._low, self._scale = low[PAIRS], scale[PAIRS]
        red, green, blue = np.moveaxis(codes, 2, 0)
        blue_rest = np.pad(blue[..., 4:], ((0, 0), (0, 0), (0, 2)))
        rest = np.concatenate([red[..., 4:], green[..., 4:]], axis=-1)
        for channels in (red[..., :4], rest, green[..., :4], blue[..., :4], blue_rest):
            self.textures.append(_texture(ctx, np.ascontiguousarray(channels)))

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


def _rgb_from_lum(ptm: Ptm) -> NDArray[np.float32]:
    """(H, W, 3, 6): a LUM PTM as three polynomials."""
    polynomials = ptm.polynomials()
    assert polynomials.chroma is not None and polynomials.rgb_from_luma is not None
    matrix = polynomials.rgb_from_luma
    coefficients = polynomials.coefficients * matrix[:, :1].astype(np.float32)
    coefficients[..., 5] += polynomials.chroma @ matrix[:, 1:3].T + matrix[:, 3]
    return coefficients


def _levels(texels: NDArray[np.float32]) -> Iterator[NDArray[np.float32]]:
    """Mip levels of a packed LRGB PTM; the brighter texels give more of the colour."""
    yield texels
    while max(texels.shape[:2]) > 1:
        weight = np.maximum(texels[..., :6] @ AMBIENT_WEIGHTS.astype(np.float32), 1e-6)[..., None]
        colored = np.concatenate([texels[..., :6], texels[..., 6:] * weight, weight], axis=-1)
        halved = _halved(_halved(colored, 0), 1)
        texels = halved[..., :8]
        texels[..., 6:] /= halved[..., 8:]
        yield texels


def _halved(texels: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
    """Means over an axis of half as many equal stretches."""
    texels = np.moveaxis(texels, axis, 0)
    size = len(texels)
    if size == 1:
        return np.moveaxis(texels, 0, axis)
    half = size // 2
    if size % 2 == 0:
        halved = (texels[0::2] + texels[1::2]) * np.float32(0.5)
    else:
        at = np.arange(half, dtype=np.float32).reshape(-1, *[1] * (texels.ndim - 1))
        halved = ((half - at) * texels[0:-1:2] + half * texels[1::2] + (at + 1) * texels[2::2]) / np.float32(size)
    return np.moveaxis(halved, 0, axis)


def _ranges(texels: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least value and span of every last-axis channel."""
    flat = texels.reshape(-1, texels.shape[-1])
    low, high = flat.min(axis=0).astype(float), flat.max(axis=0).astype(float)
    return low, np.maximum(high - low, 1e-6)


def _codes(texels: NDArray[np.float32], low: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.uint16]:
    """16-bit fractions of the span."""
    codes = (texels - low.astype(np.float32)) * (65535 / scale).astype(np.float32)
    codes += np.float32(0.5)
    return np.clip(codes, 0, 65535, out=codes).astype(np.uint16)


def _texture(ctx: moderngl.Context, texels: NDArray[np.unsignedinteger]) -> moderngl.Texture:
    height, width, channels = texels.shape
    dtype = "f1" if texels.dtype == np.uint8 else "nu2"
    texture = ctx.texture((width, height), channels, texels.tobytes(), dtype=dtype)
    texture.build_mipmaps()
    return texture
