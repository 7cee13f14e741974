"""The least-squares system of a fit. It depends on the lights alone, so it is solved before a pixel is read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.errors import SettingsError
from impostor.ptm.polynomials import TERMS, basis

ALL_TERMS = tuple(range(TERMS))
ONE_PARAMETER = (0, 3, 5)  # u², u, 1
# Rounding to 8 bits moves a value by up to 0.002: a set this badly placed turns that into the whole range.
MAX_CONDITION = 1000.0


@dataclass(frozen=True)
class Design:
    """The terms of a fit at every photograph's parameters, and what turns photographs into coefficients.

    Parameters
    ----------
    matrix : ndarray of shape (N, 6), float64
        A row a photograph: u², v², uv, u, v, 1; 0 where a term is left out.
    solver : ndarray of shape (6, N), float64
        The pseudo-inverse of `matrix`: coefficients are its product with the N values of a texel.
    condition : float
        Largest over smallest singular value of the terms in use.
    parameters : ndarray of shape (N, 2), float64
        (u, v) of every photograph.
    terms : tuple of int
        Which of the six are in use.
    """

    matrix: NDArray[np.float64]
    solver: NDArray[np.float64]
    condition: float
    parameters: NDArray[np.float64]
    terms: tuple[int, ...] = ALL_TERMS


def make_design(parameters: ArrayLike, terms: tuple[int, ...] = ALL_TERMS, where: object = "lights") -> Design:
    """Solve the least-squares system of a set of lights.

    Parameters
    ----------
    parameters : array_like of shape (N, 2), float
        (u, v) of every photograph.
    terms : tuple of int
        Which of u², v², uv, u, v, 1 to fit.
    where : object
        Named in an error: the file that the lights came from.

    Returns
    -------
    Design

    Raises
    ------
    SettingsError
        Fewer photographs than terms, or parameters so placed that many different polynomials fit them: all on a
        line, or all lights at one elevation, where u² + v² is a constant.

    References
    ----------
    HPL-98-131, section 3; the normal equations there are replaced by the singular value decomposition.
    """
    uv = np.asarray(parameters, np.float64)
    if uv.ndim != 2 or uv.shape[1] != 2 or not np.isfinite(uv).all():
        raise SettingsError(str(where), f"parameters of shape {uv.shape}; expected (N, 2), all finite")
    distinct = len(np.unique(uv.round(9), axis=0))
    if distinct < len(terms):
        raise SettingsError(
            str(where), f"{distinct} different lights or parameters; expected at least {len(terms)}, one a coefficient"
        )
    matrix = np.zeros((len(uv), TERMS))
    matrix[:, terms] = basis(uv[:, 0], uv[:, 1])[:, terms]
    active = matrix[:, terms]
    singular = np.linalg.svd(active, compute_uv=False)
    condition = float(singular[0] / max(singular[-1], np.finfo(float).tiny))
    if condition > MAX_CONDITION:
        raise SettingsError(
            str(where), f"condition number {condition:.3g}; expected below {MAX_CONDITION:g}: {_why(uv)}"
        )
    solver = np.zeros((TERMS, len(uv)))
    solver[terms, :] = np.linalg.pinv(active)
    return Design(matrix, solver, condition, uv, terms)


def _why(uv: NDArray[np.float64]) -> str:
    spread = np.linalg.svd(uv - uv.mean(axis=0), compute_uv=False)
    if spread[-1] < 0.02 * spread[0]:
        return "the lights lie on a line"
    radius = np.hypot(*uv.T)
    if np.ptp(radius) < 0.02:
        return f"all lights stand at one elevation, about {np.degrees(np.arccos(radius.mean().clip(0, 1))):.0f} degrees"
    return "the lights lie on one curve, or all in one spot"
