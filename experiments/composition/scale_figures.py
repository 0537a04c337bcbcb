"""The figures of the study of scale."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.kit import Outcome
from experiments.kit.figures import BLUE, GREEN, GREY, ORANGE, PALETTE, VERMILION, legend_below
from experiments.tasks.random_behaviours import DISTINCT

MARKERS = {"one_shot": "o", "trained": "x"}
LINES = {"one_shot": "-", "trained": ":"}
BARS = {
    "votes": ("count of votes (predicted)", GREY),
    "one_shot_bundled": ("one-shot, bundled", BLUE),
    "trained_bundled": ("trained, bundled", VERMILION),
    "one_shot_gated": ("one-shot, gated", GREEN),
    "trained_gated": ("trained, gated", ORANGE),
}


def recall(outcome: Outcome) -> Figure:
    """Recall against the number of behaviours, bundled and gated: a colour for each dimension."""
    frame = pd.DataFrame([row for row in outcome.table if row["kind"] == "distinct"]).sort_values("behaviours")
    figure = Figure(figsize=(10.5, 4.4), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for axes, how in zip(panels, ("bundled", "gated"), strict=True):
        for dim, colour in zip(outcome.settings.dims, PALETTE, strict=False):
            rows = frame.loc[frame.dim == dim]
            for rule, marker in MARKERS.items():
                words = rule.replace("_", "-")
                label = f"{words}, d = {dim:,}"
                axes.plot(rows.behaviours, rows[f"{rule}_{how}"], marker, color=colour, markersize=5, label=label)
                axes.plot(rows.behaviours, rows[f"{rule}_predicted"], LINES[rule], color=colour, linewidth=1.2)
        axes.axvline(DISTINCT, color=GREY, linestyle=":", linewidth=1)
        axes.set_xscale("log", base=2)
        axes.set_xticks(outcome.settings.sizes, [str(size) for size in outcome.settings.sizes])
        axes.set(title=how, xlabel="behaviours in one vector", ylim=(0, 1.03))
    panels[0].set_ylabel("share of pairs recalled")
    legend_below(figure, panels[0], len(outcome.settings.dims))
    return figure


def contradictions(outcome: Outcome) -> Figure:
    """Recall of behaviours that contradict each other, beside a count of votes."""
    rows = [row for row in outcome.table if row["kind"] == "contradicting"]
    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    axes = figure.subplots()
    for place, (column, (label, colour)) in enumerate(BARS.items()):
        left = np.arange(len(rows)) + (place - (len(BARS) - 1) / 2) * 0.16
        bars = axes.bar(left, [row[column] for row in rows], 0.15, color=colour, label=label)
        axes.bar_label(bars, fmt=lambda value: f"{value:.2f}".lstrip("0"), fontsize=6.5, padding=1)
    axes.set_xticks(range(len(rows)), [str(row["behaviours"]) for row in rows])
    axes.grid(axis="x", visible=False)
    axes.set(xlabel="behaviours that contradict each other in one vector", ylabel="share of pairs recalled")
    axes.set_ylim(0, 1.08)
    legend_below(figure, columns=3)
    return figure
