"""Modelling with signed distances: parts that blend, on a grid, polygonised."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from decimate import decimate
from numpy.typing import ArrayLike
from scipy.interpolate import RegularGridInterpolator
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from shapes import Mesh, unit
from skimage.measure import marching_cubes

Point = ArrayLike


def soft_min(a: np.ndarray, b: np.ndarray, k: float) -> np.ndarray:
    """The lesser of two distances, rounded over a width of k metres."""
    h = np.maximum(k - np.abs(a - b), 0.0) / k
    return np.minimum(a, b) - h * h * k / 4


def soft_max(a: np.ndarray, b: np.ndarray, k: float) -> np.ndarray:
    """The greater of two distances, rounded over a width of k metres."""
    return -soft_min(-a, -b, k)


def capsule(p: np.ndarray, a: Point, b: Point, ra: float, rb: float) -> np.ndarray:
    """Distance to a rod from a to b whose radius goes from ra to rb; p is (..., 3)."""
    a, axis = np.asarray(a, p.dtype), np.subtract(b, a).astype(p.dtype)
    t = np.clip(((p - a) @ axis) / (axis @ axis), 0, 1)
    return np.linalg.norm(p - a - t[..., None] * axis, axis=-1) - (ra + (rb - ra) * t)


def ellipsoid(p: np.ndarray, center: Point, radii: Point) -> np.ndarray:
    """Distance, to first order, to an ellipsoid along the axes."""
    q = (p - np.asarray(center, p.dtype)) / np.asarray(radii, p.dtype)
    length = np.linalg.norm(q, axis=-1)
    slope = np.linalg.norm(q / np.asarray(radii, p.dtype), axis=-1)
    return length * (length - 1) / np.maximum(slope, 1e-6)


def pleat(phase: np.ndarray) -> np.ndarray:
    """Cloth folds -0.6..0.4: rounded ridges, narrow valleys; one fold every pi."""
    return np.abs(np.cos(phase)) - 0.6


class Sculpture:
    """A field of signed distances on a grid that is finer where there is more to see."""

    def __init__(self, axes: tuple[np.ndarray, np.ndarray, np.ndarray]):
        self.axes = axes
        self.field = np.full([len(axis) for axis in axes], 1.0, dtype=np.float32)

    def part(self, low: Point, high: Point) -> tuple[tuple[slice, ...], np.ndarray]:
        """The piece of the grid inside a box: its slices and its points (..., 3)."""
        slices = tuple(
            slice(*np.searchsorted(a, ends))
            for a, *ends in zip(self.axes, np.asarray(low), np.asarray(high), strict=True)
        )
        grids = np.meshgrid(*(a[s] for a, s in zip(self.axes, slices, strict=True)), indexing="ij")
        return slices, np.stack(grids, axis=-1).astype(np.float32)

    def rod(self, a: Point, b: Point, ra: float, rb: float, k: float = 0.02) -> None:
        """Blend in a tapered rod."""
        margin = max(ra, rb) + k + 0.02
        where, p = self.part(np.minimum(a, b) - margin, np.maximum(a, b) + margin)
        self.field[where] = soft_min(self.field[where], capsule(p, a, b, ra, rb), k)

    def polygon(self, low: float, high: float, triangles: int, weights: Callable[[np.ndarray], np.ndarray]) -> Mesh:
        """The surface at distance 0 between two heights, open at both, in at most so many triangles.

        `weights` says how much the shape counts at (N, 3) places, see `decimate`.
        Its normals are the gradient of the uncut field, so that pieces cut from one figure shade alike at the joint.
        """
        y = self.axes[1][None, :, None].astype(np.float32)
        vertices, faces, _, _ = marching_cubes(np.maximum(self.field, np.maximum(low - y, y - high)), 0.0)
        rows = [np.arange(len(axis)) for axis in self.axes]
        points = np.stack([np.interp(vertices[:, k], rows[k], self.axes[k]) for k in range(3)], axis=-1)
        points, faces = largest(points, faces)
        points, faces = decimate(points, faces, triangles, weights(points))
        slope = np.stack([np.gradient(self.field, self.axes[k], axis=k) for k in range(3)], axis=-1)
        normals = unit(RegularGridInterpolator(self.axes, slope)(points))

        at_cut = np.any(np.abs(points[:, 1, None] - (low, high)) < 1e-5, axis=1)
        used, faces = np.unique(faces[~at_cut[faces].all(axis=1)], return_inverse=True)
        return Mesh(points[used], normals[used], np.zeros((len(used), 2)), faces.reshape(-1, 3))


def largest(points: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The connected piece with most triangles: crumbs and hollows inside are left out."""
    edges = faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    graph = coo_matrix((np.ones(len(edges)), tuple(edges.T)), shape=(len(points), len(points)))
    piece = connected_components(graph, directed=False)[1]
    faces = faces[piece[faces[:, 0]] == np.bincount(piece[faces[:, 0]]).argmax()]
    used, faces = np.unique(faces, return_inverse=True)
    return points[used], faces.reshape(-1, 3)


def table(y: np.ndarray, rows: Sequence[tuple[float, float, float]]) -> tuple[np.ndarray, np.ndarray]:
    """Half widths along x and z at heights y, smoothly through rows of (y, x, z)."""
    knots = np.array(rows)
    fine = np.linspace(knots[0, 0], knots[-1, 0], 200)
    bell = np.hanning(25) / np.hanning(25).sum()
    curves = [
        np.convolve(np.pad(np.interp(fine, knots[:, 0], knots[:, k]), 12, mode="edge"), bell, "valid") for k in (1, 2)
    ]
    return np.interp(y, fine, curves[0]), np.interp(y, fine, curves[1])


def draped(
    p: np.ndarray, rows: Sequence[tuple[float, float, float]], middle: tuple[float, float] = (0, 0)
) -> tuple[np.ndarray, np.ndarray]:
    """Distance to an upright body of elliptic sections, and the angle about it from +Z toward +X."""
    a, b = table(p[..., 1], rows)
    x, z = (p[..., 0] - middle[0]) / a, (p[..., 2] - middle[1]) / b
    rho = np.hypot(x, z)
    return (rho - 1) * np.minimum(a, b), np.arctan2(x, z)
