"""The figures of the study of combination."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

import sim
from experiments.composition.rows import line_of
from experiments.kit import Outcome, Page
from experiments.kit.figures import BLUE, GREY, ORANGE, VERMILION
from experiments.tasks.recorded import ONE_LIGHT, animate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ANIMATED = 0
"""The start, in the arena large, whose path the animations and the timelines show."""
SPEAKERS = {"seek_light": ORANGE, "avoid": VERMILION, "cruise": BLUE}
ACROSS = 5


def success(outcome: Outcome) -> Figure:
    """Success by row and arena."""
    return _heat(outcome, "success_rate", None)


def agreement(outcome: Outcome) -> Figure:
    """Agreement by row and arena, and in brackets that where the teacher avoids an obstacle."""
    return _heat(outcome, "agreement", "agreement_avoid")


def _heat(outcome: Outcome, column: str, beside: str | None) -> Figure:
    from matplotlib.figure import Figure

    frame = pd.DataFrame(outcome.table).dropna(subset=column)
    rows, arenas = list(dict.fromkeys(frame.row)), outcome.settings.arenas
    wide = frame.pivot_table(index="row", columns="arena", values=column, observed=True).loc[rows, arenas]
    figure = Figure(figsize=(2.6 + 1.05 * len(arenas), 0.9 + 0.27 * len(rows)), layout="constrained")
    axes = figure.subplots()
    axes.imshow(wide.to_numpy(), cmap="viridis", vmin=0, vmax=1, aspect="auto")
    other = None if beside is None else frame.pivot_table(index="row", columns="arena", values=beside).loc[rows, arenas]
    for place, name in enumerate(rows):
        for column_place, arena in enumerate(arenas):
            value = float(wide.loc[name, arena])
            text = f"{value:.3f}" + ("" if other is None else f" ({other.loc[name, arena]:.2f})")
            colour = "black" if value > 0.6 else "white"
            axes.text(column_place, place, text, ha="center", va="center", fontsize=7.5, color=colour)
    axes.set_xticks(range(len(arenas)), arenas)
    axes.set_yticks(range(len(rows)), rows)
    axes.tick_params(length=0)
    axes.grid(False)
    return figure


def paths(outcome: Outcome) -> Figure:
    """Paths in the arena large of every row whose paths were kept."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from sim import render

    found = kept(outcome)
    down = -(-len(found) // ACROSS)
    figure = Figure(figsize=(2.5 * ACROSS, 2.5 * down + 0.3), layout="constrained")
    panels = figure.subplots(down, ACROSS, squeeze=False).flat
    for axes, (name, frame) in zip(panels, found.items(), strict=False):
        render.draw_corral(axes, sim.find_arena("large"))
        for _, path in frame.groupby("episode"):
            points = path[["x", "y"]].to_numpy()
            render.draw_path(axes, points, _colours(path), 1.0)
            if not path.success.iloc[0]:
                axes.plot(*points[-1], "x", color=VERMILION, zorder=5)
        axes.set_title(name)
    for axes in list(figure.axes):
        axes.set_axis_off()
    named = {**SPEAKERS, "one program": GREY}
    handles = [Line2D([], [], color=colour, label=name) for name, colour in named.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(named))
    return figure


def familiarity(outcome: Outcome) -> Figure:
    """The familiarity of the speaker along the first path of each policy."""
    from matplotlib.figure import Figure

    found = {name: frame for name, frame in kept(outcome).items() if "familiarity" in frame}
    figure = Figure(figsize=(9, 0.5 + 0.85 * max(len(found), 1)), layout="constrained")
    panels = figure.subplots(max(len(found), 1), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (name, frame) in zip(panels, found.items(), strict=False):
        _timeline(axes, name, frame.loc[frame.episode == ANIMATED])
    panels[-1].set_xlabel("time (s)")
    return figure


def animations(page: Page, outcome: Outcome) -> None:
    """An animation of each policy on the same start, coloured by the behaviour that speaks."""
    found = {name: frame for name, frame in kept(outcome).items() if "speaker" in frame}
    if not found:
        return
    section = page.section("Who speaks")
    section.text("The same start in the arena large, at twice the speed; below each picture the behaviour that speaks.")
    for name, frame in found.items():
        path = frame.loc[frame.episode == ANIMATED]
        draw = functools.partial(animate, path.replace({"speaker": {"": "nobody"}}), name, "large", ONE_LIGHT)
        section.animation(f"animation_{name}", draw, f"Animation of {name}", line_of(name).about)


def _timeline(axes: Axes, name: str, path: pd.DataFrame) -> None:
    seconds = np.arange(len(path)) / sim.CONTROL_HZ
    axes.scatter(seconds, path.familiarity, s=5, c=_colours(path), linewidths=0)
    axes.set_ylabel(name, rotation=0, ha="right", va="center")


def _colours(path: pd.DataFrame) -> list[str]:
    """The colour of who speaks at each step."""
    if "speaker" not in path:
        return [GREY] * len(path)
    return [SPEAKERS.get(name, GREY) for name in path.speaker]


def kept(outcome: Outcome) -> dict[str, pd.DataFrame]:
    """The paths that were kept, by row."""
    files = {name: outcome.folder / "paths" / f"{name}.parquet" for name in outcome.settings.rows}
    return {name: pd.read_parquet(path) for name, path in files.items() if path.is_file()}
