"""Paths of the study of sequences, with the behaviour that speaks: kept in the run's folder, and drawn."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

import sim
from behaviours import Sequencing
from experiments.kit import Outcome, Page
from experiments.kit.figures import BLUE, ORANGE, VERMILION
from experiments.kit.store import write_frame
from experiments.tasks.recorded import animate, frame_of
from experiments.tasks.two_lamps import TASK, AskedOnce, speakers

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PATHS = 4
"""Paths that are kept for the page."""
SPEAKERS = {"to blue": BLUE, "to yellow": ORANGE}


def write(folder: Path, arena: str, policy: Sequencing, seed: int, seconds: float) -> None:
    """Drive from the first starts, and keep the paths with the behaviour that speaks at each step."""
    driven = sim.rollout(AskedOnce(policy), arena, task=TASK, episodes=range(PATHS), seed=seed, seconds=seconds)
    success = np.repeat(driven.success, np.diff(driven.offsets))
    paths = frame_of(driven.trajectory, TASK).assign(
        episode=driven.step_episode, success=success, speaker=speakers(policy, driven)
    )
    (folder / "paths").mkdir(exist_ok=True)
    write_frame(folder / "paths" / f"{arena}.parquet", paths)


def draw(outcome: Outcome) -> Figure:
    """Paths of the first codebook's vector in each arena, coloured by the behaviour that speaks."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from sim import render

    arenas = outcome.settings.arenas
    figure = Figure(figsize=(4.6 * len(arenas), 4.7), layout="constrained")
    for axes, arena in zip(figure.subplots(1, len(arenas), squeeze=False)[0], arenas, strict=True):
        render.draw_corral(axes, sim.find_arena(arena))
        for _, path in pd.read_parquet(outcome.folder / "paths" / f"{arena}.parquet").groupby("episode"):
            points = path[["x", "y"]].to_numpy()
            render.draw_path(axes, points, [SPEAKERS[name] for name in path.speaker], 1.3)
            axes.plot(*points[0], "o", markersize=5, markerfacecolor="white", markeredgecolor="black", zorder=5)
            if not path.success.iloc[0]:
                axes.plot(*points[-1], "X", markersize=8, color=VERMILION, zorder=6)
        axes.set_title(arena)
        axes.set_axis_off()
    handles = [Line2D([], [], color=colour, label=name) for name, colour in SPEAKERS.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return figure


def animations(page: Page, outcome: Outcome) -> None:
    """An animation of the first kept start in each arena, coloured by the behaviour that speaks."""
    section = page.section("Who speaks")
    section.text(
        "The first start in each arena, at four times the speed; below each picture the behaviour that speaks."
    )
    for arena in outcome.settings.arenas:
        path = pd.read_parquet(outcome.folder / "paths" / f"{arena}.parquet")
        draw = functools.partial(animate, path.loc[path.episode == 0], arena, arena, TASK, colours=SPEAKERS, speed=4)
        section.animation(
            f"animation_{arena}", draw, f"Animation in {arena}", "First to the blue lamp, then to the other."
        )
