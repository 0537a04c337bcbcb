"""The rows of several runs in one frame, with the settings that differ between them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import pandas as pd

from experiments.collecting.runs import Run
from experiments.kit import Column, Row, Study, Table
from experiments.kit.columns import NONE
from experiments.kit.settings import written

ABSENT = None
"""The value of a setting that a run does not have, since it chose another option."""


def differing(runs: Sequence[Run]) -> list[str]:
    """The settings that differ between the runs of one study, in the order in which they are declared."""
    names = list(dict.fromkeys(name for run in runs for name in run.settings))
    return [
        name
        for name in names
        if any(
            len({json.dumps(run.settings.get(name, ABSENT)) for run in runs if run.study == study}) > 1
            for study in {run.study for run in runs}
        )
    ]


def gathered(runs: Sequence[Run], settings: Sequence[str], rows: str) -> pd.DataFrame:
    """A row for each row of the `records`, or of the `table`, of each run.

    First come `run`, `study` and `config.{name}` for each of the settings; then the columns of the rows.
    """
    frames = []
    for run in runs:
        own = run.records if rows == "records" else pd.DataFrame(list(run.table))
        first = {"run": run.name, "study": run.study}
        first |= {f"config.{name}": run.settings.get(name, ABSENT) for name in settings}
        head = pd.DataFrame({name: [value] * len(own) for name, value in first.items()}, index=own.index)
        frames.append(pd.concat([head, own.drop(columns=list(first), errors="ignore")], axis=1))
    frame = pd.concat(frames, ignore_index=True)
    mixed = {str(name): _of_one_kind(frame[name]) for name in frame.columns if frame[name].dtype == object}
    return frame.assign(**mixed)


def _of_one_kind(column: Any) -> Any:
    """A column that Parquet can hold: where values are of several kinds, or lists, all of them are text."""
    known = [value for value in column.tolist() if value is not None and value is not pd.NA and value == value]
    kinds = {type(value) for value in known}
    if kinds <= {int, float}:
        return pd.to_numeric(column)
    if len(kinds) == 1 and kinds <= {bool, str}:
        return column
    return column.map(lambda value: value if isinstance(value, str) else json.dumps(value, default=str), "ignore")


def table(runs: Sequence[Run], settings: Sequence[str], study: Study | None) -> Table:
    """The tables of the runs of one study as one, with the settings that differ as its first columns."""
    rows = [
        {"run": run.name, **{f"config.{name}": run.settings.get(name, ABSENT) for name in settings}, **row}
        for run in runs
        for row in run.table
    ]
    keys = {f"config.{name}": name for name in settings}
    first = [Column(key, name, partial(_written, key)) for key, name in keys.items()] or [Column("run")]
    caption = "A row of each run's table per line, with the settings that differ between the runs."
    return Table(f"Runs of {runs[0].study}", [*first, *columns(rows, study)], caption).show(rows)


def columns(rows: Sequence[Row], study: Study | None) -> Sequence[Column]:
    """The columns of a study's table; of a study that is not installed, all that hold numbers or text."""
    keys = [Column(key) for key in study.keys] if study is not None else []
    if study is not None and study.table is not None:
        declared = {column.key for column in study.table.columns}
        return [*(key for key in keys if key.key not in declared), *study.table.columns]
    names = dict.fromkeys(name for row in rows for name in row if name != "run" and not name.startswith("config."))
    plain = [name for name in names if all(isinstance(row.get(name), str | int | float | None) for row in rows)]
    return [Column(name) for name in plain]


def _written(key: str, row: Mapping[str, Any]) -> str:
    return NONE if row[key] is ABSENT else written(row[key])


def by_study(runs: Sequence[Run]) -> Mapping[str, list[Run]]:
    """The runs of each study."""
    found: dict[str, list[Run]] = {}
    for run in runs:
        found.setdefault(run.study, []).append(run)
    return found
