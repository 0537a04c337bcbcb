"""The tables of the study of interference, and the numbers that they are made of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.composition.sums import KNOWERS
from experiments.kit import Column, Outcome, Row, Table, pivot
from experiments.kit.intervals import mean

if TYPE_CHECKING:
    from experiments.composition.interference import Interference

HOWS = {"sum": "sum", "silent_sum": "sum, each silent where only others know", "joint": "one program, learned jointly"}
WHO = {
    "several": "several behaviours know it",
    "right_one": "only the right one knows it",
    "other": "only another one knows it",
    "nobody": "nobody knows it",
}
"""Who was shown the condition of a moment."""


def summarise(settings: Interference, records: pd.DataFrame) -> list[Row]:
    """A row for each rule and way to combine, for each number of joint samples, and for each kind of condition."""
    table: list[Row] = []
    for name, keys in (("rules", ["learner", "how"]), ("repair", ["repair", "source", "joint"])):
        own = records.loc[records.part == name]
        groups: Any = own.groupby(keys, sort=False)
        for key, part in groups:
            table.append({"part": name, **dict(zip(keys, key, strict=True)), **agreements(part)})
    order = [*settings.rows]
    table.sort(key=lambda row: order.index(row["learner"]) if "learner" in row else len(order))
    for row in table:
        if "joint" in row:
            row["joint"] = int(row["joint"])
    own = records.loc[records.part == "reason"]
    return [*table, *reasons(own), *overruled(own)]


def agreements(part: Any) -> Row:
    """Means over codebooks with their bootstrap, the worst draw, and the wrong moments by who knows the condition."""
    row: Row = {}
    for name in ("agreement", "agreement_avoid", "agreement_distinct"):
        known = part.dropna(subset=name)
        if len(known):
            means = known.groupby("codebook")[name].mean()
            row |= {**mean(name, means), f"{name}_worst": known[name].min()}
            row |= {f"{name}_codebook_low": means.min(), f"{name}_codebook_high": means.max()}
    columns = [*(f"wrong_{who}" for who in KNOWERS), "alone", "corrections"]
    return row | {name: part[name].mean() for name in columns if name in part and part[name].notna().any()}


def reasons(own: pd.DataFrame) -> list[Row]:
    """For each kind of condition: how many moments and wrong moments, and what each program adds to the lead."""
    weights, wrong = own["count"], ~own.right.astype(bool)
    rows: list[Row] = []
    for who in KNOWERS:
        part = own.loc[own.knowers == who]
        if not len(part):
            continue
        count = part["count"]
        row: Row = {"part": "reason", "knowers": who, "moments": count.sum() / weights.sum()}
        row["wrong_share"] = (count * wrong[part.index]).sum() / max((weights * wrong).sum(), 1)
        for name, values in {
            "right": part.right.astype(float),
            "predicted": part.predicted.astype(float),
            "right_joint": part.right_joint.astype(float),
            **{name: part[name] for name in ("own", "rival", "bystander", "lead")},
        }.items():
            row[name] = (values * count).sum() / count.sum()
        # How much the draw of the codebooks moves what bystanders add to one condition.
        groups = part.groupby(["cell", "avoid"])
        spread = groups.bystander.std(ddof=0)
        size = groups["count"].sum()
        row["bystander_spread"] = (spread * size).sum() / size.sum()
        changes = groups.right.agg(lambda values: float(values.astype(bool).nunique() > 1))
        row["undecided"] = (changes * size).sum() / size.sum()
        rows.append(row)
    return rows


def overruled(own: Any) -> list[Row]:
    """Of the wrong moments: the behaviour whose rule fires, the one that speaks most against it, and their share."""
    wrong = own.loc[~own.right.astype(bool)]
    groups = wrong.groupby(["knowers", "owner", "against"])["count"].sum().sort_values(ascending=False)
    total = max(wrong["count"].sum(), 1)
    return [
        {"part": "overruled", "knowers": who, "owner": owner, "against": against, "wrong_share": count / total}
        for (who, owner, against), count in groups.items()
    ]


def headline(outcome: Outcome) -> str:
    """What a plain sum loses, what joint samples give back, and which rule adds best."""
    rules = {(row["learner"], row["how"]): row for row in outcome.table if row["part"] == "rules"}
    repairs = [row for row in outcome.table if row["part"] == "repair" and row["source"] == outcome.settings.sources[0]]
    words = []
    if repairs:
        first, last = (end(repairs, key=lambda row: row["joint"]) for end in (min, max))
        best = max((row for row in repairs if row["joint"] == last["joint"]), key=lambda row: row["agreement"])
        words.append(
            f"{best['joint']} joint samples bring the plain sum from {first['agreement']:.3f} to "
            f"{best['agreement']:.3f} agreement ({best['repair']})"
        )
    for how, what in (("sum", "in a plain sum"), ("silent_sum", "with silence")):
        found = [row for (_, kind), row in rules.items() if kind == how]
        if found:
            best = max(found, key=lambda row: row["agreement"])
            joint = rules[best["learner"], "joint"]
            words.append(
                f"{what} `{best['learner']}` adds best, {best['agreement']:.3f} (jointly {joint['agreement']:.3f})"
            )
    return f"{'; '.join(words)[:1].upper()}{'; '.join(words)[1:]}." if words else ""


def numbers(row: Mapping[str, Any]) -> str:
    """Agreement, where the teacher avoids, and the worst draw there, as text."""
    avoid, worst = row.get("agreement_avoid"), row.get("agreement_avoid_worst")
    return f"{row['agreement']:.3f}" + ("" if avoid is None else f" ({avoid:.3f}; {worst:.3f})")


VALUE = Column("agreement", format=numbers)
CAPTION = "Agreement with the teacher, mean over codebooks; in brackets where it avoids an obstacle: mean; worst draw."


def shown(outcome: Outcome) -> list[Table]:
    """The tables of all parts."""
    rows = {
        name: [row for row in outcome.table if row["part"] == name]
        for name in ("rules", "repair", "reason", "overruled")
    }
    found = []
    if rows["rules"]:
        how = Column("how", format=lambda row: HOWS[row["how"]])
        found.append(pivot("Learned apart and added, by rule", rows["rules"], [Column("learner")], how, VALUE, CAPTION))
    way = Column("repair", format=lambda row: f"{row['repair']}, {row['source']}")
    joint = Column("joint", "joint samples")
    found.append(pivot("The plain sum, trained further", rows["repair"], [joint], way, VALUE, CAPTION))
    return [*found, REASON.show(rows["reason"]), OVERRULED.show(rows["overruled"])]


REASON = Table("Why the plain sum is wrong: moments by who was shown their condition", [
    Column("knowers", "condition", lambda row: WHO[row["knowers"]]),
    Column("moments", format=".3f", about="share of the held-out moments"),
    Column("wrong_share", "of the wrong", ".3f", about="share of the moments that the sum answers wrongly"),
    Column("right", format=".3f", about="share of these moments that the sum answers as the teacher does"),
    Column("predicted", format=".3f", about="the same, predicted from the scores of each program alone"),
    Column("right_joint", "jointly", ".3f", about="the same for one program learned from all demonstrations"),
    Column("own", format="+.2f", about="mean lead of the teacher's command in the program of the right behaviour"),
    Column("rival", format="+.2f", about="what others that know the condition add to it"),
    Column("bystander", format="+.2f", about="what others that do not know it add to it"),
    Column("bystander_spread", "its spread", ".2f", about=(
        "standard deviation of that over the codebooks, in one condition"
    )),
    Column("undecided", format=".3f", about="share of moments that are right with one draw of the codebooks and wrong "
                                            "with another"),
])  # fmt: skip
OVERRULED = Table("Who overrules whom in the plain sum", [
    Column("knowers", "condition", lambda row: WHO[row["knowers"]]),
    Column("owner", "whose rule fires"),
    Column("against", "who adds least to its lead"),
    Column("wrong_share", "of the wrong", ".3f", about="share of the moments that the sum answers wrongly"),
])  # fmt: skip
