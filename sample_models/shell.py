"""A sea shell with vertex colours, and a knot of square bar."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from paint import mix, noise, ramp, rgb, to_bytes
from scipy.ndimage import map_coordinates
from shapes import Mesh, frames, grid, loft, merge, revolve, rotation
from writers import write_ply, write_stl

WHORLS = 6.0
GROWTH = 1.52
RIBS = 9


def whorl_surface(turns: np.ndarray, around: np.ndarray, inner: float = 1.0) -> np.ndarray:
    """Points, (len(turns), len(around), 3), of a helicospiral tube; the apex is at the origin and the axis is -Y.

    `turns` counts whorls from the apex, `around` runs about the tube's section from its outer edge toward the apex.
    """
    size = GROWTH ** (turns - WHORLS)
    rib = np.maximum(np.cos(2 * np.pi * turns * RIBS), 0.0)[:, None]
    shoulder = np.exp(-(((around - 0.62) / 0.30) ** 2)) + 0.45 * np.exp(-(((around + 0.35) / 0.26) ** 2))
    threads = 0.010 * np.cos(around * 15)
    lip = np.clip((turns - WHORLS + 0.12) / 0.12, 0, 1)[:, None] ** 2
    flare = 0.42 * lip * np.clip(np.cos(around - 0.1), 0, 1) ** 0.7
    bulge = 1 + 0.035 * rib**2 + 0.15 * rib**3 * shoulder + threads + flare
    radius = inner * 0.0300 * size[:, None] * bulge
    out = radius * np.cos(around)
    up = radius * np.sin(around) * np.where(np.sin(around) < 0, 1.9, 1.0)
    from_axis = np.maximum(0.0245 * size[:, None] + out, 0.0006 * size[:, None])
    height = -0.098 * size[:, None] + up
    angle = 2 * np.pi * turns[:, None]
    return np.stack([from_axis * np.sin(angle), height, from_axis * np.cos(angle)], axis=-1)


def shell_colors(turns: np.ndarray, around: np.ndarray) -> np.ndarray:
    """Cream with chestnut flames and spiral bands, (R, C, 3) sRGB 0..1."""
    rows, columns = len(turns), len(around)
    at = np.meshgrid(turns * 60, around / (2 * np.pi) * 128, indexing="ij")
    cloud = map_coordinates(noise((512, 128), 4, 1.7), at, order=1, mode="grid-wrap")
    flame = np.sin(2 * np.pi * (turns[:, None] * RIBS / 2 + 0.30 * np.sin(2 * around) + 0.16 * cloud)) + 0.4 * cloud
    cord = np.clip(2.2 * np.cos(around * 8 + 0.4) - 1.0, 0, 1)
    broken = np.clip(1.5 + 2.0 * np.sin(2 * np.pi * turns * RIBS * 2.5)[:, None] + cloud, 0.15, 1)
    tone = np.broadcast_to(0.55 + 0.28 * np.sin(around) + 0.14 * cloud, (rows, columns))
    color = mix(ramp(tone, ("#d8a878", "#eecfa8", "#f5e9d2")), rgb("#b5683b"), 0.85 * np.clip(1.5 * flame - 0.35, 0, 1))
    color = mix(color, rgb("#7a3f28"), 0.8 * np.clip(1.8 * flame - 1.5, 0, 1))
    color = mix(color, rgb("#85492e"), 0.75 * cord * broken)
    young = np.clip(1 - turns / 3.0, 0, 1)[:, None] * np.ones((1, columns))
    return mix(color, rgb("#b9807a"), 0.8 * young)


def stand() -> Mesh:
    """A turned walnut foot."""
    rows = [
        (0.040, 0.0),
        (0.040, 0.006),
        (0.037, 0.009),
        (0.030, 0.011),
        (0.026, 0.017),
        (0.024, 0.019),
        (0.024, 0.021),
    ]
    return revolve([*rows, (0.018, 0.021), (0.0, 0.016)], 48)


def make_shell(folder: Path) -> None:
    """Write shell.ply."""
    turns = WHORLS * np.linspace(0.0, 1.0, 380) ** 0.68
    around = np.linspace(-np.pi, np.pi, 81)
    outside = grid(whorl_surface(turns, around), around=True).flipped()
    # The lip turns over, and the inner wall runs back into the shell.
    back = WHORLS - 0.60 * np.linspace(0, 1, 28) ** 1.3
    thickness = 1 - 0.05 * np.clip((WHORLS - back) / 0.015, 0, 1)
    throat = grid(
        np.concatenate([whorl_surface(back[k : k + 1], around, thickness[k]) for k in range(len(back))]), around=True
    ).flipped()
    depth = np.broadcast_to(np.linspace(0, 1, len(back))[:, None], (len(back), len(around)))
    inside = ramp(depth, ("#f4e3d0", "#f0c6ad", "#e2a08c", "#c47a70", "#9a5757"))

    turn = rotation("z", -10) @ rotation("x", 8) @ rotation("y", -35)
    shell = merge([outside, throat])
    points = shell.positions @ turn.T
    lowest = points[points[:, 1].argmin()]
    shell = replace(shell, positions=points - lowest + (0, 0.0135, 0), normals=shell.normals @ turn.T)
    foot = stand()
    wood = np.broadcast_to(rgb("#4f3626"), (len(foot.positions), 3))
    shape = merge([shell, foot])
    low, high = shape.positions.min(axis=0), shape.positions.max(axis=0)
    shape = shape.moved(-(low[0] + high[0]) / 2, -low[1], -(low[2] + high[2]) / 2)
    colors = np.concatenate([shell_colors(turns, around).reshape(-1, 3), inside.reshape(-1, 3), wood])
    write_ply(folder / "shell.ply", shape, to_bytes(colors))


def make_knot(folder: Path) -> None:
    """Write knot.stl: a trefoil of bevelled square bar, in metres."""
    turn = np.linspace(0, 2 * np.pi, 241)
    path = np.stack(
        [np.sin(turn) + 2 * np.sin(2 * turn), np.cos(turn) - 2 * np.cos(2 * turn), -1.15 * np.sin(3 * turn)], axis=-1
    )
    tangent, side, up = frames(path)
    closing = np.arctan2(side[-1] @ up[0], side[-1] @ side[0])
    twist = -turn / (2 * np.pi) * closing + turn
    corners = np.radians([45, 135, 225, 315])
    square = 0.62 * np.stack([np.cos(corners), np.sin(corners)], axis=-1)
    following = np.roll(square, -1, axis=0)
    along = np.array([0.12, 0.37, 0.63, 0.88])[:, None]
    section = np.concatenate([p + along * (q - p) for p, q in zip(square, following, strict=True)])
    a = np.cos(twist)[:, None] * side + np.sin(twist)[:, None] * up
    b = np.cross(tangent, a)
    points = path[:, None] + section[:, :1] * a[:, None] + section[:, 1:] * b[:, None]
    points[-1] = points[0]
    knot = loft(points, caps=False)
    low, high = knot.positions.min(axis=0), knot.positions.max(axis=0)
    points = (knot.positions - [(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2]) * 0.04
    write_stl(folder / "knot.stl", replace(knot, positions=points))
