"""The order and handedness of cube-map faces: the one table that everything else stands on."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FACES = ("+x", "-x", "+y", "-y", "+z", "-z")
"""OpenGL's order."""
FACE_AXES = np.array(
    [
        [[0, 0, -1], [0, -1, 0], [1, 0, 0]],
        [[0, 0, 1], [0, -1, 0], [-1, 0, 0]],
        [[1, 0, 0], [0, 0, 1], [0, 1, 0]],
        [[1, 0, 0], [0, 0, -1], [0, -1, 0]],
        [[1, 0, 0], [0, -1, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, -1, 0], [0, 0, -1]],
    ],
    np.float64,
)
"""(6, 3, 3): for each face the directions in which columns and rows grow, and its middle. OpenGL's table, whose first
row of texels is row 0 here; seen from inside, a face is its picture mirrored."""


def face_directions(size: int) -> NDArray[np.float64]:
    """Directions of all texel centres.

    Returns
    -------
    ndarray, (6, size, size, 3) float64
        Unit vectors.
    """
    across = (np.arange(size) + 0.5) * (2 / size) - 1
    return _directions(across)


def solid_angles(size: int) -> NDArray[np.float64]:
    """Of the texels of one face, (size, size) float64, steradians; they sum to 4 pi / 6."""
    edges = np.arange(size + 1) * (2 / size) - 1
    corner = np.arctan2(
        edges[:, None] * edges, np.sqrt(edges[:, None] ** 2 + edges**2 + 1)
    )  # of the rectangle from the middle to a corner
    return np.diff(np.diff(corner, axis=0), axis=1)


def faces_of(directions: ArrayLike) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Where directions meet the cube.

    Parameters
    ----------
    directions : array_like, (..., 3) float
        Of any length but 0.

    Returns
    -------
    faces : ndarray, (...) intp
    places : ndarray, (..., 2) float64
        Column and row on the face, -1 to 1.
    """
    directions = np.asarray(directions, np.float64)
    axis = np.abs(directions).argmax(axis=-1)
    longest = np.take_along_axis(directions, axis[..., None], -1)
    faces = 2 * axis + (longest[..., 0] < 0)
    places = np.einsum("...ki,...i->...k", FACE_AXES[faces][..., :2, :], directions) / np.abs(longest)
    return faces, places


def sample(faces: NDArray[np.floating], directions: ArrayLike) -> NDArray[np.floating]:
    """Bilinear look-up in a cube map, across its edges as OpenGL's seamless filter does.

    Parameters
    ----------
    faces : ndarray, (6, N, N, C) float
    directions : array_like, (..., 3) float
        Of any length but 0.

    Returns
    -------
    ndarray, (..., C), of the faces' dtype
    """
    return sample_padded(padded(faces), directions)


def padded(faces: NDArray[np.floating]) -> NDArray[np.floating]:
    """A cube map with a border of its neighbours' texels around every face, (6, N + 2, N + 2, C)."""
    size = faces.shape[1]
    across = (np.arange(-1, size + 1) + 0.5) * (2 / size) - 1
    # A texel beyond the edge is its neighbour's nearest; one beyond a corner, which there is none of, is the corner's.
    number, places = faces_of(_directions(across))
    column, row = np.clip(np.floor((places + 1) * (size / 2)).astype(np.intp), 0, size - 1).transpose(3, 0, 1, 2)
    return faces[number, row, column]


def sample_padded(faces: NDArray[np.floating], directions: ArrayLike) -> NDArray[np.floating]:
    """As `sample`, of what `padded` gave."""
    number, places = faces_of(directions)
    at = (places + 1) * ((faces.shape[1] - 2) / 2) + 0.5
    first = np.clip(np.floor(at).astype(np.intp), 0, faces.shape[1] - 2)
    column, row = first[..., 0], first[..., 1]
    right, down = np.moveaxis((at - first).astype(faces.dtype), -1, 0)[..., None]
    upper = faces[number, row, column] * (1 - right) + faces[number, row, column + 1] * right
    lower = faces[number, row + 1, column] * (1 - right) + faces[number, row + 1, column + 1] * right
    return upper * (1 - down) + lower * down


def _directions(across: NDArray[np.floating]) -> NDArray[np.float64]:
    """Unit vectors through the crossings of lines on every face, (6, N, N, 3)."""
    columns, rows = np.meshgrid(across, across)
    on_face = np.stack([columns, rows, np.ones_like(columns)], axis=-1)
    directions = np.einsum("fki,rck->frci", FACE_AXES, on_face)
    return directions / np.linalg.norm(directions, axis=-1, keepdims=True)
