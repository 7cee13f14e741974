"""Tangent frames of meshes: which way a texture's picture lies on a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impostor.errors import SettingsError
from impostor.importing.tangents import picture_tangents
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
    found = picture_tangents(primitive.positions, primitive.normals, primitive.uvs, primitive.triangles)
    tangents, triangles, vertex = found
    normals = primitive.normals[vertex]
    lost = ~tangents[:, :3].any(axis=1)
    sides = np.cross(normals[lost], np.eye(3)[np.abs(normals[lost]).argmin(axis=1)])
    tangents[lost, :3] = sides / np.linalg.norm(sides, axis=1, keepdims=True)
    return TangentMesh(
        primitive.positions[vertex],
        normals,
        tangents,
        primitive.uvs[vertex],
        triangles.astype(np.uint32),
    )
