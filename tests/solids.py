"""Spheres and boxes as fans and as meshes: what a bake of them would give, worked out by rays and formulas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.ndimage import distance_transform_edt

from impostor.fan import DEPTH_CODES, Fan
from impostor.model import Material, Model
from impostor.normal_code import mip_codes
from impostor.views import View, Views, frame, layout_bases

SAMPLES = 4  # rays along a texel's side
DILATION = 2.5  # texels past the silhouette that hold colour, normal and depth
GREY = (188, 188, 188)
RED, GREEN, BLUE, WHITE = (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)


@dataclass(frozen=True)
class Sphere:
    """A ball of one sRGB colour."""

    center: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radius: float = 1.0
    color: tuple[int, int, int] = GREY

    def hit(self, origin, toward):
        """Distance (...) along unit rays, infinite past it, and the normal (..., 3) there."""
        offset = origin - np.array(self.center)
        along = np.einsum("...i,...i->...", offset, toward)
        under = along**2 - np.einsum("...i,...i->...", offset, offset) + self.radius**2
        near = np.where(under >= 0, -along - np.sqrt(np.maximum(under, 0)), np.inf)
        reached = np.where(under >= 0, near, 0)
        return near, (offset + reached[..., None] * toward) / self.radius

    def triangles(self, detail=48):
        """Positions (N, 3), normals (N, 3) and triangles (M, 3), counter-clockwise."""
        around, up = np.meshgrid(np.arange(2 * detail + 1), np.arange(detail + 1))
        azimuth, polar = np.pi * around / detail, np.pi * up / detail
        normals = np.stack([np.sin(polar) * np.sin(azimuth), np.cos(polar), np.sin(polar) * np.cos(azimuth)], axis=-1)
        corner = (up * (2 * detail + 1) + around)[:-1, :-1].ravel()
        below = corner + 2 * detail + 1
        faces = np.stack([corner, below, below + 1, corner, below + 1, corner + 1], axis=-1).reshape(-1, 3)
        normals = normals.reshape(-1, 3)
        return np.array(self.center) + self.radius * normals, normals, faces


@dataclass(frozen=True)
class Box:
    """An axis-aligned box of one sRGB colour."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    color: tuple[int, int, int] = GREY

    def hit(self, origin, toward):
        """Distance (...) along unit rays, infinite past it, and the normal (..., 3) there."""
        toward = np.where(np.abs(toward) < 1e-12, 1e-12, toward)
        a, b = (np.array(self.low) - origin) / toward, (np.array(self.high) - origin) / toward
        entries = np.minimum(a, b)
        enter, leave = entries.max(axis=-1), np.maximum(a, b).min(axis=-1)
        normal = -np.sign(toward) * (entries == enter[..., None])
        return np.where(enter <= leave, enter, np.inf), normal

    def triangles(self):
        """Positions (24, 3), normals (24, 3) and triangles (12, 3), counter-clockwise."""
        positions, normals = [], []
        for axis in range(3):
            for side in (-1, 1):
                u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
                normal = np.eye(3)[axis] * side
                corners = [normal + x * u + y * v for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
                positions += corners if side > 0 else corners[::-1]
                normals += [normal] * 4
        middle, half = (np.add(self.low, self.high)) / 2, np.subtract(self.high, self.low) / 2
        faces = (np.arange(6)[:, None, None] * 4 + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
        return middle + np.array(positions) * half, np.array(normals), faces


Solid = Sphere | Box


class Hits(NamedTuple):
    """What rays meet first: distance (...), infinite past everything; normal and sRGB colour (..., 3)."""

    distance: np.ndarray
    normal: np.ndarray
    color: np.ndarray


def cast(solids: Sequence[Solid], origin, toward) -> Hits:
    """The first hits of unit rays (..., 3)."""
    shape = np.broadcast_shapes(origin.shape, toward.shape)
    distance = np.full(shape[:-1], np.inf)
    normal, color = np.zeros(shape), np.zeros(shape)
    for solid in solids:
        near, facing = solid.hit(origin, toward)
        first = near < distance
        distance = np.where(first, near, distance)
        normal, color = np.where(first[..., None], facing, normal), np.where(first[..., None], solid.color, color)
    return Hits(distance, normal, color)


def solid_model(*solids: Solid, name="solids") -> Model:
    """The solids as one mesh of one material, coloured by its vertices."""
    positions, normals, colors, triangles, count = [], [], [], [], 0
    for solid in solids:
        corners, facing, faces = solid.triangles()
        positions, normals, triangles = [*positions, corners], [*normals, facing], [*triangles, faces + count]
        colors.append(np.tile(np.array([*solid.color, 255], np.uint8), (len(corners), 1)))
        count += len(corners)
    return Model.from_arrays(
        np.concatenate(positions),
        np.concatenate(triangles),
        np.concatenate(normals),
        np.concatenate(colors),
        material=Material(base_color=(1.0, 1.0, 1.0, 1.0)),
        name=name,
    )


@cache
def solid_fan(
    *solids: Solid, views=8, elevation_deg=0.0, size=64, distance=np.inf, layout="ring", slopes=(0.0, 0.0, 0.0)
) -> Fan:
    """The solids as a fan; `slopes` is the plane of every view, as `View.plane`."""
    points = np.concatenate([solid.triangles()[0] for solid in solids])
    cameras = frame(layout_bases(layout, views, np.radians(elevation_deg)), points, size, distance)
    tiles = [_tile(solids, view, size) for view in cameras]
    color, normals, coverage, depth = (np.stack(layer) for layer in zip(*tiles, strict=True))
    levels = 1
    while size >> (levels - 1) & 1 == 0 and size >> levels >= 4:
        levels += 1
    codes = mip_codes(normals, coverage, levels, mask=np.any(normals, axis=-1))
    planes = np.tile(slopes, (views, 1))
    cameras = Views(cameras.basis, cameras.center, cameras.radius, cameras.depth_range, distance, planes)
    settings = {"elevation": elevation_deg}
    return Fan("solids", layout, cameras, color, tuple(codes), depth, coverage >= 0.5, {}, settings)


def _tile(solids: Sequence[Solid], view: View, size: int):
    """One view's colour, view-space normals, coverage and depth codes, dilated."""
    across = ((np.arange(size * SAMPLES) + 0.5) / (size * SAMPLES) * 2 - 1) * view.radius
    low, high = view.depth_range
    x, y = np.meshgrid(across, -across)
    origin = view.unproject(np.stack([x, y, np.full_like(x, high)], axis=-1))
    toward = view.unproject(np.stack([x, y, np.full_like(x, low)], axis=-1)) - origin
    toward /= np.linalg.norm(toward, axis=-1, keepdims=True)
    hits = cast(solids, origin, toward)
    covered = np.isfinite(hits.distance)
    z = view.project(origin + np.where(covered, hits.distance, 0)[..., None] * toward)[..., 2]
    count = _sums(covered)
    share = np.maximum(count, 1)
    color = _sums(hits.color * covered[..., None]) / share[..., None]
    normal = _sums((hits.normal @ view.basis.T) * covered[..., None])
    depth = np.clip((_sums(z * covered) / share - low) / (high - low), 0, 1)
    distance, (rows, columns) = distance_transform_edt(count == 0, return_indices=True)
    near = distance <= DILATION
    normal = np.where(near[..., None], normal[rows, columns], 0)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    color = np.rint(color[rows, columns] * near[..., None]).astype(np.uint8)
    coverage = count / SAMPLES**2
    alpha = np.rint(coverage * 255).astype(np.uint8)
    codes = np.rint(depth[rows, columns] * near * DEPTH_CODES).astype(np.uint16)
    return np.dstack([color, alpha]), normal, coverage, codes


def _sums(samples):
    """Sums of SAMPLES x SAMPLES blocks of (S * SAMPLES, S * SAMPLES, ...)."""
    size = len(samples) // SAMPLES
    blocks = samples.reshape(size, SAMPLES, size, SAMPLES, *samples.shape[2:])
    return blocks.sum(axis=(1, 3), dtype=float)


def card_fan(pixels, half=1.0, levels=1) -> Fan:
    """One view from +Z of a flat picture (S, S, 4) uint8 that faces it in the plane z = 0, 2 `half` metres wide."""
    pixels = np.asarray(pixels, np.uint8)
    size = len(pixels)
    codes = tuple(np.full((1, size >> level, size >> level), 112, np.uint8) for level in range(levels))
    views = Views(np.eye(3)[None], np.zeros((1, 3)), np.array([half]), np.array([[-0.5, 0.5]]))
    depths = np.full((1, size, size), DEPTH_CODES // 2, np.uint16)
    return Fan("card", "ring", views, pixels[None], codes, depths, pixels[None, ..., 3] >= 128)


def corner_card(size=16):
    """A picture (size, size, 4): top left red, top right green, bottom left blue, bottom right white."""
    pixels = np.full((size, size, 4), 255, np.uint8)
    half = size // 2
    pixels[:half, :half, :3], pixels[:half, half:, :3], pixels[half:, :half, :3] = RED, GREEN, BLUE
    return pixels
