"""Tables: their columns are declared once, and shown on the terminal, on a page and in Markdown.

>>> table = Table("Recall", [Column("learner"), Column("recall", format=".2f", best="max")])
>>> print(table.show([{"learner": "one_shot", "recall": 0.9}, {"learner": "gradient", "recall": None}]).markdown())
| learner | recall |
| --- | ---: |
| one_shot | 0.90 |
| gradient | - |
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import takewhile
from typing import Any, Literal

import pandas as pd
import rich.table
from rich.cells import cell_len
from rich.console import Console
from rich.markup import escape

from experiments.kit.console import fitting, line_width, widened

NONE = "-"
"""How a value that does not exist is shown."""

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Cell:
    """One cell of a table as text; `mark` says whether it stands out, and how."""

    text: str
    mark: Literal["", "best", "bad"] = ""


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes:
        key: of the rows' values.
        label: its title; by default the key with spaces.
        format: of a number, as in Python's format strings; or a function of the whole row that returns text.
        interval: the keys of a lower and an upper bound, shown after the value.
        best: which value is marked, if any.
        among: which rows compete to be the best; all do by default.
        alike: a key whose values must be equal in all rows that compete, or nothing is marked: what was measured on
            other samples does not compare.
        bad: which values are marked as bad.
        about: the definition that stands below the table.
    """

    key: str
    label: str = ""
    format: str | Callable[[Row], str] = ""
    interval: tuple[str, str] | None = None
    best: Literal["", "max", "min"] = ""
    among: Callable[[Row], bool] = lambda row: True
    alike: str | None = None
    bad: Callable[[Any], bool] | None = None
    about: str = ""

    @property
    def title(self) -> str:
        """The text above the column."""
        return self.label or self.key.replace("_", " ")

    def text(self, row: Row) -> str:
        """The value of a row as text."""
        if callable(self.format):
            return self.format(row)
        value = row.get(self.key)
        if value is None or value != value:
            return NONE
        shown = number(value, self.format)
        if self.interval is not None and row.get(self.interval[0]) is not None:
            low, high = (number(row[end], self.format) for end in self.interval)
            shown += f" [{low}, {high}]"
        return shown

    def cells(self, rows: Sequence[Row]) -> list[Cell]:
        """The column's cells, with the best and the bad ones marked."""
        compete = [row for row in rows if self.among(row)]
        known = [row[self.key] for row in compete if isinstance(row.get(self.key), int | float)]
        alike = self.alike is None or len({row.get(self.alike) for row in compete}) == 1
        best = None
        if self.best and alike and len(set(known)) > 1:
            best = {"max": max, "min": min}[self.best](known)
        return [Cell(self.text(row), self._mark(row.get(self.key), best if self.among(row) else None)) for row in rows]

    def _mark(self, value: object, best: object) -> Literal["", "best", "bad"]:
        if value is None:
            return ""
        if self.bad is not None and self.bad(value):
            return "bad"
        return "best" if value == best else ""


@dataclass(frozen=True)
class Table:
    """A table's title, columns and caption, and its rows once it is shown."""

    title: str
    columns: Sequence[Column]
    caption: str = ""
    rows: Sequence[Row] = ()
    words: bool = False
    """Whether all columns hold words, as the first always does."""

    def show(self, rows: Sequence[Row]) -> Table:
        """The table with these rows. Columns in which no row has a value are left out."""
        columns = [
            column
            for place, column in enumerate(self.columns)
            if place == 0 or any(column.text(row) != NONE for row in rows)
        ]
        return replace(self, columns=columns, rows=list(rows))

    @property
    def cells(self) -> list[list[Cell]]:
        """The cells, row by row."""
        columns = [column.cells(self.rows) for column in self.columns]
        return [list(row) for row in zip(*columns, strict=True)] if self.rows else []

    def print(self, console: Console) -> None:
        """Print the table; no number is cut off.

        Where it is too wide for a terminal, titles of columns wrap, and the columns that still do not fit stand in
        further tables below, each beside the columns of words that lead the table. A file gets long lines.
        """
        rows, title = self.cells, self.title or None
        words = [[row[place].text for row in rows] + column.title.split() for place, column in enumerate(self.columns)]
        least = [max(map(cell_len, each)) for each in words]
        worded = (all(isinstance(row.get(column.key), str) for row in self.rows) for column in self.columns)
        keys = 1 if self.words else max(1, len(list(takewhile(bool, worded))))
        for part in fitting(least, console.width if console.is_terminal else math.inf, keys):
            titles = [self.columns[place].title for place in part]
            widths = widened([least[place] for place in part], [cell_len(text) for text in titles], console.width)
            table = rich.table.Table(title=title, width=line_width(widths))
            for place, text, width in zip(part, titles, widths, strict=True):
                table.add_column(escape(text), justify="left" if place == 0 or self.words else "right", width=width)
            for row in rows:
                texts = [(escape(row[place].text), row[place].mark) for place in part]  # [a,b] is no markup
                table.add_row(*(f"[bold green]{text}" if mark == "best" else text for text, mark in texts))
            console.print(table, crop=False)
            title = None

    def markdown(self) -> str:
        """The table for a README or an issue."""
        lines = [[column.title for column in self.columns]]
        lines.append(["---", *("---" if self.words else "---:" for _ in self.columns[1:])])
        lines += [[f"**{cell.text}**" if cell.mark == "best" else cell.text for cell in row] for row in self.cells]
        bar = "\\|"  # a bar within a cell
        return "\n".join(f"| {' | '.join(text.replace('|', bar) for text in line)} |" for line in lines)


def aggregated(
    records: pd.DataFrame, keys: Sequence[str], columns: Mapping[str, tuple[str, str]], order: Sequence[Row] = ()
) -> list[dict[str, Any]]:
    """A row for each combination of `keys`, with `columns` by name: a column of the records, and a method of a series.

    Rows are in the order of the records, or of the cells in `order`, which hold the keys.
    """
    # As functions of one group: what pandas does for all groups at once differs in the last bit.
    methods = {name: (column, getattr(pd.Series, method)) for name, (column, method) in columns.items()}
    found: Any = records.groupby(list(keys), dropna=False, sort=False).agg(**methods).reset_index()
    for key in keys:
        if found[key].isna().any():  # which makes floats of whole numbers
            found[key] = found[key].convert_dtypes().astype(object).where(found[key].notna(), None)
    places = {tuple(cell[key] for key in keys): place for place, cell in enumerate(order)}
    return sorted(found.to_dict("records"), key=lambda row: places.get(tuple(row[key] for key in keys), 0))


def pivot(title: str, rows: Sequence[Row], keys: Sequence[Column], by: Column, value: Column, caption: str) -> Table:
    """A table with a row for each combination of `keys`, and a column with the `value` for each text of `by`."""
    lines: dict[tuple[Any, ...], dict[str, Any]] = {}
    for row in rows:
        first = {column.key: row[column.key] for column in keys}
        name = by.text(row)
        lines.setdefault(tuple(first.values()), first).update({name: row[value.key], f"row of {name}": row})
    names = dict.fromkeys(by.text(row) for row in rows)
    columns = [
        replace(value, key=name, label=name, format=partial(_pivoted, value, f"row of {name}")) for name in names
    ]
    return Table(title, [*keys, *columns], caption).show(list(lines.values()))


def _pivoted(value: Column, place: str, line: Row) -> str:
    return value.text(line[place]) if place in line else NONE


def number(value: object, form: str = "") -> str:
    """A number in a format; whole numbers with commas, others with three digits, if none is given."""
    if value is None:
        return NONE
    if isinstance(value, bool | str):
        return str(value)
    if form:
        return format(value, form)
    return f"{value:,}" if isinstance(value, int) else f"{value:.3f}"
