"""Matrix products and systems of equations that are small, many, and computed in several threads at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# Above this many multiplications OpenBLAS starts threads of its own, for which threads that call it wait in turn.
ONE_THREAD = 260_000


def multiply(left: NDArray[Any], right: NDArray[Any], out: NDArray[Any] | None = None) -> NDArray[Any]:
    """A matrix product, a few columns at a time: the calling thread computes it alone.

    Parameters
    ----------
    left : ndarray of shape (M, K)
    right : ndarray of shape (..., K, N)
    out : ndarray of shape (..., M, N), optional

    Returns
    -------
    ndarray of shape (..., M, N)
    """
    rows, inner = left.shape
    columns = right.shape[-1]
    if out is None:
        out = np.empty((*right.shape[:-2], rows, columns), np.result_type(left, right))
    step = max(ONE_THREAD // (rows * inner), 8)
    whole = columns // step * step
    if whole:
        np.matmul(left, _pieces(right[..., :whole], step), out=_pieces(out[..., :whole], step))
    if whole < columns:
        np.matmul(left, right[..., whole:], out=out[..., whole:])
    return out


def _pieces(matrix: NDArray[Any], step: int) -> NDArray[Any]:
    """A view (..., P, M, step) of a matrix (..., M, P * step): one call multiplies all pieces, each by itself."""
    return matrix.reshape(*matrix.shape[:-1], -1, step).swapaxes(-3, -2)


def solve_symmetric(matrices: NDArray[Any], right: NDArray[Any]) -> NDArray[Any]:
    """Solve many small positive definite systems at once, by Cholesky's method on arrays.

    Parameters
    ----------
    matrices : ndarray of shape (T, T, N), float64
        N of them. Written over; only the lower half is read.
    right : ndarray of shape (T, N, C), float64
        Written over.

    Returns
    -------
    ndarray of shape (T, N, C), float64
        `right`.
    """
    size = len(matrices)
    for j in range(size):
        for k in range(j):
            matrices[j:, j] -= matrices[j:, k] * matrices[j, k]
        matrices[j:, j] /= np.sqrt(np.maximum(matrices[j, j], np.finfo(np.float64).tiny))
    for j in range(size):
        for k in range(j):
            right[j] -= matrices[j, k, :, None] * right[k]
        right[j] /= matrices[j, j, :, None]
    for j in reversed(range(size)):
        for k in range(j + 1, size):
            right[j] -= matrices[k, j, :, None] * right[k]
        right[j] /= matrices[j, j, :, None]
    return right
