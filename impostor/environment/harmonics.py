"""Nine numbers a channel for the diffuse light of an environment: rough, but small enough for any shader."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.environment.cube import face_directions, solid_angles
from impostor.environment.environment import Environment

COSINE = np.array([1, *[2 / 3] * 3, *[1 / 4] * 5])
"""What the cosine lobe, divided by pi, multiplies each harmonic by: A_l / pi of the paper's equation 8."""


def diffuse_harmonics(environment: Environment) -> NDArray[np.float32]:
    """The radiance of an environment in real spherical harmonics of degrees 0 to 2.

    Parameters
    ----------
    environment : Environment

    Returns
    -------
    ndarray, (9, 3) float32
        L_00, L_1-1, L_10, L_11, L_2-2, ... L_22.

    Notes
    -----
    The diffuse light they give is off by 1 % to 8 % of its mean (root mean square, of seven photographed and painted
    panoramas), and can fall below 0 opposite a sun: `Environment.diffuse` is the accurate one.

    References
    ----------
    Ramamoorthi, Hanrahan, "An Efficient Representation for Irradiance Environment Maps", 2001, equation 10.
    """
    angles = solid_angles(environment.size)[..., None]
    out = np.zeros((9, 3))
    for toward, face in zip(face_directions(environment.size), environment.faces, strict=True):
        out += np.tensordot(_basis(toward), face * angles, ((0, 1), (0, 1)))
    return out.astype(np.float32)


def harmonic_diffuse(harmonics: ArrayLike, normals: ArrayLike) -> NDArray[np.float32]:
    """Cosine-weighted mean radiance around normals from nine harmonics.

    Parameters
    ----------
    harmonics : array_like, (9, 3) float
        As `diffuse_harmonics` gives them.
    normals : array_like, (..., 3) float
        Unit vectors in the environment's axes.

    Returns
    -------
    ndarray, (..., 3) float32

    References
    ----------
    Ramamoorthi, Hanrahan, 2001, equation 7.
    """
    return (_basis(np.asarray(normals, np.float64)) * COSINE @ np.asarray(harmonics, np.float64)).astype(np.float32)


def _basis(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Y_00 to Y_22 of unit vectors, (..., 9): the paper's equation 3."""
    x, y, z = np.moveaxis(directions, -1, 0)
    first, second = np.sqrt(3 / (4 * np.pi)), np.sqrt(15 / (4 * np.pi))
    middle, last = np.sqrt(5 / (16 * np.pi)) * (3 * z**2 - 1), second / 2 * (x**2 - y**2)
    constant = np.full_like(x, np.sqrt(1 / (4 * np.pi)))
    terms = constant, first * y, first * z, first * x, second * x * y, second * y * z, middle, second * x * z, last
    return np.stack(terms, axis=-1)
