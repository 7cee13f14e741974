"""A brick and timber cottage whose walls, roof and woodwork share one painted atlas."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from house_paint import ATLAS, PIXELS, REGIONS, paint_atlas
from shapes import Mesh, box, creased, extrude, merge, revolve, tube
from writers import Glb

EAVES = 3.0
PITCH = 1.15
HALF_DEPTH = 2.8
HALF_LENGTH = 4.5
RIDGE = EAVES + HALF_DEPTH * PITCH
WING_MIDDLE, WING_HALF, WING_FRONT = 2.5, 1.7, 4.1
WING_RIDGE = EAVES + WING_HALF * PITCH


def texel(region: str, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Atlas coordinates of a place in a region: metres right of its left edge and up from its foot."""
    left, top, _, height = REGIONS[region]
    return np.stack([left + x * PIXELS, top + height - y * PIXELS], axis=-1) / ATLAS


def swatch(mesh: Mesh, region: str, scale: float = 1.0) -> Mesh:
    """Dress a shape in a plain region: every face takes a piece of it, its longest way along the grain (x)."""
    _, _, width, height = np.array(REGIONS[region]) / PIXELS
    corners = mesh.positions[mesh.faces]
    normal = np.abs(mesh.normals[mesh.faces].mean(axis=1))
    extent = np.ptp(mesh.positions, axis=0)
    grain = np.argmax(np.where(normal > 0.6, -1, extent), axis=1)
    cross_axis = np.argmin(normal + 10 * np.eye(3)[grain], axis=1)
    rows = np.arange(len(corners))
    x = (corners - mesh.positions.min(axis=0)).swapaxes(1, 2)[rows, grain] * scale
    y = (corners - mesh.positions.min(axis=0)).swapaxes(1, 2)[rows, cross_axis] * scale
    x = np.clip(x, 0, None) % (width - 0.06) if np.ptp(x) < width - 0.06 else x / max(x.max(), 1e-9) * (width - 0.06)
    y = y if np.ptp(y) < height - 0.06 else y / max(y.max(), 1e-9) * (height - 0.06)
    return Mesh(
        corners.reshape(-1, 3),
        mesh.normals[mesh.faces].reshape(-1, 3),
        texel(region, x + 0.03, y + 0.03).reshape(-1, 2),
        np.arange(corners.size // 3).reshape(-1, 3),
    )


def wall(region: str, corners: Sequence[Sequence[float]], right: Sequence[float], left_foot: Sequence[float]) -> Mesh:
    """A flat convex wall; `right` is the direction that runs right in the region, from `left_foot`."""
    points = np.array(corners, dtype=float)
    offset = points - np.array(left_foot, dtype=float)
    uvs = texel(region, offset @ np.array(right, dtype=float), offset[:, 1])
    fan = np.arange(1, len(points) - 1)
    return creased(points, np.stack([np.zeros_like(fan), fan, fan + 1], axis=-1), uvs)


def walls() -> Mesh:
    """The outer walls of the main house and its front wing."""
    length, depth, low, high = HALF_LENGTH, HALF_DEPTH, WING_MIDDLE - WING_HALF, WING_MIDDLE + WING_HALF
    front = wall(
        "front",
        [(-length, 0, depth), (length, 0, depth), (length, EAVES, depth), (-length, EAVES, depth)],
        (1, 0, 0),
        (-length, 0, depth),
    )
    back = wall(
        "back",
        [(length, 0, -depth), (-length, 0, -depth), (-length, EAVES, -depth), (length, EAVES, -depth)],
        (-1, 0, 0),
        (length, 0, -depth),
    )
    sides = []
    for sign in (1.0, -1.0):
        x = sign * length
        outline = [
            (x, 0, sign * depth),
            (x, 0, -sign * depth),
            (x, EAVES, -sign * depth),
            (x, RIDGE, 0),
            (x, EAVES, sign * depth),
        ]
        sides.append(wall("side", outline, (0, 0, -sign), (x, 0, sign * depth)))
    gable = [
        (low, 0, WING_FRONT),
        (high, 0, WING_FRONT),
        (high, EAVES, WING_FRONT),
        (WING_MIDDLE, WING_RIDGE, WING_FRONT),
        (low, EAVES, WING_FRONT),
    ]
    wing = wall("wing", gable, (1, 0, 0), (low, 0, WING_FRONT))
    right = wall(
        "cheek",
        [(high, 0, WING_FRONT), (high, 0, depth), (high, EAVES, depth), (high, EAVES, WING_FRONT)],
        (0, 0, -1),
        (high, 0, WING_FRONT),
    )
    left = wall(
        "cheek",
        [(low, 0, depth), (low, 0, WING_FRONT), (low, EAVES, WING_FRONT), (low, EAVES, depth)],
        (0, 0, 1),
        (low, 0, depth),
    )
    return merge([front, back, *sides, wing, left, right])


def slab(top: np.ndarray, uvs: np.ndarray, thick: float) -> Mesh:
    """A roof slope of four corners (eaves left, eaves right, ridge right, ridge left), with thickness below."""
    under = top - [0, thick, 0]
    points = np.concatenate([top, under])
    quads = [[0, 1, 2, 3], [7, 6, 5, 4], [4, 5, 1, 0], [5, 6, 2, 1], [6, 7, 3, 2], [7, 4, 0, 3]]
    faces = np.array([t for q in quads for t in ([q[0], q[1], q[2]], [q[0], q[2], q[3]])])
    edge = np.concatenate([uvs, uvs])
    corner_uvs = edge[faces]
    rim = texel("wood", np.array([0.1, 1.4, 1.4, 0.1]), np.array([0.05, 0.05, 0.2, 0.2]))
    corner_uvs[2:] = rim[[0, 1, 2, 0, 2, 3]].reshape(-1, 3, 2).repeat(5, axis=0).reshape(10, 3, 2)
    return creased(points, faces, corner_uvs, angle_deg=20)


def roof() -> Mesh:
    """Main slopes, wing slopes and the ridge tiles."""
    over, eave = 0.28, 0.38
    parts = []
    slope = np.hypot(1, PITCH)
    run = HALF_DEPTH + eave
    for sign in (1.0, -1.0):
        x = sign * (HALF_LENGTH + over)
        low, high = EAVES - eave * PITCH + 0.10, RIDGE + 0.10
        top = np.array([(-x, low, sign * run), (x, low, sign * run), (x, high, 0), (-x, high, 0)])
        uvs = texel("roof", np.array([0, 1, 1, 0]) * 2 * abs(x), np.array([0, 0, 1, 1]) * run * slope)
        parts.append(slab(top, uvs, 0.13))
    run = WING_HALF + eave
    for sign in (1.0, -1.0):
        low, high = EAVES - eave * PITCH + 0.12, WING_RIDGE + 0.12
        near, far = WING_FRONT + over, 0.4
        ends = (far, near) if sign < 0 else (near, far)
        x = WING_MIDDLE + sign * run
        top = np.array(
            [(x, low, ends[0]), (x, low, ends[1]), (WING_MIDDLE, high, ends[1]), (WING_MIDDLE, high, ends[0])]
        )
        uvs = texel("roof", 1.3 + np.array([0, 1, 1, 0]) * (near - far), 0.4 + np.array([0, 0, 1, 1]) * run * slope)
        parts.append(slab(top, uvs, 0.13))
    for start, end in (
        ((-HALF_LENGTH - over, RIDGE + 0.09, 0), (HALF_LENGTH + over, RIDGE + 0.09, 0)),
        ((WING_MIDDLE, WING_RIDGE + 0.11, 1.2), (WING_MIDDLE, WING_RIDGE + 0.11, WING_FRONT + over)),
    ):
        count = int(np.linalg.norm(np.subtract(end, start)) / 0.38)
        for k in range(count):
            a, b = (np.add(start, np.subtract(end, start) * (k + t) / count) for t in (0.0, 1.06))
            parts.append(swatch(tube([a, b], [0.125, 0.105], 10), "ridge"))
    return merge(parts)


def barge_boards() -> Mesh:
    """Cream boards along the gables' edges."""
    parts = []
    for x, z, half, ridge, across in (
        (0, 0, HALF_DEPTH, RIDGE, "x"),
        (WING_MIDDLE, WING_FRONT + 0.29, WING_HALF, WING_RIDGE, "z"),
    ):
        run = half + 0.40
        outline = [
            (-run, ridge - run * PITCH - 0.17),
            (0, ridge - 0.17),
            (run, ridge - run * PITCH - 0.17),
            (run, ridge - run * PITCH + 0.05),
            (0, ridge + 0.05),
            (-run, ridge - run * PITCH + 0.05),
        ]
        board = swatch(extrude(outline, 0.05), "cream")
        if across == "z":
            parts.append(board.moved(x, 0, z))
        else:
            parts += [board.turned("y", 90).moved(sign * (HALF_LENGTH + 0.29), 0, 0) for sign in (1, -1)]
    return merge(parts)


def window(width: float, height: float, panes: tuple[int, int], shutters: bool) -> Mesh:
    """A window in the plane z = 0, its sill's middle at the origin: glass, frame, bars, sill, shutters."""
    left, top, wide, high = REGIONS["glass"]
    glass = creased(
        [(-width / 2, 0, 0.02), (width / 2, 0, 0.02), (width / 2, height, 0.02), (-width / 2, height, 0.02)],
        [[0, 1, 2], [0, 2, 3]],
        np.array(
            [
                (left + 2, top + high - 2),
                (left + wide - 2, top + high - 2),
                (left + wide - 2, top + 2),
                (left + 2, top + 2),
            ]
        )
        / ATLAS,
    )
    bars = [box((0.07, height + 0.07, 0.10)).moved(sign * width / 2, height / 2, 0.03) for sign in (-1, 1)]
    bars += [box((width + 0.07, 0.07, 0.10)).moved(0, y, 0.03) for y in (0.0, height)]
    bars += [
        box((0.035, height, 0.05)).moved(width * (k / panes[0] - 0.5), height / 2, 0.03) for k in range(1, panes[0])
    ]
    bars += [box((width, 0.03, 0.05)).moved(0, height * k / panes[1], 0.03) for k in range(1, panes[1])]
    parts = [glass, *(swatch(bar, "cream") for bar in bars)]
    parts.append(swatch(box((width + 0.26, 0.07, 0.22)).moved(0, -0.06, 0.09), "stone"))
    if shutters:
        leaf = [swatch(box((width * 0.48, height + 0.06, 0.05)), "shutter")]
        parts += [leaf[0].moved(sign * (width * 0.74 + 0.06), height / 2, 0.05) for sign in (-1, 1)]
    return merge(parts)


def flower_box(width: float, seed: int) -> Mesh:
    """A wooden trough filled with flowers, its back's middle at the origin."""
    rng = np.random.default_rng(seed)
    trough = swatch(box((width, 0.18, 0.20)).moved(0, 0.09, 0.10), "wood")
    clump = [(0.0, -1.0), (0.7, -0.7), (1.0, 0.0), (0.75, 0.65), (0.0, 1.0)]
    parts = [trough]
    for k, x in enumerate(np.linspace(-width / 2 + 0.06, width / 2 - 0.06, int(width / 0.11))):
        ball = revolve(np.array(clump) * rng.uniform(0.085, 0.125), 8, 180).turned("z", rng.uniform(-40, 40))
        parts.append(
            swatch(ball, ("flowers", "leaves")[k % 3 == 2]).moved(
                x, 0.20 + rng.uniform(-0.02, 0.05), 0.11 + rng.uniform(-0.04, 0.05)
            )
        )
    return merge(parts)


def chimney() -> Mesh:
    """A stack that stands through the ridge, with two pots."""
    parts = []
    low, high, wide, deep = RIDGE - 1.3, RIDGE + 1.35, 1.05, 0.72
    for turn, half, out in ((0, wide, deep), (90, deep, wide), (180, wide, deep), (270, deep, wide)):
        face = wall(
            "stack",
            [
                (-half / 2, low, out / 2),
                (half / 2, low, out / 2),
                (half / 2, high, out / 2),
                (-half / 2, high, out / 2),
            ],
            (1, 0, 0),
            (-half / 2, low, out / 2),
        )
        parts.append(face.turned("y", turn))
    for y, grow in ((high - 0.16, 0.10), (high - 0.02, 0.18)):
        parts.append(swatch(box((wide + grow, 0.13, deep + grow)).moved(0, y, 0), "brick"))
    parts.append(swatch(box((wide + 0.04, 0.08, deep + 0.04)).moved(0, high + 0.08, 0), "stone"))
    pot = [(0.15, 0.0), (0.13, 0.35), (0.16, 0.37), (0.16, 0.45), (0.11, 0.45), (0.10, 0.2), (0.0, 0.2)]
    parts += [swatch(revolve(pot, 14), "ridge").moved(x, high + 0.12, 0) for x in (-0.26, 0.26)]
    return merge(parts)


def porch() -> Mesh:
    """The door, its step and a small tiled canopy on brackets; the door's foot is the origin, facing +Z."""
    left, top, wide, high = REGIONS["door"]
    outline = [(-0.5, 0.16, 0.04), (0.5, 0.16, 0.04), (0.5, 2.26, 0.04), (-0.5, 2.26, 0.04)]
    uvs = np.array([(left, top + high), (left + wide, top + high), (left + wide, top), (left, top)]) / ATLAS
    parts = [creased(outline, [[0, 1, 2], [0, 2, 3]], uvs)]
    parts += [swatch(box((0.12, 2.22, 0.14)).moved(sign * 0.56, 1.27, 0.05), "cream") for sign in (-1, 1)]
    parts.append(swatch(box((1.24, 0.14, 0.14)).moved(0, 2.33, 0.05), "cream"))
    parts += [
        swatch(box((1.7, 0.16, 0.7)).moved(0, 0.08, 0.35), "stone"),
        swatch(box((2.1, 0.08, 1.1)).moved(0, 0.04, 0.55), "stone"),
    ]
    parts.append(
        swatch(
            revolve([(0.0, -0.03), (0.03, -0.02), (0.035, 0.0), (0.03, 0.02), (0.0, 0.03)], 10).moved(0.36, 1.2, 0.09),
            "brass",
        )
    )
    for sign in (1.0, -1.0):
        top_corners = np.array([(sign * 1.0, 2.48, 0.0), (sign * 1.0, 2.48, 0.95), (0, 3.02, 0.95), (0, 3.02, 0.0)])
        order = [1, 0, 3, 2] if sign > 0 else [0, 1, 2, 3]
        uvs = texel("roof", 3 + np.array([0, 1, 1, 0]) * 0.95, 1 + np.array([0, 0, 1, 1]) * 1.13)
        parts.append(slab(top_corners[order], uvs, 0.09))
        parts.append(swatch(tube([(sign * 0.78, 1.75, 0.05), (sign * 0.78, 2.42, 0.78)], 0.05, 4), "beam"))
        parts.append(swatch(box((0.10, 0.10, 0.92)).moved(sign * 0.78, 2.43, 0.46), "beam"))
        parts.append(swatch(box((0.10, 0.85, 0.10)).moved(sign * 0.78, 2.02, 0.05), "beam"))
    gable = extrude([(-0.88, 2.43), (0.88, 2.43), (0, 2.92)], 0.05)
    parts.append(swatch(gable, "cream").moved(0, 0, 0.86))
    return merge(parts)


def make_house(folder: Path) -> None:
    """Write house.glb."""
    glb = Glb("house")
    painted = glb.add_material("painted", texture=glb.add_texture(paint_atlas(), 86), roughness=0.95)
    house = glb.add_node("house", at=(0, 0, -0.631))
    glb.add_node("walls", glb.add_mesh("walls", [(walls(), painted)]), house)
    glb.add_node("roof", glb.add_mesh("roof", [(merge([roof(), barge_boards()]), painted)]), house)
    glb.add_node("chimney", glb.add_mesh("chimney", [(chimney(), painted)]), house, at=(-2.9, 0, 0))
    glb.add_node("porch", glb.add_mesh("porch", [(porch(), painted)]), house, at=(-0.75, 0, HALF_DEPTH))
    wide = glb.add_mesh("wide window", [(window(1.5, 1.25, (3, 2), True), painted)])
    small = glb.add_mesh("small window", [(window(0.85, 1.05, (2, 2), False), painted)])
    trough = glb.add_mesh("flower box", [(flower_box(1.5, 3), painted)])
    for k, (mesh, x, y, z, turn) in enumerate(
        (
            (wide, -2.95, 0.95, HALF_DEPTH, 0),
            (wide, WING_MIDDLE, 0.95, WING_FRONT, 0),
            (small, WING_MIDDLE, 3.1, WING_FRONT, 0),
            (wide, 2.6, 0.95, -HALF_DEPTH, 180),
            (wide, -2.6, 0.95, -HALF_DEPTH, 180),
            (small, 0.0, 1.1, -HALF_DEPTH, 180),
            (small, HALF_LENGTH, 3.55, 0.0, 90),
            (small, -HALF_LENGTH, 3.55, 0.0, -90),
            (small, HALF_LENGTH, 1.1, -1.2, 90),
            (small, -HALF_LENGTH, 1.1, 1.1, -90),
        )
    ):
        node = glb.add_node(f"window {k + 1}", mesh, house, at=(x, y, z), turn=("y", turn))
        if mesh == wide and z > 0:
            glb.add_node(f"flower box {k + 1}", trough, node, at=(0, -0.22, 0.10))
    glb.save(folder / "house.glb")
