"""What the observability study shows: curves, a table for each disturbance, and what was chosen."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.kit import Column, Drawing, Outcome, Row, Table, pivot
from experiments.kit.figures import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PINK,
    SKY,
    VERMILION,
    by_measure,
    legend_below,
    panels,
)
from experiments.models.disturbances import DISTURBANCES
from experiments.observability.learners import LEARNERS
from experiments.tasks import in_bullet

LOOKS = {
    "teacher": (BLACK, "o"),
    "default": (VERMILION, "v"),
    "disturbed": (ORANGE, "s"),
    "trace": (BLUE, "D"),
    "hold": (PINK, "*"),
    "held_trace": (GREEN, "^"),
    "tree": (GREY, "P"),
    "tree_memory": (SKY, "X"),
}
DASHED = ("teacher", "tree", "tree_memory")
"""Learners without hypervectors."""

MEASURES = {
    "balanced agreement": ["balanced_agreement"],
    "agreement": ["agreement"],
    "success rate": ["success_rate", "success_low", "success_high"],
}


def means(table: Sequence[Row], measure: str) -> pd.DataFrame:
    """The mean of each disturbance and learner over the strengths above 0, if it was measured there."""
    frame = pd.DataFrame(table).astype({measure: float})
    above: Any = frame.loc[frame.strength > 0].groupby(["disturbance", "learner"], sort=False)[measure].mean()
    return above.dropna().reset_index()


def headline(outcome: Outcome) -> str:
    """The best learner under each disturbance."""
    measure = "success_rate" if outcome.settings.starts else "balanced_agreement"
    best = means(outcome.table, measure).sort_values(measure, ascending=False, kind="stable")
    best = best.drop_duplicates("disturbance").set_index("disturbance").to_dict("index")
    chosen = [(name, best[name]) for name in outcome.settings.disturbances if name in best]
    found = ", ".join(f"{name} `{row['learner']}` {row[measure]:.2f}" for name, row in chosen)
    return f"Highest {measure.replace('_', ' ')}, mean over the strengths above 0: {found}." if found else ""


def tables(outcome: Outcome) -> list[Table]:
    """All measures of each disturbance, what the learners are, and what they chose."""
    table, found = outcome.table, []
    value = Column("balanced_agreement", format=_measured, best="max")
    for name in dict.fromkeys(row["disturbance"] for row in table):
        rows = [row for row in table if row["disturbance"] == name]
        title = f"{name.capitalize()}: agreement / balanced agreement / success"
        about = f"By {DISTURBANCES[name].axis}; success, if robots drove. Marked: the highest balanced agreement."
        found.append(pivot(title, rows, [Column("learner")], Column("label"), value, about))
    learners = [{"learner": name, "about": LEARNERS[name].about} for name in outcome.settings.learners]
    found.append(Table("Learners", [Column("learner"), Column("about", "what it is")], words=True).show(learners))
    about = "The first `bullet_starts` and `wheeled_starts` starts of `bullet_learners`."
    keys = [Column("disturbance"), Column("label", "strength"), Column("learner")]
    found += in_bullet.tables(keys, table, about)
    chosen = choices(outcome.records)
    return [*found, CHOICES.show(chosen)] if chosen else found


def _measured(row: Mapping[str, Any]) -> str:
    success = "" if row["success_rate"] is None else f" / {row['success_rate']:.2f}"
    return f"{row['agreement']:.3f} / {row['balanced_agreement']:.2f}{success}"


def choices(records: pd.DataFrame) -> list[Row]:
    """What was compared on validation runs, and which choice of each learner was `taken`: the first of the best."""
    if "choice" not in records:
        return []
    found = records.loc[records.choice.notna(), ["disturbance", "learner", "choice", "validation"]]
    taken = set(found.groupby(["disturbance", "learner"]).validation.idxmax())
    rows: Any = found.assign(taken=["yes" if place in taken else "" for place in found.index]).to_dict("records")
    return rows


CHOICES = Table(
    "What was chosen on validation runs",
    [
        Column("disturbance"),
        Column("learner"),
        Column("choice"),
        Column("validation", "balanced agreement", ".3f", about="mean over the strengths above 0"),
        Column("taken"),
    ],
    words=True,
)


def curves(outcome: Outcome) -> Figure:
    """A column per disturbance, a row per measure, a line per learner; success only if robots drove."""
    frame = by_measure(outcome.table, MEASURES)
    # Strengths are evenly spaced, whatever their numbers.
    frame["place"] = frame.groupby("disturbance").strength.rank(method="dense") - 1
    looks: Any = {"order": list(LEARNERS), "fixed": LOOKS, "dashed": DASHED, "apart": 0.08}
    figure, grid = panels(frame, "place", "learner", "measure", "disturbance", (1.95, 1.95), **looks)
    for (measure, name), axes in grid.items():
        here = frame.loc[frame.disturbance == name].sort_values("strength")
        if name == "aliased":
            for line in axes.lines:  # categories, with nothing between one and the next
                line.set_linestyle("none")
        if measure == "agreement":
            usual = here.usual_share.iloc[0]
            axes.axhline(usual, color=GREY, linewidth=1, linestyle=(0, (1, 3)), label="most usual command")
        # From 0 on where the lowest is near it; else just below the lowest.
        low = frame.value[frame.measure == measure].min()
        axes.set_ylim(-0.03 if low < 0.5 else np.floor(low * 10) / 10, 1.03)
        labels = (
            here.label.str.replace("light left and light right", "lights").str.replace("light ", "light\n").unique()
        )
        axes.set_xticks(range(len(labels)), labels)
        axes.grid(visible=False, axis="x")
        if axes.get_xlabel():
            axes.set_xlabel(textwrap.fill(DISTURBANCES[name].axis, 21))
    legend_below(figure, columns=min(5, 2 + frame.disturbance.nunique()))
    return figure


FIGURE = Drawing(
    "observability",
    curves,
    "Agreement and success of each learner against the strength of each disturbance",
    "Bars: Wilson's 95 % interval of the success rate. Dashed: no hypervectors. Dotted: always giving the most usual "
    "command.",
    lambda outcome: pd.DataFrame(outcome.table),
)
METHOD = """
Balanced agreement: how often the learner, who sees disturbed readings, commands what the teacher does, who sees the
true ones, in `heldout` held-out runs of the teacher before the lamp; the mean over the teacher's different commands,
each counting alike. Agreement: the share of all steps, most of which are straight runs. Success: share of `starts`
held-out starts from which the robot reaches the lamp within `seconds` and stays, with Wilson's 95 % interval.

Learners of disturbed demonstrations get the strengths in turns, one per episode. What they may choose, they choose by
balanced agreement on other runs, the validation runs.
"""
