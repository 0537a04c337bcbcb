"""What the corral's records show: a table of medians and rates, and how it looks by demonstrations."""

import itertools
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.kit import Column, Drawing, Outcome, Row, Table, aggregated, pivot
from experiments.kit.figures import BLACK, BLUE, by_measure, legend_below, looks, panels
from experiments.tasks import in_bullet
from experiments.tasks.corral import success

TEACHER = "teacher"
HOME = "default"
"""The arena in which the demonstrations are made."""
KEYS = ["learner", "arena", "demonstrations"]


def summarise(settings: Any, records: pd.DataFrame) -> list[Row]:
    """One row for each learner, arena and number of demonstrations: medians and ranges over the draws.

    Success counts all draws together, with Wilson's 95 % interval.
    """
    named = {combination.name: vars(combination) for combination in settings.combinations()}
    spread = {"": "median", "_min": "min", "_max": "max"}
    columns = {name + end: (name, how) for name in ("heldout", "unseen") for end, how in spread.items()}
    columns |= {"draws": ("arena", "count"), "episodes": ("episodes", "sum"), "successes": ("successes", "sum")}
    found = aggregated(records.reindex(columns=[*KEYS, "heldout", "unseen", "episodes", "successes"]), KEYS, columns)
    groups: Any = records.groupby(KEYS, dropna=False)
    for row in found:
        row |= named.get(row["learner"], {}) | success(row["episodes"], row.pop("successes"))
        row |= in_bullet.differences(groups.get_group(tuple(row[key] for key in KEYS)))
    return found


def tables(outcome: Outcome) -> list[Table]:
    """Agreement, agreement where nothing was shown, and success, each with a column per number of demonstrations."""
    learners = [row for row in outcome.table if row["learner"] != TEACHER]
    learners.sort(key=lambda row: row["demonstrations"])
    teacher = [row for row in outcome.table if row["learner"] == TEACHER]
    home = [row for row in learners if row["arena"] == HOME]
    driven = [row for row in learners + teacher if row["success_rate"] is not None]
    count = Column("demonstrations", format=lambda row: str(row["demonstrations"] or "none"))
    range_of = "Median over the draws of the demonstrations, with lowest and highest, in held-out runs."
    rates = (
        "Share of unseen starts from which the robot reaches the lamp and stays, all draws together, with Wilson's "
        "95 % interval. The teacher and the default have more starts than the others, so nothing is marked."
    )
    heldout = Column("heldout", "", ".3f", ("heldout_min", "heldout_max"))
    unseen = Column("unseen", "", ".3f", ("unseen_min", "unseen_max"))
    rate = Column("success_rate", "", ".2f", ("success_low", "success_high"))
    learner, arena = Column("learner"), Column("arena")
    return [
        pivot("Agreement, by demonstrations", home, [learner], count, heldout, range_of),
        pivot("Agreement in conditions not demonstrated, by demonstrations", home, [learner], count, unseen, range_of),
        pivot("Success, by demonstrations", driven, [learner, arena], count, rate, rates),
        *in_bullet.tables([arena], driven, "The default after the most demonstrations, from its first starts."),
    ]


def headline(outcome: Outcome) -> str:
    """What the default combination does after the most demonstrations."""
    default, most = outcome.settings.combinations()[0].name, max(outcome.settings.demonstrations)
    rows = [row for row in outcome.table if (row["learner"], row["demonstrations"]) == (default, most)]
    agreement = next(row["heldout"] for row in rows if row["arena"] == HOME)
    rates = ", ".join(f"{row['success_rate']:.0%} of the starts in `{row['arena']}`" for row in rows)
    return (
        f"After {most} demonstrations `{default}` agrees with its teacher on {agreement:.1%} of held-out samples, and "
        f"succeeds from {rates}."
    )


FIXED = {"nearest neighbour": (BLACK, "X"), "decision tree": (BLACK, "h")}
"""Baselines are black. What is fixed here and for the default is given to no other line."""
MEASURES = {
    "agreement in held-out runs": ("heldout", "heldout_min", "heldout_max"),
    "success from unseen starts": ("success_rate", "success_low", "success_high"),
}
ARENA_MARKERS = ("s", "^", "o", "P", "v")


def curves(outcome: Outcome) -> Figure:
    """Agreement and success against the number of demonstrations; of the default also in unseen arenas."""
    labels = labels_of(outcome)
    default = next(iter(labels))
    elsewhere = {arena: f"default, in {arena}" for arena in outcome.settings.arenas if arena != HOME}
    rows = [
        row | {"label": labels[row["learner"]] if row["arena"] == HOME else elsewhere[row["arena"]], "column": ""}
        for row in outcome.table
        if row["learner"] == default or (row["learner"] in labels and row["arena"] == HOME)
    ]
    frame = by_measure(rows, MEASURES)
    frame.loc[frame.label != labels[default], ["low", "high"]] = np.nan
    fixed = {labels[default]: (BLUE, "D"), **FIXED}
    fixed |= {label: (BLUE, marker) for label, marker in zip(elsewhere.values(), itertools.cycle(ARENA_MARKERS))}
    order = [*labels.values(), *elsewhere.values()]
    options: Any = {"order": order, "fixed": looks(order, fixed), "dashed": list(elsewhere.values())}
    figure, grid = panels(frame, "demonstrations", "label", "measure", "column", (8, 3.4), **options)
    counts = sorted(set(frame.demonstrations))
    for axes in grid.values():
        axes.set_xscale("log")
        axes.set_xticks(counts, [str(count) for count in counts])
        axes.minorticks_off()
    legend_below(figure, columns=4)
    return figure


def labels_of(outcome: Outcome) -> dict[str, str]:
    """A label for each learner that drove: the default, the others by what differs from it, and baselines by name."""
    combinations = outcome.settings.combinations()
    default = combinations[0]
    labels = {default.name: f"default ({default.name})"}
    for combination in combinations[1:]:
        if len(changes := combination.changes(default)) == 1:
            labels[combination.name] = next(iter(changes.values())).replace("_", " ")
    return labels | {name: name.replace("_", " ") for name in outcome.settings.baselines}


FIGURE = Drawing(
    "generalisation",
    curves,
    "agreement with the teacher, and success, against the number of demonstrations",
    "Agreement: medians over the draws; band: the default's range. Success: all draws together; band: the default's "
    "95 % interval. Dashed: the default in unseen arenas.",
    lambda outcome: pd.DataFrame(outcome.table),
)
