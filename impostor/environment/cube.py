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
    number, places = faces_of(_directions(across))
    column, row = np.clip(np.floor((places + 1) * (size / 2)).astype(np.intp), 0, size - 1).transpose(3, 0, 1, 2)
    out = faces[number, row, column]
    # There is no texel beyond a corner: the mean of the three that meet there makes all faces agree on it.
    for end, inner in ((0, 1), (-1, -2)):
        for side, within in ((0, 1), (-1, -2)):
            out[:, end, side] = (out[:, inner, within] + out[:, inner, side] + out[:, end, within]) / 3
    return out


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


def reduced(faces: NDArray[np.floating], size: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A cube map of fewer texels that keeps its light and where it comes from.

    Parameters
    ----------
    faces : ndarray, (6, N, N, 3) float
    size : int
        Divides N.

    Returns
    -------
    light : ndarray, (6, size, size, 3) float64
        Radiance times solid angle.
    toward : ndarray, (6, size, size, 3) float64
        Unit vectors: mean directions weighted by light, so that a sun stays where it is.
    """
    many = faces.shape[1] // size
    light, toward = np.empty((2, 6, size, size, 3))
    for face, directions in enumerate(face_directions(faces.shape[1])):
        part = faces[face] * solid_angles(faces.shape[1])[..., None]
        light[face] = _block_sums(part, many)
        # A little light everywhere, so that black has a direction too.
        weight = part.sum(axis=-1, keepdims=True) + 1e-30
        toward[face] = _block_sums(weight * directions, many)
    return light, toward / np.linalg.norm(toward, axis=-1, keepdims=True)


def halved(faces: NDArray[np.floating]) -> NDArray[np.floating]:
    """A cube map of half the size, (6, N / 2, N / 2, C): every texel is the mean of four."""
    size = faces.shape[1] // 2
    return faces.reshape(6, size, 2, size, 2, -1).mean(axis=(2, 4), dtype=faces.dtype)


def _block_sums(image: NDArray[np.floating], many: int) -> NDArray[np.floating]:
    """Of (N, N, C) over squares of `many` texels a side."""
    size = image.shape[0] // many
    return image.reshape(size, many, size, many, -1).sum(axis=(1, 3))


def _directions(across: NDArray[np.floating]) -> NDArray[np.float64]:
    """Unit vectors through the crossings of lines on every face, (6, N, N, 3)."""
    columns, rows = np.meshgrid(across, across)
    on_face = np.stack([columns, rows, np.ones_like(columns)], axis=-1)
    directions = np.einsum("fki,rck->frci", FACE_AXES, on_face)
    return directions / np.linalg.norm(directions, axis=-1, keepdims=True)
