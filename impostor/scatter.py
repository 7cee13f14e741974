"""Scattering: points strewn over an area, as a density picture asks and no nearer to one another than allowed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import KDTree

from impostor.errors import SettingsError

FIRST_BLOCK, LARGEST_BLOCK = 1 << 10, 1 << 17
FEWEST_TRIES, TRIES_FOR_EACH, MOST_TRIES = 100_000, 500, 50_000_000
FULL = 5e-3
"""An area is full when less than this part of a block's candidates still finds room."""
ROUNDING = 1e-12

Points = NDArray[np.float64]


class Area(Protocol):
    """Where points may fall, seen from above."""

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Lowest x and z, highest x and z, in metres."""
        ...

    def points(self, random: Points) -> Points:
        """(N, 2) x and z, evenly spread for random numbers (N, 2) in 0..1."""
        ...


@dataclass(frozen=True)
class Rectangle:
    """Sides along x and z; metres.

    Raises
    ------
    SettingsError
        A corner that is not lower than the other.
    """

    low_x: float
    low_z: float
    high_x: float
    high_z: float

    def __post_init__(self):
        if not (self.low_x < self.high_x and self.low_z < self.high_z):
            raise SettingsError("rectangle", "has no area; expected low x, low z, high x, high z")

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        return self.low_x, self.low_z, self.high_x, self.high_z

    def points(self, random: Points) -> Points:
        low = np.array([self.low_x, self.low_z])
        return low + random * (self.high_x - self.low_x, self.high_z - self.low_z)


@dataclass(frozen=True)
class Circle:
    """A disc; metres.

    Raises
    ------
    SettingsError
        A radius that is not above 0.
    """

    x: float
    z: float
    radius: float

    def __post_init__(self):
        if not self.radius > 0:
            raise SettingsError("circle", f"radius {self.radius:g}; expected a number above 0")

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        return self.x - self.radius, self.z - self.radius, self.x + self.radius, self.z + self.radius

    def points(self, random: Points) -> Points:
        radius, angle = self.radius * np.sqrt(random[:, 0]), 2 * np.pi * random[:, 1]
        return np.stack([self.x + radius * np.cos(angle), self.z + radius * np.sin(angle)], axis=-1)


@dataclass(frozen=True)
class Polygon:
    """Any outline that does not cross itself; corners (x, z) in metres, in either direction.

    Raises
    ------
    SettingsError
        Fewer than three corners, edges that cross, no area.
    """

    corners: tuple[tuple[float, ...], ...]

    def __post_init__(self):
        if len(self.corners) < 3:
            raise SettingsError("polygon", f"{len(self.corners)} corners; expected at least three")
        if not self._trapezoids[1][-1] > 0:
            raise SettingsError("polygon", "has no area; expected corners around one")

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        (low_x, low_z), (high_x, high_z) = np.min(self.corners, axis=0), np.max(self.corners, axis=0)
        return float(low_x), float(low_z), float(high_x), float(high_z)

    @cached_property
    def _trapezoids(self) -> tuple[Points, Points]:
        """The polygon cut at the z of every corner, and the running sum of the areas.

        Columns (N, 6): lower and upper z; left x at both; right x at both.
        """
        start = np.array(self.corners, float)
        end = np.roll(start, -1, axis=0)
        rising = np.where((start[:, 1] <= end[:, 1])[:, None], np.hstack([start, end]), np.hstack([end, start]))
        levels = np.unique(start[:, 1])
        slabs = [_slab(rising, low, high) for low, high in pairwise(levels)]
        rows = np.concatenate([*slabs, np.zeros((1, 6))])
        widths = rows[:, 4] - rows[:, 2] + rows[:, 5] - rows[:, 3]
        return rows, np.cumsum(widths * (rows[:, 1] - rows[:, 0]) / 2)

    def points(self, random: Points) -> Points:
        rows, areas = self._trapezoids
        wanted = random[:, 0] * areas[-1]
        which = np.minimum(np.searchsorted(areas, wanted, side="right"), len(rows) - 2)
        before = np.where(which > 0, areas[which - 1], 0.0)
        share = (wanted - before) / np.maximum(areas[which] - before, np.finfo(float).tiny)
        low_z, high_z, left_low, left_high, right_low, right_high = rows[which].T
        low, high = right_low - left_low, right_high - left_high
        # The height below which this share of a trapezoid lies; written so that equal widths divide by no zero.
        root = low + np.sqrt(np.maximum(low**2 + share * (high**2 - low**2), 0))
        height = np.clip(share * (low + high) / np.maximum(root, np.finfo(float).tiny), 0, 1)
        left = left_low + height * (left_high - left_low)
        width = low + height * (high - low)
        return np.stack([left + random[:, 1] * width, low_z + height * (high_z - low_z)], axis=-1)


def _slab(rising: Points, low: float, high: float) -> Points:
    """Trapezoids (N, 6) of a polygon between two neighbouring levels, from its edges (x, z, x, z) upward."""
    x0, z0, x1, z1 = rising[(rising[:, 1] <= low) & (rising[:, 3] >= high)].T
    at_low, at_high = (x0 + (level - z0) / (z1 - z0) * (x1 - x0) for level in (low, high))
    order = np.argsort(at_low + at_high, kind="stable")
    at_low, at_high = at_low[order], at_high[order]
    slack = 1e-9 * max(float(np.abs(rising).max()), 1.0)
    if np.any(np.diff(at_low) < -slack) or np.any(np.diff(at_high) < -slack):
        raise SettingsError("polygon", f"edges cross between z {low:g} and {high:g}; expected an outline")
    left, right = slice(0, None, 2), slice(1, None, 2)
    levels = np.broadcast_to([[low, high]], (len(at_low) // 2, 2))
    return np.column_stack([levels, at_low[left], at_high[left], at_low[right], at_high[right]])


def scatter_points(
    area: Area,
    count: int,
    seed: int = 0,
    minimum_distance: float = 0.0,
    density: ArrayLike | None = None,
) -> Points:
    """Strew points over an area.

    Parameters
    ----------
    area : Rectangle, Circle or Polygon
    count : int
        A larger count adds points and moves none.
    seed : int
        The same seed gives the same points.
    minimum_distance : float
        Metres between any two points.
    density : array_like, (H, W) float, optional
        How likely points are, 0 being never, over the area's bounds: row 0 along the lowest z, column 0 along the
        lowest x.

    Returns
    -------
    ndarray, (N, 2) float64
        x and z in metres. Fewer than `count` where no more fit, or where the density is 0 nearly everywhere.

    Raises
    ------
    SettingsError
        A density with a number that is negative or not finite, or with none above 0.
    """
    rng = np.random.default_rng([seed, 0])
    picture = None if density is None else _relative_density(density)
    points = np.zeros((0, 2))
    tries, block = min(FEWEST_TRIES + TRIES_FOR_EACH * count, MOST_TRIES), FIRST_BLOCK
    while len(points) < count and tries > 0:
        random = rng.random((block, 3))
        candidates = area.points(random[:, :2])
        if picture is not None:
            candidates = candidates[random[:, 2] < _at(picture, area, candidates)]
        added = _apart(points, candidates, minimum_distance) if minimum_distance > 0 else candidates
        points = np.concatenate([points, added])
        if FULL * len(candidates) > max(len(added), 1):
            break
        tries -= block
        block = min(2 * block, LARGEST_BLOCK)
    return points[:count]


def _relative_density(density: ArrayLike) -> Points:
    picture = np.asarray(density, float)
    if picture.ndim != 2 or not picture.size or not np.all(np.isfinite(picture)) or picture.min() < 0:
        raise SettingsError("density", "is no picture of numbers of at least 0; expected (H, W)")
    if not picture.max() > 0:
        raise SettingsError("density", "is 0 everywhere; expected some place for points")
    return picture / picture.max()


def _at(picture: Points, area: Area, points: Points) -> Points:
    """The picture's value (N,) at points (N, 2)."""
    low_x, low_z, high_x, high_z = area.bounds
    share = (points - (low_x, low_z)) / (high_x - low_x, high_z - low_z)
    column, row = np.clip(share * picture.shape[::-1], 0, np.subtract(picture.shape[::-1], 1)).astype(np.intp).T
    return picture[row, column]


def _apart(points: Points, candidates: Points, distance: float) -> Points:
    """Those candidates (K, 2) that find room beside the points and beside the candidates before them."""
    distance *= 1 + ROUNDING
    if len(points):
        tree = KDTree(points, balanced_tree=False, compact_nodes=False)
        order = np.lexsort(np.floor(candidates.T / (8 * distance)))  # neighbours in turn find the tree in the cache
        nearest = np.empty(len(candidates))
        nearest[order], _ = tree.query(candidates[order], distance_upper_bound=distance)
        candidates = candidates[nearest == np.inf]
    # Two points of a cell this small are always too near. One in each bounds the number of pairs that follow.
    cells = np.floor(candidates * (np.sqrt(2) / distance)).astype(np.int64)
    _, first = np.unique(cells @ np.array([1 << 32, 1]), return_index=True)
    candidates = candidates[np.sort(first)]
    tree = KDTree(candidates) if len(candidates) else None
    pairs = np.zeros((0, 2), np.intp) if tree is None else tree.query_pairs(distance, output_type="ndarray")
    return candidates[_first_come(len(candidates), pairs)]


def _first_come(count: int, pairs: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Who stays (count,) when each in turn drives out those after it that it is paired with, (P, 2) rising."""
    open_, stays = np.ones(count, bool), np.zeros(count, bool)
    while len(pairs):
        unopposed = open_.copy()
        unopposed[pairs[:, 1]] = False
        stays |= unopposed
        open_ &= ~unopposed
        open_[pairs[unopposed[pairs[:, 0]], 1]] = False
        pairs = pairs[open_[pairs].all(axis=1)]
    return stays | open_
