"""The figures of the study of interference."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.composition.interference_tables import WHO
from experiments.composition.sums import KNOWERS
from experiments.kit import Outcome
from experiments.kit.figures import BLACK, BLUE, GREEN, GREY, ORANGE, PALETTE, VERMILION, legend_below

COLOURS: dict[str, str] = dict(zip(KNOWERS, (VERMILION, BLUE, ORANGE, GREEN), strict=True))


def reason(outcome: Outcome) -> Figure:
    """The lead of the right behaviour's program against what the others add, a panel for each kind of condition."""
    records = outcome.records
    own: Any = records.loc[records.part == "reason"]
    kinds = [who for who in KNOWERS if (own.knowers == who).any()][:3]
    figure = Figure(figsize=(3.6 * len(kinds), 3.9), layout="constrained")
    for axes, who in zip(
        figure.subplots(1, len(kinds), sharex=True, sharey=True, squeeze=False)[0], kinds, strict=True
    ):
        part = own.loc[own.knowers == who]
        size = 2 + 60 * np.sqrt(part["count"] / own["count"].max())
        axes.scatter(part.own, part.rival + part.bystander, s=size, color=COLOURS[who], alpha=0.25, lw=0)
        low, high = axes.get_xlim()
        axes.axline((0, 0), slope=-1, color=BLACK, linewidth=1)
        axes.set_xlim(low, high)
        wrong = np.average(~part.right.astype(bool), weights=part["count"])
        share = part["count"].sum() / own["count"].sum()
        axes.set_title(f"{WHO[who]}\n{share:.1%} of the moments, {wrong:.1%} of them wrong")
        axes.set_xlabel("lead in the right program")
    figure.axes[0].set_ylabel("lead added by the others")
    return figure


def repair(outcome: Outcome) -> Figure:
    """Agreement against the number of joint samples, of all moments and of those in which the teacher avoids."""
    frame = pd.DataFrame([row for row in outcome.table if row["part"] == "repair"])
    rules = {(row["learner"], row["how"]): row for row in outcome.table if row["part"] == "rules"}
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    panels = figure.subplots(1, 2)
    for axes, column, title in zip(
        panels, ("agreement", "agreement_avoid"), ("all moments", "where the teacher avoids"), strict=True
    ):
        ways = frame[["repair", "source"]].drop_duplicates().to_numpy().tolist()
        for (name, source), colour in zip(ways, PALETTE, strict=False):
            rows = frame.loc[(frame.repair == name) & (frame.source == source)].sort_values("joint")
            axes.plot(rows.joint, rows[column], "o-", color=colour, markersize=4, label=f"{name}, from {source}")
            low, high = rows[f"{column}_codebook_low"].astype(float), rows[f"{column}_codebook_high"].astype(float)
            axes.fill_between(rows.joint, low, high, color=colour, alpha=0.12, linewidth=0)
        for (learner, how), style in (
            (("error_driven_5", "joint"), "-"), (("evident", "silent_sum"), "--"), (("evident", "sum"), ":"),
        ):  # fmt: skip
            if (learner, how) in rules:
                label = f"{learner}, {how.replace('_', ' ')}"
                axes.axhline(rules[learner, how][column], color=GREY, linestyle=style, linewidth=1.2, label=label)
        axes.set_xscale("symlog", linthresh=1)
        axes.set_xticks(sorted(frame.joint.unique()), [str(count) for count in sorted(frame.joint.unique())])
        axes.minorticks_off()
        axes.set(title=title, xlabel="joint samples")
    panels[0].set_ylabel("agreement with the teacher")
    legend_below(figure, panels[0], 4)
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
