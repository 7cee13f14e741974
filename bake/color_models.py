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


def luminance_and_color(planes: NDArray[np.float32], root: NDArray[np.float32]) -> NDArray[np.float32]:
    """The luminance polynomial and the constant colour that together come nearest to three polynomials.

    Over the photographed lights, the sum of squared differences is least: the leading singular vector of the
    coefficients, weighted by the lights. The colour is scaled so that the luminance of every texel has about the
    same size, which lets the 8 bits that all texels share serve dark ones as well as bright ones.

    Parameters
    ----------
    planes : ndarray of shape (6, 3, N), float32
        The RGB fit of N texels, contiguous.
    root : ndarray of shape (T, 6), float32
        As `light_root` gives it.

    Returns
    -------
    ndarray of shape (6, 3, N), float32
        `planes`, written over: luminance in [:, 0], color in [:3, 1], 0..1.
    """
    weighted = multiply(root, planes.reshape(TERMS, -1)).reshape(-1, *planes.shape[1:])
    squares = np.einsum("tin,tjn->ijn", weighted, weighted)
    color = np.maximum(_leading_vector(squares), 0)  # what is below 0 there is noise
    color /= np.maximum(np.sqrt(np.einsum("cn,cn->n", color, color)), TINY)
    size = np.sqrt(np.maximum(np.einsum("cn,cn->n", color, _product(squares, color)), 0))
    scale = np.minimum(size / np.float32(TYPICAL_LUMINANCE), 1 / np.maximum(color.max(axis=0), TINY))
    scale[scale < DARKEST] = 1
    planes[:, 0] = np.einsum("tcn,cn->tn", planes, color / scale)
    np.multiply(color, scale, out=planes[:3, 1])
    return planes


def luma_and_chroma(
    planes: NDArray[np.float32], design: Design, luma_from_rgb: NDArray[np.float64]
) -> NDArray[np.float32]:
    """The luma polynomial and the mean chromaticity of three polynomials.

    Parameters
    ----------
    planes : ndarray of shape (6, 3, N), float32
    design : Design
    luma_from_rgb : ndarray of shape (3, 4), float64
        As `ycrcb` or `principal_axes` gives it.

    Returns
    -------
    ndarray of shape (6, 3, N), float32
        `planes`, written over: luma in [:, 0], chroma in [:2, 1].

    References
    ----------
    HPL-98-131, section 3.
    """
    matrix = luma_from_rgb.astype(np.float32)
    luma = np.einsum("c,tcn->tn", matrix[0, :3], planes)
    luma[5] += matrix[0, 3]
    mean = np.einsum("t,tcn->cn", design.matrix.mean(axis=0).astype(np.float32), planes)
    planes[:, 0] = luma
    planes[:2, 1] = np.einsum("ic,cn->in", matrix[1:, :3], mean) + matrix[1:, 3:]
    return planes


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
    planes : ndarray of shape (6, 3, N), float32
    design : Design

    Returns
    -------
    ndarray of shape (3, 3), float64
    """
    centred = design.matrix - design.matrix.mean(axis=0)
    values, vectors = np.linalg.eigh(centred.T @ centred)
    root = (vectors * np.sqrt(values.clip(0))).T.astype(np.float32)
    weighted = multiply(root, planes.reshape(TERMS, -1)).reshape(planes.shape)
    return np.einsum("tin,tjn->ij", weighted, weighted).astype(np.float64)


def light_root(design: Design) -> NDArray[np.float32]:
    """What turns coefficients into vectors whose squared length is a polynomial's mean square over the lights.

    Parameters
    ----------
    design : Design
        With T terms in use.

    Returns
    -------
    ndarray of shape (T, 6), float32
    """
    terms = list(design.terms)
    active = design.matrix[:, terms]
    root = np.zeros((len(terms), TERMS), np.float32)
    root[:, terms] = np.linalg.cholesky(active.T @ active / len(active)).T
    return root


def inverse(affine: NDArray[np.float64]) -> NDArray[np.float64]:
    """The way back of a (3, 4) matrix that is applied to three components and 1."""
    back = np.linalg.inv(affine[:, :3])
    return np.column_stack([back, -back @ affine[:, 3]]).astype(np.float64)


def _product(squares: NDArray[np.float32], vector: NDArray[np.float32]) -> NDArray[np.float32]:
    """Symmetric matrices (3, 3, N) times vectors (3, N)."""
    return np.einsum("ijn,jn->in", squares, vector)


def _leading_vector(squares: NDArray[np.float32]) -> NDArray[np.float32]:
    """The direction in RGB along which N sets of coefficients are largest: (3, N), of any length.

    By the power method, from gray: a colour has no negative part, so gray is never at right angles to it.
    """
    unit = squares / np.maximum(squares[0, 0] + squares[1, 1] + squares[2, 2], TINY)
    vector = unit.sum(axis=1)
    for _ in range(POWER - 1):
        vector = _product(unit, vector)
    return vector
