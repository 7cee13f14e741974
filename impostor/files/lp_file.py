"""Reading and writing `.lp` files: the photographs of a capture set, and where the light was in each."""

from __future__ import annotations

import codecs
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath

import numpy as np
from numpy.typing import NDArray

from impostor.errors import LpFileError, SettingsError
from impostor.files.output import atomic_output

FilePath = str | os.PathLike[str]
LARGEST_FILE = 16 * 1024 * 1024
LONGEST_NUMBER = 64
COLUMNS = "x y z"
SHORTEST = 1e-6  # A vector shorter than this has no direction that its digits could tell.
_NUMBER = re.compile(r"[-+]?([0-9]+(\.[0-9]*|,[0-9]+)?|[.,][0-9]+)([eE][-+]?[0-9]+)?")


@dataclass(frozen=True, eq=False)
class CaptureSet:
    """Photographs of one object, the light in another place in each.

    Parameters
    ----------
    photographs : tuple of Path
        Empty where only the lights are known.
    directions : ndarray of shape (N, 3), float64
        Unit vectors toward the light: x right, y up, z to the camera.
    """

    photographs: tuple[Path, ...]
    directions: NDArray[np.float64]

    def __post_init__(self):
        if self.directions.ndim != 2 or self.directions.shape[1] != 3:
            raise SettingsError("capture set", f"directions of shape {self.directions.shape}; expected (N, 3)")
        if self.photographs and len(self.photographs) != len(self.directions):
            raise SettingsError(
                "capture set", f"{len(self.photographs)} photographs, {len(self.directions)} directions"
            )


def read_lp(path: FilePath) -> CaptureSet:
    """Read a `.lp` file and find its photographs.

    Parameters
    ----------
    path : path-like
        With or without a first line that counts; separated by white space, commas or semicolons; with decimal points
        or commas; with names that hold spaces.

    Returns
    -------
    CaptureSet
        A photograph is sought where its name says, below the file's own folder and nowhere else. A name from another
        machine is cut from the left until it fits, to the bare file name at last; capitals may differ.

    Raises
    ------
    LpFileError
        A line cannot be read, the count lies, there are no names, or a photograph is missing or named twice.
    """
    names, directions = read_lights(path)
    return CaptureSet(find_photographs(path, names, COLUMNS), directions)


def read_lights(path: FilePath) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    """Read a `.lp` file, and look for no photograph.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    names : tuple of str
        As they stand in the file; empty where no line has one.
    directions : ndarray of shape (N, 3), float64
        Unit vectors.

    Raises
    ------
    LpFileError
        As `read_lp`, but for the photographs.
    """
    names, numbers = [], []
    for number, name, values in named_numbers(path, COLUMNS):
        names.append(name)
        numbers.append(_unit(path, number, values))
    return tuple(filter(None, names)), np.array(numbers)


def named_numbers(path: FilePath, columns: str) -> list[tuple[int, str, list[float]]]:
    """Read lines of a name and some numbers, spelled as in a `.lp` file; a first line that counts them is optional.

    Parameters
    ----------
    path : path-like
    columns : str
        What the numbers are called, a word for each.

    Returns
    -------
    list of (int, str, list of float)
        Of each line: which one it is, the name, and the numbers, of which a long one may be infinite. Names are empty
        where no line has one.

    Raises
    ------
    LpFileError
        A line cannot be read, the count lies, or some lines have names and others none.
    """
    wanted = f"expected 'name {columns}'"
    lines = [(number, line.strip()) for number, line in enumerate(_text(path, columns).splitlines(), 1) if line.strip()]
    if not lines:
        raise LpFileError(path, f"is empty; expected a count, then lines of 'name {columns}'")
    counted = re.fullmatch(r"\+?[0-9]{1,9}", lines[0][1])
    if counted:
        count, lines = int(counted[0]), lines[1:]
        if count != len(lines):
            raise LpFileError(path, f"line 1: counts {count} photographs; {len(lines)} lines follow")
        if not lines:
            raise LpFileError(path, "counts no photographs; expected at least one")
    rows = [(number, *_row(path, number, line, columns)) for number, line in lines]
    unnamed = [number for number, name, _ in rows if not name]
    if 0 < len(unnamed) < len(rows):
        raise LpFileError(path, f"line {unnamed[0]}: names no photograph, other lines do; {wanted}")
    return rows


def find_photographs(path: FilePath, names: Sequence[str], columns: str) -> tuple[Path, ...]:
    """The photographs that the lines of a file name, sought as `read_lp` has it.

    Parameters
    ----------
    path : path-like
        The file.
    names : sequence of str
    columns : str
        As `named_numbers`.

    Raises
    ------
    LpFileError
        There are no names, or a photograph is missing or named twice.
    """
    if not any(names):
        raise LpFileError(path, f"its lines name no photographs; expected 'name {columns}'")
    folder = _Folder(Path(path).parent)
    found: dict[Path, str] = {}
    for name in names:
        photograph = folder.find(name)
        if photograph is None:
            raise LpFileError(path, f"photograph {name!r} does not exist beside the file; expected it there")
        if photograph in found:
            raise LpFileError(path, f"photograph {name!r} and {found[photograph]!r} are one file; expected each once")
        found[photograph] = name
    return tuple(found)


def write_lp(capture: CaptureSet, path: FilePath, force: bool = False) -> None:
    """Write a `.lp` file.

    Parameters
    ----------
    capture : CaptureSet
        Its photographs lie in the file's folder or below it.
    path : path-like
    force : bool
        Replace an existing file.

    Raises
    ------
    OutputError
        The file exists, or cannot be written.
    SettingsError
        There are no photographs, or one cannot be named in the file or is named twice: `read_lp` would not find them.
    """
    if not capture.photographs:
        raise SettingsError(path, "the capture set has no photographs; expected at least one")
    folder = Path(path).parent.resolve()
    lines, named = [str(len(capture.photographs))], set[str]()
    for photograph, direction in zip(capture.photographs, capture.directions.tolist(), strict=True):
        if not photograph.resolve().is_relative_to(folder):
            raise SettingsError(photograph, f"is not below {str(folder)!r}, the folder of the .lp file")
        name = photograph.resolve().relative_to(folder).as_posix()
        line = f"{name} {' '.join(map(repr, direction))}"
        if not _is_read_back(line, name):
            raise SettingsError(photograph, f"name {name!r} cannot stand on a line of a .lp; expected a plain one")
        if name in named:
            raise SettingsError(photograph, "given twice; expected each photograph once")
        named.add(name)
        lines.append(line)
    text = "\n".join(lines) + "\n"
    with atomic_output(path, force) as temporary:
        temporary.write_bytes(text.encode("utf-8"))


def _is_read_back(line: str, name: str) -> bool:
    """Whether a line, written as UTF-8, gives this name again."""
    try:
        line.encode("utf-8")
        return line.splitlines() == [line] and _row("", 0, line.strip(), COLUMNS)[0] == name
    except (UnicodeEncodeError, LpFileError):
        return False


def _text(path: FilePath, columns: str) -> str:
    try:
        if not Path(path).is_file():
            raise LpFileError(path, "is a directory or no ordinary file" if Path(path).exists() else "does not exist")
        with open(path, "rb") as file:
            data = file.read(LARGEST_FILE + 1)
    except OSError as error:
        raise LpFileError(path, f"cannot be read: {error.strerror}; expected a file that can") from error
    if len(data) > LARGEST_FILE:
        raise LpFileError(path, f"is larger than {LARGEST_FILE} bytes; expected lines of 'name {columns}'")
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    for encoding in ("utf-16",) if wide else ("utf-8-sig", "latin-1"):
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        if "\0" not in text:
            return text
    raise LpFileError(path, f"is not text; expected lines of 'name {columns}'")


def _unit(path: FilePath, number: int, values: list[float]) -> NDArray[np.float64]:
    """The unit direction of one line."""
    direction = np.array(values)
    length = np.linalg.norm(direction)
    if not SHORTEST <= length < np.inf:
        raise LpFileError(path, f"line {number}: light {values}; expected a vector of length 1")
    return direction / length


def _row(path: FilePath, number: int, line: str, columns: str) -> tuple[str, list[float]]:
    """Name, or "", and numbers of one line."""
    split = next((words for words in _splits(line, len(columns.split())) if all(map(_is_number, words[1:]))), None)
    if split is None:
        raise LpFileError(path, f"line {number}: {line[:80]!r}; expected 'name {columns}'")
    name, *words = split
    if "," in line and all(word.lstrip("+-").isdecimal() for word in (name.rpartition(",")[2].strip(), *words)):
        raise LpFileError(path, f"line {number}: {line[:80]!r}: commas between numbers and in them; expected one kind")
    return name.strip('"').strip(), [float(word.replace(",", ".")) for word in words]


def _splits(line: str, count: int) -> Iterator[list[str]]:
    """A line as name, or "", and some words: split at white space, at semicolons and at commas."""
    for words in (line.rsplit(None, count), line.rsplit(";", count), line.replace(",", " ").rsplit(None, count)):
        if len(words) >= count:
            name = line[: len(words[0])].rstrip(", \t") if len(words) == count + 1 else ""
            yield [name, *(word.strip() for word in words[-count:])]


def _is_number(word: str) -> bool:
    return len(word) <= LONGEST_NUMBER and _NUMBER.fullmatch(word) is not None


class _Folder:
    """What lies below one folder, each directory listed once."""

    def __init__(self, folder: Path):
        self.folder = folder
        self._listed: dict[Path, dict[str, list[str]]] = {}

    def find(self, name: str) -> Path | None:
        """The file of a name that may come from another machine, or None."""
        for kind in (PurePosixPath, PureWindowsPath):  # the latter splits at both kinds of slash
            given = kind(name)
            parts = [part for part in given.parts if part not in (given.anchor, "..", ".")]
            for start in range(len(parts)):
                found = self._below(parts[start:])
                if found is not None:
                    return found
        return None

    def _below(self, parts: Sequence[str]) -> Path | None:
        place = self.folder
        for part in parts:
            names = self._names(place)
            alike = names.get(part.casefold(), [])
            if part not in alike and len(alike) != 1:
                return None
            place = place / (part if part in alike else alike[0])
        return place if place.is_file() else None

    def _names(self, folder: Path) -> dict[str, list[str]]:
        if folder not in self._listed:
            listed: dict[str, list[str]] = {}
            try:
                for name in sorted(os.listdir(folder)):
                    listed.setdefault(name.casefold(), []).append(name)
            except OSError:  # no directory, or not ours to read: nothing is found in it
                pass
            self._listed[folder] = listed
        return self._listed[folder]
