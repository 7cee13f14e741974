"""What a table of results is made of."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from PIL import Image

RELATIONS: dict[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">=": operator.ge,
}


@dataclass(frozen=True)
class Bar:
    """What a column's value must hold against.

    Parameters
    ----------
    column : str
        Key of the column.
    relation : {"<", "<=", ">="}
    limit : float
    """

    column: str
    relation: str
    limit: float

    def passed(self, value: float | None) -> bool:
        """Whether a value keeps the bar; one that could not be measured does not."""
        return value is not None and RELATIONS[self.relation](value, self.limit)


@dataclass(frozen=True)
class Row:
    """One line of a table.

    Parameters
    ----------
    key : str
        Stable: other programs find the row by it.
    label : str
    values : dict
        Column key to number; a missing one was not measured here.
    bars : tuple of Bar
    note : str
    """

    key: str
    label: str
    values: Mapping[str, float | None]
    bars: tuple[Bar, ...] = ()
    note: str = ""

    @property
    def passed(self) -> bool | None:
        """Whether every bar is kept, None without any."""
        return all(bar.passed(self.values.get(bar.column)) for bar in self.bars) if self.bars else None

    def as_json(self) -> dict[str, Any]:
        """Values, bars and outcome."""
        bars = [{"column": bar.column, "relation": bar.relation, "limit": bar.limit} for bar in self.bars]
        values = {key: rounded(value) for key, value in self.values.items()}
        return {"label": self.label, "values": values, "bars": bars, "passed": self.passed, "note": self.note}


@dataclass
class Table:
    """One table.

    Parameters
    ----------
    name : str
        As `--only` names it.
    title : str
    columns : dict of str
        Column key to heading, the unit in it.
    rows : list of Row
    notes : list of str
        Sentences below the table.
    chart : PIL.Image.Image, optional
        Goes with the table.
    """

    name: str
    title: str
    columns: dict[str, str]
    rows: list[Row] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    chart: Image.Image | None = None

    def as_json(self) -> dict[str, Any]:
        """The table by keys."""
        rows = {row.key: row.as_json() for row in self.rows}
        return {"title": self.title, "columns": self.columns, "rows": rows, "notes": self.notes}


def rounded(value: float | None) -> float | None:
    """Four significant digits: more would be noise."""
    return None if value is None else float(f"{value:.4g}")
