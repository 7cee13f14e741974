"""The integer form of a PTM of the 1998 report: bytes, three shifts, and no other arithmetic than integers'."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.errors import SettingsError
from impostor.ptm.polynomials import Polynomials

OFFSET = 127
UNIT = 127  # A component of the light's direction is a whole number from -127 to 127.
WHITE = 255
LARGEST_SHIFT = 30
ORDERS = (slice(0, 3), slice(3, 5), slice(5, 6))  # u² v² uv; u v; 1
POWERS = np.array([2, 2, 2, 1, 1, 0])


@dataclass(frozen=True, eq=False)
class ShiftedPtm:
    """A PTM for integer hardware; a coefficient is (byte - 127) / 2^shift for whole u and v in -127..127.

    Parameters
    ----------
    coefficients : ndarray of shape (H, W, C, 6), uint8
        As `Polynomials.coefficients`.
    shifts : tuple of int
        Of the high, the middle and the low order: u², v², uv; u, v; 1. Negative ones shift to the left.

    References
    ----------
    HPL-98-131, section 3.
    """

    coefficients: NDArray[np.uint8]
    shifts: tuple[int, int, int]

    def evaluate(self, u: int, v: int) -> NDArray[np.int32]:
        """Values under one light, in integers alone.

        Parameters
        ----------
        u, v : int
            127 times the light direction's projection, rounded; see `whole_light`.

        Returns
        -------
        ndarray of shape (H, W, C), int32
            0..255 of the picture; not clamped.

        Raises
        ------
        SettingsError
            The light is out of range.
        """
        if max(abs(int(u)), abs(int(v))) > UNIT:
            raise SettingsError("light", f"({u}, {v}); expected whole numbers from {-UNIT} to {UNIT}")
        terms = np.array([u * u, v * v, u * v, u, v, 1], np.int32)
        signed = self.coefficients.astype(np.int32) - OFFSET
        sums = [signed[..., order] @ terms[order] for order in ORDERS]
        high, middle, low = (_shift_right(total, shift) for total, shift in zip(sums, self.shifts, strict=True))
        return high + middle + low

    def bound(self, u: int, v: int) -> float:
        """How far `evaluate` is at most from the polynomial that was given, in 0..255 of the picture.

        Half a step of each rounded coefficient, and half of 1 for each of the three shifts.
        """
        weights = (u * u + v * v + abs(u * v), abs(u) + abs(v), 1)
        coefficients = sum(weight * 2.0**-shift / 2 for weight, shift in zip(weights, self.shifts, strict=True))
        return coefficients + sum(0.5 for shift in self.shifts if shift > 0)

    def polynomials(self, like: Polynomials) -> Polynomials:
        """The same in floats, with the color, the curve and all else of another PTM."""
        steps = np.repeat(2.0 ** -np.array(self.shifts), [3, 2, 1]) * float(UNIT) ** POWERS / WHITE
        coefficients = (self.coefficients.astype(np.float64) - OFFSET) * steps
        return replace(like, coefficients=coefficients.astype(np.float32))


def whole_light(lu: ArrayLike, lv: ArrayLike) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """The light direction's projection in whole numbers from -127 to 127."""
    u, v = (np.clip(np.rint(np.asarray(x, np.float64) * UNIT), -UNIT, UNIT).astype(np.int32) for x in (lu, lv))
    return u, v


def shift_quantise(polynomials: Polynomials) -> ShiftedPtm:
    """Round a PTM to the three shifts and bytes of the 1998 report.

    Parameters
    ----------
    polynomials : Polynomials

    Returns
    -------
    ShiftedPtm
        Each shift is the largest with which all coefficients of its order are within -127..128.

    Raises
    ------
    SettingsError
        Coefficients are too large for any shift.

    References
    ----------
    HPL-98-131, section 3.
    """
    whole = polynomials.coefficients * (WHITE / float(UNIT) ** POWERS)
    shifts = [_largest_shift(whole[..., order]) for order in ORDERS]
    scaled = np.rint(whole * 2.0 ** np.repeat(shifts, [3, 2, 1])) + OFFSET
    high, middle, low = shifts
    return ShiftedPtm(scaled.astype(np.uint8), (high, middle, low))


def _largest_shift(coefficients: NDArray[np.float64]) -> int:
    for shift in range(LARGEST_SHIFT, -LARGEST_SHIFT, -1):
        scaled = np.rint(np.array([coefficients.min(), coefficients.max()]) * 2.0**shift)
        if scaled[0] >= -OFFSET and scaled[1] <= WHITE - OFFSET:
            return shift
    raise SettingsError(
        "PTM coefficients", f"up to {np.abs(coefficients).max():g}; expected less than 2^{LARGEST_SHIFT}"
    )


def _shift_right(values: NDArray[np.int32], shift: int) -> NDArray[np.int32]:
    """Divide by a power of two, to the nearest whole number."""
    if shift <= 0:
        return values << -shift
    return (values + (1 << (shift - 1))) >> shift
