"""Tangent frames of meshes: which way a texture's picture lies on a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impostor.errors import SettingsError
from impostor.model import Model, Primitive

SAME = 1e-4  # largest difference between two unit vectors that count as one


@dataclass(frozen=True, eq=False)
class TangentMesh:
    """Every triangle of a model, with a tangent frame at each vertex.

    Attributes
    ----------
    positions, normals : ndarray, (N, 3) float32
    tangents : ndarray, (N, 4) float32
        Unit, toward +u and across the normal; w is -1 where the picture is mirrored. The binormal,
        `w * cross(normal, tangent)`, points up in the picture.
    uvs : ndarray, (N, 2) float32
        v runs down.
    triangles : ndarray, (M, 3) uint32
    """

    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    tangents: NDArray[np.float32]
    uvs: NDArray[np.float32]
    triangles: NDArray[np.uint32]

    @property
    def frame(self) -> NDArray[np.float64] | None:
        """Rows tangent, binormal, normal, (3, 3), where the whole mesh has the same; else None."""
        rows = np.hstack([self.normals, self.tangents])
        if np.abs(rows - rows[0]).max() > SAME:
            return None
        tangent, normal = self.tangents[0].astype(float), self.normals[0].astype(float)
        return np.stack([tangent[:3], tangent[3] * np.cross(normal, tangent[:3]), normal])


def tangent_mesh(model: Model) -> TangentMesh:
    """Work out the tangents of a model.

    Those of the triangles around a vertex are averaged, weighted by their angle there, as MikkTSpace does; a vertex
    between triangles that are mirrored and that are not is split in two. No welding: vertices that the model keeps
    apart stay apart.

    Raises
    ------
    SettingsError
        A part without texture coordinates.
    """
    parts = [_part(model.name, primitive) for primitive in model.primitives]
    first = np.cumsum([0] + [len(part.positions) for part in parts])
    return TangentMesh(
        *(
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("positions", "normals", "tangents", "uvs")
        ),
        triangles=np.concatenate(
            [part.triangles + np.uint32(start) for part, start in zip(parts, first[:-1], strict=True)]
        ),
    )


def _part(name: str, primitive: Primitive) -> TangentMesh:
    if primitive.uvs is None:
        raise SettingsError(name, "no texture coordinates; expected a mesh with them, to lay a PTM on")
    triangles = primitive.triangles.astype(np.int64)
    tangent, up = _gradients(primitive.positions[triangles].astype(float), primitive.uvs[triangles].astype(float))
    edges = primitive.positions[triangles[:, 1:]].astype(float) - primitive.positions[triangles[:, :1]]
    facing = np.cross(edges[:, 0], edges[:, 1])
    mirrored = np.einsum("mi,mi->m", np.cross(facing, tangent), up) < 0
    # Twice as many vertices as there are, then those that some triangle uses.
    used, corners = np.unique(2 * triangles + mirrored[:, None], return_inverse=True)
    vertex, corners = used // 2, corners.reshape(-1, 3)
    normals = primitive.normals[vertex].astype(float)
    across = tangent[:, None] - np.einsum("mi,mki->mk", tangent, normals[corners])[..., None] * normals[corners]
    across = _unit(across) * _angles(primitive.positions[triangles].astype(float))[..., None]
    sums = np.stack([np.bincount(corners.ravel(), across[..., i].ravel(), len(used)) for i in range(3)], axis=-1)
    sums -= np.einsum("ni,ni->n", sums, normals)[:, None] * normals
    lost = np.linalg.norm(sums, axis=1) < 1e-9
    sums[lost] = np.cross(normals[lost], np.eye(3)[np.abs(normals[lost]).argmin(axis=1)])
    return TangentMesh(
        primitive.positions[vertex],
        primitive.normals[vertex],
        np.hstack([_unit(sums), 1.0 - 2.0 * (used % 2)[:, None]]).astype(np.float32),
        primitive.uvs[vertex],
        corners.astype(np.uint32),
    )


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
