"""Footprints: how much light from all around an object keeps from the ground near its feet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, grey_dilation

from impostor.fan import DEPTH_CODES, Fan
from impostor.model import Model

SIDE = 64  # texels
LIFTS = 4  # quarters of the reach, as the shader has them
STEPS = 12  # of height within the reach
DIRECTIONS = 48
WIDEST = 2.0
"""Tangent from straight up within which light is looked for: four fifths of what reaches level ground."""
MOST_VIEWS = 24
SMOOTHED = 0.7  # texels, standard deviation
RIM = 3  # texels
GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
Vector2 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Footprint:
    """What an object keeps from the ground around its feet.

    Parameters
    ----------
    hidden : ndarray, (S, S, 4) uint8
        Part of the light, along v and u, of the object lifted by 0 to 3 quarters of its reach.
    low, high : ndarray, (2,) float64
        The rectangle it covers along u and v, metres of the model.
    base : float
        Height of the lowest point.
    reach : float
        How far above the base parts of the object count, metres.
    """

    hidden: NDArray[np.uint8]
    low: Vector2
    high: Vector2
    base: float
    reach: float


def fan_footprint(fan: Fan, reach: float) -> Footprint:
    """Of what no view sees through; u is +X and v is +Z.

    Parameters
    ----------
    fan : Fan
    reach : float
        A part of the object's height.
    """
    views = np.unique(np.linspace(0, len(fan.views), MOST_VIEWS, endpoint=False).astype(np.intp))
    points = np.concatenate([_seen_points(fan, int(view)) for view in views] or [np.zeros((0, 3))])
    if not len(points):
        return _empty()
    base, metres = float(points[:, 1].min()), reach * float(np.ptp(points[:, 1]))
    near = points[points[:, 1] <= base + metres][:, [0, 2]]
    low, high = _rectangle(near, metres)
    u, v = (_centres(low[axis], high[axis]) for axis in (0, 1))
    heights = (np.arange(STEPS) + 0.5) / STEPS * metres
    lowest = np.full((SIDE, SIDE), np.inf)
    columns, rows = (np.flatnonzero((x >= near[:, i].min()) & (x <= near[:, i].max())) for i, x in ((0, u), (1, v)))
    z, y, x = np.meshgrid(v[rows], base + heights, u[columns], indexing="ij")
    solid = np.ones(x.shape, bool)
    for view in views:
        solid &= _hidden_from(fan, int(view), np.stack([x, y, z], axis=-1))
    found = np.where(solid.any(axis=1), heights[solid.argmax(axis=1)], np.inf)
    lowest[np.ix_(rows, columns)] = found
    return Footprint(_hidden(lowest, low, high, metres), low, high, base, metres)


def model_footprint(model: Model, axes: NDArray[np.float64], reach: float) -> Footprint:
    """Of the lowest surface of a mesh.

    Parameters
    ----------
    model : Model
    axes : ndarray, (3, 3) float64
        Unit vectors u, up and v in model space.
    reach : float
        A part of the object's height.
    """
    heights = [part.positions @ axes[1] for part in model.primitives]
    base, top = min(float(h.min()) for h in heights), max(float(h.max()) for h in heights)
    metres = reach * (top - base)
    if not metres > 0:
        return _empty()
    corners = []
    for part, height in zip(model.primitives, heights, strict=True):
        low = height[part.triangles].min(axis=1) <= base + metres
        corners.append(part.positions[part.triangles[low]].astype(np.float64) @ axes.T)
    points = _scattered(np.concatenate(corners))
    points = points[points[:, 1] <= base + metres]
    low, high = _rectangle(points[:, [0, 2]], metres)
    column, row = np.clip(((points[:, [0, 2]] - low) / (high - low) * SIDE).astype(np.intp), 0, SIDE - 1).T
    lowest = np.full((SIDE, SIDE), np.inf)
    np.minimum.at(lowest, (row, column), points[:, 1] - base)
    return Footprint(_hidden(lowest, low, high, metres), low, high, base, metres)


def _empty() -> Footprint:
    return Footprint(np.zeros((SIDE, SIDE, LIFTS), np.uint8), np.zeros(2), np.ones(2), 0.0, 1.0)


def _rectangle(points: NDArray[np.float64], metres: float) -> tuple[Vector2, Vector2]:
    """What holds points (N, 2) and all that they keep light from."""
    margin = WIDEST * metres * (1 + 2 / SIDE)
    return points.min(axis=0) - margin, points.max(axis=0) + margin


def _centres(low: float, high: float) -> NDArray[np.float64]:
    return low + (np.arange(SIDE) + 0.5) / SIDE * (high - low)


def _seen_points(fan: Fan, view: int) -> NDArray[np.float64]:
    """What one view shows, (N, 3) in model space."""
    step = max(fan.size // 128, 1)
    row, column = np.nonzero(fan.silhouette[view, ::step, ::step])
    row, column, camera = row * step, column * step, fan.views[view]
    low, high = camera.depth_range
    x, y = (column + 0.5) * (2 / fan.size) - 1, 1 - (row + 0.5) * (2 / fan.size)
    z = low + fan.depth[view, row, column] * ((high - low) / DEPTH_CODES)
    return camera.unproject(np.stack([x * camera.radius, y * camera.radius, z], axis=-1))


def _hidden_from(fan: Fan, view: int, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether points (..., 3) lie at or behind what a view shows."""
    camera = fan.views[view]
    xyz = camera.project(points)
    column, row = (
        np.floor((1 + sign * xyz[..., axis] / camera.radius) * (fan.size / 2)).astype(np.intp)
        for axis, sign in ((0, 1), (1, -1))
    )
    inside = (column >= 0) & (column < fan.size) & (row >= 0) & (row < fan.size)
    column, row = np.clip(column, 0, fan.size - 1), np.clip(row, 0, fan.size - 1)
    low, high = camera.depth_range
    surface = low + fan.depth[view, row, column] * ((high - low) / DEPTH_CODES)
    texel = 2 * camera.radius / fan.size
    return inside & fan.silhouette[view, row, column] & (xyz[..., 2] <= surface + texel)


def _scattered(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (N, 3) spread evenly over triangles (M, 3, 3), and their corners."""
    a, b, c = triangles.swapaxes(0, 1)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=-1).cumsum()
    random = np.random.default_rng(0).random((3, 16 * SIDE * SIDE))
    which = np.minimum(np.searchsorted(areas, random[0] * areas[-1]), len(areas) - 1)
    root = np.sqrt(random[1])[:, None]
    across = random[2][:, None]
    inside = (1 - root) * a[which] + root * ((1 - across) * b[which] + across * c[which])
    return np.concatenate([inside, triangles.reshape(-1, 3)])


def _hidden(lowest: NDArray[np.float64], low: Vector2, high: Vector2, reach: float) -> NDArray[np.uint8]:
    """How much light is kept from each texel by what stands over texels of some height, and all above it.

    Parameters
    ----------
    lowest : ndarray, (S, S) float64
        Height over the base along v and u; infinite where there is nothing.
    low, high : ndarray, (2,) float64
    reach : float

    Returns
    -------
    ndarray, (S, S, LIFTS) uint8

    Notes
    -----
    Light comes from directions spread by the cosine over a cone. One that is blocked counts less near the reach, so
    that the darkening ends smoothly there.
    """
    number = np.arange(DIRECTIONS)
    sine = np.sqrt((number + 0.5) / DIRECTIONS) * WIDEST / np.hypot(1, WIDEST)
    spread = sine / np.sqrt(1 - sine**2) * np.exp(1j * GOLDEN_ANGLE * number)
    texels = SIDE / (high - low)
    pad = int(np.ceil(WIDEST * reach * texels.max())) + 1
    padded = np.pad(lowest.astype(np.float32), pad, constant_values=np.inf)
    total = np.zeros((LIFTS, SIDE, SIDE), np.float32)
    for along in spread:
        blocked = np.zeros_like(total)
        for height in (np.arange(STEPS)[::-1] + 0.5) / STEPS * reach:
            right, down = np.rint(height * np.array([along.real, along.imag]) * texels).astype(int)
            seen = padded[pad + down : pad + down + SIDE, pad + right : pad + right + SIDE]
            for lift in range(LIFTS):
                blocked[lift][seen + lift / LIFTS * reach <= height] = 1 - (height / reach) ** 2
        total += blocked
    total /= DIRECTIONS
    total[0] = _under_contact(total[0], lowest < reach / STEPS)
    total = gaussian_filter(total, (0, SMOOTHED, SMOOTHED))
    total[:, [0, -1]] = total[:, :, [0, -1]] = 0
    return np.rint(np.moveaxis(total, 0, -1) * 255).astype(np.uint8)


def _under_contact(hidden: NDArray[np.float32], contact: NDArray[np.bool_]) -> NDArray[np.float32]:
    """As dark under the rim of what touches the ground as right beside it, so that no black line shows around it."""
    beside = np.where(contact, 0, hidden)
    for _ in range(RIM):
        beside = np.where(contact, grey_dilation(beside, (3, 3)), hidden)
    return np.where(contact & (beside > 0), beside, hidden)
