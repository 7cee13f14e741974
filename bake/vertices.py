"""A primitive's triangles as the GPU reads them: interleaved, and in an order that suits its caches."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake.resolve import LINEAR_FROM_SRGB
from impostor.model import Primitive

REORDER_FROM = 50_000  # triangles; fewer fit the caches in any order


def cache_order(positions: NDArray[Any], triangles: NDArray[np.integer[Any]]) -> tuple[NDArray[np.intp], NDArray[Any]]:
    """An order in which neighbours in space are neighbours in memory (Morton order).

    Parameters
    ----------
    positions : ndarray, (N, 3) float
    triangles : ndarray, (M, 3) int

    Returns
    -------
    order : ndarray, (N,) intp
        The vertices in their new order: use `positions[order]`.
    triangles : ndarray, (M, 3) uint32
        The same triangles, reordered, in the new vertices' numbers.
    """
    low = positions.min(axis=0)
    extent = max(float(np.ptp(positions, axis=0).max()), 1e-30)
    cells = ((positions - low) * (1023 / extent)).astype(np.uint32)
    for shift, mask in ((16, 0x30000FF), (8, 0x300F00F), (4, 0x30C30C3), (2, 0x9249249)):
        cells = (cells | cells << np.uint32(shift)) & np.uint32(mask)
    order = np.argsort(cells[:, 0] | cells[:, 1] << np.uint32(1) | cells[:, 2] << np.uint32(2))
    rank = np.empty(len(order), np.uint32)
    rank[order] = np.arange(len(order), dtype=np.uint32)
    triangles = rank[triangles]
    return order, triangles[np.argsort(triangles.min(axis=1))]


def vertex_records(primitive: Primitive, origin: NDArray[Any]) -> tuple[NDArray[np.void], NDArray[np.uint32]]:
    """The attributes that a primitive uses, interleaved, and its triangles.

    Parameters
    ----------
    primitive : Primitive
    origin : ndarray, (3,) float
        Subtracted from the positions, so that a model far from the origin keeps its precision in 32 bits.

    Returns
    -------
    vertices : ndarray, (N,) of position 3 float32, normal 3 float32 [, uv 2 float32] [, color 4 float16, linear]
        [, normal_uv 2 float32, tangent 4 float32]
    triangles : ndarray, (M, 3) uint32
    """
    fields: dict[str, NDArray[Any]] = {
        "position": (primitive.positions - origin).astype(np.float32),
        "normal": primitive.normals.astype(np.float32, copy=False),
    }
    if primitive.uvs is not None and primitive.material.texture is not None:
        fields["uv"] = primitive.uvs.astype(np.float32, copy=False)
    if primitive.colors is not None:
        linear = np.concatenate([LINEAR_FROM_SRGB[primitive.colors[:, :3]], primitive.colors[:, 3:] / 255], axis=1)
        fields["color"] = linear.astype(np.float16)
    if primitive.normal_uvs is not None and primitive.tangents is not None:
        fields["normal_uv"], fields["tangent"] = primitive.normal_uvs, primitive.tangents
    triangles = np.ascontiguousarray(primitive.triangles, np.uint32)
    order: Any = slice(None)
    if len(triangles) >= REORDER_FROM:
        order, triangles = cache_order(fields["position"], triangles)
    vertices = np.empty(len(primitive.positions), [(name, a.dtype, a.shape[1:]) for name, a in fields.items()])
    for name, array in fields.items():
        vertices[name] = array[order]
    return vertices, triangles
