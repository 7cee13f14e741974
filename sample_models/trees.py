"""A broadleaf tree, grown by space colonisation, and a conifer."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from paint import bark, blade, bleed, rgb, shrink, to_bytes
from scipy.spatial import KDTree
from shapes import Mesh, frames, grid, merge, unit
from writers import LICENCE, Glb, write_obj

# Crown of the broadleaf tree: ellipsoids of leaves as (x, y, z, radius, height of the radius over it).
PUFFS = np.array(
    [
        [0.0, 6.3, 0.0, 2.0, 0.85],
        [1.7, 5.1, 0.5, 1.55, 0.80],
        [-1.6, 5.3, 0.7, 1.60, 0.80],
        [0.3, 5.0, -1.8, 1.60, 0.80],
        [-0.2, 4.7, 1.8, 1.45, 0.78],
        [-1.7, 4.4, -1.0, 1.30, 0.75],
        [1.5, 4.2, -1.2, 1.25, 0.75],
        [2.35, 4.0, 0.9, 1.05, 0.75],
        [-2.4, 4.1, 0.5, 1.05, 0.75],
        [0.5, 7.3, 0.2, 1.25, 0.85],
    ]
)
CROWN = np.array([0.0, 4.6, 0.0])


@dataclass
class Skeleton:
    """Nodes of a tree: each knows its parent; node 0 is the foot."""

    points: np.ndarray
    parents: np.ndarray
    radii: np.ndarray


def crown_depth(points: np.ndarray) -> np.ndarray:
    """How deep points lie in the crown: 0 at or outside its surface, 1 at the middle of a puff."""
    offset = (points[:, None] - PUFFS[None, :, :3]) / PUFFS[:, 3:4]
    offset[..., 1] /= PUFFS[:, 4]
    return np.clip(1 - np.linalg.norm(offset, axis=-1).min(axis=1), 0, 1)


def grow(rng: np.random.Generator, step: float = 0.2) -> Skeleton:
    """Grow branches toward random points of the crown, each of which draws the nearest branch until it is reached."""
    puff = rng.choice(len(PUFFS), 1500, p=PUFFS[:, 3] ** 3 / (PUFFS[:, 3] ** 3).sum())
    spread = unit(rng.standard_normal((1500, 3))) * rng.random((1500, 1)) ** 0.3
    targets = PUFFS[puff, :3] + spread * PUFFS[puff, 3:4] * np.array([0.92, 0.75, 0.92])
    heights = np.arange(0, 2.3, step)
    wander = np.stack([0.07 * np.sin(1.7 * heights), heights, 0.05 * np.sin(2.3 * heights + 1)], axis=1)
    points = list(wander - wander[0])
    parents = [-1, *range(len(points) - 1)]
    for _ in range(90):
        distance, nearest = KDTree(np.array(points)).query(targets)
        nearest = np.asarray(nearest)
        targets, nearest = targets[distance > 2 * step], nearest[distance > 2 * step]
        if len(targets) == 0:
            break
        pull = np.zeros((len(points), 3))
        np.add.at(pull, nearest, unit(targets - np.array(points)[nearest]))
        for node in np.unique(nearest):
            direction = unit(unit(pull[node]) + rng.normal(0, 0.12, 3) + (0, 0.08, 0))
            points.append(points[node] + step * direction)
            parents.append(int(node))
    return Skeleton(np.array(points), np.array(parents), np.zeros(len(points)))


def thicken(skeleton: Skeleton, tip: float = 0.0135, power: float = 2.1) -> Skeleton:
    """Set the radii by the pipe model, and straighten small kinks."""
    points, parents = skeleton.points.copy(), skeleton.parents
    area = np.zeros(len(points))
    for node in range(len(points) - 1, 0, -1):
        area[node] = area[node] or tip**power
        area[parents[node]] += area[node]
    for _ in range(2):
        middle = points.copy()
        count = np.ones(len(points))
        np.add.at(middle, parents[1:], points[1:])
        np.add.at(count, parents[1:], 1)
        middle[1:] += points[parents[1:]]
        count[1:] += 1
        points[2:] = (middle / count[:, None])[2:]
    return Skeleton(points, parents, area ** (1 / power))


def chains(skeleton: Skeleton) -> list[list[int]]:
    """Split a tree into branches: each runs on into its thickest child."""
    children: list[list[int]] = [[] for _ in skeleton.points]
    for node, parent in enumerate(skeleton.parents):
        if parent >= 0:
            children[parent].append(node)
    found, starts = [], [[0]]
    while starts:
        chain = starts.pop()
        while children[chain[-1]]:
            ordered = sorted(children[chain[-1]], key=lambda node: -skeleton.radii[node])
            starts += [[chain[-1], other] for other in ordered[1:]]
            chain.append(ordered[0])
        found.append(chain)
    return found


def branch(path: np.ndarray, radii: np.ndarray, flare: bool) -> Mesh:
    """A tapered tube with bark coordinates: half a metre of bark to one image."""
    _, side, up = frames(path)
    sides = int(np.clip(np.round(radii.max() * 70), 3, 14))
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    wraps = max(1, round(2 * np.pi * radii[0] / 0.6))
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    ring = np.cos(turn)[:, None] * side[:, None] + np.sin(turn)[:, None] * up[:, None]
    radius = np.repeat(radii[:, None], sides + 1, axis=1)
    if flare:
        lobes = 1 + 0.22 * np.cos(5 * turn + 0.6)
        radius = radius * (1 + 0.95 * np.exp(-length / 0.28)[:, None] * lobes)
    uvs = np.stack(np.broadcast_arrays(turn / (2 * np.pi) * wraps, -length[:, None] / 0.6), axis=-1)
    points = path[:, None] + radius[..., None] * ring
    points[..., 1] = np.maximum(points[..., 1], 0.0)
    return grid(points, uvs, around=True)


def wood(skeleton: Skeleton) -> Mesh:
    """The trunk and all branches."""
    parts = []
    for chain in chains(skeleton):
        radii = skeleton.radii[chain].copy()
        trunk = chain[0] == 0
        if not trunk:
            radii[0] = radii[1]
        keep = np.ones(len(chain), bool) if radii[0] > 0.05 else np.arange(len(chain)) % 2 == 0
        keep[-1] = True
        if keep.sum() < 2:
            continue
        radii[-1] *= 0.4
        parts.append(branch(skeleton.points[chain][keep], radii[keep], trunk))
    return merge(parts)


def foliage(skeleton: Skeleton, count: int, rng: np.random.Generator) -> Mesh:
    """Leaf cards on the thin branches; their normals bend away from the crown so that it shades as a round body."""
    thin = np.flatnonzero((skeleton.radii < 0.035) & (skeleton.points[:, 1] > 2.6))
    depth = crown_depth(skeleton.points[thin])
    weight = 1.25 - depth
    node = thin[rng.choice(len(thin), count, p=weight / weight.sum())]
    base = skeleton.points[node] + rng.normal(0, 0.10, (count, 3))
    growth = unit(skeleton.points[node] - skeleton.points[skeleton.parents[node]])
    outward = unit((base - CROWN) / [1, 0.9, 1])
    up = unit(0.6 * growth + 0.7 * outward + rng.normal(0, 0.55, (count, 3)) - [0, 0.15, 0])
    front = unit(np.add(outward, [0, 0.35, 0]) + rng.normal(0, 0.55, (count, 3)))
    front = unit(front - up * np.einsum("ij,ij->i", front, up)[:, None])
    across = np.cross(up, front)
    size = rng.uniform(0.50, 0.78, (count, 1))
    corner = np.array([[-0.5, 0.0], [0.5, 0.0], [0.5, 1.0], [-0.5, 1.0]])
    points = base[:, None] + size[:, None] * (corner[:, :1] * across[:, None] + (corner[:, 1:] - 0.12) * up[:, None])

    nearest = np.linalg.norm((base[:, None] - PUFFS[:, :3]) / PUFFS[:, 3:4], axis=-1).argmin(axis=1)
    puffed = unit(points - PUFFS[nearest, None, :3])
    normals = unit(0.55 * puffed + 0.55 * unit(points - CROWN) + 0.22 * front[:, None] + [0, 0.12, 0])

    # Darker clusters deep in the crown, the fresh ones at its rim: cells 0..3 of the 2 x 2 texture.
    shade = 3.6 * (1 - 1.5 * crown_depth(base)) * (0.75 + 0.25 * (base[:, 1] - 3.0) / 4.0) + rng.normal(0, 0.55, count)
    cell = np.clip(shade, 0, 3).astype(int)
    texel = corner * [1, -1] + [0.5, 1]
    uvs = texel * 0.5 + np.stack([cell % 2, cell // 2], axis=1)[:, None] * 0.5
    quads = np.arange(4 * count).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return Mesh(points.reshape(-1, 3), normals.reshape(-1, 3), uvs.reshape(-1, 2), faces)


def leaf_cluster(size: int, color: str, seed: int) -> np.ndarray:
    """A spray of about fifty leaves on twigs, (size, size, 4), growing from the bottom centre."""
    rng = np.random.default_rng(seed)
    canvas = np.zeros((2 * size, 2 * size, 4))
    canvas[..., :3] = rgb(color) * 0.5
    foot, scale = np.array([size, 1.97 * size]), 2.0 * size
    twigs = [(foot, np.array([size * 1.0, 0.35 * size]))]
    for height, lean in ((0.20, -0.62), (0.30, 0.66), (0.48, -0.60), (0.58, 0.58), (0.72, -0.4)):
        start = foot + (twigs[0][1] - foot) * height
        angle = lean + rng.normal(0, 0.12)
        twigs.append((start, start + scale * (0.40 - 0.16 * height) * np.array([np.sin(angle), -np.cos(angle)])))
    for start, end in twigs:
        blade(canvas, start, end, 0.016 * scale, rgb("#5d4a35"))
    leaves = []
    for start, end in twigs:
        heading = np.arctan2(*(end - start))
        for step in np.linspace(0.25, 1.0, 9):
            lean = heading + rng.choice([-1, 1]) * rng.uniform(0.25, 1.15) * (1.15 - 0.8 * step)
            at = start + (end - start) * step
            leaves.append((at, at + scale * rng.uniform(0.11, 0.155) * np.array([np.sin(lean), np.cos(lean)])))
    order = rng.permutation(len(leaves))
    for rank, index in enumerate(order):
        tint = rgb(color) * (0.66 + 0.46 * rank / len(order)) * rng.uniform(0.92, 1.08, 3)
        base, tip = leaves[index]
        blade(canvas, base, tip, 0.48 * np.hypot(*(tip - base)), tint, veins=1.0)
    return bleed(shrink(canvas, 2))


def make_tree(folder: Path) -> None:
    """Write tree.glb."""
    rng = np.random.default_rng(7)
    skeleton = thicken(grow(rng))
    trunk, leaves = wood(skeleton), foliage(skeleton, 2800, rng)
    cells = [leaf_cluster(384, color, 20 + k) for k, color in enumerate(("#4a612f", "#5e7838", "#748b43", "#8d9f50"))]
    atlas = np.concatenate([np.concatenate(cells[:2], axis=1), np.concatenate(cells[2:], axis=1)])
    glb = Glb("tree")
    bark_texture = glb.add_texture(to_bytes(bark(512, 3, ("#3a3028", "#6b5a49", "#8d7c68", "#a39481"), "#66703f")), 85)
    bark_material = glb.add_material("bark", texture=bark_texture, roughness=1.0)
    leaf_texture = glb.add_texture(to_bytes(atlas))
    leaf_material = glb.add_material("leaves", texture=leaf_texture, roughness=0.8, alpha_cutoff=0.4)
    root = glb.add_node("tree")
    glb.add_node("trunk", glb.add_mesh("trunk", [(trunk, bark_material)]), root)
    glb.add_node("crown", glb.add_mesh("crown", [(leaves, leaf_material)]), root)
    glb.save(folder / "tree.glb")


# The pine's texture: bark in the left sixteenth, which tiles downward, and one frond in the rest.
BARK_WIDTH, FROND_LEFT = 0.12, 0.17


def frond_texture(size: int = 512) -> np.ndarray:
    """Bark and a frond of needles, (size, size, 4); the frond grows up the image."""
    rng = np.random.default_rng(11)
    big = 2 * size
    canvas = np.zeros((big, big, 4))
    canvas[..., :3] = rgb("#2c4a33")
    left, middle = FROND_LEFT * big, (FROND_LEFT + 1) / 2 * big
    foot, top = np.array([middle, 0.995 * big]), np.array([middle, 0.03 * big])
    half = (big - left) / 2
    twigs = [(foot, top, 1.0)]
    for step in np.linspace(0.02, 0.95, 17):
        for side in (-1, 1):
            at = foot + (top - foot) * (step + rng.uniform(-0.006, 0.006) + 0.012 * side)
            reach = half * 0.97 * (1 - step) ** 0.55 * rng.uniform(0.85, 1.0) * min(1.0, 0.7 + 2.2 * step)
            lean = side * rng.uniform(0.85, 1.05)
            twigs.append((at, at + reach / abs(np.sin(lean)) * 0.96 * np.array([np.sin(lean), -np.cos(lean)]), 0.8))
    for start, end, weight in twigs:
        blade(canvas, start, end, 0.011 * big * weight, rgb("#6a5138"))
    needles = []
    for start, end, _ in twigs:
        heading = np.arctan2(*(end - start))
        for step in np.arange(0.02, 1.0, 5.0 / np.hypot(*(end - start))):
            for side in (-1, 1):
                lean = heading + side * rng.uniform(0.45, 0.95)
                at = start + (end - start) * step
                reach = big * rng.uniform(0.028, 0.042)
                needles.append((at, at + reach * np.array([np.sin(lean), np.cos(lean)]), step))
    for index in rng.permutation(len(needles)):
        base, tip, step = needles[index]
        fresh = 0.72 + 0.40 * step + rng.normal(0, 0.10)
        blade(canvas, base, tip, 0.0062 * big, rgb("#56744c") * fresh * rng.uniform(0.94, 1.06, 3))
    canvas[:, : int(left)] = np.concatenate(
        [np.tile(rgb("#2c4a33"), (big, int(left), 1)), np.zeros((big, int(left), 1))], -1
    )
    image = bleed(shrink(canvas, 2))
    strip = bark(size, 31, ("#33271f", "#5f4838", "#836753", "#967b66"))[:, : int(0.145 * size)]
    image[:, : strip.shape[1], :3] = strip
    image[:, : strip.shape[1], 3] = 1.0
    return to_bytes(image)


def frond(foot: np.ndarray, azimuth: float, length: float, width: float, rise: float, roll: float) -> Mesh:
    """One branch: a roof-shaped strip that sags and lifts its tip; its normals lean out and up."""
    along = np.linspace(0, 1, 5)
    outward = np.array([np.sin(azimuth), 0, np.cos(azimuth)])
    across = np.array([np.cos(azimuth), 0, -np.sin(azimuth)])
    height = length * (rise * along - 0.66 * along**1.5 + 0.42 * along**3)
    spine = foot + length * along[:, None] * outward + height[:, None] * (0, 1, 0)
    wing = np.array([1.0, 0.0, -1.0])
    points = spine[:, None] + width / 2 * wing[:, None] * np.add(across, (0, roll, 0))
    points[..., 1] -= np.abs(wing) * width * 0.20
    texel = np.stack(
        np.broadcast_arrays((FROND_LEFT + 1) / 2 + (1 - FROND_LEFT) / 2 * wing, 1 - along[:, None]), axis=-1
    )
    sheet = grid(points, texel)
    middle = np.array([0, foot[1] - 0.35 * length, 0])
    normals = unit(0.8 * unit(sheet.positions - middle) + (0, 0.5, 0) + 0.45 * sheet.normals)
    return replace(sheet, normals=normals)


def make_pine(folder: Path) -> None:
    """Write pine.obj, pine.mtl and pine.png."""
    rng = np.random.default_rng(5)
    height = 8.6
    levels = np.linspace(0, height, 15)
    path = np.stack([0.03 * np.sin(levels), levels, 0.03 * np.cos(1.3 * levels) - 0.03], axis=1)
    trunk = branch(path, 0.005 + 0.155 * (1 - levels / height) ** 0.9, flare=True)
    trunk = replace(trunk, uvs=trunk.uvs * [BARK_WIDTH / trunk.uvs[:, 0].max(), 1.0])
    parts = []
    count = 600
    for k, t in enumerate(np.linspace(0, 1, count) ** 0.85):
        y = 1.15 + 7.2 * t
        length = (2.3 * (1 - t) ** 0.95 + 0.22) * rng.uniform(0.82, 1.08)
        foot = np.array([np.interp(y, levels, path[:, 0]), y, np.interp(y, levels, path[:, 2])])
        azimuth = k * np.pi * (3 - np.sqrt(5)) + rng.normal(0, 0.15)
        rise = 0.06 + 0.34 * t**2 + rng.normal(0, 0.06)
        parts.append(frond(foot, azimuth, length, length * 0.46 + 0.14, rise, rng.normal(0, 0.22)))
    for azimuth in (0.0, 1.05, 2.1, 3.15, 4.2, 5.25):
        leader = frond(np.array([0.03 * np.sin(8.1), 8.15, 0]), azimuth, 0.20, 0.18, 2.3, 0.0)
        parts.append(replace(leader, faces=leader.faces[:, ::-1]))
    bark_material = "newmtl bark\nKd 1 1 1\nmap_Kd pine.png\n"
    needle_material = "newmtl needles\nKd 1 1 1\nmap_Kd pine.png\nmap_d -imfchan m pine.png\n"
    materials = f"# {LICENCE}\n{bark_material}\n{needle_material}"
    write_obj(folder / "pine.obj", [("bark", trunk), ("needles", merge(parts))], materials, frond_texture())
