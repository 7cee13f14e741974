"""A TOML file held against a schema: values out, or one line that names the line, the key, the value and the rule."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

from impostor.errors import SceneFileError
from impostor.files.scene_schema import REQUIRED, FileName, Key, MapName, Table, Tables, WrongValue
from impostor.files.toml_lines import Place, line_of, toml_spans

LARGEST_FILE = 1 << 20
LONGEST_VALUE = 60
_TOML_PLACE = re.compile(r"(.*) \(at (?:line (\d+), column \d+|end of document)\)", re.DOTALL)
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]{1,60}")
# tomllib takes time and memory with the square of a dotted key's parts.
_LONG_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){32}""")


class Document:
    """One TOML file.

    Parameters
    ----------
    path : path-like

    Attributes
    ----------
    folder : Path
        From which its relative paths lead.
    sought : set of Path
        Every file that was looked for so far, found or not, the document itself too.

    Raises
    ------
    SceneFileError
        A path that no file can have.
    """

    def __init__(self, path: str | PathLike[str]):
        self.path = Path(path)
        try:
            real = Path(os.path.realpath(path))
        except ValueError as error:
            raise SceneFileError(path, f"cannot be read: {error}") from error
        self.folder, self.sought = real.parent, {real}

    def read(self, keys: Mapping[str, Key]) -> dict[str, Any]:
        """All values by key, tables as dicts, files as absolute paths, what was left out by its default.

        Raises
        ------
        SceneFileError
            The file cannot be read, or is not TOML; a key is unknown, missing, or its value is not of its kind; a file
            that it names does not exist.
        """
        return self._table(keys, self._values, ())

    def error(self, place: Place, expected: str, found: str | None = None) -> SceneFileError:
        """What is wrong at a place; by default its value as it is written."""
        text = self._written(place) if found is None else found
        return self.problem(place, f"{text}; expected {expected}")

    def problem(self, place: Place, problem: str) -> SceneFileError:
        """As `error`, in the caller's words."""
        return SceneFileError(self.path, f"{self.where(place)}: {problem}")

    def where(self, place: Place) -> str:
        """A place with its line, as in `line 12: scatter[0].count`."""
        span = next(self._spans[part] for part in _upward(place) if part in self._spans)
        return f"line {line_of(self._text, span[0])}: {place_name(place)}"

    @cached_property
    def _text(self) -> str:
        try:
            if not self.path.is_file():
                found = "is a directory or no ordinary file" if self.path.exists() else "does not exist"
                raise SceneFileError(self.path, f"{found}; expected a scene file")
            with open(self.path, "rb") as file:
                data = file.read(LARGEST_FILE + 1)
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise SceneFileError(self.path, f"cannot be read: {reason}; expected a file that can") from error
        if len(data) > LARGEST_FILE:
            raise SceneFileError(self.path, f"is larger than {LARGEST_FILE:,} bytes; expected a scene file")
        try:
            return data.decode("utf-8-sig").replace("\r\n", "\n")
        except UnicodeDecodeError as error:
            line = data.count(b"\n", 0, error.start) + 1
            raise SceneFileError(self.path, f"line {line}: is not UTF-8; expected TOML") from None

    @cached_property
    def _values(self) -> dict[str, Any]:
        long = _LONG_KEY.search(self._text)
        if long:
            line = line_of(self._text, long.start())
            raise SceneFileError(self.path, f"line {line}: a key of more than 32 parts; expected at most 3")
        try:
            return tomllib.loads(self._text)
        except tomllib.TOMLDecodeError as error:
            found = _TOML_PLACE.fullmatch(str(error))
            text, line = (found[1], found[2]) if found else (str(error), None)
            line = int(line) if line else line_of(self._text, len(self._text))
            text = text.replace("Cannot overwrite a value", "a key is given twice")
            text = text[:1].lower() + text[1:200]
            raise SceneFileError(self.path, f"line {line}: is not TOML: {text}") from None
        except RecursionError:
            raise SceneFileError(self.path, "is nested too deeply; expected tables in tables at most") from None
        except ValueError as error:  # a whole number or a date beyond what Python makes of one
            raise SceneFileError(self.path, f"has a value that cannot be read: {str(error)[:200]}") from None

    @cached_property
    def _spans(self) -> dict[Place, tuple[int, int]]:
        return {(): (0, 0)} | toml_spans(self._text)

    def _written(self, place: Place) -> str:
        if place not in self._spans:
            return "is missing"
        first, last = self._spans[place]
        text = " ".join(self._text[first:last].split())
        return text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE - 3]}..."

    def _table(self, keys: Mapping[str, Key], value: dict[str, Any], place: Place) -> dict[str, Any]:
        for name in value:
            if name not in keys:
                close = get_close_matches(name, keys, 1)
                names = [repr(close[0])] if close else sorted(keys)
                raise self.error((*place, name), f"{'' if close else 'one of '}{', '.join(names)}", "unknown key")
        return {name: self._value(key, value.get(name), (*place, name)) for name, key in keys.items()}

    def _value(self, key: Key, value: Any, place: Place) -> Any:
        kind = key.kind
        if value is None:
            if key.default is REQUIRED:
                raise self.error(place, kind.expected, "is missing")
            if key.default is None or isinstance(kind, Tables):
                return key.default
            value = key.default
        if isinstance(kind, Tables):
            if not isinstance(value, list) or not all(isinstance(each, dict) for each in value):
                raise self.error(place, f"tables, each below [[{place_name(_keys(place))}]]")
            if len(value) > kind.most:
                raise self.error(place, f"at most {kind.most:,}", f"{len(value):,} tables")
            return [self._table(kind.keys, each, (*place, index)) for index, each in enumerate(value)]
        if isinstance(kind, Table):
            if not isinstance(value, dict):
                raise self.error(place, f"a table, [{place_name(_keys(place))}]")
            return self._table(kind.keys, value, place)
        try:
            read = kind.read(value)
        except WrongValue:
            raise self.error(place, kind.expected) from None
        return self._file(read, kind, place) if isinstance(kind, FileName) else read

    def _file(self, name: str, kind: FileName, place: Place) -> Path:
        path = Path(os.path.realpath(self.folder / name))
        self.sought.add(path)
        try:
            found = path.is_file() or (isinstance(kind, MapName) and path.is_dir())
        except OSError:  # a name that no file can have
            found = False
        if not found:
            raise self.error(place, f"a file there, seen from {str(self.folder)!r}")
        return path


def place_name(place: Place) -> str:
    """A place as people write it: `scatter[0].count`."""
    words = [f"[{part}]" if isinstance(part, int) else f".{_key_name(part)}" for part in place]
    return "".join(words).removeprefix(".")


def _key_name(key: str) -> str:
    return key if _BARE_KEY.fullmatch(key) else repr(key[:LONGEST_VALUE])


def _keys(place: Place) -> Place:
    return tuple(part for part in place if isinstance(part, str))


def _upward(place: Place) -> list[Place]:
    return [place[:length] for length in range(len(place), -1, -1)]
