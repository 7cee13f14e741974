"""What callers give a renderer, checked in one line."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.checks import check_number, check_type, check_whole, numbers, with_article
from impostor.errors import SettingsError

__all__ = ["bounded", "check_number", "check_type", "check_whole", "invertible", "numbers", "with_article"]

# What lies between has squares and inverses in single precision, in which the GPU counts.
LARGEST, SMALLEST = 1e15, 1e-15


def bounded(where: str, name: str, values: ArrayLike, *shapes: tuple[int, ...]) -> NDArray[np.float64]:
    """As `numbers`, each of them less than `LARGEST`.

    Raises
    ------
    SettingsError
    """
    given = numbers(where, name, values, *shapes)
    most = float(np.abs(given).max(initial=0))
    if most >= LARGEST:
        raise SettingsError(where, f"{name} reach {most:g}; expected less than {LARGEST:g}")
    return given


def invertible(where: str, name: str, matrix: ArrayLike | None) -> NDArray[np.float64]:
    """A (4, 4) float64 matrix that has an inverse, the identity for None.

    Raises
    ------
    SettingsError
    """
    given = bounded(where, name, np.eye(4) if matrix is None else matrix, (4, 4))
    if not abs(np.linalg.det(given)) > 0:
        raise SettingsError(where, f"{name} has no inverse; expected a matrix that has one")
    return given
