"""Domes: where to put the lights of a capture set. Unit vectors, x right, y up in the picture, z to the camera."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from impostor.errors import SettingsError

MAX_LIGHTS = 10_000
GOLDEN = (1 + math.sqrt(5)) / 2


def geodesic_dome() -> NDArray[np.float64]:
    """The 40 lights of the 1998 report: the face centres of the upper half of a once subdivided icosahedron.

    One vertex of the icosahedron points to the camera. Then ten of the new vertices lie on the horizon and no face
    crosses it, so that the dome stands on a level rim.

    Returns
    -------
    ndarray of shape (40, 3), float64
        From the top down.

    References
    ----------
    HPL-98-131, section 2 and figure 2.
    """
    ring = np.arange(5) * 2 * np.pi / 5
    height = 1 / math.sqrt(5)
    upper = np.column_stack([2 * height * np.sin(ring), 2 * height * np.cos(ring), np.full(5, height)])
    vertices = np.vstack([[0, 0, 1], upper, -upper, [0, 0, -1]])
    corners = vertices[ConvexHull(vertices).simplices]
    middles = corners + np.roll(corners, -1, axis=1)
    middles /= np.linalg.norm(middles, axis=-1, keepdims=True)
    faces = [middles]
    faces += [np.stack([corners[:, k], middles[:, k], middles[:, k - 1]], axis=1) for k in range(3)]
    centres = np.concatenate(faces).mean(axis=1)
    centres /= np.linalg.norm(centres, axis=1, keepdims=True)
    return _from_top(centres[centres[:, 2] > 0])


def ring_dome(rings: Sequence[tuple[float, int]]) -> NDArray[np.float64]:
    """Lights on rings of equal elevation; every other ring is turned by half a step.

    Parameters
    ----------
    rings : sequence of (elevation, count)
        Elevation above the picture's plane in radians, 0..pi/2, and lights on the ring.

    Returns
    -------
    ndarray of shape (N, 3), float64

    Raises
    ------
    SettingsError
        An elevation or a count out of range.
    """
    lights = []
    for number, (elevation, count) in enumerate(rings):
        if not 0 <= elevation <= math.pi / 2 + 1e-9:
            raise SettingsError("ring", f"elevation {math.degrees(elevation):g} degrees; expected 0 to 90")
        _check_count(count)
        azimuth = (np.arange(count) + (number % 2) / 2) * 2 * np.pi / count
        lights.append(
            np.column_stack(
                [
                    math.cos(elevation) * np.cos(azimuth),
                    math.cos(elevation) * np.sin(azimuth),
                    np.full(count, math.sin(elevation)),
                ]
            )
        )
    if not lights:
        raise SettingsError("rings", "none; expected at least one ring of lights")
    return np.concatenate(lights)


def fibonacci_dome(count: int, lowest: float = math.radians(10)) -> NDArray[np.float64]:
    """Lights spread evenly over the part of the hemisphere above an elevation.

    Parameters
    ----------
    count : int
    lowest : float
        Elevation of the edge in radians, 0..pi/2.

    Returns
    -------
    ndarray of shape (count, 3), float64

    Raises
    ------
    SettingsError
    """
    _check_count(count)
    if not 0 <= lowest < math.pi / 2:
        raise SettingsError("lowest", f"elevation {math.degrees(lowest):g} degrees; expected 0 up to less than 90")
    steps = np.arange(count) + 0.5
    height = 1 - (1 - math.sin(lowest)) * steps / count
    azimuth = 2 * np.pi * steps / GOLDEN
    radius = np.sqrt(1 - height * height)
    return np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height])


def parse_dome(text: str) -> NDArray[np.float64]:
    """The dome that a word of the command line names.

    Parameters
    ----------
    text : str
        "geodesic"; "fibonacci:COUNT" or "fibonacci:COUNT:LOWEST_DEG"; or "rings:ELEVATION_DEGxCOUNT,...".

    Returns
    -------
    ndarray of shape (N, 3), float64

    Raises
    ------
    SettingsError
    """
    kind, _, rest = text.partition(":")
    try:
        if text == "geodesic":
            return geodesic_dome()
        if kind == "fibonacci":
            count, _, lowest = rest.partition(":")
            return fibonacci_dome(int(count), math.radians(float(lowest or 10)))
        if kind == "rings":
            pairs = [part.split("x") for part in rest.split(",")]
            return ring_dome([(math.radians(float(elevation)), int(count)) for elevation, count in pairs])
    except SettingsError as error:
        raise SettingsError("dome", f"{text!r}: {error.problem}") from error
    except ValueError:
        pass
    raise SettingsError("dome", f"{text!r}; expected geodesic, fibonacci:COUNT[:LOWEST_DEG] or rings:DEGxCOUNT,...")


def _check_count(count: int) -> None:
    if not 1 <= count <= MAX_LIGHTS:
        raise SettingsError("dome", f"{count} lights; expected 1 to {MAX_LIGHTS}")


def _from_top(lights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sorted by height, then by azimuth: rounding must not decide the order."""
    azimuth = np.arctan2(lights[:, 1], lights[:, 0]) % (2 * np.pi)
    return lights[np.lexsort([azimuth.round(6), -lights[:, 2].round(6)])]
