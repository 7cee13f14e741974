"""Where in a TOML document each key and value stands: tomllib reads values, and forgets their lines."""

from __future__ import annotations

import re
import tomllib

Place = tuple[str | int, ...]
"""Keys and indices from the document's root, as in ("scatter", 0, "count")."""

_BLANK = re.compile(r"(?:[ \t\n]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_TEXT = re.compile(
    r'"""(?:\\.|[^\\])*?"""(?:"{0,2})' r"|'''.*?'''(?:'{0,2})" r'|"(?:\\.|[^"\\\n])*"' r"|'[^'\n]*'", re.DOTALL
)
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_SCALAR = re.compile(r"[^,\]}#\n]*")


def toml_spans(text: str) -> dict[Place, tuple[int, int]]:
    """First and last position of every value of a document, by its place.

    Parameters
    ----------
    text : str
        A document that `tomllib.loads` accepts, with `\\n` between its lines.

    Returns
    -------
    dict of tuple to (int, int)
        The characters `text[first:last]`: of a table its header, or its first key where it has none; else the value.
    """
    return _Walk(text).spans


def line_of(text: str, position: int) -> int:
    """The number of the line, from 1, that holds a position."""
    return text.count("\n", 0, position) + 1


class _Walk:
    """One pass over a document that is known to be right, so that a glance at each part tells what it is."""

    def __init__(self, text: str):
        self.text, self.at = text, 0
        self.spans: dict[Place, tuple[int, int]] = {}
        self._counts: dict[Place, int] = {}
        table: Place = ()
        self._skip(_BLANK)
        while self.at < len(text):
            if text[self.at] == "[":
                table = self._header()
            else:
                self._pair(table)
            self._skip(_BLANK)

    def _skip(self, pattern: re.Pattern[str]) -> str:
        found = pattern.match(self.text, self.at)
        if found is None:  # not a document that tomllib accepts
            raise ValueError(f"position {self.at}")
        self.at = found.end()
        return found[0]

    def _header(self) -> Place:
        first = self.at
        array = self.text.startswith("[[", self.at)
        self.at += 1 + array
        *parents, last = self._key()
        self.at += 1 + array
        place: Place = ()
        for key in parents:
            place = self._inside((*place, key), first)
        place = (*place, last)
        if array:
            self.spans.setdefault(place, (first, self.at))
            self._counts[place] = self._counts.get(place, 0) + 1
            place = (*place, self._counts[place] - 1)
        self.spans[place] = first, self.at
        return place

    def _inside(self, place: Place, first: int) -> Place:
        """A table that a header passes through: of an array of tables the last one."""
        if place in self._counts:
            return (*place, self._counts[place] - 1)
        self.spans.setdefault(place, (first, self.at))
        return place

    def _key(self) -> list[str]:
        parts = []
        while True:
            self._skip(_SPACE)
            quoted = self.text[self.at] in "\"'"
            part = self._skip(_TEXT if quoted else _BARE)
            parts.append(tomllib.loads(f"key = {part}")["key"] if quoted else part)
            self._skip(_SPACE)
            if self.text[self.at] != ".":
                return parts
            self.at += 1

    def _pair(self, table: Place) -> None:
        first = self.at
        *parents, last = self._key()
        key_end = self.at
        for key in parents:
            table = (*table, key)
            self.spans.setdefault(table, (first, key_end))
        self.at += 1
        self._skip(_SPACE)
        self._value((*table, last))

    def _value(self, place: Place) -> None:
        first = self.at
        start = self.text[self.at]
        if start in "[{":
            self.at += 1
            index = 0
            self._skip(_BLANK)
            while self.text[self.at] not in "]}":
                if start == "[":
                    self._value((*place, index))
                else:
                    self._pair(place)
                index += 1
                self._skip(_BLANK)
                if self.text[self.at] == ",":
                    self.at += 1
                    self._skip(_BLANK)
            self.at += 1
        elif start in "\"'":
            self._skip(_TEXT)
        else:
            self.at = first + len(self._skip(_SCALAR).rstrip())
        self.spans[place] = first, self.at
