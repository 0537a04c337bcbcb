"""The tables of the page, and the numbers that they are made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

import sim
from experiments.corral.controllers import original
from experiments.corral.forgetting import ABOUT
from experiments.corral.trajectories import PLACES
from experiments.kit import Column, Row, Table

WHOLE = ("episodes", "pairs_stored", "bins")
"""Numbers that are whole."""


def is_learner(row: Mapping[str, Any]) -> bool:
    """Whether a row competes: teachers are what it is measured against, rows in the physics engine repeat others."""
    return not row["controller"].startswith("teacher") and original(row["controller"]) == row["controller"]


def agreement(key: str, label: str, about: str) -> Column:
    """A column of shares, of which the best learner's is marked."""
    return Column(key, label, ".3f", best="max", among=is_learner, about=about)


MAIN = Table(
    "Corral escape",
    [
        Column("controller"),
        Column(
            "episodes", "starts", about="held-out starts driven; none of them was demonstrated, and start by start all "
            "controllers meet the same ones, the first of them"
        ),
        Column(
            "success_rate", "success [95 %]", ".3f", ("success_low", "success_high"), bad=lambda rate: rate < 0.5,
            about="share of episodes in which the robot touches the lamp and stays for the dwell time, with Wilson's "
            "95 % interval",
        ),
        Column(
            "common_rate", "common", ".3f", best="max", among=is_learner,
            about="success on the starts that all controllers of this table drove, on which they can be compared",
        ),
        Column(
            "minus_original", "diff", "+.3f",
            about="success minus that of the row which it repeats in the physics engine, on the starts that both drove",
        ),
        Column("escape_rate", "escape", about="share of episodes in which the robot leaves the corral at any time"),
        Column(
            "time_to_light_s", "time", ".1f", best="min", among=is_learner, alike="episodes",
            about="median time to the first touch of the lamp, s; a failed episode counts as longer than any other, so "
            "there is no median (-) where half of them fail",
        ),
        Column(
            "dwell_fraction", "dwell", about="of the control steps after first touching the lamp, the share spent at it"
        ),
        Column("collision_fraction", "collide", about="share of control steps in contact with a wall"),
        agreement(
            "train_agreement", "train",
            "agreement on the demonstrations, without the conditions that were shown with more than one command",
        ),
        agreement("heldout_agreement", "held out", "agreement on other runs of the teacher"),
        agreement(
            "unseen_agreement", "unseen",
            "agreement on the held-out samples whose condition was never demonstrated; - where there is none",
        ),
        Column(
            "pairs_stored", "pairs", ",.0f",
            about="pairs of condition and command in the program, repetitions included (nearest neighbour: samples "
            "kept)",
        ),
        Column(
            "bins", format=".0f", about="bins of equal width per sensor; - for controllers that see raw readings"
        ),
        Column(
            "query_us", "µs", ",.0f",
            about="median time of one answer for one robot, on the machine that ran this, with its workers busy",
        ),
    ],
    "Marked: the best of its column, without the teachers, and only where all were measured on the same starts: success "
    "is compared in the column `common`, times only if all drove as many starts. Orange: less than half of the "
    "episodes succeed. Agreement: share of samples for which the controller commands what the teacher did, without "
    "those after the lamp was reached, since a robot at rest repeats one condition and would flatter every learner.",
)  # fmt: skip
NUMBERS = [key for column in MAIN.columns[1:] for key in (column.key, *(column.interval or ()))]
"""The numbers that are shown of every controller; those that do not apply to it are None."""

AGREEMENT = Table(
    "Agreement in detail",
    [
        Column("controller"),
        Column("train_agreement_all", "train, all", about="contradicting demonstrations included"),
        Column(
            "heldout_agreement_distinct", "per condition",
            about="held out; each distinct condition counts once, at the bins of `default` for all controllers",
        ),
        *(
            Column(f"heldout_agreement.{rule}", rule.replace("_", " "), bad=lambda share: share < 0.5)
            for rule in sim.TEACHER_RULES
        ),
        Column(
            "ambiguous_share", "on the edge",
            about="of the held-out samples with another command than the teacher's, the share in bins in which the "
            "teacher itself gives several commands, since its threshold runs through the bin: no program that sees "
            "only bins can always be right there",
        ),
        Column("unseen_share", about="held-out samples whose condition was never demonstrated"),
    ],
    "The same agreement, counted in other ways; by rule: held out, where each of the teacher's rules fires. Orange: "
    "less than half.",
)  # fmt: skip
COUNTS = Table(
    "What the printed algorithm decided",
    [
        Column("controller"),
        Column("samples", format=",.0f"),
        Column("new", format=",.0f", about="stored for the first time"),
        Column("re_added", "re-added", ",.0f", about="stored again, as the memory no longer resembled it"),
        Column("truly_known", format=",.0f", about="skipped, and stored before"),
        Column("falsely_known", format=",.0f", about="skipped although never stored: what it showed was lost"),
        Column("contradicting", format=",.0f", about="stored before with another command"),
    ],
    "What the algorithm decided about the demonstrated samples, in the order in which it met them.",
)
CANDIDATES = Table(
    "Bins of paper_best_bins",
    [
        Column("bins", format=".0f"),
        Column("validation_success", "success on validation starts"),
        Column("train_agreement", "agreement on all demonstrated samples"),
    ],
    "How the bins of `paper_best_bins` were chosen.",
)
RECALL = Table(
    "Recall of the demonstrated conditions",
    [
        Column("bins", format=".0f"),
        Column(
            "conditions",
            format=",.0f",
            about="distinct conditions; asked are those that were shown with one command only",
        ),
        *(Column(learner, about=about) for learner, about in ABOUT.items()),
    ],
    "What each step of the algorithm costs: the same demonstrations, learned in five ways, and the share of conditions "
    "for which the program then recalls the command.",
)
FAILURES = Table(
    "Failing episodes",
    [
        Column("controller"),
        Column("failed"),
        Column("of"),
        *(Column(place) for place in PLACES),
        Column(
            "unlike_teacher", "steps unlike the teacher's",
            about="0 where every command was the teacher's: bad luck of start and noise",
        ),
    ],
    "Failing episodes, and where the robot was when the time was up.",
)  # fmt: skip
MISTAKES = Table(
    "Commands in failing episodes that are not the teacher's",
    [
        Column("controller"),
        Column("rule", "where the teacher would", lambda row: row["rule"].replace("_", " ")),
        Column("command", "it commands"),
        Column("share", "share of steps"),
        Column(
            "readings", "readings (m)", lambda row: ", ".join(f"{row[sensor.name]:.2f}" for sensor in sim.SENSORS)
        ),
    ],
    "The commands that differ from the teacher's most often in the failing episodes: share of their control steps, and "
    "the median readings (left light, right light, distance) at which they were given.",
    words=True,
)  # fmt: skip


def measured(records: pd.DataFrame) -> dict[str, Row]:
    """The numbers that were measured of each controller; other than those of the main table, only if they apply."""
    found = {}
    for row in records.loc[records.kind == "controller"].drop(columns="kind").to_dict(orient="records"):
        known = {str(key): int(value) if key in WHOLE else value for key, value in row.items() if pd.notna(value)}
        found[row["controller"]] = {"controller": row["controller"], **dict.fromkeys(NUMBERS), **known}
    return found


def shared_success(episodes: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """Success on the starts that all of these controllers drove: a row per start, a column per controller."""
    success = episodes.pivot(index="episode", columns="controller", values="success")
    return success.loc[:, list(names)].dropna().astype(bool)


def failing(episodes: pd.DataFrame, names: Sequence[str]) -> list[Row]:
    """For each controller, how many episodes failed, where their robots ended, and the steps unlike the teacher's."""
    failed = episodes.loc[~episodes.success]
    table = pd.crosstab(failed.controller, failed.end).reindex(index=names, columns=list(PLACES), fill_value=0)
    steps = failed.groupby("controller")[["steps_unlike_teacher", "steps"]].sum()
    table["failed"], table["of"] = table.sum(axis=1), episodes.controller.value_counts()
    table["unlike_teacher"] = steps.steps_unlike_teacher / steps.steps
    return table.rename_axis("controller").reset_index().to_dict(orient="records")


def most_frequent_mistakes(records: pd.DataFrame, names: Sequence[str], most: int = 3) -> list[Row]:
    """The most frequent differences of each controller that fails."""
    rows = records.loc[(records.kind == "mistake") & records.controller.isin(names)].groupby("controller").head(most)
    order = rows.controller.map(list(names).index)
    return rows.iloc[order.argsort(kind="stable")].to_dict(orient="records")
