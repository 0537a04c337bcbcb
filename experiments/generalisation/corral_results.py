"""What the corral's records show: a table of medians and rates, and how it looks by demonstrations."""

from collections.abc import Iterable
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.kit import Column, Outcome, Row, Table
from experiments.kit.figures import BLACK, BLUE, legend_below, lines
from experiments.tasks.corral import success

TEACHER = "teacher"
HOME = "default"
"""The arena in which the demonstrations are made."""
KEYS = ["learner", "arena", "demonstrations"]


def summarise(settings: Any, records: pd.DataFrame) -> list[Row]:
    """One row for each learner, arena and number of demonstrations: medians and ranges over the draws.

    Success counts all draws together, with Wilson's 95 % interval.
    """
    combinations = {combination.name: combination for combination in settings.combinations()}
    records = records.reindex(columns=[*KEYS, "heldout", "unseen", "episodes", "successes"])
    table: list[Row] = []
    for _, group in records.groupby(KEYS, dropna=False, sort=False):
        row: Row = group[KEYS].iloc[0].to_dict()
        row["demonstrations"] = None if pd.isna(row["demonstrations"]) else int(row["demonstrations"])
        if row["learner"] in combinations:
            row |= vars(combinations[row["learner"]])
        row["draws"] = len(group)
        for name in ("heldout", "unseen"):
            values = group[name]
            row |= {name: values.median(), f"{name}_min": values.min(), f"{name}_max": values.max()}
        table.append(row | success(group.episodes.sum(), group.successes.sum()))
    return table


def tables(outcome: Outcome) -> list[Table]:
    """Agreement, agreement where nothing was shown, and success, each with a column per number of demonstrations."""
    learners = [row for row in outcome.table if row["learner"] != TEACHER]
    home = [row for row in learners if row["arena"] == HOME]
    counts = sorted({row["demonstrations"] for row in home})
    shown = []
    for name, title in (("heldout", "Agreement"), ("unseen", "Agreement in conditions not demonstrated")):
        columns = [Column("learner"), *(Column(str(count), "", ".3f", _ends(count)) for count in counts)]
        caption = "Median over the draws of the demonstrations, with lowest and highest, in held-out runs."
        rows = _by_demonstrations(home, name, f"{name}_min", f"{name}_max")
        shown.append(Table(f"{title}, by demonstrations", columns, caption).show(rows))
    rate = ("success_rate", "success_low", "success_high")
    teacher = {
        row["arena"]: dict(zip((TEACHER, *_ends(TEACHER)), (row[name] for name in rate), strict=True))
        for row in outcome.table
        if row["learner"] == TEACHER
    }
    rows = [row | teacher[row["arena"]] for row in _by_demonstrations(learners, *rate)]
    columns = [Column(str(name), "", ".2f", _ends(name)) for name in (*counts, TEACHER)]
    caption = (
        "Share of unseen starts from which the robot reaches the lamp and stays, all draws together, with Wilson's "
        "95 % interval. The teacher and the default have more starts than the others, so nothing is marked."
    )
    table = Table("Success, by demonstrations", [Column("learner"), Column("arena"), *columns], caption)
    return [*shown, table.show(rows)]


def _ends(name: object) -> tuple[str, str]:
    return f"{name}_low", f"{name}_high"


def _by_demonstrations(rows: Iterable[Row], value: str, low: str, high: str) -> list[Row]:
    """One row for each learner and arena, with a value and its ends for each number of demonstrations."""
    found: dict[tuple[str, str], Row] = {}
    for row in rows:
        if row[value] is not None:
            count, (first, last) = str(row["demonstrations"]), _ends(row["demonstrations"])
            line = found.setdefault((row["learner"], row["arena"]), {"learner": row["learner"], "arena": row["arena"]})
            line |= {count: row[value], first: row[low], last: row[high]}
    return list(found.values())


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
ARENA_MARKERS = ("s", "^", "o", "P", "v")


def curves(outcome: Outcome) -> Figure:
    """Agreement and success against the number of demonstrations."""
    labels = labels_of(outcome)
    default = next(iter(labels))
    rows = [row for row in outcome.table if row["arena"] == HOME and row["learner"] in labels]
    home = pd.DataFrame([row | {"label": labels[row["learner"]]} for row in rows])
    figure = Figure(figsize=(11, 5.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    for axes, value, low, high in (
        (left, "heldout", "heldout_min", "heldout_max"),
        (right, "success_rate", "success_low", "success_high"),
    ):
        order, fixed = list(labels.values()), {labels[default]: (BLUE, "D"), **FIXED}
        lines(axes, home, "demonstrations", value, "label", order=order, fixed=fixed)
        band = home.loc[home.learner == default].sort_values(by="demonstrations")
        axes.fill_between(band.demonstrations, band[low], band[high], color=BLUE, alpha=0.15, linewidth=0)
        axes.set_xscale("log")
        counts = sorted(set(home.demonstrations))
        axes.set_xticks(counts, [str(count) for count in counts])
        axes.minorticks_off()
        axes.set_xlabel("demonstrations")
    _elsewhere(right, outcome, default)
    left.set(title="agreement with the teacher in held-out runs", ylabel="agreement")
    right.set(title="success from unseen starts", ylabel="success rate", ylim=(-0.03, 1.03))
    legend_below(figure, right, 4)
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


def _elsewhere(axes: Axes, outcome: Outcome, default: str) -> None:
    """The success of the default in unseen arenas."""
    arenas = [arena for arena in outcome.settings.arenas if arena != HOME]
    for place, arena in enumerate(arenas):
        rows = [row for row in outcome.table if (row["learner"], row["arena"]) == (default, arena)]
        points = sorted((row["demonstrations"], row["success_rate"]) for row in rows)
        marker = ARENA_MARKERS[place % len(ARENA_MARKERS)]
        label = f"default, in {arena}"
        axes.plot(*zip(*points, strict=True), ":", color=BLUE, marker=marker, mfc="white", ms=6, label=label)
