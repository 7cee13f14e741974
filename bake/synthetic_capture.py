"""Photographs of a relief that exists only as numbers: it shadows itself, and its parts light one another."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage, sparse

from impostor.errors import SettingsError

LARGEST_SIDE = 2048
AZIMUTHS = 24  # directions in which a texel looks for others that light it
BAND = 1 << 13  # texels whose form factors are in memory at a time: some hundreds each
LIGHT_RADIUS = math.radians(0.5)  # of the lamps: what makes the penumbra
Floats = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Relief:
    """A surface above the picture's plane, seen from straight above.

    Parameters
    ----------
    heights : ndarray of shape (H, W), float64
        Toward the camera, in texels. Around the picture lies a floor at the lowest height.
    albedo : ndarray of shape (H, W, 3), float64
        Linear, 0..1; 0 where there is nothing to be seen.
    gloss : float
        Strength of a white highlight: what it adds where it is strongest, of a light at normal incidence.
    shininess : float
        Exponent of the highlight (Blinn-Phong).

    Raises
    ------
    SettingsError
        Shapes that do not fit together, or a value out of range.
    """

    heights: NDArray[np.float64]
    albedo: NDArray[np.float64]
    gloss: float = 0.0
    shininess: float = 60.0

    def __post_init__(self):
        shape = self.heights.shape
        if len(shape) != 2 or not 2 <= min(shape) <= max(shape) <= LARGEST_SIDE:
            raise SettingsError("relief", f"heights of shape {shape}; expected sides of 2 to {LARGEST_SIDE}")
        if self.albedo.shape != (*shape, 3):
            raise SettingsError("relief", f"albedo of shape {self.albedo.shape}; expected {(*shape, 3)}")
        if not (np.isfinite(self.heights).all() and (self.albedo >= 0).all() and (self.albedo <= 1).all()):
            raise SettingsError("relief", "a height is not finite, or an albedo outside 0..1")
        if not (0 <= self.gloss < math.inf and 0 < self.shininess < math.inf):
            raise SettingsError("relief", f"gloss {self.gloss:g}, shininess {self.shininess:g}; expected positive")

    def normals(self) -> NDArray[np.float64]:
        """Unit normals (H, W, 3): x right, y up, z to the camera."""
        down, right = np.gradient(self.heights)
        normals = np.stack([-right, down, np.ones_like(right)], axis=-1)
        return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def photograph(
    relief: Relief,
    lights: ArrayLike,
    *,
    bounce: bool = True,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> NDArray[np.float32]:
    """The relief under one light after another.

    Parameters
    ----------
    relief : Relief
    lights : array_like of shape (N, 3), float
        Unit vectors toward far lights, z above 0: x right, y up. A white texel that faces its light is white.
    bounce : bool
        Add the light that reaches a texel from the others, once reflected.
    progress : callable
        Called with steps done and steps in all: lights, then bands of bounced light.

    Returns
    -------
    ndarray of shape (N, H, W, 3), float32
        Linear light; may pass 1.

    Raises
    ------
    SettingsError
        A light that is not above the surface.
    """
    directions = np.asarray(lights, np.float64)
    if directions.ndim != 2 or directions.shape[1] != 3:
        raise SettingsError("lights", f"of shape {directions.shape}; expected (N, 3)")
    if not (directions[:, 2] > 0).all():
        raise SettingsError("lights", f"lowest z is {directions[:, 2].min():g}; expected above 0, above the horizon")
    normals = relief.normals()
    bands = math.ceil(relief.heights.size / BAND) if bounce else 0
    pictures = np.empty((len(directions), *relief.albedo.shape), np.float32)
    added = np.zeros_like(pictures)  # what does not bounce: highlights, and light that has bounced
    for number, light in enumerate(directions):
        visible = visibility(relief.heights, light)
        pictures[number] = relief.albedo * (visible * np.maximum(normals @ light, 0))[..., None]
        if relief.gloss:
            half = light + [0, 0, 1]
            shine = np.maximum(normals @ (half / np.linalg.norm(half)), 0) ** relief.shininess
            added[number] = (relief.gloss * visible * shine * (relief.albedo.max(axis=-1) > 0))[..., None]
        progress(number + 1, len(directions) + bands)
    if bounce:
        albedo = relief.albedo.reshape(-1, 3).astype(np.float32)
        for number, band in enumerate(form_factors(relief)):
            texels = slice(number * BAND, (number + 1) * BAND)
            for direct, more in zip(pictures, added, strict=True):
                more.reshape(-1, 3)[texels] += albedo[texels] * (band @ direct.reshape(-1, 3))
            progress(len(directions) + number + 1, len(directions) + bands)
    pictures += added
    return pictures


def visibility(heights: NDArray[np.float64], light: ArrayLike) -> NDArray[np.float64]:
    """How much of a light each texel sees.

    Parameters
    ----------
    heights : ndarray of shape (H, W), float64
    light : array_like of shape (3,), float
        Unit vector.

    Returns
    -------
    ndarray of shape (H, W), float64
        0 in the shadow of another part of the surface, 1 outside, between them in the penumbra.
    """
    x, y, z = np.asarray(light, np.float64).tolist()
    across = math.hypot(x, y)
    if across < 1e-9:
        return np.ones(heights.shape)
    elevation = math.atan2(z, across)
    # Above this slope toward the light all light is lost: what is lower than that everywhere needs no look.
    least = math.tan(max(elevation - LIGHT_RADIUS, math.radians(0.1)))
    steps = min(math.ceil(np.ptp(heights) / least), math.ceil(math.hypot(*heights.shape)))
    horizon = np.full(heights.shape, -np.inf)
    for step in range(1, steps + 1):
        np.maximum(horizon, (_shifted(heights, x / across * step, y / across * step) - heights) / step, out=horizon)
    return np.clip((elevation - np.arctan(horizon)) / (2 * LIGHT_RADIUS) + 0.5, 0, 1)


def form_factors(relief: Relief) -> Iterator[sparse.csr_matrix]:
    """Which share of what reaches each texel comes from each other one.

    Parameters
    ----------
    relief : Relief

    Yields
    ------
    sparse matrix of shape (n, H * W), float32
        The rows of n texels, the picture's first ones first. Its product with the texels' reflected light is the light
        that the n receive, in the unit in which a light at normal incidence gives 1.

    Notes
    -----
    In each of 24 azimuths a texel's horizon rises from its tangent plane, step by step outward. Each step that lifts
    it shows a piece of surface between the old horizon and the new, over which the cosine is integrated exactly.
    """
    normals = relief.normals().reshape(-1, 3)
    for start in range(0, relief.heights.size, BAND):
        texels = np.arange(start, min(start + BAND, relief.heights.size))
        pieces = [
            piece
            for azimuth in (np.arange(AZIMUTHS) + 0.5) * 2 * np.pi / AZIMUTHS
            for piece in _pieces(relief.heights, normals[texels], texels, math.cos(azimuth), math.sin(azimuth))
        ]
        rows, columns, shares = (np.concatenate(part) for part in zip(*pieces, strict=True))
        entries = shares * np.float32(2 / AZIMUTHS), (rows, columns)
        yield sparse.csr_matrix(entries, shape=(len(texels), relief.heights.size))


def _pieces(
    heights: NDArray[np.float64], normals: NDArray[np.float64], texels: NDArray[np.int64], x: float, y: float
) -> Iterator[tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float32]]]:
    """What texels see of the surface along one azimuth, step by step: rows, columns and shares of the form factors."""
    height, width = heights.shape
    row, column = np.divmod(texels, width)
    own, top = heights.ravel()[texels], heights.max()
    along, up = normals[:, 0] * x + normals[:, 1] * y, normals[:, 2]
    horizon = -along / up  # slope of the tangent plane
    left = np.arange(len(texels))  # whose horizon something may still lift
    step = 0
    while len(left):
        step += 1
        at, across = row[left] - y * step, column[left] + x * step
        inside = (at > -0.5) & (at < height - 0.5) & (across > -0.5) & (across < width - 0.5)
        kept = inside & (top - own[left] > horizon[left] * step)
        left, at, across = left[kept], at[kept], across[kept]
        slope = (_interpolated(heights, at, across) - own[left]) / step
        seen = slope > horizon[left]
        low, high, texel = horizon[left[seen]], slope[seen], left[seen]
        # Integrals of cos² and of sin cos of the elevation, whose tangents the slopes are.
        flat = (np.arctan(high) - np.arctan(low) + high / (1 + high**2) - low / (1 + low**2)) / 2
        steep = (high**2 / (1 + high**2) - low**2 / (1 + low**2)) / 2
        whence = np.rint(at[seen]) * width + np.rint(across[seen])
        yield (
            texel.astype(np.int32),
            whence.astype(np.int32),
            (along[texel] * flat + up[texel] * steep).astype(np.float32),
        )
        horizon[texel] = high


def _interpolated(heights: NDArray[np.float64], row: Floats, column: Floats) -> NDArray[np.float64]:
    """Heights at places, linear between texels' centres; the floor outside them."""
    height, width = heights.shape
    top, left = row.astype(np.int64).clip(0, height - 2), column.astype(np.int64).clip(0, width - 2)
    down, right = row - top, column - left
    upper = heights[top, left] * (1 - right) + heights[top, left + 1] * right
    lower = heights[top + 1, left] * (1 - right) + heights[top + 1, left + 1] * right
    within = (row >= 0) & (row <= height - 1) & (column >= 0) & (column <= width - 1)
    return np.where(within, upper * (1 - down) + lower * down, heights.min())


def _shifted(heights: NDArray[np.float64], right: float, up: float) -> NDArray[np.float64]:
    """The heights a step away from every texel; the floor outside the picture."""
    return ndimage.shift(heights, (up, -right), order=1, mode="constant", cval=float(heights.min()))
