"""The corral from above, and trajectories in it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Rectangle
from numpy.typing import NDArray

from sim.arena import Arena
from sim.result import Rollout
from sim.shapes import Box
from sim.teachers import BEHAVIOURS, InOrder

WALL, INK, PAPER = "#3d4654", "#22272f", "#ffffff"
LAMPS = {"yellow": "#f5b400", "blue": "#2f6fd0", "red": "#d03a3a"}
"""Lamps by their colour; others are white."""
COLOURS = {"seek_light": "#e07b00", "avoid": "#c8324b", "cruise": "#3f74b5"}
"""The colour of each of the teacher's behaviours."""


def draw_corral(ax: Axes, arena: Arena) -> None:
    """Draw walls and lamp from above into `ax`, in m, with equal scales and without a frame."""
    for shape in arena.obstacles:
        if isinstance(shape, Box):
            corner, width, height = (shape.x - shape.half_x, shape.y - shape.half_y), 2 * shape.half_x, 2 * shape.half_y
            ax.add_patch(Rectangle(corner, width, height, color=WALL, lw=0, zorder=2))
        else:
            ax.add_patch(Circle((shape.x, shape.y), shape.radius, color=WALL, lw=0, zorder=2))
    for lamp in arena.lamps:
        for scale, alpha in ((3.2, 0.10), (2.2, 0.16), (1.5, 0.25), (1.0, 1.0)):
            colour, radius = LAMPS.get(lamp.colour, PAPER), scale * lamp.radius
            ax.add_patch(Circle((lamp.x, lamp.y), radius, color=colour, alpha=alpha, lw=0, zorder=1))
    left, right, bottom, top = extent(arena)
    ax.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", xticks=[], yticks=[])
    ax.set_axis_off()


def draw_path(
    ax: Axes, points: NDArray[np.float64], colours: Sequence[str], width: float, alpha: float | None = None
) -> None:
    """Draw a path through `points` `[N, 2]`, each piece in the colour of the point at which it begins."""
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    ax.add_collection(LineCollection(list(pieces), colors=list(colours[:-1]), linewidths=width, alpha=alpha, zorder=3))


def draw_rollout(ax: Axes, rollout: Rollout, episodes: Iterable[int] | None = None, legend: bool = True) -> None:
    """Draw a corral and trajectories, coloured by the behaviour that the teacher would choose.

    A hollow dot marks each start; a cross marks the end of an episode without success.

    Args:
        ax: where to draw.
        rollout: a recorded rollout.
        episodes: the episodes to draw; by default the first 12.
        legend: whether to explain colours and marks under the picture.

    Raises:
        KeyError: an episode is missing, or the rollout has no trajectories.
    """
    draw_corral(ax, rollout.arena)
    for episode in rollout.episode[:12].tolist() if episodes is None else episodes:
        path = rollout.slice(episode)
        points = np.stack([path.x, path.y], axis=1)
        rules = InOrder(rollout.task).rule(path.sensors, path.goal)
        draw_path(ax, points, [_COLOUR_OF_RULE[rule] for rule in rules.tolist()], 1.1, 0.75)
        # A robot that avoids an obstacle turns on the spot, which a line does not show.
        turns = points[rules == _AVOID]
        ax.scatter(turns[:, 0], turns[:, 1], s=9, color=COLOURS["avoid"], lw=0, zorder=4)
        ax.plot(*points[0], "o", ms=5, mfc=PAPER, mec=INK, mew=1.2, zorder=5)
        if not rollout.success[rollout.episode == episode][0]:
            ax.plot(*points[-1], "X", ms=8, mfc=COLOURS["avoid"], mec=PAPER, mew=0.8, zorder=6)
    if legend:
        handles = [Line2D([], [], color=colour, lw=2, label=name.replace("_", " ")) for name, colour in COLOURS.items()]
        handles.append(Line2D([], [], ls="", marker="o", ms=5, mfc=PAPER, mec=INK, label="start"))
        handles.append(
            Line2D([], [], ls="", marker="X", ms=7, mfc=COLOURS["avoid"], mec=PAPER, label="did not succeed")
        )
        ax.legend(
            handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0.02), ncols=5, fontsize=8, frameon=False,
            handlelength=1.4, columnspacing=1.2,
        )  # fmt: skip


def extent(arena: Arena) -> tuple[float, float, float, float]:
    """What a picture shows: everything, with room for the lamps' light."""
    left, right, bottom, top = arena.extent()
    room = [
        (lamp.x + side * 2.2 * lamp.radius, lamp.y + side * 2.2 * lamp.radius)
        for lamp in arena.lamps
        for side in (-1, 1)
    ]
    x, y = zip(*room, strict=True)
    return min(left, *x) - 0.2, max(right, *x) + 0.2, min(bottom, *y) - 0.2, max(top, *y) + 0.2


_COLOUR_OF_RULE = {rule: COLOURS[name] for name, rules in BEHAVIOURS.items() for rule in rules}
(_AVOID,) = BEHAVIOURS["avoid"]
