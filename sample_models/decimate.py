"""Fewer triangles by edge collapse, many edges at a time."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix


def _edges(faces: np.ndarray) -> np.ndarray:
    """Every edge once, (E, 2), lower vertex first."""
    # In a closed surface every edge runs once each way: keep the way that goes up.
    pairs = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    return pairs[pairs[:, 0] < pairs[:, 1]]


def _area_vectors(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (points[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _quadrics(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The sum over each vertex's faces of area x squared distance to their planes, as (N, 4, 4)."""
    area = _area_vectors(points, faces)
    size = np.linalg.norm(area, axis=1, keepdims=True)
    normal = area / np.maximum(size, 1e-20)
    plane = np.hstack([normal, -np.einsum("ij,ij->i", normal, points[faces[:, 0]])[:, None]])
    quadric = (plane[:, :, None] * plane[:, None, :] * size[:, :, None]).reshape(-1, 16)
    corner = csr_matrix((np.ones(faces.size), (faces.ravel(), np.repeat(np.arange(len(faces)), 3))))
    return (corner @ quadric).reshape(-1, 4, 4)


def _merged(points: np.ndarray, quadrics: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the vertex that replaces each edge goes, and what that costs."""
    a, b = points[edges[:, 0]], points[edges[:, 1]]
    middle, length = (a + b) / 2, np.linalg.norm(a - b, axis=1)
    quadric = quadrics[edges[:, 0]] + quadrics[edges[:, 1]]
    # A weak pull to the middle keeps the solution on flat and straight parts.
    pull = 1e-3 * np.trace(quadric[:, :3, :3], axis1=1, axis2=2) + 1e-18
    matrix = quadric[:, :3, :3] + pull[:, None, None] * np.eye(3)
    right = -quadric[:, :3, 3] + pull[:, None] * middle
    place = np.linalg.solve(matrix, right[..., None])[..., 0]
    place = np.where(np.linalg.norm(place - middle, axis=1, keepdims=True) < length[:, None], place, middle)
    full = np.hstack([place, np.ones((len(place), 1))])
    cost = np.einsum("ij,ijk,ik->i", full, quadric, full)
    return place, cost + 1e-3 * pull * length**2


def decimate(points: np.ndarray, faces: np.ndarray, target: int, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Collapse the edges that change a closed surface least.

    Parameters
    ----------
    points : ndarray, (N, 3) float64
    faces : ndarray, (M, 3) int
        A closed manifold.
    target : int
        Stop at this many triangles or slightly fewer.

    weights : ndarray, (N,) float64
        How much a change at each vertex counts.

    Returns
    -------
    points : ndarray, (K, 3) float64
    faces : ndarray, (L, 3) int64

    References
    ----------
    Garland and Heckbert, "Surface Simplification Using Quadric Error Metrics", 1997.
    """
    points, faces = points.copy(), faces.astype(np.int64)
    quadrics = _quadrics(points, faces) * weights[:, None, None]
    stuck = np.zeros(0, dtype=np.int64)
    while len(faces) > target:
        every = _edges(faces)
        edges = every[~np.isin(every[:, 0] * len(points) + every[:, 1], stuck)]
        if len(edges) == 0:
            break
        place, cost = _merged(points, quadrics, edges)
        order = np.argsort(cost, kind="stable")
        rank = np.empty(len(edges), dtype=np.int64)
        rank[order] = np.arange(len(edges))

        # An edge is taken when it is the cheapest around both its ends, so that no two taken edges share a triangle.
        best = np.full(len(points), len(edges))
        np.minimum.at(best, edges.ravel(), np.repeat(rank, 2))
        around = best.copy()
        np.minimum.at(around, every[:, 0], best[every[:, 1]])
        np.minimum.at(around, every[:, 1], best[every[:, 0]])
        taken = np.flatnonzero((around[edges] == rank[:, None]).all(axis=1))
        taken = taken[np.argsort(rank[taken])][: (len(faces) - target + 1) // 2]

        # Two vertices with more than two common neighbours would pinch the surface.
        links = (every.ravel(), every[:, ::-1].ravel())
        near = csr_matrix((np.ones(2 * len(every)), links), shape=(len(points), len(points)))
        common = near[edges[taken, 0]].multiply(near[edges[taken, 1]]).sum(axis=1)
        pinched = np.asarray(common).ravel() != 2
        taken, bad = taken[~pinched], [taken[pinched]]

        moved, goes_to, edge_of = points.copy(), np.arange(len(points)), np.full(len(points), -1)
        keep, drop = edges[taken].T
        moved[keep] = moved[drop] = place[taken]
        goes_to[drop] = keep
        edge_of[keep] = edge_of[drop] = taken
        touched = edge_of[faces].max(axis=1)
        before, after = _area_vectors(points, faces), _area_vectors(moved, faces)
        sizes = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
        stays = np.sort(goes_to[faces], axis=1)
        stays = (np.diff(stays, axis=1) > 0).all(axis=1)
        folded = (np.einsum("ij,ij->i", before, after) < 0.3 * sizes) & stays & (touched >= 0)
        refused = np.isin(taken, touched[folded])
        undo = edges[taken[refused]]
        moved[undo], goes_to[undo] = points[undo], undo
        bad = edges[np.concatenate([*bad, taken[refused]])]
        stuck = np.union1d(stuck, bad[:, 0] * len(points) + bad[:, 1])
        taken, points = taken[~refused], moved
        np.add.at(quadrics, edges[taken, 0], quadrics[edges[taken, 1]])
        faces = goes_to[faces]
        faces = faces[(np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)]
    used, faces = np.unique(faces, return_inverse=True)
    return points[used], faces.reshape(-1, 3)
