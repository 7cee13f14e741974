"""A PTM in 8-bit coefficients, with a scale and a bias for each of the six."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.errors import SettingsError
from impostor.ptm.polynomials import TERMS, Curve, Parameters, Polynomials, check_shapes, ptm_format

WHITE = 255
LARGEST_SCALE = 1e30  # Times 255 still a finite float32.
BAND = 32  # rows, measured
SMALLEST_RANGE = 1e-6  # Of 255: what a viewer that reads its scales as "%f" takes for no range at all.


@dataclass(frozen=True, eq=False)
class Ptm:
    """A PTM as a `.ptm` file holds it; a coefficient is (byte - bias) * scale, in 0..255 of the picture.

    Parameters
    ----------
    coefficients : ndarray of shape (H, W, C, 6), uint8
        As `Polynomials.coefficients`; row 0 is the top.
    scale : ndarray of shape (6,), float64
        0 or more; at most 1e30.
    bias : ndarray of shape (6,), int64
        0..255.
    color : ndarray of shape (H, W, 3), uint8, optional
    chroma : ndarray of shape (H, W, 2), uint8, optional
    rgb_from_luma : ndarray of shape (3, 4), float64, optional
        As `Polynomials.rgb_from_luma`.
    curve, parameters : str
        As in `Polynomials`.

    Raises
    ------
    SettingsError
        Where shapes or types do not fit together, or a scale or bias is out of range.
    """

    coefficients: NDArray[np.uint8]
    scale: NDArray[np.float64]
    bias: NDArray[np.int64]
    color: NDArray[np.uint8] | None = None
    chroma: NDArray[np.uint8] | None = None
    rgb_from_luma: NDArray[np.float64] | None = None
    curve: Curve = "srgb"
    parameters: Parameters = "light"

    def __post_init__(self):
        check_shapes(self.coefficients, self.color, self.chroma, self.rgb_from_luma)
        for name in ("coefficients", "color", "chroma"):
            array = getattr(self, name)
            if array is not None and array.dtype != np.uint8:
                raise SettingsError(f"PTM {name}", f"type {array.dtype}; expected uint8")
        for name, most in (("scale", LARGEST_SCALE), ("bias", WHITE)):
            values = np.asarray(getattr(self, name))
            if values.shape != (TERMS,) or not ((values >= 0) & (values <= most)).all():
                raise SettingsError(f"PTM {name}", f"{values.tolist()}; expected {TERMS} numbers from 0 to {most:g}")

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in texels."""
        return self.coefficients.shape[1], self.coefficients.shape[0]

    @property
    def format(self) -> Literal["RGB", "LRGB", "LUM"]:
        """Which of the three kinds this is."""
        return ptm_format(self.color, self.chroma)

    def polynomials(self) -> Polynomials:
        """The same PTM in floats, where 1 is white."""
        table = (np.arange(256)[:, None] - self.bias) * (self.scale / WHITE)
        coefficients = np.stack([table[self.coefficients[..., term], term] for term in range(TERMS)], axis=-1)
        return Polynomials(
            coefficients.astype(np.float32),
            _unit(self.color),
            _unit(self.chroma),
            self.rgb_from_luma,
            self.curve,
            self.parameters,
        )


def quantise(polynomials: Polynomials, scale: ArrayLike | None = None, bias: ArrayLike | None = None) -> Ptm:
    """Round a PTM to 8 bits.

    Parameters
    ----------
    polynomials : Polynomials
    scale, bias : array_like of shape (6,), optional
        Of a PTM that this one is to share them with, a mip-map's with its first level. Left out, they are the ones
        that just span the coefficients.

    Returns
    -------
    Ptm
        A texel whose `color` passes 1 gives the excess to its luminance and stays the same colour; so does a whole
        channel of `chroma` outside 0..1 with `rgb_from_luma`.

    Raises
    ------
    SettingsError
        A coefficient is too large.

    Notes
    -----
    With its own scale, a coefficient is off by at most half a step, and by one step at the ends of its range, where
    the rounded bias takes up to half a step. The range always holds 0, so that the bias is in 0..255 and 0 is exact.
    The scale is rounded to seven digits, as a file prints it, before it is used.

    References
    ----------
    HPL-2004-225, "PTM Representation".
    """
    coefficients, color, chroma, matrix = _within_bytes(polynomials)
    if scale is None or bias is None:
        scale, bias = scale_and_bias(coefficients)
    scale, bias = np.asarray(scale, np.float64), np.asarray(bias, np.int64)
    levels = _levels(coefficients, scale, bias)
    color, chroma = (None if array is None else _byte(array * WHITE) for array in (color, chroma))
    return Ptm(levels, scale, bias, color, chroma, matrix, polynomials.curve, polynomials.parameters)


def scale_and_bias(coefficients: NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The scales and biases that just span a PTM's coefficients.

    Parameters
    ----------
    coefficients : ndarray of shape (..., 6)
        1 is white.

    Returns
    -------
    scale : ndarray of shape (6,), float64
        (highest - lowest) / 255, rounded to seven digits; 1 where all is 0.
    bias : ndarray of shape (6,), int64
        round(-lowest / scale).
    """
    others = tuple(range(coefficients.ndim - 1))
    lowest = np.minimum(coefficients.min(axis=others), 0).astype(np.float64) * WHITE
    highest = np.maximum(coefficients.max(axis=others), 0).astype(np.float64) * WHITE
    flat = highest - lowest < SMALLEST_RANGE
    scale = np.array([float(f"{value:.7g}") for value in np.where(flat, 1, (highest - lowest) / WHITE)])
    return scale, np.clip(np.rint(-lowest / scale), 0, WHITE).astype(np.int64)


def _levels(
    coefficients: NDArray[np.float32], scale: NDArray[np.float64], bias: NDArray[np.int64]
) -> NDArray[np.uint8]:
    """Coefficients in steps, a band of rows at a time: it stays in the cache while its planes are interleaved."""
    steps = np.divide(WHITE, scale, out=np.zeros(TERMS), where=scale > 0)
    levels = np.empty(coefficients.shape, np.uint8)
    for top in range(0, len(levels), BAND):
        band = slice(top, top + BAND)
        for channel, term in np.ndindex(coefficients.shape[2:]):
            exact = coefficients[band, :, channel, term] * float(steps[term]) + float(bias[term])
            levels[band, :, channel, term] = _byte(exact)
    return levels


def _within_bytes(
    polynomials: Polynomials,
) -> tuple[NDArray[np.float32], NDArray[np.float32] | None, NDArray[np.float32] | None, NDArray[np.float64] | None]:
    """Coefficients, color, chroma and matrix of the same PTM with color and chroma in 0..1."""
    coefficients, color, chroma = polynomials.coefficients, polynomials.color, polynomials.chroma
    matrix = polynomials.rgb_from_luma
    if color is not None:
        excess = np.maximum(color.max(axis=-1, keepdims=True), 1)
        coefficients, color = coefficients * excess[..., None], color / excess
    if chroma is not None and matrix is not None:
        lowest, highest = np.minimum(chroma.min((0, 1)), 0), np.maximum(chroma.max((0, 1)), 1)
        matrix = matrix.copy()
        matrix[:, 3] += matrix[:, 1:3] @ lowest
        matrix[:, 1:3] *= highest - lowest
        chroma = (chroma - lowest) / (highest - lowest)
    return coefficients, color, chroma, matrix


def _byte(values: NDArray[np.floating]) -> NDArray[np.uint8]:
    return np.clip(np.rint(values), 0, WHITE).astype(np.uint8)


def _unit(values: NDArray[np.uint8] | None) -> NDArray[np.float32] | None:
    return None if values is None else (values / np.float32(WHITE)).astype(np.float32)
