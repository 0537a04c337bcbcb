"""What programs read and answered over one episode."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

import sim
from experiments.kit.figures import BLACK, BLUE, GREEN, VERMILION

RULES = dict(zip(sim.TEACHER_RULES, ("#FFF3A8", "#F8D9A0", "#EFC7DC", "#F3B79A", "#DCEBF7"), strict=True))
READINGS = ((VERMILION, "-"), (BLUE, "-"), (BLACK, "--"))


def timelines(lines: Mapping[str, pd.DataFrame]) -> Figure:
    """Readings, similarity, margin and familiarity over time, a column per controller, with the teacher's rules."""
    figure = Figure(figsize=(0.8 + 5.6 * len(lines), 7.2), layout="constrained")
    grid = figure.subplots(4, len(lines), sharex="col", height_ratios=[1.2, 1.5, 1.0, 0.55], squeeze=False)
    for column, (name, line) in zip(grid.T, lines.items(), strict=True):
        readings, answer, familiar, speakers = column
        readings.set_title(f"{name}, held-out start {line.episode.iloc[0]}")
        for sensor, (colour, style) in zip(sim.SENSORS, READINGS, strict=True):
            label = sensor.name.replace("_", " ")
            readings.plot(line.seconds, line[sensor.name], style, color=colour, linewidth=1.2, label=label)
        answer.plot(line.seconds, line.similarity, color=BLACK, linewidth=1.2, label="similarity to the winning result")
        answer.plot(line.seconds, line.margin, color=VERMILION, linewidth=1.2, label="margin to the runner-up")
        familiar.plot(line.seconds, line.familiarity, color=GREEN, linewidth=1.2, label="familiarity of the condition")
        for axes in (answer, familiar):
            axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]), top=axes.get_ylim()[1] * 1.25)
            axes.set_ylabel("cosine")
        for axes in (readings, answer, familiar):
            draw_rules(axes, line)
            axes.grid(visible=False)
            axes.legend(loc="upper right", ncols=3, fontsize=7.5, handlelength=1.4, columnspacing=1.0)
        readings.set_ylabel("readings (m)")
        readings.set_ylim(0, 6.6)
        draw_speakers(speakers, line)
        speakers.set_xlabel("time (s)")
        speakers.set_xlim(0, max(line.seconds.iloc[-1], 1.0))
    handles: list[Any] = [Patch(color=colour, label=rule.replace("_", " ")) for rule, colour in RULES.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), title="the teacher's rule")
    return figure


def draw_rules(axes: Axes, line: pd.DataFrame) -> None:
    """Colour the background by the rule that would fire."""
    rule, seconds = line["rule"].to_numpy(), line.seconds.to_numpy()
    begins = np.flatnonzero(np.diff(rule, prepend=-1))
    ends = np.append(seconds[begins[1:]], seconds[-1] + 1 / sim.CONTROL_HZ)
    spans = np.stack([seconds[begins], ends - seconds[begins]], axis=1)
    for index, name in enumerate(sim.TEACHER_RULES):
        fires = spans[rule[begins] == index].tolist()
        axes.broken_barh(fires, (0, 1), transform=axes.get_xaxis_transform(), color=RULES[name], linewidth=0, zorder=0)


def draw_speakers(axes: Axes, line: pd.DataFrame) -> None:
    """Where the command was not the teacher's, and who spoke, if several behaviours were combined."""
    differs = line[line.differs]
    axes.plot(differs.seconds, np.zeros(len(differs)), "|", color=VERMILION, markersize=9)
    lanes = ["differs"]
    if "speaker" in line:
        lanes += reversed(sim.BEHAVIOURS)
        axes.plot(line.seconds, line.speaker.map(lanes.index), "|", color=BLUE, markersize=7)
    axes.set_yticks(range(len(lanes)), [lane.replace("_", " ") for lane in lanes])
    axes.set_ylim(-0.6, len(lanes) - 0.4)
    axes.grid(visible=False, axis="x")
