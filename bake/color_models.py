"""From three fitted polynomials a texel to one: the colour models of a PTM, each in closed form.

Every model is linear in the photographs, so all of them follow from the RGB fit alone, without a second look at the
photographs: the lights' Gram matrix says how far apart two sets of coefficients are over the photographed lights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bake.design import Design
from bake.small_products import multiply
from impostor.ptm.polynomials import RGB_FROM_YCRCB, TERMS

TYPICAL_LUMINANCE = 0.5  # root mean square over the lights, of every texel whose colour leaves room for it
DARKEST = np.float32(1e-6)  # a texel that is black under all lights
TINY = np.float32(1e-20)
POWER = 4  # of the squares: a second colour half as strong as the first is left at 0.4 percent


def luminance_and_color(planes: NDArray[np.float32], design: Design) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The luminance polynomial and the constant colour that together come nearest to three polynomials.

    Over the photographed lights, the sum of squared differences is least: the leading singular vector of the
    coefficients, weighted by the lights. The colour is scaled so that the luminance of every texel has about the
    same size, which lets the 8 bits that all texels share serve dark ones as well as bright ones.

    Parameters
    ----------
    planes : ndarray of shape (6, N, 3), float32
        The RGB fit of N texels.
    design : Design

    Returns
    -------
    luminance : ndarray of shape (6, N), float32
    color : ndarray of shape (N, 3), float32
        0..1.
    """
    terms = list(design.terms)
    root = np.linalg.cholesky(_gram(design) / len(design.matrix)).T.astype(np.float32)
    used = planes if len(terms) == TERMS else planes[terms]
    channels = np.ascontiguousarray(used.transpose(2, 0, 1))
    weighted = multiply(root, channels)
    squares = _squares(weighted)
    color = np.maximum(_leading_vector(squares), 0)  # what is below 0 there is noise
    color /= np.maximum(np.sqrt(np.einsum("cn,cn->n", color, color)), TINY)
    size = np.sqrt(np.maximum(np.einsum("cn,cn->n", color, _product(squares, color)), 0))
    scale = np.minimum(size / np.float32(TYPICAL_LUMINANCE), 1 / np.maximum(color.max(axis=0), TINY))
    scale[scale < DARKEST] = 1
    red, green, blue = color / scale
    luminance = np.zeros((TERMS, planes.shape[1]), np.float32)
    luminance[terms] = channels[0] * red + channels[1] * green + channels[2] * blue
    return luminance, (color * scale).T


def luma_and_chroma(
    planes: NDArray[np.float32], design: Design, luma_from_rgb: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The luma polynomial and the mean chromaticity of three polynomials.

    Parameters
    ----------
    planes : ndarray of shape (6, N, 3), float32
    design : Design
    luma_from_rgb : ndarray of shape (3, 4), float64
        As `ycrcb` or `principal_axes` gives it.

    Returns
    -------
    luma : ndarray of shape (6, N), float32
    chroma : ndarray of shape (N, 2), float32

    References
    ----------
    HPL-98-131, section 3.
    """
    matrix = luma_from_rgb.astype(np.float32)
    luma = planes @ matrix[0, :3]
    luma[5] += matrix[0, 3]
    mean = np.tensordot(design.matrix.mean(axis=0).astype(np.float32), planes, axes=1)
    return luma, mean @ matrix[1:, :3].T + matrix[1:, 3]


def ycrcb() -> NDArray[np.float64]:
    """JFIF's luma, Cr and Cb from (R, G, B, 1), all 0..1: (3, 4), float64."""
    return inverse(RGB_FROM_YCRCB)


def principal_axes(spread: NDArray[np.float64]) -> NDArray[np.float64]:
    """The colour space whose first component varies most with the light, and whose others vary least.

    Parameters
    ----------
    spread : ndarray of shape (3, 3), float64
        Covariance of RGB over the lights, summed over texels, as `light_spread` gives it.

    Returns
    -------
    ndarray of shape (3, 4), float64
        As `ycrcb`; chroma is scaled and shifted to stay in 0..1.

    References
    ----------
    HPL-98-131, section 3: "examine the input images and determine a color conversion".
    """
    _, vectors = np.linalg.eigh(spread)
    axes = vectors[:, ::-1].T
    axes[0] *= np.sign(axes[0].sum()) or 1.0
    first = axes[0] / np.abs(axes[0]).sum()
    chroma = axes[1:] / np.abs(axes[1:]).sum(axis=1, keepdims=True)
    offset = -np.minimum(chroma, 0).sum(axis=1)
    return np.column_stack([np.vstack([first, chroma]), np.array([0.0, *offset])])


def light_spread(planes: NDArray[np.float32], design: Design) -> NDArray[np.float64]:
    """Covariance of RGB over the photographed lights, summed over N texels.

    Parameters
    ----------
    planes : ndarray of shape (6, N, 3), float32
    design : Design

    Returns
    -------
    ndarray of shape (3, 3), float64
    """
    terms = list(design.terms)
    centred = design.matrix - design.matrix.mean(axis=0)
    values, vectors = np.linalg.eigh((centred.T @ centred)[np.ix_(terms, terms)])
    root = (vectors * np.sqrt(values.clip(0))).T.astype(np.float32)
    weighted = np.tensordot(root, planes[terms], axes=1).reshape(-1, 3)
    return (weighted.T @ weighted).astype(np.float64)


def inverse(affine: NDArray[np.float64]) -> NDArray[np.float64]:
    """The way back of a (3, 4) matrix that is applied to three components and 1."""
    back = np.linalg.inv(affine[:, :3])
    return np.column_stack([back, -back @ affine[:, 3]]).astype(np.float64)


def _gram(design: Design) -> NDArray[np.float64]:
    active = design.matrix[:, list(design.terms)]
    return active.T @ active


def _squares(weighted: NDArray[np.float32]) -> NDArray[np.float32]:
    """Products of the channels of N sets of coefficients (3, T, N): RR, GG, BB, RG, GB, BR, as (6, N)."""
    pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)]
    return np.stack([np.einsum("tn,tn->n", weighted[i], weighted[j]) for i, j in pairs])


def _product(squares: NDArray[np.float32], vector: NDArray[np.float32]) -> NDArray[np.float32]:
    """The symmetric 3x3 matrices of `_squares` times vectors (3, N)."""
    rr, gg, bb, rg, gb, br = squares
    r, g, b = vector
    return np.stack([rr * r + rg * g + br * b, rg * r + gg * g + gb * b, br * r + gb * g + bb * b])


def _leading_vector(squares: NDArray[np.float32]) -> NDArray[np.float32]:
    """The direction in RGB along which N sets of coefficients are largest: (3, N), of any length.

    By the power method, from gray: a colour has no negative part, so gray is never at right angles to it.
    """
    unit = squares / np.maximum(squares[0] + squares[1] + squares[2], TINY)
    vector = np.ones((3, squares.shape[1]), np.float32)
    for _ in range(POWER):
        vector = _product(unit, vector)
    return vector
