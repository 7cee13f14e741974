"""Averages of a cube map under round lobes, by spherical harmonics: smooth, and wide lobes cost no more than narrow."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from impostor.environment.cube import face_directions, reduced

Lobe = Callable[[NDArray[np.floating]], NDArray[np.floating]]
"""From angles away from its middle, radians, to weights of any scale."""

ROWS_PER_DEGREE = 4
ORDERS_AT_ONCE = 32
PROFILE_STEPS = 4096


def convolved(
    faces: NDArray[np.float32], lobes: Sequence[Lobe], sizes: Sequence[int], degrees: Sequence[int]
) -> list[NDArray[np.float32]]:
    """Weighted means of a cube map around all directions.

    Parameters
    ----------
    faces : ndarray, (6, N, N, 3) float32
    lobes : sequence of callable
    sizes : sequence of int
        For each lobe the side of the faces that it gives.
    degrees : sequence of int
        For each lobe that of its finest harmonics; what it holds beyond is lost.

    Returns
    -------
    list of ndarray, (6, sizes[k], sizes[k], 3) float32
        Within the range of `faces`.

    Notes
    -----
    A convolution with a round lobe multiplies all harmonics of one degree by one number. Light is spread over a grid of
    directions, many for each wave of the finest harmonic, so that each texel keeps its energy and its place.

    References
    ----------
    Driscoll, Healy, "Computing Fourier Transforms and Convolutions on the 2-Sphere", 1994, theorem 1.
    """
    grid = _spread(faces, rows=ROWS_PER_DEGREE * max(degrees))
    grids = _convolved_grids(grid, _factors(lobes, degrees), np.asarray(degrees))
    low, high = faces.min(axis=(0, 1, 2)), faces.max(axis=(0, 1, 2))
    return [
        np.stack([np.clip(_from_bordered(grid, toward), low, high) for toward in face_directions(size)])
        for grid, size in zip(map(_bordered, grids), sizes, strict=True)
    ]


def _spread(faces: NDArray[np.float32], rows: int) -> NDArray[np.float64]:
    """Light times solid angle on a grid of directions, row 0 around +y, (rows, 2 * rows, 3) float64."""
    size = faces.shape[1]
    while size > rows // 2:
        size //= 2
    light, toward = reduced(faces, size)
    row, column, down, right = _places(toward.reshape(-1, 3), rows)
    grid = np.zeros((3, (rows + 2) * (2 * rows + 1)))
    for step_down, step_right in ((0, 0), (0, 1), (1, 0), (1, 1)):
        weight = (down if step_down else 1 - down) * (right if step_right else 1 - right)
        cell = (row + step_down) * (2 * rows + 1) + column + step_right
        for channel in range(3):
            grid[channel] += np.bincount(cell, weight * light[..., channel].ravel(), grid.shape[1])
    grid = grid.reshape(3, rows + 2, 2 * rows + 1).transpose(1, 2, 0)
    # What fell into the border belongs to the texels that `_bordered` copies there.
    grid[:, 0] += grid[:, -1]
    grid = grid[:, :-1]
    grid[1] += np.roll(grid[0], rows, axis=0)
    grid[-2] += np.roll(grid[-1], rows, axis=0)
    return grid[1:-1]


def _bordered(grid: NDArray[np.floating]) -> NDArray[np.floating]:
    """A grid of directions with what lies beyond its poles and its last column, (rows + 2, 2 * rows + 1, 3)."""
    rows = grid.shape[0]
    grid = np.concatenate([np.roll(grid[:1], rows, axis=1), grid, np.roll(grid[-1:], rows, axis=1)])
    return np.concatenate([grid, grid[:, :1]], axis=1)


def _from_bordered(grid: NDArray[np.floating], directions: NDArray[np.float64]) -> NDArray[np.float32]:
    """Bilinear look-up in a bordered grid of directions."""
    row, column, down, right = _places(directions, grid.shape[0] - 2)
    down, right = down[..., None], right[..., None]
    upper = grid[row, column] * (1 - right) + grid[row, column + 1] * right
    lower = grid[row + 1, column] * (1 - right) + grid[row + 1, column + 1] * right
    return (upper * (1 - down) + lower * down).astype(np.float32)


def _places(directions: NDArray[np.floating], rows: int):
    """Row and column of the upper left of the four nearest directions of a grid with a border, and the way on."""
    x, y, z = np.moveaxis(directions, -1, 0)
    down = np.arctan2(np.hypot(x, z), y) * (rows / np.pi) + 0.5
    right = np.arctan2(x, z) * (rows / np.pi) % (2 * rows)
    row, column = np.minimum(down.astype(np.intp), rows), np.minimum(right.astype(np.intp), 2 * rows - 1)
    return row, column, down - row, right - column


def _factors(lobes: Sequence[Lobe], degrees: Sequence[int]) -> NDArray[np.float64]:
    """What lobes multiply the harmonics of every degree by, (finest + 1, lobes) float64; 0 beyond a lobe's own."""
    angles = (np.arange(PROFILE_STEPS) + 0.5) * (np.pi / PROFILE_STEPS)
    weights = np.stack([lobe(angles) for lobe in lobes], axis=-1) * np.sin(angles)[:, None]
    weights /= weights.sum(axis=0)
    x = np.cos(angles)
    factors, before, polynomial = [], np.zeros_like(x), np.ones_like(x)
    for n in range(max(degrees) + 1):
        factors.append((polynomial @ weights) * (n <= np.asarray(degrees)))
        before, polynomial = polynomial, ((2 * n + 1) * x * polynomial - n * before) / (n + 1)
    return np.stack(factors)


def _convolved_grids(
    grid: NDArray[np.float64], factors: NDArray[np.float64], degrees: NDArray[np.intp]
) -> list[NDArray[np.float32]]:
    """Light times solid angle to weighted means under every lobe, (rows, 2 * rows, 3) float32 each."""
    rows, (orders, lobes) = grid.shape[0], factors.shape
    half = rows // 2
    waves = np.fft.rfft(grid, axis=1)[:, :orders].swapaxes(0, 1)
    north, south = np.ascontiguousarray(waves[:, :half]), np.ascontiguousarray(waves[:, : half - 1 : -1])
    out = np.zeros((lobes, orders, rows, 3), np.complex128)
    x = np.cos((np.arange(half) + 0.5) * (np.pi / rows))
    for order, polynomials in _legendre(orders - 1, x):
        has = np.flatnonzero(degrees >= order)
        for odd in (0, 1):
            # Polynomials of even distance from their order are alike north and south, the others opposite.
            sign, part = 1 - 2 * odd, polynomials[odd::2]
            harmonics = part @ (north[order] + sign * south[order]).view(np.float64)
            lobed = factors[order + odd :: 2, has, None] * harmonics[:, None]
            wave = (part.T @ lobed.reshape(len(part), len(has) * 6)).view(np.complex128)
            wave = wave.reshape(half, len(has), 3).swapaxes(0, 1)
            out[has, order, :half] += wave
            out[has, order, half:] += sign * wave[:, ::-1]
    means = (np.fft.irfft(each, 2 * rows, axis=0) * (2 * rows) for each in out)
    return [np.ascontiguousarray(each.swapaxes(0, 1), np.float32) for each in means]


def _legendre(degree: int, x: NDArray[np.float64]) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """For every order m associated Legendre polynomials of degrees m to `degree`, (degree + 1 - m, len(x)) float64.

    Scaled so that with exp(i m longitude) they are orthonormal on the sphere.
    """
    numbers = np.arange(1, degree + 1)
    logs = np.concatenate([[0], np.cumsum(np.log((2 * numbers - 1) / (2 * numbers)))])
    for first in range(0, degree + 1, ORDERS_AT_ONCE):
        m = np.arange(first, min(first + ORDERS_AT_ONCE, degree + 1))[:, None]
        table = np.zeros((degree + 1 - first, len(m), len(x)))
        table[0] = np.exp((logs[m] + np.log((2 * m + 1) / (4 * np.pi)) + m * np.log(1 - x**2)) / 2)
        for step in range(1, len(table)):
            n = m + step
            back = np.sqrt(((n - 1) ** 2 - m**2) / (4 * (n - 1) ** 2 - 1)) * table[step - 2] if step > 1 else 0
            table[step] = np.sqrt((4 * n**2 - 1) / (n**2 - m**2)) * (x * table[step - 1] - back)
        for place, order in enumerate(m[:, 0].tolist()):
            yield order, table[: degree + 1 - order, place]
