"""Where the light stood, from its highlight on a mirror ball."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from bake.photographs import Photographs, open_photographs
from impostor.errors import PhotographError, SettingsError

SMALLEST_RADIUS = 4.0  # pixels
HIGHLIGHT = 0.9  # of the brightest value on the ball: what counts as the light's image
DARKEST_HIGHLIGHT = 0.2  # of white: below it there is no highlight to be found
LARGEST_HIGHLIGHT = 0.2  # of the ball's area
RIM = 0.98  # of the radius: nearer to the outline, background shines through
BLUR = 0.02  # of the radius


@dataclass(frozen=True)
class Circle:
    """The outline of a ball in a picture, in pixels; pixel centres at whole numbers, y down."""

    x: float
    y: float
    radius: float


def circle_of_mask(mask: NDArray[np.bool_], where: object = "mask") -> Circle:
    """The circle that covers what a mask covers: same centre of gravity, same area.

    Parameters
    ----------
    mask : ndarray of shape (H, W), bool
    where : object
        Named in an error.

    Returns
    -------
    Circle

    Raises
    ------
    SettingsError
        The mask is empty, tiny, or not round.
    """
    rows, columns = np.nonzero(mask)
    radius = float(np.sqrt(len(rows) / np.pi))
    if radius < SMALLEST_RADIUS:
        raise SettingsError(str(where), f"covers {len(rows)} pixels; expected a ball of radius {SMALLEST_RADIUS:g}")
    circle = Circle(float(columns.mean()), float(rows.mean()), radius)
    spread = np.array([rows.var(), columns.var()]) / (radius * radius / 4)
    if np.abs(spread - 1).max() > 0.1:
        raise SettingsError(
            str(where), f"is {2 * np.sqrt(spread)[1]:.2f} x {2 * np.sqrt(spread)[0]:.2f} radii; not round"
        )
    return circle


def read_mask(path: str | os.PathLike[str]) -> NDArray[np.bool_]:
    """A mask picture as an ndarray of shape (H, W), bool: what is brighter than half of white."""
    photographs = open_photographs([path])
    return photographs.decode(0).max(axis=-1) > photographs.white / 2


def light_of_highlight(
    picture: NDArray[np.floating], circle: Circle, where: object = "photograph"
) -> NDArray[np.float64]:
    """The direction of the light whose mirror image is the brightest spot on a ball.

    Parameters
    ----------
    picture : ndarray of shape (H, W), float
        Brightness, 0..1.
    circle : Circle
    where : object
        Named in an error.

    Returns
    -------
    ndarray of shape (3,), float64
        Unit vector: x right, y up, z to the camera, which is taken to be far away. z may be below 0: near its rim the
        ball mirrors what stands behind it.

    Raises
    ------
    SettingsError
        Nothing on the ball is bright, or too much is.
    """
    y, x = np.indices(picture.shape)
    inside = np.hypot(x - circle.x, y - circle.y) < RIM * circle.radius
    smooth = ndimage.gaussian_filter(picture, BLUR * circle.radius)
    brightest = float(np.where(inside, smooth, 0).max())
    if brightest < DARKEST_HIGHLIGHT:
        raise SettingsError(
            str(where), f"brightest value on the ball is {brightest:.2f} of white; expected a highlight"
        )
    spots = np.zeros(picture.shape, np.int32)
    ndimage.label(inside & (smooth >= HIGHLIGHT * brightest), output=spots)
    areas = np.bincount(spots.ravel())[1:]
    if areas.sum() > LARGEST_HIGHLIGHT * np.pi * circle.radius**2:
        raise SettingsError(str(where), f"highlight covers {areas.sum()} pixels of the ball; expected a small spot")
    largest = smooth * (spots == int(np.argmax(areas)) + 1)
    row, column = float((y * largest).sum() / largest.sum()), float((x * largest).sum() / largest.sum())
    across, up = (column - circle.x) / circle.radius, (circle.y - row) / circle.radius
    normal = np.array([across, up, np.sqrt(max(1 - across * across - up * up, 0))])
    # The view vector (0, 0, 1) mirrored in the normal.
    return 2 * normal[2] * normal - np.array([0, 0, 1])


def lights_of_ball(paths: Sequence[str | os.PathLike[str]], circle: Circle) -> NDArray[np.float64]:
    """The light of every photograph of a mirror ball.

    Parameters
    ----------
    paths : sequence of path-like
    circle : Circle

    Returns
    -------
    ndarray of shape (N, 3), float64
        Unit vectors.

    Raises
    ------
    PhotographError, SettingsError
    """
    photographs = open_photographs(paths)
    width, height = photographs.size
    if not (0 <= circle.x < width and 0 <= circle.y < height):
        raise PhotographError(photographs.paths[0], f"is {width}x{height}; the ball at {circle} lies outside")
    # The blur grows with the radius: one far larger than the picture would take hours.
    if not SMALLEST_RADIUS <= circle.radius <= max(width, height):
        raise SettingsError("circle", f"radius {circle.radius:g}; expected {SMALLEST_RADIUS:g} to {max(width, height)}")
    return np.array([_light(photographs, index, circle) for index in range(len(photographs))])


def _light(photographs: Photographs, index: int, circle: Circle) -> NDArray[np.float64]:
    picture = photographs.decode(index).mean(axis=-1) / photographs.white
    return light_of_highlight(picture, circle, Path(photographs.paths[index]))
