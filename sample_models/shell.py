"""A sea shell with vertex colours, and a knot of square bar."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from paint import mix, noise, ramp, rgb, to_bytes
from scipy.ndimage import map_coordinates
from shapes import frames, grid, loft, merge, rotation
from writers import write_ply, write_stl

WHORLS = 6.2
GROWTH = 1.62


def whorl_surface(turns: np.ndarray, around: np.ndarray, inner: float = 1.0) -> np.ndarray:
    """Points, (len(turns), len(around), 3), of a helicospiral tube; the apex is at the origin and the axis is -Y.

    `turns` counts whorls from the apex, `around` runs about the tube's section from its outer edge toward the apex.
    """
    size = GROWTH ** (turns - WHORLS)
    ribs = 0.055 * np.maximum(np.cos(2 * np.pi * turns * 11), 0.0) ** 2
    knobs = 0.22 * np.maximum(np.cos(2 * np.pi * turns * 11), 0.0) ** 4
    shoulder = np.exp(-(((around - 0.75) / 0.32) ** 2))
    threads = 0.012 * np.cos(around * 22)
    lip = 0.35 * np.clip((turns - WHORLS + 0.10) / 0.10, 0, 1) ** 2
    bulge = 1 + ribs[:, None] + knobs[:, None] * shoulder + threads + lip[:, None] * np.clip(np.cos(around - 0.2), 0, 1)
    radius = inner * 0.0215 * size[:, None] * bulge
    out = radius * np.cos(around)
    up = radius * np.sin(around) * np.where(np.sin(around) < 0, 1.75, 1.18)
    from_axis = 0.0182 * size[:, None] + out
    from_axis = np.maximum(from_axis, 0.0008 * size[:, None])
    height = -0.076 * size[:, None] + up
    angle = 2 * np.pi * turns[:, None]
    return np.stack([from_axis * np.sin(angle), height, from_axis * np.cos(angle)], axis=-1)


def shell_colors(turns: np.ndarray, around: np.ndarray) -> np.ndarray:
    """Cream with chestnut flames and spiral bands, (R, C, 3) sRGB 0..1."""
    rows, columns = len(turns), len(around)
    cloud = noise((512, 128), 4, 1.7)
    at = np.meshgrid(turns * 60, around / (2 * np.pi) * 128, indexing="ij")
    cloud = map_coordinates(cloud, at, order=1, mode="wrap")
    flame = np.sin(2 * np.pi * (turns[:, None] * 9 + 0.35 * np.sin(2 * around) + 0.22 * cloud)) + 0.55 * cloud
    band = np.cos(around * 3 + 0.6) ** 2
    base = ramp(np.broadcast_to(0.5 + 0.3 * np.sin(around) + 0.1 * cloud, (rows, columns)), ("#c98f62", "#e6c49a", "#f0dfc2"))
    color = mix(base, rgb("#8c4a2a"), np.clip(1.3 * flame - 0.25, 0, 1) * (0.35 + 0.6 * band))
    color = mix(color, rgb("#5d2c1f"), 0.7 * np.clip(1.6 * flame - 1.3, 0, 1) * band)
    young = np.clip(1 - turns / 2.6, 0, 1)[:, None] * np.ones((1, columns))
    return mix(color, rgb("#b06d6a"), 0.75 * young)


def make_shell(folder: Path) -> None:
    """Write shell.ply."""
    turns = WHORLS * np.linspace(0.0, 1.0, 420) ** 0.75
    around = np.linspace(-np.pi, np.pi, 57)
    outside = grid(whorl_surface(turns, around), around=True)
    colors = shell_colors(turns, around)
    back = np.linspace(WHORLS, WHORLS - 0.62, 44)
    thickness = np.clip(1 - 0.055 * np.clip((WHORLS - back) / 0.02, 0, 1), 0, 1)
    throat = grid(whorl_surface(back, around) * 1.0, around=True)
    inner = np.stack([whorl_surface(back[k : k + 1], around, thickness[k])[0] for k in range(len(back))])
    throat = grid(inner, around=True)
    glow = np.broadcast_to(np.linspace(0, 1, len(back))[:, None], inner.shape[:2])
    pink = ramp(glow, ("#f0d9c4", "#e3a98f", "#c9776a", "#8f4a4a", "#5a2f33"))
    shape = merge([outside, throat])
    color = to_bytes(np.concatenate([colors.reshape(-1, 3), pink.reshape(-1, 3)]))
    turn = rotation("z", 14) @ rotation("x", -10) @ rotation("y", 200)
    points = shape.positions @ turn.T
    low, high = points.min(axis=0), points.max(axis=0)
    points -= [(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2]
    write_ply(folder / "shell.ply", replace(shape, positions=points, normals=shape.normals @ turn.T), color)


def make_knot(folder: Path) -> None:
    """Write knot.stl: a trefoil of bevelled square bar, in metres."""
    turn = np.linspace(0, 2 * np.pi, 181)
    path = np.stack([np.sin(turn) + 2 * np.sin(2 * turn), np.cos(turn) - 2 * np.cos(2 * turn), -1.15 * np.sin(3 * turn)], axis=-1)
    tangent, side, up = frames(path)
    closing = np.arctan2(side[-1] @ up[0], side[-1] @ side[0])
    twist = -turn / (2 * np.pi) * closing + turn
    corners = np.radians([45, 135, 225, 315])
    square = 0.62 * np.stack([np.cos(corners), np.sin(corners)], axis=-1)
    following = np.roll(square, -1, axis=0)
    section = np.stack([square + 0.13 * (following - square), following + 0.13 * (square - following)], axis=1).reshape(-1, 2)
    a = np.cos(twist)[:, None] * side + np.sin(twist)[:, None] * up
    b = np.cross(tangent, a)
    points = path[:, None] + section[:, :1] * a[:, None] + section[:, 1:] * b[:, None]
    points[-1] = points[0]
    knot = loft(points, caps=False)
    low, high = knot.positions.min(axis=0), knot.positions.max(axis=0)
    points = (knot.positions - [(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2]) * 0.04
    write_stl(folder / "knot.stl", replace(knot, positions=points))


