"""Vertex normals: computed where a model has none, and the winding that agrees with them."""

from __future__ import annotations

import numpy as np

_LARGEST_FAN = 512


def weld(positions: np.ndarray, least_step: float = 0.0) -> np.ndarray:
    """Number the distinct positions.

    Parameters
    ----------
    positions : ndarray, (N, 3) float32
    least_step : float
        Of the grid, where the positions were rounded before they were moved to the origin.

    Returns
    -------
    ndarray, (N,) int64
        Vertices at the same position share a number, 0 .. count - 1.

    Notes
    -----
    Positions are the same when they round to the same point of a grid of 2**-22 of the largest coordinate, about
    the step of a float there: exporters write the last point of a circle by another sum than its first.
    """
    step = max(float(np.abs(positions).max(initial=0.0)) * 2.0**-22, least_step) or 1.0
    bits = np.rint(positions / step).astype(np.int64).view(np.uint64)
    multipliers = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
    key = (bits * multipliers).sum(axis=1, dtype=np.uint64)
    key ^= key >> np.uint64(29)
    order = np.argsort(key, kind="stable")
    same_key = np.diff(key[order]) == 0
    same_position = (bits[order[1:]] == bits[order[:-1]]).all(axis=1)
    if (same_key & ~same_position).any():
        return np.unique(bits, axis=0, return_inverse=True)[1].reshape(-1)
    number = np.empty(len(positions), np.int64)
    number[order] = np.concatenate([[0], np.cumsum(~same_key)])
    return number


def face_vectors(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Cross product of two edges of each triangle: its normal times twice its area, (M, 3)."""
    a, b, c = (positions[triangles[:, k]].T.astype(np.float64) for k in range(3))
    (ux, uy, uz), (vx, vy, vz) = b - a, c - a
    return np.stack([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx], axis=1)


def computed_normals(
    positions: np.ndarray, triangles: np.ndarray, crease: float, welded: bool = True, least_step: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angle-weighted vertex normals, with vertices doubled along edges sharper than the crease angle.

    Parameters
    ----------
    positions : ndarray, (N, 3) float32
    triangles : ndarray, (M, 3) int64
        None of zero area.
    crease : float
        Radians. Two faces of a vertex share its normal when theirs differ by less; 0 shades flat, pi all smooth.
    welded : bool
        Whether vertices at the same position count as one.
    least_step : float
        As `weld`.

    Returns
    -------
    normals : ndarray, (K, 3) float32
    triangles : ndarray, (M, 3) int64
        Into the K new vertices.
    source : ndarray, (K,) int64
        The old vertex of each new one.
    """
    faces = _unit(face_vectors(positions, triangles))
    if crease <= 0.0:
        corners = np.arange(triangles.size).reshape(-1, 3)
        return np.repeat(faces, 3, axis=0), corners, triangles.reshape(-1)
    point = weld(positions, least_step) if welded else np.arange(len(positions))
    points = point[triangles]
    weights = _corner_angles(positions, triangles)
    smooth = _unit(_sum_at(points, weights, faces, int(point.max()) + 1))
    normals, source = smooth[point], np.arange(len(positions))
    if crease >= np.pi:
        return normals, triangles, source
    # Faces within half the crease of the mean are within the crease of each other: nothing to split there.
    off_mean = np.einsum("mj,mkj->mk", faces, smooth[points]) < np.cos(crease / 2)
    hard = np.zeros(len(smooth), bool)
    hard[points[off_mean]] = True
    corners = np.flatnonzero(hard[points].reshape(-1))
    if not len(corners):
        return normals, triangles, source
    own = _creased_normals(points.reshape(-1)[corners], weights.reshape(-1)[corners], faces[corners // 3], crease)
    return _split(normals, triangles, corners, own)


def _creased_normals(points: np.ndarray, weights: np.ndarray, faces: np.ndarray, crease: float) -> np.ndarray:
    """A normal for each corner: the weighted sum over the corners of its point whose faces are within the crease."""
    order = np.argsort(points, kind="stable")
    starts = np.flatnonzero(np.concatenate([[True], np.diff(points[order]) != 0]))
    sizes = np.diff(np.append(starts, len(order)))
    total = faces.astype(np.float64).copy()
    for size in np.unique(sizes):
        # A point with hundreds of faces is the tip of a cone: each face keeps its own normal there.
        if size == 1 or size > _LARGEST_FAN:
            continue
        step = max(1, 4_000_000 // int(size * size))
        fans = starts[sizes == size]
        for first in range(0, len(fans), step):
            members = order[fans[first : first + step, None] + np.arange(size)]
            normals = faces[members]
            near = np.einsum("pij,pkj->pik", normals, normals) >= np.cos(crease)
            total[members] = np.einsum("pik,pk,pkj->pij", near, weights[members], normals, optimize=True)
    return _unit(total)


def _split(
    normals: np.ndarray, triangles: np.ndarray, corners: np.ndarray, own: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Give the listed corners vertices of their own, one for each distinct pair of old vertex and normal."""
    old = triangles.reshape(-1)[corners]
    x, y, z = np.rint(own * 1000).astype(np.int64).T + 1000
    packed = (old << 33) | (x << 22) | (y << 11) | z
    _, first, inverse = np.unique(packed, return_index=True, return_inverse=True)
    split = triangles.reshape(-1).copy()
    split[corners] = len(normals) + inverse
    used = np.zeros(len(normals) + len(first), bool)
    used[split] = True
    source = np.concatenate([np.arange(len(normals)), old[first]])[used]
    return np.concatenate([normals, own[first]])[used], (np.cumsum(used) - 1)[split].reshape(-1, 3), source


def repaired_normals(normals: np.ndarray, positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Given normals made unit; those of no length or not finite are replaced by computed ones."""
    normals = normals.astype(np.float32)
    length = np.linalg.norm(normals, axis=1)
    bad = ~(np.isfinite(length) & (length > 1e-12))
    normals = normals / np.where(bad, 1.0, length)[:, None]
    if bad.any():
        normals[bad] = computed_normals(positions, triangles, np.pi)[0][bad]
    return normals.astype(np.float32)


def agreeing_winding(positions: np.ndarray, triangles: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Triangles wound counter-clockwise about the mean of their vertex normals."""
    mean = normals[triangles].sum(axis=1)
    against = np.einsum("ij,ij->i", face_vectors(positions, triangles), mean) < 0
    wound = triangles.copy()
    wound[against] = triangles[against][:, ::-1]
    return wound


def _corner_angles(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Inner angles, (M, 3) float32."""
    points = positions[triangles]
    edges = _unit_edges(points[:, [1, 2, 0]] - points)
    cosines = -np.einsum("mkj,mkj->mk", edges, edges[:, [2, 0, 1]])
    return np.arccos(np.clip(cosines, -1.0, 1.0))


def _unit_edges(edges: np.ndarray) -> np.ndarray:
    return edges / np.maximum(np.linalg.norm(edges, axis=2, keepdims=True), np.finfo(np.float32).tiny)


def _sum_at(points: np.ndarray, weights: np.ndarray, faces: np.ndarray, count: int) -> np.ndarray:
    """Weighted sum of face normals over the corners at each point, (count, 3)."""
    flat = points.reshape(-1)
    columns = [np.bincount(flat, (weights * faces[:, j : j + 1]).reshape(-1), count) for j in range(3)]
    return np.stack(columns, axis=1)


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors, float32; +Y where the length is zero (an unused vertex, or two faces back to back)."""
    length = np.linalg.norm(vectors, axis=1)
    unit = (vectors / np.where(length > 0, length, 1.0)[:, None]).astype(np.float32)
    unit[~(length > 0)] = (0.0, 1.0, 0.0)
    return unit
