"""The page of what was gathered: tables, how the main column depends on what differs, and the comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.collecting import tables
from experiments.collecting.comparing import Comparison
from experiments.collecting.runs import Run
from experiments.kit import Page, Study, Table
from experiments.kit.figures import BLUE, GREY, legend_below, lines

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_ROWS = 2000
"""Rows of a table on a page; the Parquet file has all of them."""
MOST_DRAWN = 40
"""Differences in one figure; each needs a line."""


def page(
    folder: Path,
    runs: Sequence[Run],
    gathered: Mapping[str, Table],
    studies: Mapping[str, Study | None],
    settings: Sequence[str],
    missing: Table,
    found: Comparison | None,
    command: str,
) -> Page:
    """The page of the runs, whose figures are kept in `folder`."""
    done = sum(run.state == "finished" for run in runs)
    made = Page("Collected runs", f"{done} of {len(runs)} runs that were found have finished.", folder=folder)
    if missing.rows:
        made.section(missing.title).table(missing)
    if found is not None:
        _comparison(made, found)
    for study, table in gathered.items():
        section = made.section(table.title)
        if len(table.rows) > MOST_ROWS:
            section.text(f"The first {MOST_ROWS:,} of {len(table.rows):,} rows; `rows.parquet` has all of them.")
        section.table(table.show(table.rows[:MOST_ROWS]))
        data, axes = _curve(table, studies[study], settings)
        if len(data):
            section.figure(
                f"{study}_by_{axes[0].removeprefix('config.')}",
                lambda data=data, axes=axes: curve(data, *axes),
                f"{axes[1]} by {axes[0].removeprefix('config.')}",
                "Lines: medians over all other settings; bands: from the lowest to the highest.",
                data,
            )
    made.section("How to reproduce").code(command)
    return made


def _comparison(made: Page, found: Comparison) -> None:
    section = made.section("What differs")
    section.text(*found.notes)
    section.table(tables.settings(found))
    if found.differences:
        section.table(tables.differences(found))
        data = pd.DataFrame(found.differences)
        data.insert(
            0, "name", [" ".join(str(row[key]) for key in [*found.groups, "metric"]) for row in data.to_dict("records")]
        )
        told = data.loc[data.verdict.isin(["higher", "lower"])].head(MOST_DRAWN)
        if len(told):
            section.figure(
                "differences",
                lambda: differences(told),
                "The differences whose interval excludes 0, with their intervals",
                f"{found.labels[1]} minus {found.labels[0]}, divided by the larger of the two means, so that metrics "
                f"of different units share an axis; at most {MOST_DRAWN}.",
                told,
            )
    if found.equal:
        section.text(f"{found.equal:,} further numbers are the same in both.")
    if found.metrics:
        section.table(tables.metrics(found).show(found.metrics[:MOST_ROWS]))


def _curve(table: Table, study: Study | None, settings: Sequence[str]) -> tuple[pd.DataFrame, tuple[str, str, str]]:
    """What is drawn of a table: a setting that differs, a column that has a best value, and the names of the rows."""
    frame = pd.DataFrame(list(table.rows))
    named = [f"config.{name}" for name in settings]
    there = [name for name in named if name in frame and len(set(frame[name].dropna())) > 1]
    best = [column.key for column in table.columns if column.best and column.key in frame]
    if not there or not best or study is None:
        return frame.iloc[:0], ("", "", "")
    x, y = min(there, key=lambda name: name == "config.seed"), best[0]
    keys = [key for key in study.keys if key in frame]
    name = ["/".join(str(row[key]) for key in keys) for row in frame.to_dict("records")]
    data = frame.assign(row=name).dropna(subset=[x, y])
    return data.loc[:, [x, y, "row"]], (x, y, "row")


def curve(data: pd.DataFrame, x: str, y: str, hue: str) -> Figure:
    """A column of the table by a setting."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    axes = figure.subplots()
    numbers = pd.api.types.is_numeric_dtype(data[x])
    lines(axes, data if numbers else data.assign(**{x: data[x].astype(str)}), x, y, hue)
    axes.set(xlabel=x.removeprefix("config."), ylabel=y.replace("_", " "))
    legend_below(figure)
    return figure


def differences(data: pd.DataFrame) -> Figure:
    """Differences and their intervals, each relative to the larger mean."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 1.0 + 0.24 * len(data)), layout="constrained")
    axes = figure.subplots()
    scale: Any = data[["a", "b"]].abs().max(axis=1)
    places = range(len(data))
    axes.hlines(places, data.low / scale, data.high / scale, color=GREY)
    axes.plot(data.difference / scale, places, "o", color=BLUE)
    axes.axvline(0, color=GREY, linewidth=0.8)
    axes.set(yticks=places, yticklabels=data.name, ylim=(len(data) - 0.4, -0.6), xlabel="relative difference")
    return figure
