"""The figures of the reports, as functions that return a matplotlib `Figure`. They draw; nothing is computed here."""

from __future__ import annotations

import functools
import io
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ParamSpec

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.transforms import Affine2D

import sim
from experiments.command_map import COMMANDS, DISTANCE, CommandMap
from experiments.forgetting import CLIPPED, DEFAULT, MEAN, PRINTED, SUM, Recalled
from experiments.timeline import Timeline
from sim import render
from sim.teacher import OBSTACLE

# Okabe and Ito's colours, which stay apart for colour-blind readers.
BLACK, ORANGE, SKY, GREEN = "#222222", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILION, PINK, GREY = "#0072B2", "#D55E00", "#CC79A7", "#8A949E"

HATCH = "#4A545E"

CONTROLLER_COLOURS = {
    "teacher": BLACK,
    "default": BLUE,
    "paper": VERMILION,
    "paper_best_bins": ORANGE,
    "bundled": GREEN,
    "hand_written": PINK,
    "nearest_neighbour": SKY,
    "decision_tree": "#7B5EA7",
    "random": GREY,
    "teacher_wheeled": "#5B6875",
}
COMMAND_COLOURS = dict(zip(COMMANDS, ("#A9D3EE", "#F2C14E", "#D58FB5", "#D0D5DA"), strict=True))
RULE_COLOURS = dict(zip(sim.TEACHER_RULES, ("#FFF3A8", "#F8D9A0", "#EFC7DC", "#F3B79A", "#DCEBF7"), strict=True))
LEARNER_COLOURS = {PRINTED: VERMILION, CLIPPED: ORANGE, MEAN: SKY, SUM: GREEN, DEFAULT: BLUE}
LEARNER_MARKERS = {PRINTED: "v", CLIPPED: "o", MEAN: "^", SUM: "s", DEFAULT: "D"}

STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.labelsize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#5B6875",
    "grid.color": "#E3E8EC",
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "hatch.linewidth": 0.6,
}

P = ParamSpec("P")


def _styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    @functools.wraps(draw)
    def inside(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with matplotlib.rc_context(STYLE):
            return draw(*args, **kwargs)

    return inside


def png(figure: Figure, dpi: int = 120) -> bytes:
    """A figure as the bytes of a PNG file; the same figure gives the same bytes."""
    buffer = io.BytesIO()
    with matplotlib.rc_context(STYLE):
        # Without the version of matplotlib, which it would write into the file.
        figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
    return buffer.getvalue()


@_styled
def success(table: Sequence[Mapping[str, Any]]) -> Figure:
    """Success rate of each row of the table with its interval, in the order of the table."""
    figure = Figure(figsize=(9, 0.8 + 0.36 * len(table)), layout="constrained")
    axes = figure.subplots()
    for place, row in enumerate(table):
        colour = CONTROLLER_COLOURS.get(row["controller"], GREY)
        rate, low, high = row["success_rate"], row["success_low"], row["success_high"]
        axes.plot([low, high], [place, place], color=colour, linewidth=3, solid_capstyle="round", alpha=0.45)
        axes.plot(rate, place, "o", color=colour, markersize=8, clip_on=False)
        label = f"{rate:.3f}   [{low:.3f}, {high:.3f}]   {row['episodes']:,} episodes"
        axes.text(1.04, place, label, va="center", fontsize=8.5, transform=axes.get_yaxis_transform())
    axes.set_yticks(range(len(table)), [row["controller"] for row in table], fontsize=9.5)
    axes.set_ylim(len(table) - 0.5, -0.5)
    axes.set_xlim(0, 1)
    axes.set_xlabel("success rate, with 95 % interval")
    axes.grid(axis="x")
    axes.set_axisbelow(True)
    axes.tick_params(axis="y", length=0, pad=10)
    axes.spines["left"].set_visible(False)
    return figure


@_styled
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


@_styled
def command_maps(maps: Mapping[str, Sequence[CommandMap]]) -> Figure:
    """The teacher's commands over sensor space, and below them each program's, with the differences hatched."""
    first = next(iter(maps.values()))
    figure = Figure(figsize=(3.1 * len(first) + 0.4, 3.0 * (1 + len(maps)) + 0.4), layout="constrained")
    grid = figure.subplots(1 + len(maps), len(first), squeeze=False)
    for column, command in enumerate(first):
        _map(grid[0, column], command, "teacher")
        grid[0, column].set_title(command.plane.title)
    for row, (name, own) in enumerate(maps.items(), 1):
        for column, command in enumerate(own):
            _map(grid[row, column], command, name)
            met = command.met > 0
            wrong = command.differs
            grid[row, column].set_title(
                f"differs in {wrong.mean():.0%} of the cells, in {(wrong & met).sum()} of {met.sum()} met",
                fontsize=8.5,
                fontweight="normal",
            )
    for axes, name in zip(grid[:, 0], ("teacher", *maps), strict=True):
        axes.annotate(
            name, (-0.32, 0.5), xycoords="axes fraction", rotation=90, va="center", fontsize=11, fontweight="bold"
        )
    handles: list[Any] = [Patch(color=COMMAND_COLOURS[name], label=name) for name in COMMANDS[:3]]
    handles.append(Patch(facecolor="white", edgecolor=HATCH, hatch="/////", label="differs from the teacher"))
    handles.append(Line2D([], [], linestyle="", marker="o", color=BLACK, markersize=4, label="held-out samples (area)"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return figure


def _map(axes: Axes, command: CommandMap, who: str) -> None:
    plane, bins = command.plane, command.bins
    x, y = sim.SENSORS[plane.x], sim.SENSORS[plane.y]
    box = (x.low, x.high, y.low, y.high)
    shown = command.teacher if who == "teacher" else command.learned
    axes.imshow(
        shown,
        origin="lower",
        extent=box,
        aspect="auto",
        cmap=ListedColormap(list(COMMAND_COLOURS.values())),
        vmin=-0.5,
        vmax=len(COMMANDS) - 0.5,
        interpolation="nearest",
    )
    x_edges, y_edges = np.linspace(x.low, x.high, bins + 1), np.linspace(y.low, y.high, bins + 1)
    if who != "teacher" and command.differs.any():
        wide, high = float(x_edges[1] - x_edges[0]), float(y_edges[1] - y_edges[0])
        cells = [
            Path.unit_rectangle().transformed(
                Affine2D().translate(column, row).scale(wide, high).translate(x.low, y.low)
            )
            for row, column in np.argwhere(command.differs).tolist()
        ]
        # One path for all cells, so that the hatching runs on from one to the next.
        whole = Path.make_compound_path(*cells)
        axes.add_patch(PathPatch(whole, facecolor="none", edgecolor=HATCH, hatch="/////", linewidth=0))
    rows, columns = np.nonzero(command.met)
    size = command.met[rows, columns]
    if len(size):
        # The area grows with the logarithm, or the few cells of the straight runs would hide all others.
        area = 1.5 + 14 * np.log1p(size) / np.log1p(size.max())
        x_middles, y_middles = (x_edges[:-1] + x_edges[1:]) / 2, (y_edges[:-1] + y_edges[1:]) / 2
        axes.scatter(x_middles[columns], y_middles[rows], area, color=BLACK, linewidths=0, zorder=3)
    if plane.y == DISTANCE:
        axes.axhline(OBSTACLE, color=BLACK, linewidth=0.8, linestyle=":")
    axes.set_xlabel(f"{x.name.replace('_', ' ')} ({x.unit})")
    axes.set_ylabel(f"{y.name.replace('_', ' ')} ({y.unit})")


@_styled
def timelines(lines: Sequence[Timeline]) -> Figure:
    """Readings, similarity, margin and familiarity over time, one column a controller, with the teacher's rules."""
    heights = [1.2, 1.5, 1.0, 0.55]
    figure = Figure(figsize=(0.8 + 5.6 * len(lines), 7.2), layout="constrained")
    grid = figure.subplots(4, len(lines), sharex="col", height_ratios=heights, squeeze=False)
    for column, line in enumerate(lines):
        readings, answer, familiar, voices = grid[:, column]
        for axes in (readings, answer, familiar):
            _bands(axes, line)
        readings.set_title(f"{line.name}, held-out start {line.episode}")
        for index, (colour, style) in enumerate(((VERMILION, "-"), (BLUE, "-"), (BLACK, "--"))):
            name = sim.SENSORS[index].name.replace("_", " ")
            readings.plot(line.seconds, line.sensors[:, index], style, color=colour, linewidth=1.2, label=name)
        readings.set_ylabel("readings (m)")
        answer.plot(line.seconds, line.similarity, color=BLACK, linewidth=1.2, label="similarity to the winning result")
        answer.plot(line.seconds, line.margin, color=VERMILION, linewidth=1.2, label="margin to the runner-up")
        answer.set_ylabel("cosine")
        familiar.plot(line.seconds, line.familiarity, color=GREEN, linewidth=1.2, label="familiarity of the condition")
        familiar.set_ylabel("cosine")
        for axes in (answer, familiar):
            axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]), top=axes.get_ylim()[1] * 1.25)
        for axes in (readings, answer, familiar):
            axes.legend(loc="upper right", ncols=3, fontsize=7.5, handlelength=1.4, columnspacing=1.0)
        readings.set_ylim(0, 6.6)
        _voices(voices, line)
        voices.set_xlabel("time (s)")
        voices.set_xlim(0, max(line.seconds[-1], 1.0))
    handles: list[Any] = [Patch(color=colour, label=rule.replace("_", " ")) for rule, colour in RULE_COLOURS.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), title="the teacher's rule")
    return figure


def _bands(axes: Axes, line: Timeline) -> None:
    """Colour the background by the rule that would fire."""
    begins = np.flatnonzero(np.diff(line.rule, prepend=-1))
    ends = np.append(line.seconds[begins[1:]], line.seconds[-1] + 1 / sim.CONTROL_HZ)
    spans = np.stack([line.seconds[begins], ends - line.seconds[begins]], axis=1)
    for index, rule in enumerate(sim.TEACHER_RULES):
        own = spans[line.rule[begins] == index].tolist()
        across = axes.get_xaxis_transform()
        axes.broken_barh(own, (0, 1), transform=across, color=RULE_COLOURS[rule], linewidth=0, zorder=0)


def _voices(axes: Axes, line: Timeline) -> None:
    """Who spoke, if several could, and where the command was not the teacher's."""
    lanes = ["differs", *(voice.replace("_", " ") for voice in reversed(line.voices))]
    axes.plot(line.seconds[line.differs], np.zeros(line.differs.sum()), "|", color=VERMILION, markersize=9)
    if line.speaker is not None:
        lane = len(line.voices) - line.speaker
        axes.plot(line.seconds, lane, "|", color=BLUE, markersize=7)
    axes.set_yticks(range(len(lanes)), lanes)
    axes.set_ylim(-0.6, len(lanes) - 0.4)
    axes.grid(axis="y")


@_styled
def forgetting(panels: Sequence[Recalled]) -> Figure:
    """Recall of the demonstrated conditions by how many conditions came after them, one panel per number of bins."""
    figure = Figure(figsize=(0.6 + 4.8 * len(panels), 3.9), layout="constrained")
    grid = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axes, panel in zip(grid, panels, strict=True):
        for learner in panel.right:
            age, recall = panel.by_age(learner)
            axes.plot(
                age,
                recall,
                color=LEARNER_COLOURS[learner],
                marker=LEARNER_MARKERS[learner],
                markersize=4.5,
                linewidth=1.4,
                label=learner,
            )
        axes.axhline(panel.guess, color=GREY, linewidth=1.2, linestyle=":", label="most frequent command")
        axes.set_title(f"{panel.bins} bins a sensor, {panel.conditions:,} conditions")
        axes.set_xlabel("distinct conditions met since (0 = newest)")
        axes.set_ylim(-0.03, 1.05)
        axes.set_xlim(left=-0.02 * panel.conditions)
        axes.grid()
    grid[0].set_ylabel("share recalled rightly")
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure
