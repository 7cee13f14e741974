"""The sRGB curve, in one place (IEC 61966-2-1)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def srgb_from_linear(linear: ArrayLike) -> NDArray[Any]:
    """Linear light to the sRGB curve; clipped to 0..1, floating dtypes are kept."""
    linear = np.clip(linear, 0, 1)
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)


def linear_from_srgb(srgb: ArrayLike) -> NDArray[Any]:
    """The sRGB curve to linear light; clipped to 0..1, floating dtypes are kept."""
    srgb = np.clip(srgb, 0, 1)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
