"""The figure of the observability study: agreement and success against the strength of each disturbance."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.figures import BLACK, BLUE, GREEN, GREY, ORANGE, PINK, SKY, STYLE, VERMILION
from experiments.observability_disturbances import DISTURBANCES
from experiments.results import Row

LOOKS: dict[str, tuple[str, str, Any]] = {
    "teacher": (BLACK, "o", ":"),
    "default": (VERMILION, "v", "-"),
    "disturbed": (ORANGE, "s", "-"),
    "trace": (BLUE, "D", "-"),
    "hold": (PINK, "*", "-"),
    "held_trace": (GREEN, "^", "-"),
    "tree": (GREY, "P", "--"),
    "tree_memory": (SKY, "X", "--"),
}
"""Colour, marker and line of each learner; dashed where no hypervectors are at work, dotted the rules themselves."""

USUAL = (0, (1, 3))
"""How the share of the most usual command is drawn."""

FIGURES = {
    "balanced_agreement": "balanced agreement",
    "agreement": "agreement",
    "success_rate": "success rate",
}


def curves(table: Sequence[Row]) -> Figure:
    """A column per disturbance, a line per learner; success only if somebody drove."""
    names = list(dict.fromkeys(row["disturbance"] for row in table))
    values = [value for value in FIGURES if any(row[value] is not None for row in table)]
    with matplotlib.rc_context(STYLE):
        size = max(0.9 + 1.95 * len(names), 5.4), 0.9 + 1.95 * len(values)
        figure = Figure(figsize=size, layout="constrained")
        grid = figure.subplots(len(values), len(names), sharey="row", sharex="col", squeeze=False)
        for column, name in enumerate(names):
            own = [row for row in table if row["disturbance"] == name]
            for axes, value in zip(grid[:, column], values, strict=True):
                _lines(axes, own, value)
            _strengths(grid[-1, column], own)
            grid[0, column].set_title(name)
        for axes, value in zip(grid[:, 0], values, strict=True):
            axes.set_ylabel(FIGURES[value])
            low = min(row[value] for row in table if row[value] is not None)
            # From 0 on where the lowest is near it; else just below the lowest.
            axes.set_ylim(-0.03 if low < 0.5 else np.floor(low * 10) / 10, 1.03)
        figure.legend(handles=_key(table), loc="outside lower center", ncols=min(5, 2 + len(names)))
    return figure


def _key(table: Sequence[Row]) -> list[Line2D]:
    """The legend's entries: one look a learner, whatever lines it has in a panel."""
    present = {row["learner"] for row in table}
    entries = [
        Line2D([], [], color=colour, marker=marker, linestyle=line, markersize=4.5, label=learner.replace("_", " "))
        for learner, (colour, marker, line) in LOOKS.items()
        if learner in present
    ]
    return [*entries, Line2D([], [], color=GREY, linestyle=USUAL, label="most usual command")]


def _lines(axes: Axes, rows: Sequence[Row], value: str) -> None:
    learners = list(dict.fromkeys(row["learner"] for row in rows))
    strengths = sorted({row["strength"] for row in rows})
    for place, learner in enumerate(learners):
        own = [row for row in rows if row["learner"] == learner and row[value] is not None]
        # Beside each other, so that no interval and no marker hides another.
        x = np.array([strengths.index(row["strength"]) for row in own]) + 0.08 * (place - (len(learners) - 1) / 2)
        y = [row[value] for row in own]
        colour, marker, line = LOOKS[learner]
        # A category has no values between, so that no line joins one to the next.
        style = "none" if rows[0]["disturbance"] == "aliased" else line
        axes.plot(x, y, linestyle=style, color=colour, marker=marker, markersize=4.5, linewidth=1.2)
        if value == "success_rate":
            low, high = ([row[end] for row in own] for end in ("success_low", "success_high"))
            axes.vlines(x, low, high, color=colour, alpha=0.35, linewidth=1.4)
    if value == "agreement":
        axes.axhline(rows[0]["usual_share"], color=GREY, linewidth=1, linestyle=USUAL)
    axes.grid(axis="y")


def _strengths(axes: Axes, rows: Sequence[Row]) -> None:
    labels = dict(sorted({row["strength"]: row["label"] for row in rows}.items()))
    ticks = [label.replace("light left and light right", "lights") for label in labels.values()]
    ticks = [tick.replace("light ", "light\n") for tick in ticks]
    axes.set_xticks(range(len(ticks)), ticks)
    axes.set_xlabel(textwrap.fill(DISTURBANCES[rows[0]["disturbance"]].axis, 21))
