"""Image series with one or two parameters, as a focus stack: what the lights' file is to a dome."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from impostor.errors import LpFileError

LARGEST_FILE = 16 * 1024 * 1024


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
    """Read lines of a photograph's name and its one or two parameters; a first line that counts them is optional.

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
        A line cannot be read, the count lies, or a photograph is not beside the file.

    References
    ----------
    HPL-2004-225, "PTM Representation": focus variation, and other simple effects of one or two parameters.
    """
    lines = [(number, line.split()) for number, line in enumerate(_text(path).splitlines(), 1) if line.strip()]
    if lines and len(lines[0][1]) == 1 and lines[0][1][0].isdigit():
        expected = int(lines[0][1][0])
        lines = lines[1:]
        if expected != len(lines):
            raise LpFileError(path, f"line 1: counts {expected} photographs; {len(lines)} lines follow")
    if not lines:
        raise LpFileError(path, "names no photographs; expected lines of 'name value'")
    wanted = "'name value'" if count == 1 else "'name value value'"
    photographs, values = [], []
    for number, words in lines:
        name = " ".join(words[:-count])
        try:
            values.append([float(word) for word in words[-count:]])
        except ValueError:
            values.append([np.nan])
        if not name or not np.isfinite(values[-1]).all():
            raise LpFileError(path, f"line {number}: {' '.join(words)[:80]!r}; expected {wanted}")
        photograph = Path(path).parent / name
        if not photograph.is_file():
            raise LpFileError(path, f"photograph {name!r} does not exist beside the file; expected it there")
        photographs.append(photograph)
    raw = np.array(values)
    uv = np.zeros((len(raw), 2))
    for column, (low, high) in enumerate(map(_range, raw.T)):
        uv[:, column] = (raw[:, column] - low) / (high - low) * 2 - 1
    return Series(tuple(photographs), raw, uv)


def _range(column: NDArray[np.float64]) -> tuple[float, float]:
    low, high = float(column.min()), float(column.max())
    if (low >= -1 and high <= 1) or low == high:
        return -1.0, 1.0
    return low, high


def _text(path: str | os.PathLike[str]) -> str:
    try:
        with open(path, "rb") as file:
            data = file.read(LARGEST_FILE + 1)
    except OSError as error:
        raise LpFileError(path, f"cannot be read: {error.strerror}") from error
    if len(data) > LARGEST_FILE or b"\0" in data:
        raise LpFileError(path, "is not a short text; expected lines of 'name value'")
    return data.decode("utf-8-sig", "replace")
