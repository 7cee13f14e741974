"""Normals that lean as a picture says: what the shaders of the bake and of the mesh pass compute."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FLAT = 128
"""The byte for 0. As in GPU Gems 19: with glTF's 127.5 no flat picture could be written."""
LEAST = 0.01
"""What is left of a normal along the surface's own: even a picture of nothing leaves one."""


def mapped_normals(normals: ArrayLike, tangents: ArrayLike, texels: ArrayLike, scale: float = 1.0) -> NDArray:
    """Normals of a surface under a normal map.

    Parameters
    ----------
    normals : array_like, (..., 3) float
        Of the surface itself; of any length.
    tangents : array_like, (..., 4) float
        Toward the right of the picture, of any length; w is -1 where the picture is mirrored, else 1. Where x, y and z
        are 0 the normals stay as they are.
    texels : array_like, (..., 3) float
        What the picture holds there, 0 to 255; means of several texels as they are.
    scale : float
        Of what leans right and up.

    Returns
    -------
    ndarray, (..., 3) float64
        Unit.

    References
    ----------
    glTF 2.0, section 3.9.3, `normalTexture`.
    """
    up, right = _unit(np.asarray(normals, float)), _unit(np.asarray(tangents, float)[..., :3])
    x, y, z = np.moveaxis((np.asarray(texels, float) - FLAT) / (255 - FLAT), -1, 0)
    above = np.asarray(tangents, float)[..., 3:] * np.cross(up, right)
    lean = scale * (x[..., None] * right + y[..., None] * above)
    return _unit(lean + np.maximum(z, LEAST)[..., None] * up)


def _unit(vectors: NDArray) -> NDArray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-30)
