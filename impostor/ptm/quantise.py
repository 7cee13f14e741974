"""A PTM in 8-bit coefficients, with a scale and a bias for each of the six."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impostor.ptm.polynomials import Curve, Parameters, Polynomials


@dataclass(frozen=True)
class Ptm:
    """A PTM as a `.ptm` file holds it; a coefficient is (byte - bias) * scale, in 0..255 of the picture.

    Parameters
    ----------
    coefficients : ndarray of shape (H, W, C, 6), uint8
        As `Polynomials.coefficients`; row 0 is the top.
    scale : ndarray of shape (6,), float64
    bias : ndarray of shape (6,), int64
        0..255.
    color : ndarray of shape (H, W, 3), uint8, optional
    chroma : ndarray of shape (H, W, 2), uint8, optional
    rgb_from_luma : ndarray of shape (3, 4), float64, optional
        As `Polynomials.rgb_from_luma`.
    curve, parameters : str
        As in `Polynomials`.
    """

    coefficients: NDArray[np.uint8]
    scale: NDArray[np.float64]
    bias: NDArray[np.int64]
    color: NDArray[np.uint8] | None = None
    chroma: NDArray[np.uint8] | None = None
    rgb_from_luma: NDArray[np.float64] | None = None
    curve: Curve = "srgb"
    parameters: Parameters = "light"

    def polynomials(self) -> Polynomials:
        """The same PTM in floats."""
        raise NotImplementedError


def quantise(polynomials: Polynomials) -> Ptm:
    """Round a PTM to 8 bits (HPL-2004-225, "PTM Representation")."""
    raise NotImplementedError
