"""The diffuse light of an environment: what a matt white surface shows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from impostor.environment.convolution import convolved

SIZE, DEGREE = 32, 128


def diffuse_faces(faces: NDArray[np.float32]) -> NDArray[np.float32]:
    """Cosine-weighted mean radiance around every normal: irradiance / pi.

    Parameters
    ----------
    faces : ndarray, (6, N, N, 3) float32

    Returns
    -------
    ndarray, (6, SIZE, SIZE, 3) float32

    References
    ----------
    Ramamoorthi, Hanrahan, "An Efficient Representation for Irradiance Environment Maps", 2001, equation 5.
    """
    return convolved(faces, [lambda angles: np.maximum(np.cos(angles), 0)], [SIZE], [DEGREE])[0]
