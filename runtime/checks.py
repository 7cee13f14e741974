"""What callers give, checked in one line."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impostor.errors import SettingsError


def numbers(where: str, name: str, values: ArrayLike, *shapes: tuple[int, ...]) -> NDArray[np.float64]:
    """Finite numbers in one of some shapes.

    Parameters
    ----------
    where, name : str
        What the values belong to, and what they are called there.
    values : array_like
    shapes : tuple of int
        -1 stands for any length.

    Returns
    -------
    ndarray, float64
        The caller's own array where that is one.

    Raises
    ------
    SettingsError
        No numbers, another shape, or one that is not finite.
    """
    try:
        array = np.asarray(values, float)
    except (TypeError, ValueError):
        found = f"{name} is a {type(values).__name__}"
        raise SettingsError(where, f"{found}; expected numbers of shape {_in_words(shapes)}") from None
    if array.shape not in shapes and not any(_fits(array.shape, shape) for shape in shapes):
        raise SettingsError(where, f"{name} of shape {array.shape}; expected {_in_words(shapes)}")
    if not np.isfinite(array).all():
        raise SettingsError(where, f"{name} with a number that is not finite; expected finite ones")
    return array


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


def check_type(where: str, value: object, kind: type, origin: str = "") -> None:
    """Refuse what is not of a type; `origin` says where such a thing comes from.

    Raises
    ------
    SettingsError
    """
    if not isinstance(value, kind):
        raise SettingsError(where, f"a {type(value).__name__}; expected a {kind.__name__}{origin}")


def _fits(found: tuple[int, ...], wanted: tuple[int, ...]) -> bool:
    return len(found) == len(wanted) and all(most in (-1, count) for count, most in zip(found, wanted, strict=True))


def _in_words(shapes: tuple[tuple[int, ...], ...]) -> str:
    return " or ".join(str(shape).replace("-1", "N") for shape in shapes)
