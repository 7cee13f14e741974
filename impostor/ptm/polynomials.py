"""The biquadratic of a PTM, in floats."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.errors import SettingsError
from impostor.srgb import linear_from_srgb, srgb_from_linear

TERMS = 6  # of u², v², uv, u, v, 1, in this order
DROP_OFF = 0.1  # of N.L below zero: from about 6 degrees under the surface on, it is dark
Curve = Literal["srgb", "linear"]
Parameters = Literal["light", "view", "series"]

# JFIF's YCbCr on 0..1, Cr before Cb as `.ptm` files have them; 128 of 255 is no chroma.
RGB_FROM_YCRCB = np.array([[1, 1.402, 0], [1, -0.714136, -0.344136], [1, 0, 1.772]])
RGB_FROM_YCRCB = np.column_stack([RGB_FROM_YCRCB, -RGB_FROM_YCRCB[:, 1:].sum(axis=1) * 128 / 255])


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


@dataclass(frozen=True, eq=False)
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
        check_shapes(self.coefficients, self.color, self.chroma, self.rgb_from_luma)
        for name in ("coefficients", "color", "chroma", "rgb_from_luma"):
            array = getattr(self, name)
            if array is not None and not _all_finite(array):
                raise SettingsError(f"PTM {name}", "a value is not finite")

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in texels."""
        return self.coefficients.shape[1], self.coefficients.shape[0]

    @property
    def format(self) -> Literal["RGB", "LRGB", "LUM"]:
        """Which of the three kinds this is."""
        return ptm_format(self.color, self.chroma)


def _all_finite(array: NDArray[np.floating[Any]]) -> bool:
    """Whether no value is infinite or NaN: then most often their sum is finite, too, and found in half the time."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(array.sum()) or np.isfinite(array).all())


def ptm_format(color: object, chroma: object) -> Literal["RGB", "LRGB", "LUM"]:
    """Which kind a PTM is that has, or has not, a color and a chroma."""
    if color is not None:
        return "LRGB"
    return "RGB" if chroma is None else "LUM"


def check_shapes(
    coefficients: NDArray[Any], color: NDArray[Any] | None, chroma: NDArray[Any] | None, matrix: NDArray[Any] | None
) -> None:
    """Refuse arrays that do not make one PTM together; parameters as in `Polynomials`.

    Raises
    ------
    SettingsError
    """
    shape = coefficients.shape
    if len(shape) != 4 or shape[2] not in (1, 3) or shape[3] != TERMS or 0 in shape:
        raise SettingsError("PTM coefficients", f"shape {shape}; expected (H, W, 1 or 3, {TERMS})")
    if (shape[2] == 1) != ((color is not None) ^ (chroma is not None)) or (color is not None and chroma is not None):
        raise SettingsError("PTM", "expected RGB coefficients, or one polynomial a texel with color or with chroma")
    if (chroma is None) != (matrix is None):
        raise SettingsError("PTM", "chroma and rgb_from_luma belong together")
    for name, array, expected in (
        ("color", color, (*shape[:2], 3)),
        ("chroma", chroma, (*shape[:2], 2)),
        ("rgb_from_luma", matrix, (3, 4)),
    ):
        if array is not None and array.shape != expected:
            raise SettingsError(f"PTM {name}", f"shape {array.shape}; expected {expected}")


def channels(polynomials: Polynomials, lu: ArrayLike, lv: ArrayLike) -> NDArray[np.float32]:
    """Values of the polynomials at one (u, v), or at one of its own for each texel.

    Parameters
    ----------
    polynomials : Polynomials
    lu, lv : array_like of shape () or (H, W)
        The light direction's projection on tangent and binormal.

    Returns
    -------
    ndarray of shape (H, W, C), float32
        Not clamped.

    References
    ----------
    HPL-2004-225, "PTM Representation".
    """
    terms = basis(lu, lv).astype(np.float32)
    if terms.ndim == 1:
        return polynomials.coefficients @ terms
    return np.einsum("hwct,hwt->hwc", polynomials.coefficients, terms)


def picture(polynomials: Polynomials, values: NDArray[np.float32]) -> NDArray[np.float32]:
    """RGB from the values of the polynomials.

    Parameters
    ----------
    polynomials : Polynomials
        For its color or its chroma.
    values : ndarray of shape (H, W, C), float32
        As `channels` gives them.

    Returns
    -------
    ndarray of shape (H, W, 3), float32
        Not clamped; on the PTM's `curve`.
    """
    if polynomials.color is not None:
        return values * polynomials.color
    if polynomials.chroma is None or polynomials.rgb_from_luma is None:
        return values
    matrix = polynomials.rgb_from_luma
    rgb = np.concatenate([values, polynomials.chroma], axis=-1) @ matrix[:, :3].T.astype(np.float32)
    return rgb + matrix[:, 3].astype(np.float32)


def evaluate(polynomials: Polynomials, lu: ArrayLike, lv: ArrayLike) -> NDArray[np.float32]:
    """The picture of a PTM at one (u, v), or at one of its own for each texel.

    Parameters
    ----------
    polynomials : Polynomials
    lu, lv : array_like of shape () or (H, W)
        The light direction's projection on tangent and binormal.

    Returns
    -------
    ndarray of shape (H, W, 3), float32
        Clamped to 0..1; on the PTM's `curve`.

    References
    ----------
    HPL-2004-225, "PTM Representation".
    """
    return np.clip(picture(polynomials, channels(polynomials, lu, lv)), 0, 1)


def light_direction(lu: ArrayLike, lv: ArrayLike) -> NDArray[np.float64]:
    """The direction in front of the surface whose projection on tangent and binormal is (lu, lv).

    Parameters
    ----------
    lu, lv : array_like of shape (...)

    Returns
    -------
    ndarray of shape (..., 3), float64
        Of length 1: x right, y up, z out of the surface. Where lu² + lv² passes 1, z is 0 and the length more.
    """
    u, v = np.broadcast_arrays(np.asarray(lu, np.float64), np.asarray(lv, np.float64))
    return np.stack([u, v, np.sqrt(np.clip(1 - u * u - v * v, 0, 1))], axis=-1)


def drop_off(n_dot_l: ArrayLike) -> NDArray[np.float64]:
    """How much light is left when it comes from below the surface.

    Parameters
    ----------
    n_dot_l : array_like of shape (...)
        z of the unit light direction.

    Returns
    -------
    ndarray of shape (...), float64
        1 for z >= 0, 0 for z <= -`DROP_OFF`, linear between. It multiplies linear light.

    References
    ----------
    HPL-2004-225, "Rendering using Programmable Graphics Hardware": the static texture of Code Listing 1.
    """
    return np.clip(1 + np.asarray(n_dot_l, np.float64) / DROP_OFF, 0, 1)


def relight(polynomials: Polynomials, direction: ArrayLike) -> NDArray[np.float32]:
    """The picture of a PTM under light from one direction, or from one of its own for each texel.

    Parameters
    ----------
    polynomials : Polynomials
        Whose `parameters` are not "series".
    direction : array_like of shape (3,) or (H, W, 3)
        Toward the light, of any length: x right, y up, z out of the surface. (u, v) cannot tell light from below the
        surface from light above it: it is taken on the horizon and fades by `drop_off`.

    Returns
    -------
    ndarray of shape (H, W, 3), float32
        Clamped to 0..1; on the PTM's `curve`.

    Raises
    ------
    SettingsError
        A direction has no length, or (u, v) is no direction.

    References
    ----------
    HPL-98-131, section 3; HPL-2004-225, "Rendering using Programmable Graphics Hardware".
    """
    if polynomials.parameters == "series":
        raise SettingsError("PTM", "its parameters are those of an image series; expected a direction's")
    u, v, height = np.moveaxis(unit_directions(direction), -1, 0)
    to_horizon = np.where(height < 0, np.maximum(np.hypot(u, v), 1e-6), 1)
    lit = evaluate(polynomials, u / to_horizon, v / to_horizon)
    left = drop_off(height)[..., None].astype(np.float32)
    if (left == 1).all():
        return lit
    if polynomials.curve == "linear":
        return lit * left
    return np.where(left == 1, lit, srgb_from_linear(linear_from_srgb(lit) * left)).astype(np.float32)


def unit_directions(directions: ArrayLike) -> NDArray[np.float64]:
    """Directions of shape (..., 3) at length 1.

    Raises
    ------
    SettingsError
        One has no length, or a value that is not finite.
    """
    directions = np.asarray(directions, np.float64)
    length = np.linalg.norm(directions, axis=-1, keepdims=True)
    if not (np.isfinite(length) & (length > 1e-12)).all():
        raise SettingsError("direction", "expected finite vectors of some length")
    return directions / length
