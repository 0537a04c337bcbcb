"""The page of the observability study: the figure, what it says in words, and all numbers."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.kit import Column, Outcome, Page, Row, Study, Table
from experiments.kit.figures import BLACK, BLUE, GREEN, GREY, ORANGE, PINK, SKY, VERMILION, legend_below, lines
from experiments.observability.disturbances import DISTURBANCES
from experiments.observability.learners import LEARNERS

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
    "balanced_agreement": "balanced agreement",
    "agreement": "agreement",
    "success_rate": "success rate",
}
MEMORIES = ("trace", "hold", "held_trace")


def fill(page: Page, outcome: Outcome, study: Study) -> None:
    """The figure, what it says, the table of each disturbance, and what was chosen."""
    table = outcome.table
    section = page.section("Agreement and success against the strength of the disturbance")
    alt = "Agreement and success of each learner against the strength of each disturbance"
    section.figure("observability", partial(curves, table), alt, caption(outcome.settings), pd.DataFrame(table))
    section.terms({learner: LEARNERS[learner].about for learner in outcome.settings.learners})
    page.section("What it says").terms({name: sentence(table, name) for name in names(table)})
    section = page.section("The table")
    for name in names(table):
        section.table(by_strength(table, name))
    if found := choices(outcome.records):
        page.section("What was chosen on validation runs").table(CHOICES.show(found))
    page.section("All numbers").table(study.shown(outcome)[0])


def names(table: Iterable[Row]) -> list[str]:
    """The disturbances of a table, in its order."""
    return list(dict.fromkeys(row["disturbance"] for row in table))


def caption(settings: Any) -> str:
    """How the figure is to be read."""
    text = (
        f"Balanced agreement: how often the learner, who sees disturbed readings, commands what the teacher does, who "
        f"sees the true ones, in {settings.heldout} held-out runs of the teacher before the lamp; the mean over the "
        "teacher's different commands, each counting alike. Agreement: the share of all steps, most of which are "
        "straight runs; the dotted line is for always giving the most usual command. Dashed: no hypervectors."
    )
    if settings.starts:
        text += (
            f" Success: share of {settings.starts} held-out starts from which the robot reaches the lamp within "
            f"{settings.seconds:g} s and stays, with Wilson's 95 % interval."
        )
    return text


def means(table: Sequence[Row], disturbance: str, measure: str) -> dict[str, float]:
    """The mean over the strengths above 0, of each learner that was measured there."""
    frame = pd.DataFrame(table)
    rows = frame.loc[(frame.disturbance == disturbance) & (frame.strength > 0)].astype({measure: float})
    found: Any = rows.groupby("learner", sort=False)[measure].mean().dropna()
    return found.to_dict()


def sentence(table: Sequence[Row], disturbance: str) -> str:
    """What training on a disturbance and a memory change, in means over its strengths above 0."""
    texts = []
    for measure in ("balanced_agreement", "success_rate"):
        known = means(table, disturbance, measure)
        if not known:
            continue
        best = max(known, key=lambda learner: known[learner])
        text = f"{MEASURES[measure]}: highest for `{best}` ({known[best]:.2f})"
        if {"default", "disturbed"} <= set(known):
            text += f"; {_change(known['default'], known['disturbed'])} by learning disturbed demonstrations"
        memories = [learner for learner in MEMORIES if learner in known]
        if memories and "disturbed" in known:
            changes = [f"{_change(known['disturbed'], known[memory])} by `{memory}`" for memory in memories]
            text += f"; then {', '.join(changes)}"
        texts.append(text[0].upper() + text[1:])
    return f"Means over the strengths above 0. {'. '.join(texts)}."


def _change(before: float, after: float) -> str:
    difference = round(after, 2) - round(before, 2)
    if abs(difference) < 0.005:
        return f"unchanged ({after:.2f})"
    return f"{'raised' if difference > 0 else 'lowered'} from {before:.2f} to {after:.2f}"


def headline(outcome: Outcome) -> str:
    """The best learner under each disturbance."""
    measure = "success_rate" if outcome.settings.starts else "balanced_agreement"
    found = []
    for name in names(outcome.table):
        if known := means(outcome.table, name, measure):
            best = max(known, key=lambda learner: known[learner])
            found.append(f"{name} `{best}` {known[best]:.2f}")
    return f"Highest {MEASURES[measure]}, mean over the strengths above 0: {', '.join(found)}." if found else ""


def by_strength(table: Sequence[Row], disturbance: str) -> Table:
    """All measures of one disturbance, with a row for each learner and a column for each strength."""
    rows: dict[str, Row] = {}
    for row in table:
        if row["disturbance"] == disturbance:
            text = f"{row['agreement']:.3f} / {row['balanced_agreement']:.2f}"
            text += "" if row["success_rate"] is None else f" / {row['success_rate']:.2f}"
            line = rows.setdefault(row["learner"], {"learner": row["learner"]})
            line |= {row["label"]: row["balanced_agreement"], f"{row['label']} text": text}
    labels = dict.fromkeys(row["label"] for row in table if row["disturbance"] == disturbance)
    columns = [Column(label, label, partial(_text, label), best="max") for label in labels]
    how = "Agreement / balanced agreement / success, if driven. Green: the highest balanced agreement."
    about = f"{disturbance}: {DISTURBANCES[disturbance].axis}. {how}"
    return Table(disturbance, [Column("learner"), *columns], about).show(list(rows.values()))


def _text(label: str, row: Any) -> str:
    return row[f"{label} text"]


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


def curves(table: Sequence[Row]) -> Figure:
    """A column per disturbance, a row per measure, a line per learner; success only if robots drove."""
    frame, present = pd.DataFrame(table), names(table)
    measures = [measure for measure in MEASURES if any(row[measure] is not None for row in table)]
    figure = Figure(figsize=(max(0.9 + 1.95 * len(present), 5.4), 0.9 + 1.95 * len(measures)), layout="constrained")
    grid = figure.subplots(len(measures), len(present), sharey="row", sharex="col", squeeze=False)
    for column, name in zip(grid.T, present, strict=True):
        here = frame.loc[frame.disturbance == name]
        # Strengths are evenly spaced, whatever their numbers.
        here = here.assign(place=here.strength.rank(method="dense") - 1)
        column[0].set_title(name)
        for axes, measure in zip(column, measures, strict=True):
            _panel(axes, here.loc[here[measure].notna()], measure)
        _strengths(column[-1], here)
    for panels, measure in zip(grid, measures, strict=True):
        panels[0].set_ylabel(MEASURES[measure])
        low = min(row[measure] for row in table if row[measure] is not None)
        # From 0 on where the lowest is near it; else just below the lowest.
        panels[0].set_ylim(-0.03 if low < 0.5 else np.floor(low * 10) / 10, 1.03)
    learners = frame.groupby("disturbance", sort=False).learner.nunique().to_numpy()
    fullest = int(learners.argmax())
    legend_below(figure, grid[measures.index("agreement"), fullest], min(5, 2 + len(present)))
    return figure


def _panel(axes: Axes, frame: pd.DataFrame, measure: str) -> None:
    driven = measure == "success_rate"
    ends = {"low": "success_low", "high": "success_high"} if driven else {}
    order = [learner for learner in LEARNERS if learner in set(frame.learner)]
    frame = frame.astype({measure: float, **dict.fromkeys(ends.values(), float)})
    lines(axes, frame, "place", measure, "learner", order=order, fixed=LOOKS, dashed=DASHED, apart=0.08, **ends)
    if frame.disturbance.iloc[0] == "aliased":
        for line in axes.lines:  # categories, with nothing between one and the next
            line.set_linestyle("none")
    if measure == "agreement":
        share = frame.usual_share.iloc[0]
        axes.axhline(share, color=GREY, linewidth=1, linestyle=(0, (1, 3)), label="most usual command")
    axes.grid(visible=False, axis="x")
    axes.set_ylabel("")


def _strengths(axes: Axes, frame: pd.DataFrame) -> None:
    labels = frame.sort_values(by="strength").label.unique()
    ticks = [label.replace("light left and light right", "lights").replace("light ", "light\n") for label in labels]
    axes.set_xticks(range(len(ticks)), ticks)
    axes.set_xlabel(textwrap.fill(DISTURBANCES[frame.disturbance.iloc[0]].axis, 21))
