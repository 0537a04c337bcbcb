"""The figures of the page. They draw; nothing is computed here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path

import sim
from experiments.corral.command_map import COMMANDS, DISTANCE, SLICES, Slice
from experiments.corral.forgetting import ABOUT, by_age, most_frequent
from experiments.kit import Row
from experiments.kit.figures import BLACK, BLUE, GREEN, GREY, SKY, VERMILION, legend_below, lines
from sim import render
from sim.teachers.escape import OBSTACLE

HATCH = "#4A545E"
COLOURS = dict(zip(COMMANDS, ("#A9D3EE", "#F2C14E", "#D58FB5", "#D0D5DA"), strict=True))
RULES = dict(zip(sim.TEACHER_RULES, ("#FFF3A8", "#F8D9A0", "#EFC7DC", "#F3B79A", "#DCEBF7"), strict=True))
READINGS = ((VERMILION, "-"), (BLUE, "-"), (BLACK, "--"))


def success(table: Sequence[Row]) -> Figure:
    """Success rate of each row of the table with its interval, in the order of the table."""
    frame = pd.DataFrame(table)
    figure = Figure(figsize=(8, 0.8 + 0.32 * len(frame)), layout="constrained")
    axes = figure.subplots()
    bars = [frame.success_rate - frame.success_low, frame.success_high - frame.success_rate]
    axes.errorbar(frame.success_rate, frame.controller, xerr=bars, fmt="o", color=BLUE, ecolor=SKY, elinewidth=3)
    axes.invert_yaxis()
    axes.set(xlim=(-0.02, 1.02), xlabel="success rate, with 95 % interval")
    axes.grid(visible=False, axis="y")
    return figure


def trajectories(rollouts: Mapping[str, sim.Rollout], episodes: Sequence[int], columns: int = 4) -> Figure:
    """The corral from above for each controller, with its trajectories from the same starts."""
    rows, across = -(-len(rollouts) // columns), min(columns, len(rollouts))
    figure = Figure(figsize=(max(3.4 * across, 6.4), 2.9 * rows + 0.4), layout="constrained")
    grid = figure.subplots(rows, across, squeeze=False).ravel()
    for axes in grid[len(rollouts) :]:
        axes.set_axis_off()
    for axes, (name, rollout) in zip(grid, rollouts.items(), strict=False):
        render.draw_rollout(axes, rollout, episodes, legend=False)
        successes = int(rollout.success[np.isin(rollout.episode, episodes)].sum())
        axes.set_title(f"{name}: {successes} of {len(episodes)} succeed")
    handles = [Line2D([], [], color=colour, label=name.replace("_", " ")) for name, colour in render.COLOURS.items()]
    handles.append(Line2D([], [], ls="", marker="o", mfc=render.PAPER, mec=render.INK, label="start"))
    handles.append(Line2D([], [], ls="", marker="X", color=render.COLOURS["avoid"], label="end of a failed episode"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return figure


def recall_by_age(panels: Sequence[pd.DataFrame]) -> Figure:
    """Recall of the demonstrated conditions by how many conditions came after them; a panel for each number of bins."""
    figure = Figure(figsize=(0.6 + 4.8 * len(panels), 3.9), layout="constrained")
    grid = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axes, panel in zip(grid, panels, strict=True):
        curves = pd.concat([by_age(panel, learner) for learner in reversed(ABOUT)])
        lines(axes, curves, "age", "recall", "learner")
        axes.axhline(most_frequent(panel), color=GREY, linewidth=1.2, linestyle=":", label="most frequent command")
        conditions = int(panel.conditions.iloc[0])
        axes.set_title(f"{panel.bins.iloc[0]} bins per sensor, {conditions:,} conditions")
        axes.set(xlabel="distinct conditions met since (0 = newest)", ylabel="share recalled rightly")
        axes.set_ylim(-0.03, 1.05)
        axes.set_xlim(left=-0.02 * conditions)
    legend_below(figure, grid[0], 6)
    return figure


def command_maps(maps: Mapping[str, pd.DataFrame]) -> Figure:
    """The teacher's commands over sensor space, and below them each program's, with the differences hatched."""
    figure = Figure(figsize=(3.1 * len(SLICES) + 0.4, 3.0 * (1 + len(maps)) + 0.4), layout="constrained")
    grid = figure.subplots(1 + len(maps), len(SLICES), squeeze=False)
    first = next(iter(maps.values()))
    rows = {"teacher": first.assign(learned=first.teacher), **maps}
    for axes_row, (name, frame) in zip(grid, rows.items(), strict=True):
        for axes, plane in zip(axes_row, SLICES, strict=True):
            cells = frame.loc[frame.slice == plane.title]
            draw_slice(axes, plane, cells)
            differs, met = cells.learned != cells.teacher, cells.samples > 0
            title = f"differs in {differs.mean():.0%} of the cells, in {(differs & met).sum()} of {met.sum()} met"
            axes.set_title(title, fontsize=8.5, fontweight="normal")
        axes_row[0].annotate(
            name, (-0.32, 0.5), xycoords="axes fraction", rotation=90, va="center", fontsize=11, fontweight="bold"
        )
    for axes, plane in zip(grid[0], SLICES, strict=True):
        axes.set_title(plane.title, fontsize=10, fontweight="bold")
    handles: list[Any] = [Patch(color=COLOURS[name], label=name) for name in COMMANDS[:3]]
    handles.append(Patch(facecolor="white", edgecolor=HATCH, hatch="/////", label="differs from the teacher"))
    handles.append(Line2D([], [], linestyle="", marker="o", color=BLACK, markersize=4, label="held-out samples (area)"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return figure


def draw_slice(axes: Axes, plane: Slice, cells: pd.DataFrame) -> None:
    """One map: the commands as colours, differences hatched, held-out samples as dots."""
    x, y = sim.SENSORS[plane.x], sim.SENSORS[plane.y]
    bins = int(cells.row.max()) + 1
    edges = np.linspace(x.low, x.high, bins + 1), np.linspace(y.low, y.high, bins + 1)
    learned, differs = (
        column.to_numpy().reshape(bins, bins) for column in (cells.learned, cells.learned != cells.teacher)
    )
    axes.pcolormesh(*edges, learned, cmap=ListedColormap(list(COLOURS.values())), vmin=-0.5, vmax=len(COMMANDS) - 0.5)
    # One path of all cells: a hatch for each cell would take three times as long.
    rows, columns = np.nonzero(differs)
    across, up = np.array([0, 1, 1, 0, 0]), np.array([0, 0, 1, 1, 0])
    corners = [edges[0][columns[:, None] + across], edges[1][rows[:, None] + up]]
    codes = [Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY]
    hatched = Path(np.stack(corners, -1).reshape(-1, 2), codes * len(rows))
    axes.add_patch(PathPatch(hatched, facecolor="none", edgecolor=HATCH, hatch="/////", lw=0))
    met = cells.loc[cells.samples > 0]
    # The area grows with the logarithm, or the few cells of the straight runs would hide all others.
    area = 1.5 + 14 * np.log1p(met.samples) / np.log1p(met.samples.max())
    middle = [(edge[:-1] + edge[1:]) / 2 for edge in edges]
    axes.scatter(middle[0][met.column], middle[1][met.row], area, color=BLACK, linewidths=0, zorder=3)
    if plane.y == DISTANCE:
        axes.axhline(OBSTACLE, color=BLACK, linewidth=0.8, linestyle=":")
    axes.grid(visible=False)
    axes.set_xlabel(f"{x.name.replace('_', ' ')} ({x.unit})")
    axes.set_ylabel(f"{y.name.replace('_', ' ')} ({y.unit})")


def timelines(lines: Mapping[str, pd.DataFrame]) -> Figure:
    """Readings, similarity, margin and familiarity over time, a column per controller, with the teacher's rules."""
    figure = Figure(figsize=(0.8 + 5.6 * len(lines), 7.2), layout="constrained")
    grid = figure.subplots(4, len(lines), sharex="col", height_ratios=[1.2, 1.5, 1.0, 0.55], squeeze=False)
    for (readings, answer, familiar, marks), (name, line) in zip(grid.T, lines.items(), strict=True):
        differs = f"{line.differs.sum()} of {len(line)} commands differ"
        readings.set_title(f"{name}, held-out start {line.episode.iloc[0]}: {differs}")
        for sensor, (colour, style) in zip(sim.SENSORS, READINGS, strict=True):
            label = sensor.name.replace("_", " ")
            readings.plot(line.seconds, line[sensor.name], style, color=colour, linewidth=1.2, label=label)
        readings.set(ylabel="readings (m)", ylim=(0, 6.6))
        answer.plot(line.seconds, line.similarity, color=BLACK, linewidth=1.2, label="similarity to the winning result")
        answer.plot(line.seconds, line.margin, color=VERMILION, linewidth=1.2, label="margin to the runner-up")
        familiar.plot(line.seconds, line.familiarity, color=GREEN, linewidth=1.2, label="familiarity of the condition")
        for axes in (answer, familiar):
            axes.set(ylabel="cosine", ylim=(min(0.0, axes.get_ylim()[0]), axes.get_ylim()[1] * 1.25))
        for axes in (readings, answer, familiar):
            draw_rules(axes, line)
            axes.grid(visible=False)
            axes.legend(loc="upper right", ncols=3, fontsize=7.5, handlelength=1.4, columnspacing=1.0)
        draw_marks(marks, line)
        marks.set(xlabel="time (s)", xlim=(0, max(line.seconds.iloc[-1], 1.0)))
    handles: list[Any] = [Patch(color=colour, label=rule.replace("_", " ")) for rule, colour in RULES.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), title="the teacher's rule")
    return figure


def draw_rules(axes: Axes, line: pd.DataFrame) -> None:
    """Colour the background by the rule that would fire."""
    for index, colour in enumerate(RULES.values()):
        steps = [(start, 1 / sim.CONTROL_HZ) for start in line.loc[line["rule"] == index, "seconds"]]
        axes.broken_barh(steps, (0, 1), transform=axes.get_xaxis_transform(), color=colour, linewidth=0, zorder=0)


def draw_marks(axes: Axes, line: pd.DataFrame) -> None:
    """Where the command was not the teacher's, and who spoke, if several behaviours were combined."""
    differs = line.loc[line.differs]
    axes.plot(differs.seconds, np.zeros(len(differs)), "|", color=VERMILION, markersize=9)
    lanes = ["differs"]
    if "speaker" in line:
        lanes += reversed(sim.BEHAVIOURS)
        axes.plot(line.seconds, line.speaker.map(lanes.index), "|", color=BLUE, markersize=7)
    axes.set_yticks(range(len(lanes)), [lane.replace("_", " ") for lane in lanes])
    axes.set_ylim(-0.6, len(lanes) - 0.4)
    axes.grid(visible=False, axis="x")
