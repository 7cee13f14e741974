"""Image series with one or two parameters, as a focus stack: what the lights' file is to a dome."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from impostor.errors import LpFileError
from impostor.files.lp_file import find_photographs, named_numbers


@dataclass(frozen=True, eq=False)
class Series:
    """Photographs that differ by one or two parameters.

    Parameters
    ----------
    photographs : tuple of Path
    values : ndarray of shape (N, P), float64
        As they stand in the file; P is 1 or 2.
    parameters : ndarray of shape (N, 2), float64
        (u, v) of the fit: a parameter that stays within -1..1 is itself, any other is stretched so that its range is
        -1..1: 8-bit coefficients of larger numbers would lose the picture in rounding. v is 0 where P is 1.
    """

    photographs: tuple[Path, ...]
    values: NDArray[np.float64]
    parameters: NDArray[np.float64]

    def ranges(self) -> list[tuple[float, float]]:
        """What -1 and 1 of u, and of v, stand for."""
        return [_range(column) for column in self.values.T]


def read_series(path: str | os.PathLike[str], count: int) -> Series:
    """Read lines of a photograph's name and its one or two parameters, spelled as in a `.lp` file.

    Parameters
    ----------
    path : path-like
    count : {1, 2}
        Parameters a line.

    Returns
    -------
    Series

    Raises
    ------
    LpFileError
        As `read_lp`; or a parameter is not finite.

    References
    ----------
    HPL-2004-225, "PTM Representation": focus variation, and other simple effects of one or two parameters.
    """
    columns = " ".join(["value"] * count)
    rows = named_numbers(path, columns)
    for number, _, values in rows:
        if not np.isfinite(values).all():
            raise LpFileError(path, f"line {number}: {values}; expected finite numbers")
    photographs = find_photographs(path, [name for _, name, _ in rows], columns)
    raw = np.array([values for _, _, values in rows])
    uv = np.zeros((len(raw), 2))
    for column, (low, high) in enumerate(map(_range, raw.T)):
        uv[:, column] = (raw[:, column] - low) / (high - low) * 2 - 1
    return Series(photographs, raw, uv)


def _range(column: NDArray[np.float64]) -> tuple[float, float]:
    low, high = float(column.min()), float(column.max())
    if (low >= -1 and high <= 1) or low == high:
        return -1.0, 1.0
    return low, high
