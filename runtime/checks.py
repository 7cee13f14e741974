"""What callers give a renderer, checked in one line."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.checks import check_number, check_type, numbers, with_article
from impostor.errors import SettingsError

__all__ = ["check_number", "check_type", "invertible", "numbers", "with_article"]


def invertible(where: str, name: str, matrix: ArrayLike | None) -> NDArray[np.float64]:
    """A (4, 4) float64 matrix that has an inverse, the identity for None.

    Raises
    ------
    SettingsError
    """
    given = numbers(where, name, np.eye(4) if matrix is None else matrix, (4, 4))
    if not abs(np.linalg.det(given)) > 0:
        raise SettingsError(where, f"{name} has no inverse; expected a matrix that has one")
    return given
