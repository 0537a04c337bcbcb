"""The figure of the study of dimensions."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from experiments.capacity.dimension_tables import closed_dims
from experiments.capacity.protocol import TASKS
from experiments.kit import Outcome
from experiments.kit.figures import BLUE, VERMILION, legend_below

COLOURS = dict(zip(TASKS, (BLUE, VERMILION), strict=True))
COLUMNS = 4


def lines(outcome: Outcome) -> Figure:
    """Dimensions needed against k, a panel for each architecture and a colour for each task."""
    records, settings = outcome.records, outcome.settings
    names = list(dict.fromkeys(row["architecture"] for row in outcome.table))
    deep = -(-len(names) // COLUMNS)
    figure = Figure(figsize=(11, 0.8 + 2.5 * deep), layout="constrained")
    panels = figure.subplots(deep, COLUMNS, squeeze=False, sharex=True).flat
    ends = np.array([min(settings.counts), max(settings.counts)])
    for name, axes in zip(names, panels, strict=False):  # names first: what is left of the panels stays empty
        for task, colour in COLOURS.items():
            (row,) = (row for row in outcome.table if (row["task"], row["architecture"]) == (task, name))
            own = records[(records.task == task) & (records.architecture == name)].groupby("k").needed.first()
            axes.plot(own.index, own, "o", color=colour, markersize=2.5, label=f"{task}, measured")
            for line, style in (("", "-"), ("published_", "--")):
                if row.get(f"{line}slope") is not None:
                    height = row[f"{line}slope"] * ends + row[f"{line}start"]
                    label = f"{task}, {line.strip('_') or 'fitted'}"
                    axes.plot(ends, height, style, color=colour, linewidth=1, label=label)
            closed = closed_dims(name, task, sorted(settings.counts), settings.items, settings.accuracy)
            if closed:
                axes.plot(closed.keys(), closed.values(), ":", color=colour, label=f"{task}, closed form")
        axes.set(title=name, ylim=(0, None))
    for axes in panels:
        axes.set_axis_off()
    for place, axes in enumerate(figure.axes):
        if place % COLUMNS == 0:
            axes.set_ylabel("dimensions d")
        if place >= len(names) - COLUMNS:
            axes.set_xlabel("vectors in one, k")
            axes.tick_params(labelbottom=True)
    legend_below(figure, columns=4)
    return figure
