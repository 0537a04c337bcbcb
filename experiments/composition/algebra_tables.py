"""The tables of the study of algebra, and the numbers that they are made of."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pandas as pd

from experiments.kit import Column, Outcome, Row, Table, aggregated
from experiments.kit.intervals import mean


def removed(own: pd.DataFrame) -> list[Row]:
    """In how many codebooks what is left is exact."""
    return [{"codebooks": len(own), "exact": int(own.exact.astype(bool).sum())}]


def mirrors(own: pd.DataFrame) -> list[Row]:
    """The agreement of each program on each side."""
    rows: list[Row] = []
    groups: Any = own.groupby("program", sort=False)
    for program, part in groups:
        row: Row = {"program": program}
        for side in ("left", "right", "both"):
            row |= mean(side, part[side])
        rows.append(row)
    return rows


def recognised(own: pd.DataFrame) -> list[Row]:
    """The share recognised by the number of steps."""
    columns = {"sequences": ("sequences", "sum")}
    shares = ("recognised", "ceiling", "where_one_is_left")
    columns |= {name: (name, "mean") for name in shares if name in own}
    columns |= {"recognised_low": ("recognised", "min"), "recognised_high": ("recognised", "max")}
    rows = aggregated(own, ["steps"], columns)
    return [row | {name: int(row[name]) for name in ("steps", "sequences")} for row in rows]


def distances(own: pd.DataFrame) -> list[Row]:
    """The rank correlation of distance and disagreement: its mean over the codebooks, lowest and highest."""
    from scipy.stats import spearmanr  # takes half a second to load

    keys = ["readings", "rule", "shown", "codebook"]
    groups: Any = own.groupby(keys, sort=False)
    ranked: list[Row] = []
    for key, part in groups:
        found: Any = spearmanr(part.distance, part.disagreement)
        ranked.append({**dict(zip(keys, key, strict=True)), "pairs": len(part), "spearman": float(found.statistic)})
    columns = {"pairs": ("pairs", "min"), "spearman": ("spearman", "mean")}
    columns |= {"spearman_low": ("spearman", "min"), "spearman_high": ("spearman", "max")}
    return aggregated(pd.DataFrame(ranked), keys[:3], columns)


def switched(own: pd.DataFrame) -> list[Row]:
    """The weights of each codebook."""
    numbers: Any = own[["codebook", "readings_apart", "measured", "predicted"]]
    rows: list[Row] = numbers.to_dict("records")
    for row in rows:
        row |= {name: int(row[name]) for name in ("codebook", "readings_apart")}
        row["error"] = abs(row["measured"] - row["predicted"])
    return rows


SUMMARISED: dict[str, Callable[[pd.DataFrame], list[Row]]] = {
    "removal": removed,
    "mirror": mirrors,
    "distance": distances,
    "recognition": recognised,
    "interpolation": switched,
}


def headline(outcome: Outcome) -> str:
    """One number for each operation."""
    rows: dict[str, list[Row]] = {}
    for row in outcome.table:
        rows.setdefault(row["operation"], []).append(row)
    words = []
    if "removal" in rows:
        (row,) = rows["removal"]
        words.append(f"removal is exact with {row['exact']} of {row['codebooks']} codebooks")
    if "mirror" in rows:
        shares = {row["program"]: row["right"] for row in rows["mirror"]}
        words.append(f"on the side that was never shown the mirrored sum agrees in {shares['sum']:.3f}")
    if "recognition" in rows:
        row = max(rows["recognition"], key=lambda row: row["steps"])
        of = f"{row['steps']} steps tell {row['recognised']:.3f} of behaviours"
        words.append(f"{of} (the true rules {row['ceiling']:.3f})")
    if "interpolation" in rows:
        worst = max(row["error"] for row in rows["interpolation"])
        words.append(f"the switching weight is predicted within {worst:.3f}")
    return f"{'; '.join(words).capitalize()}." if words else ""


def tables(outcome: Outcome) -> list[Table]:
    """A table for each operation."""
    return [
        TABLES[operation].show([row for row in outcome.table if row["operation"] == operation])
        for operation in outcome.settings.operations
    ]


def agreement(side: str, about: str) -> Column:
    """A column of agreement."""
    return Column(side, format=".3f", interval=(f"{side}_low", f"{side}_high"), about=about)


TABLES = {
    "removal": Table("Removal: (a + b + c) - b", [Column("codebooks"), Column("exact", about=(
        "codebooks with which it equals a + c bit for bit, whichever of the three is removed"
    ))]),
    "mirror": Table("Mirror images of a program that never saw the lamp on the right only", [
        Column("program"),
        agreement("left", "agreement with the teacher where the lamp is seen on the left only, as it was shown"),
        agreement("right", "on the right only, which was never shown"),
        agreement("both", "on both sides, as it was shown"),
    ]),
    "distance": Table("Distance of programs and disagreement of the rules", [
        Column("readings", about="uniform over the sensors' ranges, or driven: from runs of the teacher"),
        Column("rule"),
        Column("shown", about="whether all variants learn from the same readings, or each from its own"),
        Column("pairs"),
        Column("spearman", "rank correlation", ".3f", ("spearman_low", "spearman_high"), about=(
            "of distance and disagreement over all pairs; mean over codebooks [lowest, highest]"
        )),
    ]),
    "recognition": Table("Which behaviour is a robot running?", [
        Column("steps", about="random control steps of one episode that are seen"),
        Column("sequences"),
        Column("recognised", format=".3f", interval=("recognised_low", "recognised_high"), about=(
            "share of the sequences whose behaviour is found; mean over codebooks [lowest, highest]"
        )),
        Column("ceiling", format=".3f", about="what the true rules could tell"),
        Column("where_one_is_left", "one left", ".3f", about="share found where only one rule agrees with all steps"),
    ]),
    "interpolation": Table("Where (1 - w) * seek + w * flee changes over", [
        Column("codebook"),
        Column("readings_apart", "readings", about="at which the two disagree"),
        Column("measured", format=".3f", about="least weight, in steps of .005, that has left seek in half of them"),
        Column("predicted", format=".3f", about="by the leads of both, without building a sum"),
        Column("error", format=".3f"),
    ]),
}  # fmt: skip
