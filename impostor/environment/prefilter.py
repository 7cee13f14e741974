"""Radiance as surfaces of some roughness mirror it."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from impostor.environment.convolution import convolved

SMALLEST = 8


def prefiltered(faces: NDArray[np.float32]) -> tuple[NDArray[np.float32], ...]:
    """Levels of radiance as surfaces of more and more roughness mirror it.

    Parameters
    ----------
    faces : ndarray, (6, N, N, 3) float32
        N is a power of two.

    Returns
    -------
    tuple of ndarray, (6, N >> k, N >> k, 3) float32
        K of them, down to `SMALLEST`, for roughness k / (K - 1); level 0 is `faces`.

    References
    ----------
    Karis, "Real Shading in Unreal Engine 4", 2013: the lobe as seen head-on, N = V = R.
    """
    size, last = faces.shape[1], int(np.log2(faces.shape[1] / SMALLEST))
    if not last:
        return (faces,)
    alphas = [(level / last) ** 2 for level in range(1, last + 1)]
    sizes = [size >> level for level in range(1, last + 1)]
    # A lobe's harmonics fall by exp(-2 alpha degree), but that of roughness 1 has a kink at the horizon.
    degrees = [max(round(7 / alpha), 128) for alpha in alphas]
    return faces, *convolved(faces, [partial(ggx, alpha=alpha) for alpha in alphas], sizes, degrees)


def ggx(angles: NDArray[np.floating], alpha: float) -> NDArray[np.floating]:
    """How much light from some angles away a surface mirrors to a viewer straight above it; not normalised.

    References
    ----------
    Walter, Marschner, Li, Torrance, "Microfacet Models for Refraction through Rough Surfaces", 2007, equation 33.
    """
    tilt = np.sin(angles / 2) ** 2
    return np.maximum(np.cos(angles), 0) / (alpha**2 + (1 - alpha**2) * tilt) ** 2
