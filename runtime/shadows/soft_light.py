"""Lights that are as large as they look: the points of a source, and how many of them a shadow needs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from impostor.lighting import DirectionalLight
from impostor.shadow_projection import LOWEST_LIGHT, Ground, along_light
from runtime.viewing.viewer import Viewer

COUNTS = np.array([1, 4, 6, 8, 12, 24])
"""Of points of a source: whole parts of the bits that a mark has for them."""
MOST_POINTS = 24
WIDEST_STEP = 5.0  # pixels of penumbra to a point
SMALLEST_STEP = 0.02  # of the ground's light: an edge that is not seen once it is blurred
MOST_TRIANGLES = 1_500_000
"""Of the copies of a mesh for one light; more cast from fewer points, whose shadows are blurred more."""
HARD = 1.0  # pixels; a narrower penumbra is none
RIM = 1.3  # radii
BEHIND = 1e9  # pixels that a metre behind the eye counts as
GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


def source_points(light: DirectionalLight, ground: Ground, count: int) -> NDArray[np.float64]:
    """Directions toward points that are spread evenly over a light's disc.

    Returns
    -------
    ndarray, (count, 3) float64
        Of unequal length. All are at least `LOWEST_LIGHT` over the ground: what of the disc would reach below the
        horizon is pressed together above it.

    References
    ----------
    Vogel, "A better way to construct the sunflower head", 1979.
    """
    number = np.arange(count)
    places = np.sqrt((number + 0.5) / count) * np.exp(1j * GOLDEN_ANGLE * number)
    # The shadows are blurred by a disc of their distance: in all they spread as far as those of the whole source.
    places = (places - places.mean()) * np.sqrt(1 - (count > 1) / count)
    return _toward(light, ground, places.real, places.imag)


def source_rim(light: DirectionalLight, ground: Ground) -> list[DirectionalLight]:
    """Four hard lights around a light's disc: its shadow, blurred as it is, lies within the hull of theirs."""
    wider = replace(light, softness=float(np.arctan(RIM * np.tan(light.softness))))
    corners = _toward(wider, ground, np.array([-1, 1, -1, 1]), np.array([-1, -1, 1, 1]))
    return [DirectionalLight((x, y, z)) for x, y, z in corners.tolist()]


def points_affordable(triangles: int) -> int:
    """From how many points of a source so many triangles cast at most, one of `COUNTS`."""
    return int(COUNTS[max(np.searchsorted(COUNTS, MOST_TRIANGLES // max(triangles, 1), side="right") - 1, 1)])


def points_needed(penumbra: NDArray[np.float64], share: float, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """How many points (N,) of a source hide the steps between their shadows, one of `COUNTS`.

    Parameters
    ----------
    penumbra : ndarray, (N,) float64
        Largest width in pixels.
    share : float
        The light's part of the ground's light.
    most : int
        One of `COUNTS`.
    """
    wanted = np.clip(np.minimum(penumbra / WIDEST_STEP, share / SMALLEST_STEP), COUNTS[1], most)
    return np.where(penumbra < HARD, 1, COUNTS[np.searchsorted(COUNTS, wanted)])


def point_bits(count: int) -> NDArray[np.uint32]:
    """The bits (count,) of a mark that each of some points of a source sets; all of them together."""
    width = MOST_POINTS // count
    return (((1 << width) - 1) << (np.arange(count) * width)).astype(np.uint32)


def step_at_metre(light: DirectionalLight, ground: Ground, count: int) -> float:
    """Metres on the ground between the shadows of two neighbouring points of a source, cast from a metre above."""
    return 0.0 if count == 1 else penumbra_at_metre(light, ground) / (2 * np.sqrt(count))


def penumbra_at_metre(light: DirectionalLight, ground: Ground) -> float:
    """Width in metres of the penumbra, across the light, of what is a metre above the ground."""
    return 2 * np.tan(light.softness) / float(ground.normal @ light.toward)


def penumbra_pixels(
    corners: NDArray[np.float64], light: DirectionalLight, ground: Ground, viewer: Viewer
) -> NDArray[np.float64]:
    """The largest width (N,) on screen of the penumbras of boxes (N, 8, 3), endless where one is behind the eye."""
    height = np.maximum(corners @ ground.normal - ground.offset, 0)
    metres = penumbra_at_metre(light, ground) * height
    points = along_light(corners, light.toward, ground)
    scale = viewer.pixels_per_metre(points.reshape(-1, 3)).reshape(height.shape)
    return (metres * np.where(scale > 0, scale, BEHIND)).max(axis=1)


def _toward(
    light: DirectionalLight, ground: Ground, across: NDArray[np.floating], up: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Directions to places on a light's disc, -1 to 1 level with the ground and up."""
    toward, reach = np.array(light.toward), np.tan(light.softness)
    axis = ground.normal if abs(ground.normal @ toward) < 0.999 else np.eye(3)[np.abs(ground.normal).argmin()]
    level = np.cross(axis, toward)
    level /= np.linalg.norm(level)
    rising = np.cross(toward, level)
    climb = abs(float(ground.normal @ rising))
    rising *= np.sign(ground.normal @ rising) or 1.0
    low = min(reach, (float(ground.normal @ toward) - LOWEST_LIGHT) / max(climb, 1e-9))
    offset = np.where(up > 0, reach, low) * up
    return toward + reach * across[:, None] * level + offset[:, None] * rising
