"""The figures of the generalisation study, one or two panels for each part."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.figures import BLACK, BLUE, GREEN, GREY, ORANGE, PINK, SKY, STYLE, VERMILION
from experiments.results import Row

PURPLE, BROWN, OLIVE = "#7B5EA7", "#8C5A2B", "#7A8B2A"
LINES = (ORANGE, VERMILION, PINK, GREEN, OLIVE, SKY, PURPLE, BROWN)
"""Colours of the combinations with one part changed, in the order of the table."""
MARKERS = "s^vDP<>h"
RIVAL_LOOKS = {"nearest_neighbour": (GREY, "X"), "decision_tree": (BLACK, "*")}
ARENA_MARKERS = {"narrow": "s", "offset_lamp": "^", "large": "D"}


def panels(table: Sequence[Row], parts: Sequence[str]) -> Figure:
    """The panels of some parts, two side by side."""
    chosen = [(part, draw) for part in parts for draw in PANELS[part]]
    across = min(2, len(chosen))
    down = -(-len(chosen) // across)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(5.9 * across, 4.3 * down), layout="constrained")
        grid = figure.subplots(down, across, squeeze=False).ravel()
        for axes, (part, draw) in zip(grid, chosen, strict=False):
            draw(axes, [row for row in table if row["part"] == part])
        for axes in grid[len(chosen) :]:
            axes.set_axis_off()
    return figure


def _named(rows: Sequence[Row]) -> dict[str, tuple[str, str, str]]:
    """Label, colour and marker of each learner that has a line of its own: those that drove at home."""
    default = next((row for row in rows if row["encoder"] is not None), None)
    if default is None:
        return {}
    looks = {default["learner"]: (f"default ({default['learner']})", BLUE, "o")}
    spare = iter(zip(LINES, MARKERS, strict=True))
    for row in rows:
        if row["learner"] in looks or row["success_rate"] is None:
            continue
        if row["learner"] in RIVAL_LOOKS:
            colour, marker = RIVAL_LOOKS[row["learner"]]
            looks[row["learner"]] = (row["learner"].replace("_", " "), colour, marker)
        elif row["encoder"] is not None:
            parts = ("encoder", "protection", "record", "rule")
            changed = "/".join(row[part] for part in parts if row[part] != default[part])
            colour, marker = next(spare, (GREY, "."))
            looks[row["learner"]] = (changed.replace("_", " "), colour, marker)
    return looks


def _by_demonstrations(axes: Axes, rows: Sequence[Row], figure: str, low: str, high: str) -> None:
    home = [row for row in rows if row["arena"] == "default" and row["demonstrations"] is not None]
    for learner, (label, colour, marker) in _named(rows).items():
        own = [row for row in home if row["learner"] == learner and row[figure] is not None]
        x = np.array([row["demonstrations"] for row in own], dtype=float)
        bounds = np.array([[row[low], row[high]] for row in own], dtype=float).reshape(-1, 2)
        width = 2.2 if colour == BLUE else 1.1
        axes.plot(
            x, [row[figure] for row in own], color=colour, marker=marker, markersize=5, linewidth=width, label=label
        )
        if colour == BLUE:
            axes.fill_between(x, bounds[:, 0], bounds[:, 1], color=colour, alpha=0.15, linewidth=0)
    counts = sorted({row["demonstrations"] for row in home})
    axes.set_xscale("log")
    axes.set_xticks(counts, [str(count) for count in counts])
    axes.minorticks_off()
    axes.set_xlabel("demonstrations")
    axes.grid()


def _agreement(axes: Axes, rows: Sequence[Row]) -> None:
    _by_demonstrations(axes, rows, "heldout", "heldout_min", "heldout_max")
    axes.set_title("Corral: agreement with the teacher in held-out runs")
    axes.set_ylabel("agreement (median over draws; band: range)")
    axes.legend(loc="lower right", fontsize=7)


def _success(axes: Axes, rows: Sequence[Row]) -> None:
    _by_demonstrations(axes, rows, "success_rate", "success_low", "success_high")
    default = next((row["learner"] for row in rows if row["encoder"] is not None), None)
    handles = []
    for arena in dict.fromkeys(row["arena"] for row in rows if row["arena"] != "default"):
        own = [row for row in rows if (row["learner"], row["arena"]) == (default, arena)]
        points = [(row["demonstrations"], row["success_rate"]) for row in own if row["success_rate"] is not None]
        marker = ARENA_MARKERS.get(arena, "P")
        look: dict[str, Any] = {
            "color": BLUE,
            "linestyle": ":",
            "marker": marker,
            "markersize": 6,
            "markerfacecolor": "white",
        }
        if points:
            axes.plot(*zip(*points, strict=True), **look)
            handles.append(Line2D([], [], label=f"default, in {arena.replace('_', ' ')}", **look))
    axes.set_title("Corral: success from unseen starts")
    axes.set_ylabel("success rate (band: 95 % interval)")
    axes.set_ylim(-0.03, 1.03)
    axes.legend(handles=handles, loc="lower center", fontsize=7)


def _accuracy(axes: Axes, rows: Sequence[Row]) -> None:
    sensors = max(row["sensors"] for row in rows)
    own = [row for row in rows if row["sensors"] == sensors]
    names = list(dict.fromkeys(row["model"] for row in own))
    looks = {"stratified": ("o", -0.12, "random fifths (stratified)"), "blocks": ("s", 0.12, "fifths in time (blocks)")}
    for split in dict.fromkeys(row["split"] for row in own):
        marker, shift, label = looks[split]
        for row in (row for row in own if row["split"] == split):
            place = names.index(row["model"]) + shift
            colour = BLUE if row["model"] == "one_hypervector" else GREY
            axes.plot(
                [row["accuracy_min"], row["accuracy_max"]], [place, place], color=colour, linewidth=2.5, alpha=0.4
            )
            face = colour if split == "stratified" else "white"
            axes.plot(row["accuracy"], place, marker, color=colour, markerfacecolor=face, markersize=6)
        axes.plot([], [], marker, color=BLACK, markerfacecolor=BLACK if split == "stratified" else "white", label=label)
    axes.set_yticks(range(len(names)), [name.replace("_", " ") for name in names])
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_title(f"Wall following, {sensors} sensors: accuracy")
    axes.set_xlabel("accuracy on the fifth left out (mean; bar: lowest and highest)")
    axes.grid(axis="x")
    axes.legend(loc="lower left", fontsize=7.5)


def _errors(axes: Axes, rows: Sequence[Row]) -> None:
    colours = {"corral": GREEN, "wall_following": VERMILION}
    styles: dict[str, Any] = {"one_hypervector": "-", "nearest_neighbours": "--", "mlp": ":", "ridge": "-."}
    for task in dict.fromkeys(row["task"] for row in rows):
        own, colour = [row for row in rows if row["task"] == task], colours[task]
        discrete = [row for row in own if row["levels"] is not None]
        axes.plot([r["levels"] for r in discrete], [r["relative"] for r in discrete], "o", ls="", color=colour, ms=7)
        largest = max((row["dim"] for row in own if row["dim"] is not None), default=None)
        for row in own:
            if row["model"] in styles and row["dim"] in (largest, None):
                width = 2.4 if row["model"] == "one_hypervector" else 1.2
                axes.axhline(row["relative"], color=colour, linestyle=styles[row["model"]], linewidth=width)
    handles = [
        Line2D([], [], color=colours[task], linewidth=5, label=f"teacher: {task.replace('_', ' ')}")
        for task in dict.fromkeys(row["task"] for row in rows)
    ]
    handles.append(Line2D([], [], color=BLACK, marker="o", linestyle="", label="one hypervector, discrete levels"))
    names = {"one_hypervector": "one hypervector, interpolating", "mlp": "MLP"}
    present = {row["model"] for row in rows}
    handles += [
        Line2D([], [], color=BLACK, linestyle=style, label=names.get(name, name.replace("_", " ")))
        for name, style in styles.items()
        if name in present
    ]
    levels = sorted({row["levels"] for row in rows} - {None})
    axes.set_xscale("log")
    axes.set_xticks(levels, [str(level) for level in levels])
    axes.minorticks_off()
    axes.set_ylim(0, 1)
    axes.set_title("Smooth commands: error")
    axes.set_xlabel("levels a wheel")
    axes.set_ylabel("error, as a share of that of the mean command")
    axes.grid(axis="y")
    axes.legend(handles=handles, loc="upper right", fontsize=7)


PANELS: dict[str, list[Callable[[Axes, Sequence[Row]], None]]] = {
    "corral": [_agreement, _success],
    "wall_following": [_accuracy],
    "smooth": [_errors],
}
"""What is drawn for each part."""
