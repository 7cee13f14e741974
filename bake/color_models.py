"""From three fitted polynomials a texel to one: the colour models of a PTM, each in closed form.

Every model is linear in the photographs, so all of them follow from the RGB fit alone, without a second look at the
photographs: the lights' Gram matrix says how far apart two sets of coefficients are over the photographed lights.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from bake.design import Design
from bake.one_pass import Coefficients, Floats
from bake.small_products import multiply
from impostor.ptm.polynomials import RGB_FROM_YCRCB, TERMS

TYPICAL_LUMINANCE = 0.5  # root mean square over the lights, of every texel whose colour leaves room for it
DARKEST = np.float32(1e-6)  # a texel that is black under all lights
TINY = np.float32(1e-20)
POWER = 4  # of the squares: a second colour half as strong as the first is left at 0.4 percent


def three_polynomials(planes: Floats, axes: Floats, scratch: Floats, out: Floats) -> None:
    """The polynomials of red, green and blue.

    Parameters
    ----------
    planes, axes, scratch : ndarray
        As in `luminance_and_color`.
    out : ndarray of shape (18, N), float32
        Takes six coefficients of red, of green and of blue.
    """
    np.einsum("ck,tkn->tcn", axes, planes, out=out.reshape(TERMS, 3, -1))


def luminance_and_color(planes: Floats, axes: Floats, scratch: Floats, out: Floats, back: Floats) -> None:
    """The luminance polynomial and the constant colour that together come nearest to three polynomials.

    Over the photographed lights, the sum of squared differences is least: the leading singular vector of the
    coefficients, turned by `light_root`. The colour is scaled so that the luminance of every texel has about the
    same size, which lets the 8 bits that all texels share serve dark ones as well as bright ones.

    Parameters
    ----------
    planes : ndarray of shape (6, 3, N), float32
        The fit of N texels along three axes, turned by `light_root`; contiguous.
    axes : ndarray of shape (3, 3), float32
        The axes, in columns, as red, green and blue; orthonormal.
    scratch : ndarray of shape (6, 3, N), float32
        Contiguous; written over. New memory for every block of texels would take as long as all the arithmetic.
    out : ndarray of shape (9, N), float32
        Takes the luminance, 6 rows, and the color, 3 rows, 0..1.
    back : ndarray of shape (6, 6), float32
        The pseudo-inverse of `light_root`.
    """
    squares = scratch[3:]
    for axis in range(3):  # the matrix is symmetric
        np.einsum("tn,tjn->jn", planes[:, axis], planes[:, axis:], out=squares[axis, axis:])
        squares[axis + 1 :, axis] = squares[axis, axis + 1 :]
    square, scale, most = scratch[2]
    along, other = _leading_vector(squares, axes.sum(axis=0), scratch[0], scratch[1], square)
    color = np.einsum("ck,kn->cn", axes, along, out=out[TERMS:])
    np.maximum(color, 0, out=color)  # what is below 0 there is noise
    np.maximum(np.einsum("cn,cn->n", color, color, out=square), TINY, out=square)
    # For a color of length 1, the luminance's mean square over the lights is its product with the matrix.
    np.einsum("kc,cn->kn", axes.T, color, out=along)
    np.einsum("kn,kn->n", along, np.einsum("ijn,jn->in", squares, along, out=other), out=scale)
    np.sqrt(np.maximum(scale, 0, out=scale), out=scale)
    scale /= np.multiply(square, np.float32(TYPICAL_LUMINANCE), out=most)
    np.minimum(scale, np.divide(1, np.maximum(np.amax(color, axis=0, out=most), TINY, out=most), out=most), out=scale)
    np.maximum(scale, DARKEST, out=scale)
    color *= scale
    along /= np.multiply(square, scale, out=square)
    multiply(back, np.einsum("tkn,kn->tn", planes, along, out=squares[:2].reshape(TERMS, -1)), out[:TERMS])


def luma_and_chroma(
    planes: Floats, axes: Floats, scratch: Floats, out: Floats, design: Design, luma_from_rgb: NDArray[np.float64]
) -> None:
    """The luma polynomial and the mean chromaticity of three polynomials.

    Parameters
    ----------
    planes, axes, scratch : ndarray
        As in `luminance_and_color`.
    out : ndarray of shape (8, N), float32
        Takes the luma, 6 rows, and the chroma, 2 rows.
    design : Design
    luma_from_rgb : ndarray of shape (3, 4), float64
        As `ycrcb` or `principal_axes` gives it.

    References
    ----------
    HPL-98-131, section 3.
    """
    matrix = np.column_stack([luma_from_rgb[:, :3] @ axes, luma_from_rgb[:, 3]]).astype(np.float32)
    np.einsum("c,tcn->tn", matrix[0, :3], planes, out=out[:TERMS])
    out[5] += matrix[0, 3]
    mean = np.einsum("t,tcn->cn", design.matrix.mean(axis=0).astype(np.float32), planes, out=scratch[0])
    np.einsum("ic,cn->in", matrix[1:, :3], mean, out=out[TERMS:])
    out[TERMS:] += matrix[1:, 3:]


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


def light_spread(coefficients: Coefficients, design: Design, pool: ThreadPoolExecutor) -> NDArray[np.float64]:
    """Covariance of RGB over the photographed lights, summed over all texels: (3, 3), float64."""
    centred = design.matrix - design.matrix.mean(axis=0)
    values, vectors = np.linalg.eigh(centred.T @ centred)
    root = (vectors * np.sqrt(values.clip(0))).T.astype(np.float32)

    def spread(bounds: tuple[int, int]) -> NDArray[np.float64]:
        planes = np.empty((TERMS, 3, bounds[1] - bounds[0]), np.float32)
        coefficients.block(*bounds, planes)
        weighted = multiply(root, planes.reshape(TERMS, -1)).reshape(planes.shape)
        return np.einsum("tin,tjn->ij", weighted, weighted).astype(np.float64)

    along = np.sum(list(pool.map(spread, coefficients.blocks)), axis=0)
    return coefficients.axes @ along @ coefficients.axes.T


def light_root(design: Design) -> NDArray[np.float64]:
    """What turns coefficients into vectors whose squared length is a polynomial's mean square over the lights.

    Parameters
    ----------
    design : Design

    Returns
    -------
    ndarray of shape (6, 6), float64
    """
    terms = list(design.terms)
    active = design.matrix[:, terms]
    root = np.zeros((TERMS, TERMS))
    root[np.ix_(terms, terms)] = np.linalg.cholesky(active.T @ active / len(active)).T
    return root


def inverse(affine: NDArray[np.float64]) -> NDArray[np.float64]:
    """The way back of a (3, 4) matrix that is applied to three components and 1."""
    back = np.linalg.inv(affine[:, :3])
    return np.column_stack([back, -back @ affine[:, 3]]).astype(np.float64)


def _leading_vector(
    squares: Floats, start: Floats, vector: Floats, other: Floats, length: Floats
) -> tuple[Floats, Floats]:
    """The direction, of any length, along which N sets of coefficients with products (3, 3, N) are largest.

    By the power method, from gray, which `start` (3,) is: a colour has no negative part, so gray is never at right
    angles to it. It is found in one of two arrays (3, N); the other one is given back behind it. `length` (N,) is
    scratch memory.
    """
    np.einsum("ijn,j->in", squares, start, out=vector)
    for power in range(2, POWER + 1):
        np.einsum("ijn,jn->in", squares, vector, out=other)
        vector, other = other, vector
        if power == POWER // 2:  # as high as dark texels allow
            _divide(vector, np.amax(vector, axis=0, out=length))
    return vector, other


def _divide(vectors: Floats, lengths: Floats) -> None:
    """Divide vectors (3, N) by lengths (N,), in place; a vector of no length keeps it."""
    np.divide(vectors, np.maximum(lengths, TINY, out=lengths), out=vectors)
