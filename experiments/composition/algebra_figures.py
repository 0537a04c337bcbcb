"""The figure of the study of algebra."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.kit import Outcome
from experiments.kit.figures import BLACK, BLUE, GREY, VERMILION

COLOURS = {"error_driven": BLUE, "one_shot": VERMILION}


def operations(outcome: Outcome) -> Figure:
    """A panel for recognition, one for distance by each kind of readings, and one for the switching weight."""
    panels: list[Callable[[Axes], None]] = []
    if "recognition" in outcome.settings.operations:
        panels.append(lambda axes: recognition(axes, outcome))
    if "distance" in outcome.settings.operations:
        panels += [lambda axes, name=name: distance(axes, outcome, name) for name in outcome.settings.readings]
    if "interpolation" in outcome.settings.operations:
        panels.append(lambda axes: interpolation(axes, outcome))
    across = min(len(panels), 2)
    down = -(-len(panels) // across)
    figure = Figure(figsize=(4.6 * across, 3.6 * down), layout="constrained")
    for place, axes in enumerate(figure.subplots(down, across, squeeze=False).flat):
        if place < len(panels):
            panels[place](axes)
        else:
            axes.set_axis_off()
    return figure


def recognition(axes: Axes, outcome: Outcome) -> None:
    """The share recognised against the steps seen, beside the ceiling."""
    rows = pd.DataFrame([row for row in outcome.table if row["operation"] == "recognition"]).sort_values("steps")
    axes.plot(rows.steps, rows.ceiling, "--", color=BLACK, linewidth=1.2, label="what the true rules could tell")
    axes.plot(rows.steps, rows.recognised, "o-", color=BLUE, markersize=5, linewidth=1.4, label="recognised")
    axes.axhline(1 / len(outcome.settings.behaviours), color=GREY, linestyle=":", linewidth=1, label="chance")
    axes.set_xscale("log")
    axes.set_xticks(rows.steps, [str(steps) for steps in rows.steps])
    axes.minorticks_off()
    axes.set(title="recognition", xlabel="steps seen", ylabel="share recognised", ylim=(0, 1.02))
    axes.legend()


def distance(axes: Axes, outcome: Outcome, readings: str) -> None:
    """Distance of programs against disagreement of rules, a point for each two variants of the first codebook."""
    records, settings = outcome.records, outcome.settings
    own = records.loc[(records.readings == readings) & (records.codebook == 0) & (records.shown == settings.shown[0])]
    for rule in settings.rules:
        points = own.loc[own.rule == rule]
        axes.scatter(points.disagreement, points.distance, s=7, color=COLOURS[rule], alpha=0.5, lw=0, label=rule)
    axes.set(title=f"distance, {readings} readings", xlabel="share of readings at which the rules disagree")
    axes.set_ylabel("distance of programs")
    axes.legend(markerscale=2)


def interpolation(axes: Axes, outcome: Outcome) -> None:
    """Measured switching weights against predicted ones, a point for each codebook."""
    rows = pd.DataFrame([row for row in outcome.table if row["operation"] == "interpolation"])
    low, high = (float(getattr(rows[["measured", "predicted"]].to_numpy(), end)()) for end in ("min", "max"))
    ends = [low - 0.02, high + 0.02]
    axes.plot(ends, ends, ":", color=GREY, linewidth=1)
    axes.plot(rows.predicted, rows.measured, "o", color=BLUE, markersize=5)
    axes.set(title="switching weight", xlabel="predicted from the leads", ylabel="measured", xlim=ends, ylim=ends)
