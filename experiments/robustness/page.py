"""The page of the damage study: how much of each behaviour is left, in figures, tables and words."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from experiments.kit import Column, Outcome, Page, Row, Study, Table
from experiments.kit.figures import BLUE, GREEN, ORANGE, PURPLE, VERMILION, legend_below, lines
from experiments.robustness.damage import DAMAGES, PARAMETERS, PARTS

LOOKS = {
    "default": (BLUE, "o"),
    "one_shot": (VERMILION, "^"),
    "hand_written": (GREEN, "s"),
    "mlp": (ORANGE, "D"),
    "decision_tree": (PURPLE, "v"),
}
MEASURES = {"agreement": "agreement with the teacher", "success_rate": "success rate"}
BOUNDS = {"agreement": ("agreement_min", "agreement_max"), "success_rate": ("success_low", "success_high")}
CAPTIONS = {
    "agreement": "Lines: mean over the draws of the damage. Bands: lowest to highest draw. Dashed: no hypervectors; "
    "the share is of their parameters, and the same curve is in each row.",
    "success_rate": "Dots: share of episodes that succeed. Bars: Wilson's 95 % interval. Dashed: no hypervectors.",
}
SERIES = [Column("learner"), Column("part"), Column("damage")]
METHOD = (
    "Program: the d numbers of the raw sum that was learned. Codebooks: the table of role-bound sensor values and the "
    "stored results; conditions are encoded with the damaged table and the clean-up compares with the damaged "
    "results, while the program was learned with undamaged ones. Query: the encoded condition, damaged anew for each "
    "condition, the same one always in the same way.",
    "Learners without hypervectors are compared with them. MLP: weights and biases alike. Decision tree: thresholds "
    "(flipped: mirrored within the sensor's range; zero: its low end) and the decisions of its leaves (flipped: "
    "another command wins; zero: the first command). Noise is relative to the root mean square of the layer, or of "
    "all thresholds, or of all leaves.",
    "Damaged elements are drawn without replacement; a larger share damages those of a smaller one and more. "
    "Agreement: share of held-out samples, before the lamp was reached, on which the commands are the teacher's. "
    "Success: share of held-out starts from which the damaged robot reaches the lamp and stays; the draws of one "
    "damage share the starts, and the interval (Wilson's, 95 %) takes the episodes as independent.",
)


def fill(page: Page, outcome: Outcome, study: Study) -> None:
    """Figures, what is survived, and all numbers."""
    settings, table = outcome.settings, of_learners(outcome)
    section = page.section("What is left")
    section.text(
        f"A growing share of a learned controller's elements is damaged, up to {max(settings.shares):.0%}, and nothing "
        f"is learned again. Each share is drawn {settings.draws} times; noise has a standard deviation of "
        f"{settings.noise:g} root mean squares of what it is added to.",
        *answers(table, settings.kept),
    )
    measures, data = measured(table), pd.DataFrame(table)
    for measure in measures:
        draw = partial(curves, table, [measure], settings.noise)
        section.figure(measure, draw, f"{MEASURES[measure]} against the damaged share", CAPTIONS[measure], data)
    if len(measures) > 1:
        draw, alt = partial(curves, table, measures, settings.noise), "agreement and success against the damaged share"
        section.figure("robustness", draw, alt, "Both measures in one figure.", data)
    section = page.section("Shares that are survived")
    section.table(survival_table(table, settings.kept))
    section.table(sizes(outcome))
    page.section("How it was measured").text(*METHOD)
    section = page.section("All numbers")
    for found in study.shown(outcome):
        section.table(found)
    section.table(ALL.show(outcome.table))


def of_learners(outcome: Outcome) -> list[Row]:
    """The rows of the table without the teacher's, which has no part that could be damaged."""
    return [row for row in outcome.table if "part" in row]


def measured(table: Sequence[Row]) -> list[str]:
    """The measures that the table has: success, only if some robot drove."""
    return [measure for measure in MEASURES if any(row[measure] is not None for row in table)]


def series(table: Sequence[Row]) -> dict[tuple[str, str, str], list[Row]]:
    """The rows of each learner, part and damage, with rising shares."""
    found: dict[tuple[str, str, str], list[Row]] = {}
    for row in table:
        found.setdefault((row["learner"], row["part"], row["damage"]), []).append(row)
    return found


def survival(table: Sequence[Row], kept: float) -> list[Row]:
    """For each learner, part and damage: the largest share up to which `kept` of each measure is left.

    None where the measure was not taken on damaged elements, or was 0 without damage.
    """
    return [
        {"learner": learner, "part": part, "damage": damage}
        | {measure: _survives([(row["share"], row[measure]) for row in rows], kept) for measure in MEASURES}
        for (learner, part, damage), rows in series(table).items()
    ]


def _survives(points: Sequence[tuple[float, float | None]], kept: float) -> float | None:
    known = [(share, value) for share, value in points if value is not None]
    if len(known) < 2 or known[0][1] == 0 or known[0][0] != 0:
        return None
    survived = 0.0
    for share, value in known[1:]:
        if value < kept * known[0][1]:
            break
        survived = share
    return survived


def answers(table: Sequence[Row], kept: float) -> list[str]:
    """One sentence for each measure and kind of damage, from the numbers alone."""
    rows = survival(table, kept)
    sentences = []
    for measure, name in (("agreement", "agreement"), ("success_rate", "success")):
        for damage in dict.fromkeys(row["damage"] for row in rows):
            known = [row for row in rows if row["damage"] == damage and row[measure] is not None]
            known.sort(key=lambda row: -row[measure])
            listed = ", ".join(f"`{row['learner']}` {row['part']} {row[measure]:.0%}" for row in known)
            if known:
                largest = f"the largest share that leaves {kept:.0%} of the {name}"
                sentences.append(f"{DAMAGES[damage].capitalize()}, {largest}: {listed}.")
    return sentences


def headline(outcome: Outcome) -> str:
    """What the first kind of damage leaves of the agreement."""
    return next(iter(answers(of_learners(outcome), outcome.settings.kept)), "")


def survival_table(table: Sequence[Row], kept: float) -> Table:
    """The shares that are survived, as a table."""
    columns = [Column(measure, f"{name.split(' with')[0]} kept up to", ".0%") for measure, name in MEASURES.items()]
    caption = (
        f"The largest share measured up to which at least {kept:.0%} of the undamaged value is left at every share."
    )
    return Table("Shares that are survived", [*SERIES, *columns], caption).show(survival(table, kept))


def sizes(outcome: Outcome) -> Table:
    """How many elements there are, by learner and part."""
    ends = ".elements"
    found = [(name.removesuffix(ends), size) for name, size in outcome.metrics.items() if name.endswith(ends)]
    rows = [{"part": name, "elements": int(size or 0)} for name, size in sorted(found)]
    return Table("Sizes", [Column("part"), Column("elements")], "How much there is to damage.").show(rows)


def tables(outcome: Outcome) -> list[Table]:
    """Agreement, and success where robots drove, with a column for each share."""
    table = of_learners(outcome)
    return [by_share(table, measure) for measure in measured(table)]


def by_share(table: Sequence[Row], measure: str) -> Table:
    """One measure, in per cent, of each learner, part and damage, by share."""
    rows = []
    for (learner, part, damage), found in series(table).items():
        values = {f"{row['share']:g}": row[measure] for row in found if row[measure] is not None}
        rows.append({"learner": learner, "part": part, "damage": damage, **values})
    shares = dict.fromkeys(f"{row['share']:g}" for row in table)
    columns = [Column(share, format=partial(_percent, share)) for share in shares]
    return Table(f"{MEASURES[measure]} (%), by share of damaged elements", [*SERIES, *columns]).show(rows)


def _percent(key: str, row: Any) -> str:
    return f"{100 * row[key]:.1f}" if key in row else "-"


ALL = Table(
    "All numbers",
    [
        *SERIES,
        Column("share", format="g"),
        Column("agreement", interval=("agreement_min", "agreement_max"), about="mean over the draws [lowest, highest]"),
        Column("success_rate", interval=("success_low", "success_high"), about="with Wilson's 95 % interval"),
        Column("episodes"),
    ],
)


def curves(table: Sequence[Row], measures: Sequence[str], noise: float) -> Figure:
    """Each measure against the share of damaged elements: a row for each part, a column for each damage."""
    frame = pd.DataFrame(table)
    parts = [part for part in frame.part.unique() if part != PARAMETERS] or [PARAMETERS]
    damages, learners = frame.damage.unique(), list(frame.learner.unique())
    panels = [(measure, part) for measure in measures for part in parts]
    size = 1.2 + 2.9 * len(damages), 0.9 + 2.05 * len(panels)
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(len(panels), len(damages), sharex=True, sharey=True, squeeze=False)
    for row, (measure, part) in zip(grid, panels, strict=True):
        for axes, damage in zip(row, damages, strict=True):
            here = frame.loc[(frame.damage == damage) & frame.part.isin([part, PARAMETERS]) & frame[measure].notna()]
            low, high = BOUNDS[measure]
            lines(
                axes, here.astype({measure: float, low: float, high: float}), "share", measure, "learner",
                order=learners, low=low, high=high, fixed=LOOKS, dashed=("mlp", "decision_tree"),
                apart=0.005 if measure == "success_rate" else 0.0,
            )  # fmt: skip
            axes.set(ylim=(-0.04, 1.04), xlabel="share of damaged elements", ylabel="")
            for axis in (axes.xaxis, axes.yaxis):
                axis.set_major_formatter(PercentFormatter(1))
        row[0].set_ylabel(f"damage to\n{PARTS.get(part, 'the parameters')}\n\n{MEASURES[measure].split(' with')[0]}")
    for axes, damage in zip(grid[0], damages, strict=True):
        axes.set_title(DAMAGES[damage] + (f" ({noise:g} rms)" if damage == "noise" else ""))
    legend_below(figure, grid[0, 0], len(learners))
    return figure
