"""Scattered points keep their distance, fill their area evenly and stay where they were."""

import time
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from impostor.errors import SettingsError
from impostor.scatter import Circle, Polygon, Rectangle, scatter_points

SQUARE = Rectangle(-10, 5, 10, 25)
L_SHAPE = Polygon(((0, 0), (8, 0), (8, 2), (2, 2), (2, 6), (0, 6)))
HOURGLASS = Polygon(((0, 0), (4, 0), (3, 2), (4, 4), (0, 4), (1, 2)))
SLOPED = Polygon(((0, 0), (10, 3), (4, 9)))


@dataclass(frozen=True)
class Chi:
    """Counts against the shares that were expected of them."""

    counts: np.ndarray
    shares: np.ndarray

    def fits(self):
        expected = self.shares / self.shares.sum() * self.counts.sum()
        chi = np.sum((self.counts - expected) ** 2 / expected)
        freedom = len(self.counts) - 1
        return chi < freedom + 5 * np.sqrt(2 * freedom)


@pytest.mark.parametrize("area", [SQUARE, Circle(3, -4, 12), L_SHAPE, HOURGLASS], ids=["square", "circle", "l", "hour"])
@pytest.mark.parametrize("distance", [0.05, 0.3, 2.0])
def test_every_pair_keeps_the_minimum_distance(area, distance):
    points = scatter_points(area, 900, 3, distance)
    assert len(points) > 1
    assert pdist(points).min() >= distance


def test_distance_holds_with_a_density_far_from_the_origin():
    density = np.zeros((16, 16))
    density[4, 9], density[11, 2] = 1, 0.01
    points = scatter_points(Rectangle(99_000, -99_010, 99_020, -99_000), 400, 0, 0.02, density)
    assert len(points) == 400
    assert pdist(points).min() >= 0.02


def test_an_area_is_filled_until_no_more_fit():
    """Random packing ends where discs of half the distance cover 0.547 of the plane; a few percent are left out."""
    points = scatter_points(Rectangle(0, 0, 100, 100), 100_000, 1, 2.0)
    assert 0.49 < len(points) * np.pi / 100**2 < 0.56


def test_ten_thousand_take_less_than_a_second():
    started = time.process_time()
    points = scatter_points(Rectangle(0, 0, 500, 500), 10_000, 1, 3.0)
    assert len(points) == 10_000
    assert time.process_time() - started < 1


@pytest.mark.parametrize("distance", [0.0, 0.4])
def test_the_same_seed_gives_the_same_points_and_another_others(distance):
    first, again, other = (scatter_points(SQUARE, 300, seed, distance) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, again)
    assert not np.isclose(first, other).any(axis=1).any()


@pytest.mark.parametrize("distance", [0.0, 0.2])
def test_a_larger_count_adds_points_and_moves_none(distance):
    few, many = (scatter_points(SQUARE, count, 9, distance) for count in (137, 2500))
    np.testing.assert_array_equal(few, many[: len(few)])
    assert (len(few), len(many)) == (137, 2500)


def test_a_rectangle_is_filled_evenly():
    points = scatter_points(SQUARE, 40_000)
    counts, _, _ = np.histogram2d(*points.T, bins=8, range=[[-10, 10], [5, 25]])
    assert counts.sum() == 40_000
    assert Chi(counts.ravel(), np.ones(64)).fits()


def test_a_circle_is_filled_evenly():
    points = scatter_points(Circle(3, -4, 5), 40_000)
    radius = np.hypot(*(points - (3, -4)).T)
    assert radius.max() <= 5
    counts, _ = np.histogram(radius**2, bins=16, range=(0, 25))
    assert Chi(counts, np.ones(16)).fits()


def inside(polygon, points):
    """Even-odd rule, by crossings of a ray toward +X."""
    corners = np.array(polygon.corners)
    (x, z), crossings = points.T, np.zeros(len(points), int)
    for (x0, z0), (x1, z1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if z0 != z1:
            crossings += ((z0 <= z) != (z1 <= z)) & (x < x0 + (z - z0) / (z1 - z0) * (x1 - x0))
    return crossings % 2 == 1


@pytest.mark.parametrize("polygon", [L_SHAPE, HOURGLASS, SLOPED], ids=["l", "hourglass", "sloped"])
@pytest.mark.parametrize("turn", [1, -1])
def test_a_polygon_is_filled_evenly_and_nowhere_else(polygon, turn):
    polygon = Polygon(polygon.corners[::turn])
    points = scatter_points(polygon, 40_000)
    assert inside(polygon, points).all()
    low_x, low_z, high_x, high_z = polygon.bounds
    box, cells = [[low_x, high_x], [low_z, high_z]], 6
    grid = np.random.default_rng(0).uniform((low_x, low_z), (high_x, high_z), (400_000, 2))
    shares, _, _ = np.histogram2d(*grid[inside(polygon, grid)].T, bins=cells, range=box)
    counts, _, _ = np.histogram2d(*points.T, bins=cells, range=box)
    enough = shares > 500
    assert Chi(counts[enough], shares[enough]).fits()


def test_a_density_is_followed_with_its_first_row_at_the_lowest_z():
    density = np.array([[0, 1, 2, 4], [8, 0, 1, 1], [3, 3, 0, 5]], float)
    points = scatter_points(Rectangle(0, 0, 4, 3), 30_000, 2, density=density)
    counts, _, _ = np.histogram2d(points[:, 1], points[:, 0], bins=(3, 4), range=[[0, 3], [0, 4]])
    assert counts.sum() == 30_000
    assert (counts[density == 0] == 0).all()
    assert Chi(counts[density > 0], density[density > 0]).fits()


def test_a_density_leaves_gaps_under_a_minimum_distance_too():
    density = np.kron([[1, 0], [0, 1]], np.ones((8, 8)))
    points = scatter_points(Rectangle(0, 0, 20, 20), 2000, 2, 0.5, density)
    assert len(points) > 400
    assert ((points[:, 0] < 10) == (points[:, 1] < 10)).all()


@pytest.mark.parametrize(
    ("area", "count", "distance"),
    [
        (Rectangle(0, 0, 1, 1), 1_000_000, 1000),
        (Rectangle(0, 0, 1000, 0.001), 1_000_000, 1),
        (Circle(0, 0, 1e-3), 10, 1e5),
    ],
)
def test_what_does_not_fit_ends_soon(area, count, distance):
    started = time.process_time()
    points = scatter_points(area, count, 0, distance)
    assert 1 <= len(points) < count
    assert time.process_time() - started < 2


def test_a_density_that_is_black_nearly_everywhere_ends_soon():
    density = np.zeros((1000, 1000))
    density[500, 500] = 1
    started = time.process_time()
    points = scatter_points(Rectangle(0, 0, 1000, 1000), 2000, 0, 0, density)
    assert len(points) < 2000
    assert ((points >= 500) & (points <= 501)).all()
    assert time.process_time() - started < 3


@pytest.mark.parametrize(
    ("make", "problem"),
    [
        (lambda: Rectangle(1, 0, 1, 5), "no area"),
        (lambda: Circle(0, 0, 0), "radius 0"),
        (lambda: Polygon(((0, 0), (1, 1))), "2 corners"),
        (lambda: Polygon(((0, 0), (1, 1), (2, 2))), "no area"),
        (lambda: Polygon(((0, 0), (4, 4), (4, 0), (0, 4.0))), "edges cross"),
        (lambda: Polygon(((0, 1), (4, 1), (2, 1))), "no area"),
        (lambda: scatter_points(SQUARE, 5, density=np.zeros((4, 4))), "0 everywhere"),
        (lambda: scatter_points(SQUARE, 5, density=[[1, np.nan]]), "at least 0"),
        (lambda: scatter_points(SQUARE, 5, density=[[1, -1]]), "at least 0"),
    ],
)
def test_areas_and_densities_that_make_no_sense_are_refused(make, problem):
    with pytest.raises(SettingsError, match=problem):
        make()
