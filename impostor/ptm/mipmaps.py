"""Mip-maps of a PTM: its coefficients, filtered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from impostor.ptm.polynomials import Polynomials, basis


def mip_maps(polynomials: Polynomials) -> list[Polynomials]:
    """A PTM in ever smaller sizes, each texel the mean of what it covers.

    The best levels that there are. `runtime.surfaces.textures` makes others in a fifth of the time: the tests alone
    make these, for what it costs to be quick.

    Parameters
    ----------
    polynomials : Polynomials

    Returns
    -------
    list of Polynomials
        Level 0 is the given one; every next side is half the last, rounded down, the last level 1 x 1.

    Notes
    -----
    A value is linear in the coefficients, so that RGB and LUM filter exactly. LRGB is a product, and a mean of
    products is no product. What is filtered is therefore the products' three polynomials; each texel of each level
    then takes the luminance and color whose product differs least from them, in mean square over all light
    directions. `tests/unit/ptm/test_ptm_mipmaps.py` measures what that gains over filtering luminance and color apart.

    References
    ----------
    HPL-98-131, section 3; HPL-2004-225, "PTM Representation".
    """
    levels = [polynomials]
    # The exact means go from level to level, so that no level inherits the last one's error.
    means, apart = polynomials.coefficients, polynomials.coefficients
    if polynomials.color is not None:
        means = means * polynomials.color[..., None]
    chroma = polynomials.chroma
    while max(means.shape[:2]) > 1:
        means = halve(means)
        if polynomials.color is not None:
            apart = halve(apart)
            luminance, color = as_product(means, apart[:, :, 0] @ light_gram()[-1])
            levels.append(replace(polynomials, coefficients=luminance, color=color))
        else:
            chroma = None if chroma is None else halve(chroma)
            levels.append(replace(polynomials, coefficients=means, chroma=chroma))
    return levels


def halve(texels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Box-filter to half the size; where a side is odd, the texels between two halves count for both.

    Parameters
    ----------
    texels : ndarray of shape (H, W, ...), float32

    Returns
    -------
    ndarray of shape (max(H // 2, 1), max(W // 2, 1), ...), float32
        The mean is kept.
    """
    for axis in (0, 1):
        texels = np.moveaxis(_halve_rows(np.moveaxis(texels, axis, 0)), 0, axis)
    return np.ascontiguousarray(texels)


def as_product(
    polynomials: NDArray[np.float32], brightness: NDArray[np.floating]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The nearest LRGB texels to RGB ones.

    Parameters
    ----------
    polynomials : ndarray of shape (H, W, 3, 6), float32
    brightness : ndarray of shape (H, W), float
        Mean over all lights that each texel's luminance is to have; the rest is color.

    Returns
    -------
    luminance : ndarray of shape (H, W, 1, 6), float32
    color : ndarray of shape (H, W, 3), float32

    Notes
    -----
    The color is the first eigenvector of the 3 x 3 matrix of the channels' inner products over the light's
    directions, and the luminance the least-squares answer to it: the best approximation of rank one.
    """
    gram = light_gram()
    products = np.einsum("hwct,ts,hwds->hwcd", polynomials.astype(np.float64), gram, polynomials, optimize=True)
    direction = np.abs(np.linalg.eigh(products)[1][..., -1])
    luminance = np.einsum("hwct,hwc->hwt", polynomials, direction)
    mean = luminance @ gram[-1]
    # The split between the two is free: where one of them has no brightness to go by, the color is at its brightest.
    told = (mean > 1e-6) & (brightness > 1e-6)
    gain = np.where(told, np.divide(mean, brightness, where=told, out=np.ones_like(mean)), 1 / direction.max(axis=-1))
    luminance, color = luminance / gain[..., None], direction * gain[..., None]
    return luminance[:, :, None].astype(np.float32), color.astype(np.float32)


def light_gram() -> NDArray[np.float64]:
    """Mean products of the six terms over the disc of light directions.

    Returns
    -------
    ndarray of shape (6, 6), float64
        `difference @ light_gram() @ difference` is the mean squared difference of two texels' values; its last row
        gives a texel's mean value.
    """
    samples = basis(*disc_lights().T)
    return samples.T @ samples / len(samples)


def disc_lights() -> NDArray[np.float64]:
    """Light directions (16, 2) whose mean is that over the whole disc, of any polynomial of degree five or less."""
    # A product of two terms of a PTM has degree four.
    angles = np.arange(8) * np.pi / 4
    radii = np.sqrt((1 + np.array([-1, 1]) / 3**0.5) / 2)
    return np.concatenate([r * np.column_stack([np.cos(angles), np.sin(angles)]) for r in radii])


def _halve_rows(texels: NDArray[np.float32]) -> NDArray[np.float32]:
    count = len(texels)
    half = count // 2
    if half == 0:
        return texels
    if count % 2 == 0:
        return (texels[0::2] + texels[1::2]) * np.float32(0.5)
    # Each of `half` results covers count / half texels: a part of one, a whole one and a part of the next.
    first = ((half - np.arange(half)) / count).astype(np.float32).reshape(-1, *[1] * (texels.ndim - 1))
    means = first * texels[0:-1:2] + np.float32(half / count) * texels[1::2] + first[::-1] * texels[2::2]
    return means.astype(np.float32, copy=False)
