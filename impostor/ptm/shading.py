"""How a scene's lights fall on a PTM: the reference that the GPU path must equal.

A PTM is a picture for each direction of a light of one strength. Under several coloured lights its pictures are turned
to linear light, each times its light's colour, and summed. Ambient light adds one picture more.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.lighting import DirectionalLight
from impostor.ptm.polynomials import Curve, Polynomials, basis, drop_off, picture, relight
from impostor.srgb import linear_from_srgb, srgb_from_linear

AMBIENT_WEIGHTS = np.array([1 / 3, 1 / 3, 0, 0, 0, 1])
"""Means of u², v², uv, u, v, 1 over all directions above the surface."""


@cache
def ambient_gain(curve: Curve) -> float:
    """What makes a matt surface under ambient light 1 as bright as its albedo.

    Its polynomial is the cosine on the curve; `AMBIENT_WEIGHTS` give the mean of that over the hemisphere.
    """
    cosines = (np.arange(10000) + 0.5) / 10000
    return 2.0 if curve == "linear" else float(1 / linear_from_srgb(srgb_from_linear(cosines).mean()))


def shaded(
    polynomials: Polynomials, toward: ArrayLike, colors: ArrayLike, ambient: ArrayLike = 0.0
) -> NDArray[np.float64]:
    """What a surface with a PTM shows, texel by texel.

    Parameters
    ----------
    polynomials : Polynomials
    toward : array_like, (N, 3) or (N, H, W, 3) float
        Toward each light, along tangent, binormal and normal of the surface.
    colors : array_like, (N, 3) or (N, H, W, 3) float
        Linear light that arrives of it.
    ambient : array_like, () or (3,) float
        Linear light from everywhere above the surface.

    Returns
    -------
    ndarray, (H, W, 3) float64
        On the sRGB curve, clipped to 0..1.

    Notes
    -----
    Ambient light shows the mean of the texel's polynomial over the hemisphere, (a0 + a1) / 3 + a5, times
    `ambient_gain`. So crevices that few lights reach are dark under it, too.
    """
    around = picture(polynomials, polynomials.coefficients @ AMBIENT_WEIGHTS.astype(np.float32))
    light = ambient_gain(polynomials.curve) * np.asarray(ambient, float) * _linear(polynomials, around)
    for direction, color in zip(np.asarray(toward, float), np.asarray(colors, float), strict=True):
        light = light + color * _linear(polynomials, relight(polynomials, direction))
    return srgb_from_linear(light)


def flat_terms(
    frame: ArrayLike, lights: Sequence[DirectionalLight], ambient: ArrayLike, curve: Curve
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The pictures whose sum a flat surface shows under directional lights, without those that are black.

    Parameters
    ----------
    frame : array_like, (3, 3) float
        Rows tangent, binormal, normal; unit, world space.
    lights : sequence of DirectionalLight
    ambient : array_like, () or (3,) float
    curve : {"srgb", "linear"}

    Returns
    -------
    weights : ndarray, (N, 6) float64
        Their product with a texel's coefficients is its value.
    colors : ndarray, (N, 3) float64
        Multiply the value, clipped to 0..1, in linear light.
    """
    toward = np.array([light.toward for light in lights], float).reshape(-1, 3) @ np.asarray(frame, float).T
    color = np.array([light.color for light in lights], float).reshape(-1, 3) * drop_off(toward[:, 2])[:, None]
    around = ambient_gain(curve) * np.broadcast_to(np.asarray(ambient, float), (3,))
    weights, colors = np.vstack([light_weights(toward), AMBIENT_WEIGHTS]), np.vstack([color, around])
    seen = colors.any(axis=1)
    return weights[seen], colors[seen]


def light_weights(toward: NDArray[np.float64]) -> NDArray[np.float64]:
    """What unit directions (..., 3) give the coefficients, (..., 6); from below the surface as from the horizon."""
    u, v, height = np.moveaxis(toward, -1, 0)
    to_horizon = np.where(height < 0, np.maximum(np.hypot(u, v), 1e-6), 1)
    return basis(u / to_horizon, v / to_horizon)


def _linear(polynomials: Polynomials, values: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.clip(values, 0, 1) if polynomials.curve == "linear" else linear_from_srgb(values)
