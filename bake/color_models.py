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


def luminance_and_color(
    planes: NDArray[np.float32], scratch: NDArray[np.float32], root: NDArray[np.float32]
) -> NDArray[np.float32]:
    """The luminance polynomial and the constant colour that together come nearest to three polynomials.

    Over the photographed lights, the sum of squared differences is least: the leading singular vector of the
    coefficients, weighted by the lights. The colour is scaled so that the luminance of every texel has about the
    same size, which lets the 8 bits that all texels share serve dark ones as well as bright ones.

    Parameters
    ----------
    planes : ndarray of shape (6, 3, N), float32
        The RGB fit of N texels, contiguous.
    scratch : ndarray of shape (9, 3, N), float32
        Contiguous; written over. New memory for every block of texels would take as long as all the arithmetic.
    root : ndarray of shape (T, 6), float32
        As `light_root` gives it.

    Returns
    -------
    ndarray of shape (6, 3, N), float32
        `planes`, written over: luminance in [:, 0], color in [:3, 1], 0..1.
    """
    terms, texels = len(root), planes.shape[2]
    weighted, squares = scratch[:terms], scratch[TERMS:]
    multiply(root, planes.reshape(TERMS, -1), weighted.reshape(terms, -1))
    np.einsum("tin,tjn->ijn", weighted, weighted, out=squares)
    length, scale, _ = scratch[2]
    color, other = _leading_vector(squares, scratch[0], scratch[1], length)
    np.maximum(color, 0, out=color)  # what is below 0 there is noise
    _divide(color, np.sqrt(np.einsum("cn,cn->n", color, color, out=length), out=length))
    np.einsum("cn,cn->n", color, np.einsum("ijn,jn->in", squares, color, out=other), out=scale)
    np.sqrt(np.maximum(scale, 0, out=scale), out=scale)
    scale /= np.float32(TYPICAL_LUMINANCE)
    np.maximum(np.amax(color, axis=0, out=length), TINY, out=length)
    np.minimum(scale, np.divide(1, length, out=length), out=scale)
    np.maximum(scale, DARKEST, out=scale)
    luminance = scratch[3:5].reshape(TERMS, texels)
    np.einsum("tcn,cn->tn", planes, np.divide(color, scale, out=other), out=luminance)
    planes[:, 0] = luminance
    np.multiply(color, scale, out=planes[:3, 1])
    return planes


def luma_and_chroma(
    planes: NDArray[np.float32], scratch: NDArray[np.float32], design: Design, luma_from_rgb: NDArray[np.float64]
) -> NDArray[np.float32]:
    """The luma polynomial and the mean chromaticity of three polynomials.

    Parameters
    ----------
    planes : ndarray of shape (6, 3, N), float32
    scratch : ndarray of shape (9, 3, N), float32
        As in `luminance_and_color`.
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
    luma, mean = scratch[:2].reshape(TERMS, -1), scratch[2]
    np.einsum("c,tcn->tn", matrix[0, :3], planes, out=luma)
    luma[5] += matrix[0, 3]
    np.einsum("t,tcn->cn", design.matrix.mean(axis=0).astype(np.float32), planes, out=mean)
    planes[:, 0] = luma
    np.einsum("ic,cn->in", matrix[1:, :3], mean, out=planes[:2, 1])
    planes[:2, 1] += matrix[1:, 3:]
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


def _leading_vector(
    squares: NDArray[np.float32],
    vector: NDArray[np.float32],
    other: NDArray[np.float32],
    length: NDArray[np.float32],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The direction in RGB, of any length, along which N sets of coefficients with products (3, 3, N) are largest.

    By the power method, from gray: a colour has no negative part, so gray is never at right angles to it. It is found
    in one of two arrays (3, N); the other one is given back behind it. `length` (N,) is scratch memory.
    """
    np.sum(squares, axis=1, out=vector)
    for power in range(2, POWER + 1):
        np.einsum("ijn,jn->in", squares, vector, out=other)
        vector, other = other, vector
        if power == POWER // 2:  # as high as dark texels allow
            _divide(vector, np.amax(vector, axis=0, out=length))
    return vector, other


def _divide(vectors: NDArray[np.float32], lengths: NDArray[np.float32]) -> None:
    """Divide vectors (3, N) by lengths (N,), in place; a vector of no length keeps it."""
    np.divide(vectors, np.maximum(lengths, TINY, out=lengths), out=vectors)
