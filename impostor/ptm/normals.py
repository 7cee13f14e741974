"""Normals of a PTM, where its polynomials are brightest, and what they allow: specular light and diffuse gain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.errors import SettingsError
from impostor.ptm.polynomials import Polynomials, channels, light_direction, picture, relight, unit_directions

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)  # Rec. 709
ANGLES = 32  # Samples of the horizon, to start from.
STEPS = 8
BLOCK = 65536  # texels at a time
TIE = 1e-4  # Of a texel's coefficients: of lights that are equally bright within this, the most upright is taken.


def brightest_light(polynomials: Polynomials) -> NDArray[np.float64]:
    """The light direction under which each texel is brightest.

    Parameters
    ----------
    polynomials : Polynomials
        The three of an RGB texel count as their luminance.

    Returns
    -------
    ndarray of shape (H, W, 2), float64
        (u, v), of length 1 or less.

    Notes
    -----
    Where the polynomial has a maximum inside the unit disc, that is the closed form of its stationary point. Else,
    the stationary point being outside, a saddle or a minimum, the brightest light is on the horizon: there the
    polynomial is a trigonometric one of degree two with at most two maxima, which Newton's method finds.

    References
    ----------
    HPL-2004-225, "Light-Dependent Texture Mapping and Beyond"; Malzbender, Gelb, Wolters 2001, equations 16, 17.
    """
    coefficients = polynomials.coefficients
    one = coefficients[:, :, 0] if coefficients.shape[2] == 1 else np.einsum("hwct,c->hwt", coefficients, LUMINANCE)
    flat = one.reshape(-1, one.shape[-1]).astype(np.float64)
    # What is dug from the rim makes the maximum of a plain or a ridge unique, and the nearest to the normal.
    flat[:, :2] -= TIE * np.abs(flat[:, :5]).max(axis=1, keepdims=True) + 1e-12
    a0, a1, a2, a3, a4 = flat[:, :5].T
    determinant = 4 * a0 * a1 - a2 * a2
    with np.errstate(divide="ignore", invalid="ignore"):
        light = np.stack([a2 * a4 - 2 * a1 * a3, a2 * a3 - 2 * a0 * a4], axis=-1) / determinant[:, None]
        inside = (determinant > 0) & (a0 < 0) & ((light * light).sum(axis=-1) <= 1)
    light[~inside] = _brightest_on_horizon(flat[~inside])
    return light.reshape(*one.shape[:2], 2)


def normals(polynomials: Polynomials) -> NDArray[np.float32]:
    """Normals of a diffuse surface: it is brightest where the light comes along the normal.

    Parameters
    ----------
    polynomials : Polynomials

    Returns
    -------
    ndarray of shape (H, W, 3), float32
        Of length 1: x right, y up, z >= 0 to the camera.
    """
    return light_direction(*np.moveaxis(brightest_light(polynomials), -1, 0)).astype(np.float32)


def albedo(polynomials: Polynomials) -> NDArray[np.float32]:
    """The picture in which each texel stands under its own brightest light.

    Parameters
    ----------
    polynomials : Polynomials

    Returns
    -------
    ndarray of shape (H, W, 3), float32
        0..1 on the PTM's `curve`; what a diffuse surface returns of light along its normal.
    """
    light = brightest_light(polynomials)
    return np.clip(picture(polynomials, channels(polynomials, light[..., 0], light[..., 1])), 0, 1)


def relight_specular(
    polynomials: Polynomials,
    surface_normals: NDArray[np.float32],
    direction: ArrayLike,
    *,
    diffuse: float = 1.0,
    specular: float = 0.5,
    exponent: float = 40.0,
) -> NDArray[np.float32]:
    """A PTM under one light, with a highlight that its photographs did not show.

    Parameters
    ----------
    polynomials : Polynomials
    surface_normals : ndarray of shape (H, W, 3), float32
        As `normals` gives them.
    direction : array_like of shape (3,)
        Toward the light, of any length.
    diffuse, specular : float
        Shares of the PTM's picture and of the white highlight (N.H)^exponent.
    exponent : float
        0 or more; large is shiny.

    Returns
    -------
    ndarray of shape (H, W, 3), float32
        Clamped to 0..1; on the PTM's `curve`.

    Raises
    ------
    SettingsError
        The direction has no length, or the exponent is negative.

    References
    ----------
    HPL-2004-225, "Light-Dependent Texture Mapping and Beyond"; Malzbender, Gelb, Wolters 2001, "Specular enhancement".
    """
    if exponent < 0:
        raise SettingsError("exponent", f"{exponent}; expected 0 or more")
    light = unit_directions(direction)
    lit = np.float32(diffuse) * relight(polynomials, light)
    if light[2] <= 0:
        return np.clip(lit, 0, 1)
    half = unit_directions(light + np.array([0, 0, 1])).astype(np.float32)
    highlight = np.clip(surface_normals @ half, 0, 1) ** np.float32(exponent)
    return np.clip(lit + np.float32(specular) * highlight[..., None], 0, 1).astype(np.float32)


def diffuse_gain(polynomials: Polynomials, gain: float) -> Polynomials:
    """A PTM whose texels answer more strongly to the light's direction, and keep their normals.

    Parameters
    ----------
    polynomials : Polynomials
    gain : float
        What multiplies the curvature; 1 changes nothing.

    Returns
    -------
    Polynomials
        Under each texel's brightest light, value and slope are the old ones.

    References
    ----------
    Malzbender, Gelb, Wolters 2001, "Diffuse gain".
    """
    if not np.isfinite(gain):
        raise SettingsError("gain", f"{gain}; expected a finite number")
    u, v = np.moveaxis(brightest_light(polynomials)[..., None], 2, 0)
    a0, a1, a2, a3, a4, a5 = np.moveaxis(polynomials.coefficients.astype(np.float64), -1, 0)
    b3 = a3 + (1 - gain) * (2 * a0 * u + a2 * v)
    b4 = a4 + (1 - gain) * (2 * a1 * v + a2 * u)
    b5 = a5 + (1 - gain) * (a0 * u * u + a1 * v * v + a2 * u * v) + (a3 - b3) * u + (a4 - b4) * v
    stronger = np.stack([gain * a0, gain * a1, gain * a2, b3, b4, b5], axis=-1).astype(np.float32)
    return replace(polynomials, coefficients=stronger)


def _brightest_on_horizon(coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
    """(u, v) of length 1 where each quadratic (N, 6) is largest on the unit circle; shape (N, 2)."""
    angle = np.empty(len(coefficients))
    for start in range(0, len(coefficients), BLOCK):
        block = slice(start, start + BLOCK)
        angle[block] = _brightest_angle(_horizon_terms(coefficients[block]))
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _horizon_terms(coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
    """Factors of cos 2x, sin 2x, cos x and sin x on the unit circle, but for a constant; shape (4, N)."""
    a0, a1, a2, a3, a4 = coefficients[:, :5].T
    return np.stack([(a0 - a1) / 2, a2 / 2, a3, a4])


def _brightest_angle(terms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle (N,) of the highest maximum."""
    angles = np.arange(ANGLES) * 2 * np.pi / ANGLES
    values = _on_horizon(terms[:, :, None], angles)
    peaks = (values >= np.roll(values, 1, axis=1)) & (values >= np.roll(values, -1, axis=1))
    # Two peaks may be so nearly of a height that the samples do not tell which is higher.
    order = np.argsort(np.where(peaks, values, -np.inf), axis=1)[:, -2:]
    tops = [_climb(terms, angles[order[:, column]]) for column in (0, 1)]
    heights = [_on_horizon(terms, top) for top in tops]
    return np.where(heights[0] > heights[1], *tops)


def _on_horizon(terms: NDArray[np.float64], angle: NDArray[np.float64]) -> NDArray[np.float64]:
    cos2, sin2, cos, sin = terms
    return cos2 * np.cos(2 * angle) + sin2 * np.sin(2 * angle) + cos * np.cos(angle) + sin * np.sin(angle)


def _climb(terms: NDArray[np.float64], start: NDArray[np.float64]) -> NDArray[np.float64]:
    """Newton's method from angles (N,), never farther than the next sample."""
    cos2, sin2, cos, sin = terms
    spacing = 2 * np.pi / ANGLES
    angle = start
    for _ in range(STEPS):
        c, s, c2, s2 = np.cos(angle), np.sin(angle), np.cos(2 * angle), np.sin(2 * angle)
        slope = -2 * cos2 * s2 + 2 * sin2 * c2 - cos * s + sin * c
        bend = -4 * cos2 * c2 - 4 * sin2 * s2 - cos * c - sin * s
        uphill = np.sign(slope) * spacing / 4
        step = np.where(bend < 0, np.divide(-slope, bend, out=uphill.copy(), where=bend < 0), uphill)
        angle = np.clip(angle + step, start - spacing, start + spacing)
    return angle
