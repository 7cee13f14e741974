"""From one kind of PTM to another: three polynomials a texel, one with a color, or one with a chroma."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from impostor.errors import SettingsError
from impostor.ptm.mipmaps import as_product, light_gram
from impostor.ptm.polynomials import RGB_FROM_YCRCB, Polynomials

FORMATS = ("RGB", "LRGB", "LUM")


def converted(polynomials: Polynomials, kind: Literal["RGB", "LRGB", "LUM"]) -> Polynomials:
    """The same PTM as another kind, or the nearest there is.

    Parameters
    ----------
    polynomials : Polynomials
    kind : {"RGB", "LRGB", "LUM"}
        To RGB nothing is lost. LRGB keeps a texel's hue under all lights; LUM, which is YCbCr, its chroma.

    Returns
    -------
    Polynomials

    Raises
    ------
    SettingsError
        Another kind.
    """
    if kind not in FORMATS:
        raise SettingsError("PTM format", f"{kind!r}; expected one of {', '.join(FORMATS)}")
    if kind == polynomials.format:
        return polynomials
    rgb = _to_rgb(polynomials)
    if kind == "RGB":
        return rgb
    mean = rgb.coefficients @ light_gram()[-1].astype(np.float32)
    if kind == "LRGB":
        # One brightness for all texels serves dark ones as well as bright ones: the coefficients share their scales.
        brightness = np.full(mean.shape[:2], max(float(mean.max()), 1e-6))
        luminance, color = as_product(rgb.coefficients, brightness)
        return replace(rgb, coefficients=luminance, color=np.clip(color, 0, 1))
    from_rgb = np.linalg.inv(RGB_FROM_YCRCB[:, :3])
    luma = np.einsum("c,hwct->hwt", from_rgb[0], rgb.coefficients)
    luma[..., 5] -= from_rgb[0] @ RGB_FROM_YCRCB[:, 3]
    chroma = (mean - RGB_FROM_YCRCB[:, 3]) @ from_rgb[1:].T
    return replace(
        rgb,
        coefficients=luma[:, :, None].astype(np.float32),
        chroma=chroma.astype(np.float32),
        rgb_from_luma=RGB_FROM_YCRCB.copy(),
    )


def _to_rgb(polynomials: Polynomials) -> Polynomials:
    coefficients = polynomials.coefficients
    if polynomials.color is not None:
        coefficients = coefficients * polynomials.color[..., None]
    elif polynomials.chroma is not None and polynomials.rgb_from_luma is not None:
        matrix = polynomials.rgb_from_luma.astype(np.float32)
        constant = polynomials.chroma @ matrix[:, 1:3].T + matrix[:, 3]
        coefficients = coefficients * matrix[:, 0, None]
        coefficients[..., 5] += constant
    return replace(polynomials, coefficients=coefficients, color=None, chroma=None, rgb_from_luma=None)
