"""What callers give, checked in one line."""

from __future__ import annotations

from numbers import Integral, Real

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
    given = None
    try:
        given = np.asarray(values)
        # NumPy would read the text "2" as 2.
        array = None if given.dtype.kind in "SUc" else np.asarray(given, float)
    except (TypeError, ValueError):
        array = None
    if given is not None and given.dtype.kind == "c":
        raise SettingsError(where, f"{name} of complex numbers; expected real ones")
    if array is None:
        found = f"{name} is a {type(values).__name__}"
        raise SettingsError(where, f"{found}; expected numbers of shape {_in_words(shapes)}")
    if array.shape not in shapes and not any(_fits(array.shape, shape) for shape in shapes):
        raise SettingsError(where, f"{name} of shape {array.shape}; expected {_in_words(shapes)}")
    if not np.isfinite(array).all():
        raise SettingsError(where, f"{name} with a number that is not finite; expected finite ones")
    return array


def check_number(
    where: str, name: str, value: object, low: float = -np.inf, high: float = np.inf, *, above: bool = False
) -> None:
    """Refuse what is no finite number from `low`, or `above` it, to `high`.

    Raises
    ------
    SettingsError
    """
    if np.isfinite(low):
        expected = f"a number {'above' if above else 'from' if high < np.inf else 'of at least'} {low:g}"
        expected += f" to {high:g}" if high < np.inf else ""
    else:
        expected = "a finite number"
    if not isinstance(value, Real):
        raise SettingsError(where, f"{name} is a {type(value).__name__}; expected {expected}")
    number = float(value)
    if not (np.isfinite(number) and low <= number <= high) or (above and number == low):
        raise SettingsError(where, f"{name} {value}; expected {expected}")


def check_whole(where: str, value: object, low: int, high: int) -> int:
    """A whole number from `low` to `high`, as Python's own.

    Raises
    ------
    SettingsError
        Another number, or something else.
    """
    if isinstance(value, Integral) and not isinstance(value, bool):
        if low <= int(value) <= high:
            return int(value)
        raise SettingsError(where, f"{value}; expected {low} to {high}")
    found = value if isinstance(value, Real) else f"a {type(value).__name__}"
    raise SettingsError(where, f"{found}; expected a whole number from {low} to {high}")


def check_type(where: str, value: object, kind: type, origin: str = "") -> None:
    """Refuse what is not of a type; `origin` says where such a thing comes from.

    Raises
    ------
    SettingsError
    """
    if not isinstance(value, kind):
        raise SettingsError(where, f"a {type(value).__name__}; expected {with_article(kind)}{origin}")


def with_article(kind: type) -> str:
    """The name of a type after "a" or "an"."""
    return f"{'an' if kind.__name__[0] in 'AEIOUaeiou' else 'a'} {kind.__name__}"


def _fits(found: tuple[int, ...], wanted: tuple[int, ...]) -> bool:
    return len(found) == len(wanted) and all(most in (-1, count) for count, most in zip(found, wanted, strict=True))


def _in_words(shapes: tuple[tuple[int, ...], ...]) -> str:
    return " or ".join(str(shape).replace("-1", "N") for shape in shapes)
