"""The lines of the study of dimensions, and what they are compared with."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from experiments.capacity import published
from experiments.capacity.protocol import TASKS, UNBINDING, make
from experiments.kit import Column, Outcome, Row, Table, grid
from torchvsa import dim_needed, recall_probability
from torchvsa.capacity import CLOSED_FORMS, Kind

if TYPE_CHECKING:
    from collections.abc import Sequence

AT = 15
"""The k at which lines are compared."""


def summarise(settings: Any, records: pd.DataFrame, architectures: Sequence[str]) -> list[Row]:
    """A row for each task and architecture: lines and what they are compared with, or similarities after unbinding."""
    table: list[Row] = []
    for cell in grid(task=[*TASKS, UNBINDING], architecture=architectures):
        own: Any = records[(records.task == cell["task"]) & (records.architecture == cell["architecture"])]
        table.append({**cell, **(returned(own, cell) if cell["task"] == UNBINDING else lines(settings, own, cell))})
    return table


def lines(settings: Any, own: pd.DataFrame, cell: Row) -> Row:
    """The line of what is needed, that of the published rule, the published one, and that of the closed form."""
    name, task = cell["architecture"], cell["task"]
    ends: Any = own.groupby("k")[["needed", "first"]].first().astype(float)
    row = line("", ends["needed"]) | line("grid_", ends["first"])
    if (known := published.LINES[task].get(name)) is not None:
        slope, start = known
        row |= {"published_slope": slope, "published_start": start, "published_at": AT * slope + start}
        for rule in ("", "grid_"):
            if row[f"{rule}slope"] is not None:
                row[f"{rule}ratio"] = row[f"{rule}at"] / row["published_at"]
                row[f"{rule}slope_ratio"] = row[f"{rule}slope"] / slope
    needed = closed_dims(name, task, [int(k) for k in ends.index], settings.items, settings.accuracy)
    if needed:
        difference = own.accuracy - [
            recalled(name, task, settings.items, *pair) for pair in zip(own.dim, own.k, strict=True)
        ]
        by_k = difference.groupby(own.k).mean()
        row |= line("closed_", pd.Series(needed, dtype=float))
        row |= {"difference": difference.mean(), "largest_difference": by_k[by_k.abs().idxmax()]}
    return row


def line(name: str, dims: pd.Series) -> Row:
    """Slope, intercept and the value at k = 15 of the least squares line through the numbers that there are."""
    dims = dims.dropna()
    keys = (f"{name}slope", f"{name}start", f"{name}at")
    if len(dims) < 2:
        return dict.fromkeys(keys)
    slope, start = np.polyfit(dims.index.to_numpy(dtype=float), dims.to_numpy(), 1)
    return dict(zip(keys, (slope, start, AT * slope + start), strict=True))


def recalled(name: str, task: Kind, items: int, dim: float, k: float) -> float:
    """The accuracy by the closed form."""
    return recall_probability(make(name, int(dim)), int(dim), int(k), items, kind=task)


def closed_dims(name: str, task: str, counts: Sequence[int], items: int, accuracy: float) -> dict[int, int]:
    """The dimensions that the closed form needs for each k; empty without one."""
    architecture, _, atoms = name.partition(" ")
    if architecture not in CLOSED_FORMS:
        return {}
    options: dict[str, Any] = {"kind": task, **({"atoms": atoms} if atoms else {})}
    return {k: dim_needed(architecture, k, items, accuracy, **options) for k in counts}


def returned(own: pd.DataFrame, cell: Row) -> Row:
    """Similarities after unbinding, and the published ones."""
    means = own.groupby("k").similarity.mean()
    row: Row = {"dim": int(own.dim.iloc[0])}
    row |= {f"after_{keys}": means[keys] for keys in published.STEPS if keys in means}
    known = published.RETURNED.get(cell["architecture"], ())
    return row | {f"published_{keys}": one for keys, one in zip(published.STEPS, known, strict=False)}


def headline(outcome: Outcome) -> str:
    """How far the lines are from the published ones."""
    rows = [row for row in outcome.table if row.get("grid_ratio") is not None]
    if not rows:
        return ""
    ratios, slopes = ([row[key] for row in rows] for key in ("grid_ratio", "grid_slope_ratio"))
    return (
        f"By the published rule d at k = {AT} is {min(ratios):.2f} to {max(ratios):.2f} times the published one, and "
        f"the slope {min(slopes):.2f} to {max(slopes):.2f} times."
    )


def fitted(name: str) -> Any:
    """The format of a column that shows a line, and its value at k = 15."""

    def text(row: Row) -> str:
        if row.get(f"{name}slope") is None:
            return "-"
        slope, start, at = (row[f"{name}{end}"] for end in ("slope", "start", "at"))
        return f"{slope:.1f}k {'+' if start >= 0 else '-'} {abs(start):.1f}: {at:.0f}"

    return text


def ratios(name: str) -> Any:
    """The format of a column that compares a line with the published one."""

    def text(row: Row) -> str:
        at, slope = row.get(f"{name}ratio"), row.get(f"{name}slope_ratio")
        return "-" if at is None else f"{at:.2f}, {slope:.2f}"

    return text


LINES = [
    Column("architecture"),
    Column("at", "d needed", fitted(""), about="the least squares line, and its value at k = 15"),
    Column("grid_at", "first on the grid", fitted("grid_"), about="the same by the rule of the published measurements"),
    Column("published_at", "published", fitted("published_")),
    Column("ratio", "needed / p.", ratios(""), about="over the published: at k = 15, and of the slopes"),
    Column("grid_ratio", "first / p.", ratios("grid_")),
    Column("closed_at", "closed form", fitted("closed_")),
    Column(
        "difference", "measured - c.", "+.4f", about="accuracy over the closed form's, mean of all that was measured"
    ),
    Column("largest_difference", "at one k", "+.4f", about="the largest mean of one k"),
]
TITLES = {
    "bundle": "Dimensions for k items in a bundle, found as its k nearest",
    "pairs": "Dimensions for k bound pairs in a bundle, unbound one by one",
}
STEPS = [
    column
    for keys in published.STEPS
    for column in (
        Column(f"after_{keys}", f"{keys} key{'s' * (keys > 1)}", ".2f"),
        Column(f"published_{keys}", "published", ".2f"),
    )
]
RETURNED = Table(
    "Similarity after binding with keys and unbinding again", [Column("architecture"), Column("dim", "d"), *STEPS]
)


def tables(outcome: Outcome) -> list[Table]:
    """A table for each task, and one for repeated unbinding."""
    found = [*(Table(TITLES[task], LINES) for task in TASKS), RETURNED]
    return [
        table.show([row for row in outcome.table if row["task"] == task])
        for task, table in zip((*TASKS, UNBINDING), found, strict=True)
    ]
