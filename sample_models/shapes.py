"""Small polygon shapes and the few operations that the sample models are built with.

Every shape is a `Mesh` in metres, right-handed, +Y up, with counter-clockwise front faces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix


@dataclass(frozen=True)
class Mesh:
    """Triangles with a normal and a texture coordinate at every vertex.

    Attributes
    ----------
    positions, normals : ndarray, (N, 3) float64
    uvs : ndarray, (N, 2) float64
        v runs down the image, as in glTF.
    faces : ndarray, (M, 3) int64
    """

    positions: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray
    faces: np.ndarray

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
        """The same mesh, translated."""
        return replace(self, positions=self.positions + np.array([x, y, z]))

    def turned(self, axis: str, angle_deg: float) -> Mesh:
        """The same mesh, rotated about the x, y or z axis."""
        matrix = rotation(axis, angle_deg)
        return replace(self, positions=self.positions @ matrix.T, normals=self.normals @ matrix.T)

    def flipped(self) -> Mesh:
        """The same mesh, inside out."""
        return replace(self, normals=-self.normals, faces=self.faces[:, ::-1])


def rotation(axis: str, angle_deg: float) -> np.ndarray:
    """The (3, 3) matrix of a right-handed turn about a coordinate axis."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    matrix = np.eye(3)
    matrix[j, j] = matrix[k, k] = c
    matrix[k, j], matrix[j, k] = s, -s
    return matrix


def unit(vectors: ArrayLike) -> np.ndarray:
    """Vectors of length one along the last axis; a zero vector stays zero."""
    vectors = np.asarray(vectors, dtype=float)
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh of many."""
    starts = np.cumsum([0] + [len(m.positions) for m in meshes[:-1]])
    return Mesh(
        np.concatenate([m.positions for m in meshes]),
        np.concatenate([m.normals for m in meshes]),
        np.concatenate([m.uvs for m in meshes]),
        np.concatenate([m.faces + start for m, start in zip(meshes, starts, strict=True)]),
    )


def creased(positions: ArrayLike, faces: ArrayLike, uvs: ArrayLike | None = None, angle_deg: float = 40.0) -> Mesh:
    """A mesh whose normals are smooth except across edges sharper than an angle.

    Parameters
    ----------
    positions : array_like, (N, 3) float
        Vertices at one place count as one vertex.
    faces : array_like, (M, 3) int
    uvs : array_like, (N, 2) or (M, 3, 2) float, optional
        Per vertex or per face corner.
    angle_deg : float
        Faces that meet at less than this share a normal.
    """
    positions, faces = np.asarray(positions, dtype=float), np.asarray(faces)
    corners = positions[faces].reshape(-1, 3)
    area = np.cross(corners[1::3] - corners[::3], corners[2::3] - corners[::3])
    kept = np.linalg.norm(area, axis=1) > 1e-12
    faces, area, corners = faces[kept], area[kept], corners.reshape(-1, 3, 3)[kept].reshape(-1, 3)
    if uvs is None:
        corner_uvs = np.zeros((len(corners), 2))
    else:
        uvs = np.asarray(uvs, dtype=float)
        corner_uvs = (uvs[kept] if uvs.ndim == 3 else uvs[faces]).reshape(-1, 2)

    _, place = np.unique(np.round(corners, 6), axis=0, return_inverse=True)
    face_of = np.repeat(np.arange(len(faces)), 3)
    incidence = csr_matrix((np.ones(len(place)), (np.arange(len(place)), place.ravel())))
    pair = (incidence @ incidence.T).tocoo()
    normal = unit(area)
    near = np.einsum("ij,ij->i", normal[face_of[pair.row]], normal[face_of[pair.col]]) > np.cos(np.radians(angle_deg))
    sums = csr_matrix((np.ones(near.sum()), (pair.row[near], pair.col[near])), shape=pair.shape) @ area[face_of]

    table = np.hstack([corners, unit(sums), corner_uvs])
    _, first, index = np.unique(np.round(table, 6), axis=0, return_index=True, return_inverse=True)
    table = table[first]
    return Mesh(table[:, :3], table[:, 3:6], table[:, 6:], index.reshape(-1, 3))


def grid(points: ArrayLike, uvs: ArrayLike | None = None, around: bool = False) -> Mesh:
    """A smooth surface through a grid of points.

    Parameters
    ----------
    points : array_like, (R, C, 3) float
        Seen from the front, rows run up and columns to the right.
    uvs : array_like, (R, C, 2) float, optional
    around : bool
        The last column lies on the first: normals run on across the seam.
    """
    points = np.asarray(points, dtype=float)
    rows, columns = points.shape[:2]
    if around:
        across = np.roll(points[:, :-1], -1, axis=1) - np.roll(points[:, :-1], 1, axis=1)
        across = np.concatenate([across, across[:, :1]], axis=1)
    else:
        across = np.gradient(points, axis=1)
    normals = unit(np.cross(across, np.gradient(points, axis=0)))
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    flat_uvs = np.zeros((points.size // 3, 2)) if uvs is None else np.asarray(uvs, dtype=float).reshape(-1, 2)
    return Mesh(points.reshape(-1, 3), normals.reshape(-1, 3), flat_uvs, faces)


def loft(sections: ArrayLike, angle_deg: float = 40.0, caps: bool = True) -> Mesh:
    """A skin over closed sections.

    Parameters
    ----------
    sections : array_like, (R, C, 3) float
        Rows of points, counter-clockwise seen against the direction in which the rows advance; the first point is
        not repeated.
    angle_deg : float
        See `creased`.
    caps : bool
        Close both ends with a fan about the section's centre.
    """
    sections = np.asarray(sections, dtype=float)
    rows, columns = sections.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, d = index[:-1], index[1:]
    b, c = np.roll(a, -1, axis=1), np.roll(d, -1, axis=1)
    faces = [np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)]
    points = [sections.reshape(-1, 3)]
    if caps:
        low, high = rows * columns, rows * columns + 1
        points.append(np.stack([sections[0].mean(axis=0), sections[-1].mean(axis=0)]))
        faces.append(np.stack([b[0], a[0], np.full(columns, low)], axis=-1))
        faces.append(np.stack([d[-1], c[-1], np.full(columns, high)], axis=-1))
    return creased(np.concatenate(points), np.concatenate(faces), angle_deg=angle_deg)


def revolve(profile: ArrayLike, sides: int = 32, angle_deg: float = 40.0) -> Mesh:
    """A solid of revolution about +Y: profile rows are (radius, y), from the bottom up along the outside.

    A profile that ends where it starts makes a ring; any other is closed with a disc at both ends.
    """
    profile = np.asarray(profile, dtype=float)
    turn = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    ring = np.stack([np.sin(turn), np.zeros(sides), np.cos(turn)], axis=-1)
    sections = profile[:, :1, None] * ring + profile[:, 1:, None] * (0.0, 1.0, 0.0)
    return loft(sections, angle_deg, caps=not np.allclose(profile[0], profile[-1]))


def frames(path: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tangent, side and upward unit vectors along a path of (K, 3) points, twisting as little as possible."""
    tangent = unit(np.gradient(path, axis=0))
    side = np.zeros_like(tangent)
    helper = np.eye(3)[np.argmin(np.abs(tangent[0]))]
    side[0] = unit(np.cross(helper, tangent[0]))
    for k in range(1, len(path)):
        side[k] = unit(side[k - 1] - tangent[k] * (side[k - 1] @ tangent[k]))
    return tangent, side, np.cross(tangent, side)


def tube(path: ArrayLike, radius: ArrayLike, sides: int = 8, angle_deg: float = 60.0) -> Mesh:
    """A capped round rod along a path of (K, 3) points; radius is one number or one a point."""
    path = np.asarray(path, dtype=float)
    _, side, up = frames(path)
    turn = (np.arange(sides) + 0.5) * (2 * np.pi / sides)
    ring = np.cos(turn)[:, None] * side[:, None] + np.sin(turn)[:, None] * up[:, None]
    return loft(path[:, None] + np.broadcast_to(radius, len(path))[:, None, None] * ring, angle_deg)


def box(size: ArrayLike, bevel: float = 0.0, steps: int = 2) -> Mesh:
    """A box about the origin with rounded edges.

    Parameters
    ----------
    size : array_like, (3,) float
    bevel : float
        Radius of the edges; 0 leaves them sharp.
    steps : int
        Facets across a rounded edge.
    """
    half = np.asarray(size, dtype=float) / 2
    if bevel <= 0:
        lines = [np.array([-h, h]) for h in half]
    else:
        arc = bevel * np.tan(np.linspace(-np.pi / 4, np.pi / 4, 2 * (steps // 2) + 1))
        arc = arc[arc >= 0][::-1]
        lines = [np.concatenate([-(h - bevel) - arc, (h - bevel) + arc[::-1]]) for h in half]
    sides = []
    for axis in range(3):
        j, k = (axis + 1) % 3, (axis + 2) % 3
        for sign in (1.0, -1.0):
            points = np.zeros((len(lines[k]), len(lines[j]), 3))
            points[..., axis] = sign * half[axis]
            points[..., j], points[..., k] = np.meshgrid(lines[j] * sign, lines[k])
            uvs = np.stack(np.meshgrid(np.linspace(0, 1, len(lines[j])), np.linspace(1, 0, len(lines[k]))), axis=-1)
            sides.append(grid(points, uvs))
    mesh = merge(sides)
    if bevel <= 0:
        return mesh
    core = np.clip(mesh.positions, -(half - bevel), half - bevel)
    normals = unit(mesh.positions - core)
    return replace(mesh, positions=core + bevel * normals, normals=normals)


def extrude(outline: ArrayLike, depth: float, bevel: float = 0.0, angle_deg: float = 40.0) -> Mesh:
    """A flat outline given thickness along z.

    Parameters
    ----------
    outline : array_like, (K, 2) float
        Counter-clockwise x, y; may be concave.
    depth : float
        The solid spans z = -depth/2 .. depth/2.
    bevel : float
        Width and depth of a 45 degree chamfer on both rims.
    """
    outline = np.asarray(outline, dtype=float)
    edge = unit(np.roll(outline, -1, axis=0) - outline)
    outward = np.stack([edge[:, 1], -edge[:, 0]], axis=-1)
    mitre = outward + np.roll(outward, 1, axis=0)
    inner = outline - bevel * 2 * mitre / np.maximum((mitre**2).sum(axis=1, keepdims=True), 0.5)
    half = depth / 2
    layers = [(outline, -half), (outline, half)]
    if bevel > 0:
        layers = [(inner, -half), (outline, bevel - half), (outline, half - bevel), (inner, half)]
    points = np.concatenate([np.column_stack([ring, np.full(len(ring), z)]) for ring, z in layers])
    count = len(outline)
    index = np.arange(len(points)).reshape(-1, count)
    a, d = index[:-1], index[1:]
    b, c = np.roll(a, -1, axis=1), np.roll(d, -1, axis=1)
    cap = triangulate(layers[-1][0])
    faces = [np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3), cap + index[-1, 0], cap[:, ::-1]]
    return creased(points, np.concatenate(faces), angle_deg=angle_deg)


def triangulate(outline: np.ndarray) -> np.ndarray:
    """Triangles, (K - 2, 3) int, of a simple counter-clockwise polygon of (K, 2) points, by clipping ears."""

    def cross(o: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (a[..., 0] - o[..., 0]) * (b[..., 1] - o[..., 1]) - (a[..., 1] - o[..., 1]) * (b[..., 0] - o[..., 0])

    rest = list(range(len(outline)))
    faces = []
    while len(rest) > 3:
        for i in range(len(rest)):
            trio = [rest[i - 1], rest[i], rest[(i + 1) % len(rest)]]
            a, b, c = outline[trio]
            others = outline[[k for k in rest if k not in trio]]
            inside = (cross(a, b, others) >= -1e-12) & (cross(b, c, others) >= -1e-12) & (cross(c, a, others) >= -1e-12)
            if cross(a, b, c) > 1e-14 and not inside.any():
                break
        faces.append(trio)
        rest.pop(i)
    return np.array([*faces, rest])
