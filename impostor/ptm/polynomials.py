"""The biquadratic of a PTM, in floats."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.errors import SettingsError

TERMS = 6  # of u², v², uv, u, v, 1, in this order
Curve = Literal["srgb", "linear"]
Parameters = Literal["light", "view", "series"]


def basis(u: ArrayLike, v: ArrayLike) -> NDArray[np.float64]:
    """The six terms that the coefficients multiply.

    Parameters
    ----------
    u, v : array_like of shape (...)
        The unit light direction's projection on tangent and binormal, -1..1: u to the right, v up.

    Returns
    -------
    ndarray of shape (..., 6), float64
        u², v², uv, u, v, 1.

    References
    ----------
    HPL-2004-225, "PTM Representation".
    """
    u, v = np.broadcast_arrays(np.asarray(u, np.float64), np.asarray(v, np.float64))
    return np.stack([u * u, v * v, u * v, u, v, np.ones_like(u)], axis=-1)


@dataclass(frozen=True)
class Polynomials:
    """A PTM in floats: what a fit gives, what a file's bytes mean, and what all PTM arithmetic works on.

    Values are 0 (black) to 1 (white) on `curve`. Row 0 is the top of the picture. A PTM is one of

    - RGB: three polynomials a texel;
    - LRGB: one polynomial for luminance, times `color`;
    - LUM: one polynomial for luma, beside a constant `chroma`, both turned to RGB by `rgb_from_luma`.

    Parameters
    ----------
    coefficients : ndarray of shape (H, W, C, 6), float32
        a0..a5 of u², v², uv, u, v, 1. C is 3 for RGB, 1 for LRGB and LUM.
    color : ndarray of shape (H, W, 3), float32, optional
        LRGB only. The picture is luminance times this; luminance may pass 1.
    chroma : ndarray of shape (H, W, 2), float32, optional
        LUM only.
    rgb_from_luma : ndarray of shape (3, 4), float64, optional
        LUM only. Turns (luma, chroma 0, chroma 1, 1) into RGB.
    curve : {"srgb", "linear"}
        Whether values are on the curve of the photographs or proportional to light.
    parameters : {"light", "view", "series"}
        What (u, v) is: the light's direction, the viewer's, or the one or two parameters of an image series.

    Raises
    ------
    SettingsError
        Where shapes do not fit together or a value is not finite.
    """

    coefficients: NDArray[np.float32]
    color: NDArray[np.float32] | None = None
    chroma: NDArray[np.float32] | None = None
    rgb_from_luma: NDArray[np.float64] | None = None
    curve: Curve = "srgb"
    parameters: Parameters = "light"

    def __post_init__(self):
        shape = self.coefficients.shape
        if len(shape) != 4 or shape[2] not in (1, 3) or shape[3] != TERMS or 0 in shape:
            raise SettingsError("PTM coefficients", f"shape {shape}; expected (H, W, 1 or 3, {TERMS})")
        one_polynomial = shape[2] == 1
        if one_polynomial != ((self.color is not None) ^ (self.chroma is not None)):
            raise SettingsError("PTM", "expected RGB coefficients, or one polynomial a texel with color or with chroma")
        if (self.chroma is None) != (self.rgb_from_luma is None):
            raise SettingsError("PTM", "chroma and rgb_from_luma belong together")
        for name, array, expected in (
            ("color", self.color, (*shape[:2], 3)),
            ("chroma", self.chroma, (*shape[:2], 2)),
            ("rgb_from_luma", self.rgb_from_luma, (3, 4)),
        ):
            if array is not None and array.shape != expected:
                raise SettingsError(f"PTM {name}", f"shape {array.shape}; expected {expected}")
        for name in ("coefficients", "color", "chroma", "rgb_from_luma"):
            array = getattr(self, name)
            if array is not None and not np.isfinite(array).all():
                raise SettingsError(f"PTM {name}", "a value is not finite")

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in texels."""
        return self.coefficients.shape[1], self.coefficients.shape[0]

    @property
    def format(self) -> Literal["RGB", "LRGB", "LUM"]:
        """Which of the three kinds this is."""
        if self.color is not None:
            return "LRGB"
        return "RGB" if self.chroma is None else "LUM"
