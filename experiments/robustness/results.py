"""What the damage study shows: curves, the shares that are survived, and each measure by share."""

from collections.abc import Sequence
from typing import Any

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from experiments.kit import Column, Drawing, Outcome, Row, Table, pivot
from experiments.kit.figures import BLUE, GREEN, ORANGE, PURPLE, VERMILION, by_measure, legend_below, panels
from experiments.models.damage import DAMAGES, PARAMETERS, PARTS
from experiments.tasks import in_bullet

LOOKS = {
    "default": (BLUE, "o"),
    "one_shot": (VERMILION, "^"),
    "hand_written": (GREEN, "s"),
    "mlp": (ORANGE, "D"),
    "decision_tree": (PURPLE, "v"),
}
MEASURES = {
    "agreement": ("agreement", "agreement_min", "agreement_max"),
    "success": ("success_rate", "success_low", "success_high"),
}
KEYS = ["learner", "part", "damage"]


def survival(table: Sequence[Row], kept: float) -> list[Row]:
    """For each learner, part and damage: the largest share up to which `kept` of each measure is left.

    None where the measure was not taken on damaged elements, or was 0 without damage.
    """
    series: Any = pd.DataFrame(table).groupby(KEYS, sort=False)
    return [
        dict(zip(KEYS, case, strict=True)) | {value: _survived(group, value, kept) for value, *_ in MEASURES.values()}
        for case, group in series
    ]


def _survived(group: pd.DataFrame, column: str, kept: float) -> float | None:
    known = group.dropna(subset=column).astype({column: float})
    if len(known) < 2 or known.share.iloc[0] != 0 or known[column].iloc[0] == 0:
        return None
    left = known[column] >= kept * known[column].iloc[0]
    return float(known.share[left.cummin()].max())


def headline(outcome: Outcome) -> str:
    """What the first kind of damage leaves of the agreement."""
    rows = survival(outcome.table, outcome.settings.kept)
    damage = rows[0]["damage"]
    known = [row for row in rows if row["damage"] == damage and row["agreement"] is not None]
    known.sort(key=lambda row: -row["agreement"])
    listed = ", ".join(f"`{row['learner']}` {row['part']} {row['agreement']:.0%}" for row in known)
    if not listed:
        return ""
    kept = f"the largest share that leaves {outcome.settings.kept:.0%} of the agreement"
    return f"{DAMAGES[damage].capitalize()}, {kept}: {listed}."


def tables(outcome: Outcome) -> list[Table]:
    """What is survived, and each measure that was taken, with a column for each share."""
    rows = [row for row in outcome.table if "part" in row]
    kept, sizes = outcome.settings.kept, outcome.metrics
    survived = [
        row | {"elements": int(sizes[f"{row['learner']}.{row['part']}.elements"] or 0)} for row in survival(rows, kept)
    ]
    columns = [
        *map(Column, KEYS),
        Column("elements", about="how much there is to damage"),
        Column("agreement", "agreement kept up to", ".0%"),
        Column("success_rate", "success kept up to", ".0%"),
    ]
    about = f"The largest share measured up to which at least {kept:.0%} of the undamaged value is left at every share."
    found = [Table("Shares that are survived", columns, about).show(survived)]
    keys = [Column(key) for key in KEYS]
    for name, (value, *_) in MEASURES.items():
        title, about = f"{name} (%), by share of damaged elements", "Mean over the draws; the figure shows intervals."
        taken = [row for row in rows if row[value] is not None]
        shown = Column(value, format=lambda row, value=value: f"{100 * row[value]:.1f}")
        found += [pivot(title.capitalize(), taken, keys, Column("share", format="g"), shown, about)] if taken else []
    about = "The first `bullet_starts` and `wheeled_starts` starts of `bullet_learners`."
    undamaged = {row["learner"]: row | {"part": None, "damage": None} for row in rows if not row["share"]}
    driven = [*undamaged.values(), *(row for row in rows if row["share"])]
    return found + in_bullet.tables([*keys, Column("share", format="g")], driven, about)


def curves(outcome: Outcome) -> Figure:
    """Each measure against the share of damaged elements: a row for each part, a column for each damage."""
    frame = by_measure([row for row in outcome.table if "part" in row], MEASURES)
    # Learners without hypervectors are compared with each part of those that have them.
    parts = [part for part in frame.part.unique() if part != PARAMETERS] or [PARAMETERS]
    each = [frame[frame.part.isin([part, PARAMETERS])].assign(part=part) for part in parts]
    frame = pd.concat(each).sort_values("measure", kind="stable")
    frame["row"] = "damage to\n" + frame.part.map({**PARTS, PARAMETERS: "the parameters"}) + "\n\n" + frame.measure
    frame["title"] = frame.damage.map({**DAMAGES, "noise": f"{DAMAGES['noise']} ({outcome.settings.noise:g} rms)"})
    frame = frame.rename(columns={"share": "share of damaged elements"})
    looks: Any = {"order": outcome.settings.learners, "fixed": LOOKS, "dashed": ("mlp", "decision_tree")}
    figure, _ = panels(frame, "share of damaged elements", "learner", "row", "title", (2.9, 2.05), apart=0.005, **looks)
    for axes in figure.axes:
        axes.set_ylim(-0.04, 1.04)
        axes.xaxis.set_major_formatter(PercentFormatter(1))
        axes.yaxis.set_major_formatter(PercentFormatter(1))
    legend_below(figure)
    return figure


FIGURE = Drawing(
    "robustness",
    curves,
    "agreement and success against the damaged share",
    "Agreement: mean over the draws of the damage, bars from the lowest to the highest draw. Success: share of the "
    "episodes that succeed, bars are Wilson's 95 % interval. Dashed: no hypervectors; the share is of their "
    "parameters, and the same curve is in each row.",
    lambda outcome: pd.DataFrame(outcome.table),
)
METHOD = """
A growing share of a learned controller's elements is damaged, and nothing is learned again. Each share is drawn `draws`
times; noise has a standard deviation of `noise` root mean squares of what it is added to.

Program: the d numbers of the raw sum that was learned. Codebooks: the table of role-bound sensor values and the stored
results; conditions are encoded with the damaged table and the clean-up compares with the damaged results, while the
program was learned with undamaged ones. Query: the encoded condition, damaged anew for each condition, the same one
always in the same way.

Learners without hypervectors are compared with them. MLP: weights and biases alike. Decision tree: thresholds
(flipped: mirrored within the sensor's range; zero: its low end) and the decisions of its leaves (flipped: another
command wins; zero: the first command). Noise is relative to the root mean square of the layer, or of all thresholds, or
of all leaves.

Damaged elements are drawn without replacement; a larger share damages those of a smaller one and more. Agreement: share
of held-out samples, before the lamp was reached, on which the commands are the teacher's. Success: share of held-out
starts from which the damaged robot reaches the lamp and stays; the draws of one damage share the starts, and the
interval takes the episodes as independent.
"""
