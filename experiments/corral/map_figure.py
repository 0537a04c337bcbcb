"""Maps of commands over sensor space."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

import sim
from experiments.corral.command_map import COMMANDS, DISTANCE, SLICES, Slice
from experiments.kit.figures import BLACK
from sim.teachers.escape import OBSTACLE

HATCH = "#4A545E"
COLOURS = dict(zip(COMMANDS, ("#A9D3EE", "#F2C14E", "#D58FB5", "#D0D5DA"), strict=True))


def command_maps(maps: Mapping[str, pd.DataFrame]) -> Figure:
    """The teacher's commands over sensor space, and below them each program's, with the differences hatched."""
    figure = Figure(figsize=(3.1 * len(SLICES) + 0.4, 3.0 * (1 + len(maps)) + 0.4), layout="constrained")
    grid = figure.subplots(1 + len(maps), len(SLICES), squeeze=False)
    first = next(iter(maps.values()))
    rows = [("teacher", first.assign(learned=first.teacher)), *maps.items()]
    for axes_row, (name, frame) in zip(grid, rows, strict=True):
        for axes, plane in zip(axes_row, SLICES, strict=True):
            cells = frame.loc[frame.slice == plane.title]
            draw_slice(axes, plane, cells)
            differs, met = cells.learned != cells.teacher, cells.samples > 0
            axes.set_title(
                f"differs in {differs.mean():.0%} of the cells, in {(differs & met).sum()} of {met.sum()} met",
                fontsize=8.5,
                fontweight="normal",
            )
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

    def square(column: pd.Series) -> NDArray[Any]:
        return column.to_numpy().reshape(bins, bins)

    axes.imshow(
        square(cells.learned),
        origin="lower",
        extent=(x.low, x.high, y.low, y.high),
        aspect="auto",
        cmap=ListedColormap(list(COLOURS.values())),
        vmin=-0.5,
        vmax=len(COMMANDS) - 0.5,
        interpolation="nearest",
    )
    width, height = (x.high - x.low) / bins, (y.high - y.low) / bins
    differs = np.argwhere(square(cells.learned != cells.teacher)).tolist()
    if differs:
        # One path for all cells, so that the hatching runs on from one to the next.
        place = Affine2D().scale(width, height).translate(x.low, y.low)
        squares = [
            Path.unit_rectangle().transformed(Affine2D().translate(column, row) + place) for row, column in differs
        ]
        outline = Path.make_compound_path(*squares)
        axes.add_patch(PathPatch(outline, facecolor="none", edgecolor=HATCH, hatch="/////", linewidth=0))
    met = cells.loc[cells.samples > 0]
    if len(met):
        # The area grows with the logarithm, or the few cells of the straight runs would hide all others.
        area = 1.5 + 14 * np.log1p(met.samples) / np.log1p(met.samples.max())
        middle = x.low + (met.column + 0.5) * width, y.low + (met.row + 0.5) * height
        axes.scatter(*middle, area, color=BLACK, linewidths=0, zorder=3)
    if plane.y == DISTANCE:
        axes.axhline(OBSTACLE, color=BLACK, linewidth=0.8, linestyle=":")
    axes.grid(visible=False)
    axes.set_xlabel(f"{x.name.replace('_', ' ')} ({x.unit})")
    axes.set_ylabel(f"{y.name.replace('_', ' ')} ({y.unit})")
