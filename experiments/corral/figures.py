"""Success, trajectories and recall by age. They draw; nothing is computed here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import sim
from experiments.corral.forgetting import ABOUT, CLIPPED, DEFAULT, MEAN, PRINTED, SUM, by_age, most_frequent
from experiments.kit import Row
from experiments.kit.figures import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PINK,
    PURPLE,
    SKY,
    SLATE,
    VERMILION,
    legend_below,
    lines,
)
from sim import render

COLOURS = {
    "teacher": BLACK,
    "default": BLUE,
    "paper": VERMILION,
    "paper_best_bins": ORANGE,
    "bundled": GREEN,
    "hand_written": PINK,
    "nearest_neighbour": SKY,
    "decision_tree": PURPLE,
    "random": GREY,
    "teacher_wheeled": SLATE,
}
LEARNERS = {
    PRINTED: (VERMILION, "v"),
    CLIPPED: (ORANGE, "o"),
    MEAN: (SKY, "^"),
    SUM: (GREEN, "s"),
    DEFAULT: (BLUE, "D"),
}


def success(table: Sequence[Row]) -> Figure:
    """Success rate of each row of the table with its interval, in the order of the table."""
    figure = Figure(figsize=(9, 0.8 + 0.36 * len(table)), layout="constrained")
    axes = figure.subplots()
    for place, row in enumerate(table):
        colour = COLOURS.get(row["controller"], GREY)
        rate, low, high = row["success_rate"], row["success_low"], row["success_high"]
        axes.plot([low, high], [place, place], color=colour, linewidth=3, solid_capstyle="round", alpha=0.45)
        axes.plot(rate, place, "o", color=colour, markersize=8, clip_on=False)
        label = f"{rate:.3f}   [{low:.3f}, {high:.3f}]   {row['episodes']:,} episodes"
        axes.text(1.04, place, label, va="center", fontsize=8.5, transform=axes.get_yaxis_transform())
    axes.set_yticks(range(len(table)), [row["controller"] for row in table], fontsize=9.5)
    axes.set_ylim(len(table) - 0.5, -0.5)
    axes.set_xlim(0, 1)
    axes.set_xlabel("success rate, with 95 % interval")
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0, pad=10)
    axes.spines["left"].set_visible(False)
    return figure


def trajectories(rollouts: Mapping[str, sim.Rollout], episodes: Sequence[int], columns: int = 4) -> Figure:
    """The corral from above for each controller, with its trajectories from the same starts."""
    rows = -(-len(rollouts) // columns)
    across = min(columns, len(rollouts))
    figure = Figure(figsize=(max(3.4 * across, 6.4), 2.9 * rows + 0.4), layout="constrained")
    grid = figure.subplots(rows, across, squeeze=False).ravel()
    for axes in grid[len(rollouts) :]:
        axes.set_axis_off()
    for axes, (name, rollout) in zip(grid, rollouts.items(), strict=False):
        render.draw_rollout(axes, rollout, episodes, legend=False)
        successes = int(rollout.success[np.isin(rollout.episode, episodes)].sum())
        axes.set_title(f"{name}: {successes} of {len(episodes)} succeed")
    handles = [
        Line2D([], [], color=colour, lw=2, label=name.replace("_", " ")) for name, colour in render.COLOURS.items()
    ]
    handles.append(Line2D([], [], ls="", marker="o", ms=5, mfc=render.PAPER, mec=render.INK, label="start"))
    red, paper = render.COLOURS["avoid"], render.PAPER
    handles.append(Line2D([], [], ls="", marker="X", ms=7, mfc=red, mec=paper, label="end of a failed episode"))
    handles.append(Line2D([], [], ls="", marker="o", ms=7, mfc=render.LAMP, mec=render.LAMP, label="lamp"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return figure


def recall_by_age(panels: Sequence[pd.DataFrame]) -> Figure:
    """Recall of the demonstrated conditions by how many conditions came after them; a panel for each number of bins."""
    figure = Figure(figsize=(0.6 + 4.8 * len(panels), 3.9), layout="constrained")
    grid = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axes, panel in zip(grid, panels, strict=True):
        curves = pd.concat([by_age(panel, learner) for learner in ABOUT])
        lines(axes, curves, "age", "recall", "learner", order=list(ABOUT), fixed=LEARNERS)
        axes.axhline(most_frequent(panel), color=GREY, linewidth=1.2, linestyle=":", label="most frequent command")
        conditions = int(panel.conditions.iloc[0])
        axes.set_title(f"{panel.bins.iloc[0]} bins per sensor, {conditions:,} conditions")
        axes.set(xlabel="distinct conditions met since (0 = newest)", ylabel="share recalled rightly")
        axes.set_ylim(-0.03, 1.05)
        axes.set_xlim(left=-0.02 * conditions)
    legend_below(figure, grid[0], 6)
    return figure
