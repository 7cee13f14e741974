"""Tangents: which way a picture lies on a surface, for its normals to lean where they should."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SHORTEST = 1e-9  # sums of unit vectors below this point nowhere


def picture_tangents(
    positions: NDArray[np.floating],
    normals: NDArray[np.floating],
    uvs: NDArray[np.floating],
    triangles: NDArray[np.integer],
) -> tuple[NDArray[np.float32], NDArray[np.int64], NDArray[np.int64]]:
    """A tangent at each vertex, with vertices doubled between triangles that show the picture and its mirror image.

    Those of the triangles around a vertex are averaged, weighted by their angle there, as MikkTSpace does. No welding:
    vertices that the model keeps apart stay apart.

    Parameters
    ----------
    positions, normals : ndarray, (N, 3) float
        Normals are unit.
    uvs : ndarray, (N, 2) float
        v runs down.
    triangles : ndarray, (M, 3) int

    Returns
    -------
    tangents : ndarray, (K, 4) float32
        Unit, toward +u and across the normal; w is -1 where the picture is mirrored. The binormal,
        `w * cross(normal, tangent)`, points up in the picture. x, y and z are 0 where the triangles have no area in it.
    triangles : ndarray, (M, 3) int64
        Into the K new vertices.
    source : ndarray, (K,) int64
        The old vertex of each new one.
    """
    triangles = triangles.astype(np.int64)
    points = positions[triangles].astype(float)
    tangent, up = _gradients(points, uvs[triangles].astype(float))
    facing = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    mirrored = np.einsum("mi,mi->m", np.cross(facing, tangent), up) < 0
    # Twice as many vertices as there are, then those that some triangle uses.
    used, corners = np.unique(2 * triangles + mirrored[:, None], return_inverse=True)
    source, corners = used // 2, corners.reshape(-1, 3)
    across = normals[source].astype(float)
    leaning = tangent[:, None] - np.einsum("mi,mki->mk", tangent, across[corners])[..., None] * across[corners]
    leaning = _unit(leaning) * _angles(points)[..., None]
    sums = np.zeros((len(used), 3))
    for axis in range(3):
        sums[:, axis] = np.bincount(corners.ravel(), leaning[..., axis].ravel(), len(used))
    return _finished(sums, 1.0 - 2.0 * (used % 2), across), corners, source


def repaired_tangents(tangents: NDArray[np.floating], normals: NDArray[np.floating]) -> NDArray[np.float32]:
    """Given tangents (N, 4) made unit and turned across unit normals; zero where they point nowhere."""
    tangents = np.where(np.isfinite(tangents).all(axis=1, keepdims=True), tangents, 0).astype(np.float64)
    return _finished(tangents[:, :3], np.where(tangents[:, 3] < 0, -1.0, 1.0), normals.astype(float))


def _finished(sums: NDArray[np.float64], sides: NDArray[np.float64], normals: NDArray[np.float64]):
    across = sums - np.einsum("ni,ni->n", sums, normals)[:, None] * normals
    across[np.linalg.norm(across, axis=1) < SHORTEST] = 0
    return np.hstack([_unit(across), sides[:, None]]).astype(np.float32)


def _gradients(points: NDArray[np.float64], uvs: NDArray[np.float64]):
    """Directions (M, 3) in which u grows and v falls, unit; zero where a triangle has no area in the picture."""
    (du1, dv1), (du2, dv2) = np.moveaxis(uvs[:, 1:] - uvs[:, :1], 0, -1)
    edge1, edge2 = np.moveaxis(points[:, 1:] - points[:, :1], 1, 0)
    turn = np.sign(du1 * dv2 - du2 * dv1)[:, None]
    along_u = turn * (edge1 * dv2[:, None] - edge2 * dv1[:, None])
    along_v = turn * (edge2 * du1[:, None] - edge1 * du2[:, None])
    return _unit(along_u), _unit(-along_v)


def _angles(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles (M, 3) at the corners of triangles (M, 3, 3)."""
    after = _unit(np.roll(points, -1, axis=1) - points)
    before = _unit(np.roll(points, 1, axis=1) - points)
    return np.arccos(np.clip(np.einsum("mki,mki->mk", after, before), -1, 1))


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-30)
