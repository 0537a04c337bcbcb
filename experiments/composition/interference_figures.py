"""The figures of the study of interference."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.composition.interference_tables import HOWS, WHO
from experiments.composition.sums import ANYWHERE, KNOWERS, SHARED
from experiments.kit import Outcome
from experiments.kit.figures import BLACK, BLUE, GREEN, GREY, ORANGE, PALETTE, VERMILION, legend_below

SAMPLES = {ANYWHERE: "samples of any moments", SHARED: "samples of shared conditions"}
REFERENCES = {("error_driven_5", "joint"): "-", ("evident", "silent_sum"): "--"}
"""Rows of the table of rules that are drawn beside repaired sums, and their lines."""
COLOURS: dict[str, str] = dict(zip(KNOWERS, (VERMILION, BLUE, ORANGE, GREEN), strict=True))


def reason(outcome: Outcome) -> Figure:
    """The lead of the right behaviour's program against what the others add, a panel for each kind of condition."""
    records = outcome.records
    own: Any = records.loc[records.part == "reason"]
    kinds = [who for who in KNOWERS if (own.knowers == who).any()][:3]
    added, weights = own.rival + own.bystander, own["count"]
    figure = Figure(figsize=(3.8 * len(kinds), 4.0), layout="constrained")
    for axes, who in zip(
        figure.subplots(1, len(kinds), sharex=True, sharey=True, squeeze=False)[0], kinds, strict=True
    ):
        here = own.knowers == who
        size = 3 + 60 * np.sqrt(weights[here] / weights.max())
        axes.scatter(own.own[here], added[here], s=size, color=COLOURS[who], alpha=0.25, lw=0)
        axes.axline((0, 0), slope=-1, color=BLACK, linewidth=1)
        wrong, share = (
            np.average(~own.right[here].astype(bool), weights=weights[here]),
            weights[here].sum() / weights.sum(),
        )
        axes.set_title(f"{WHO[who]}\n{share:.1%} of the moments,\n{wrong:.1%} of these wrong")
        axes.set_xlabel("lead in the right program")
        axes.set_xlim(min(own.own.min(), 0) - 0.5, own.own.quantile(0.99) + 1)
        axes.set_ylim(added.min() - 0.5, added.quantile(0.99) + 1)
    figure.axes[0].set_ylabel("lead added by the others")
    return figure


def repair(outcome: Outcome) -> Figure:
    """Agreement against the number of joint samples, of all moments and of those in which the teacher avoids."""
    frame = pd.DataFrame([row for row in outcome.table if row["part"] == "repair"]).sort_values("joint")
    rules = {(row["learner"], row["how"]): row for row in outcome.table if row["part"] == "rules"}
    counts = sorted(frame.joint.unique())
    figure = Figure(figsize=(10, 4.4), layout="constrained")
    panels = figure.subplots(1, 2)
    columns = {"agreement": "all moments", "agreement_avoid": "where the teacher avoids"}
    for axes, (column, title) in zip(panels, columns.items(), strict=True):
        ways = [(name, source) for name in outcome.settings.repairs for source in outcome.settings.sources]
        for (name, source), colour in zip(ways, PALETTE, strict=False):
            rows = frame.loc[(frame.repair == name) & (frame.source == source)]
            place = [counts.index(count) for count in rows.joint]
            axes.plot(place, rows[column], "o-", color=colour, markersize=4, label=f"{name}, {SAMPLES[source]}")
            low, high = rows[f"{column}_codebook_low"].astype(float), rows[f"{column}_codebook_high"].astype(float)
            axes.fill_between(place, low, high, color=colour, alpha=0.12, linewidth=0)
        for (learner, how), style in REFERENCES.items():
            if (learner, how) in rules:
                label = f"{learner}, {HOWS[how]}"
                axes.axhline(rules[learner, how][column], color=GREY, linestyle=style, linewidth=1.2, label=label)
        axes.set_xticks(range(len(counts)), [str(count) for count in counts])
        axes.set(title=title, xlabel="joint samples")
    panels[0].set_ylabel("agreement with the teacher")
    legend_below(figure, panels[0], 2)
    return figure


def rules(outcome: Outcome) -> Figure:
    """Wrong moments of sums by rule and by who knows their conditions, beside those of programs learned jointly."""
    rows = {(row["learner"], row["how"]): row for row in outcome.table if row["part"] == "rules"}
    names = [name for name in outcome.settings.rows if (name, "sum") in rows]
    figure = Figure(figsize=(9.5, 1.4 + 0.42 * len(names)), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True, sharex=True)
    for axes, how, title in zip(
        panels, ("sum", "silent_sum"), ("plain sum", "each silent where only others know"), strict=True
    ):
        left = np.zeros(len(names))
        for who in KNOWERS:
            wrong = np.array([rows.get((name, how), {}).get(f"wrong_{who}", 0.0) for name in names])
            axes.barh(range(len(names)), wrong, left=left, color=COLOURS[who], label=WHO[who])
            left += wrong
        joint = [1 - rows[name, "joint"]["agreement"] for name in names]
        axes.plot(joint, range(len(names)), "|", color=BLACK, markersize=14, label="one program, learned jointly")
        axes.set(title=title, xlabel="share of held-out moments answered wrongly")
        axes.grid(axis="y", visible=False)
    panels[0].set_yticks(range(len(names)), names)
    panels[0].invert_yaxis()
    legend_below(figure, panels[0], 3)
    return figure
