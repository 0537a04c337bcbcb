"""The report of the damage study: how much of each behaviour is left, in figures, tables and words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from behaviours.storage import write_atomically
from experiments.corral_tables import number
from experiments.figures import BLUE, GREEN, GREY, ORANGE, STYLE, VERMILION, png
from experiments.report import Page
from experiments.results import Results, Row

LOOKS = {
    "default": (BLUE, "-", "o"),
    "one_shot": (VERMILION, "-", "^"),
    "hand_written": (GREEN, "-", "s"),
    "mlp": (ORANGE, "--", "D"),
    "decision_tree": ("#7B5EA7", "--", "v"),
}
"""Colour, line and marker of each learner; dashed where no hypervectors are at work."""

PARTS = {
    "program": "the program",
    "codebooks": "the codebooks",
    "query": "the query",
    "parameters": "the parameters",
}
DAMAGES = {"flip": "sign flipped", "zero": "set to zero", "noise": "Gaussian noise added"}
MEASURES = {"agreement": "agreement with the teacher (%)", "success_rate": "success rate (%)"}
SHORT = {"agreement": "agreement (%)", "success_rate": "success (%)"}


def write_report(folder: Path, results: Results) -> Path:
    """Write `report.html` and its figures under `figures/`."""
    config, table = results.config, results.table
    (folder / "figures").mkdir(exist_ok=True)
    page = Page("Robustness: what is left of a damaged behaviour", lead(config))
    section = page.section("What is left")
    section.text(*answers(table, config["kept"]))
    measures = [measure for measure in MEASURES if any(row[measure] is not None for row in table)]
    for measure in measures:
        content = png(curves(table, [measure], config["noise"]))
        write_atomically(folder / "figures" / f"{measure}.png", content)
        section.picture(content, f"{MEASURES[measure]} against the share of damaged elements", CAPTIONS[measure])
    write_atomically(folder / "figures" / "robustness.png", png(curves(table, measures, config["noise"]), dpi=100))
    survived = page.section("Shares that are survived")
    rows = survival(table, config["kept"])
    columns = ["learner", "part", "damage", *(f"{MEASURES[measure].split(' (')[0]} kept up to" for measure in measures)]
    survived.table(
        columns,
        [[row["learner"], row["part"], row["damage"], *(_share(row[measure]) for measure in measures)] for row in rows],
        f"The largest share measured up to which at least {config['kept']:.0%} of the undamaged value is left at every "
        "share.",
    )
    sizes = sorted(
        {
            (name.removesuffix(".elements"), int(size or 0))
            for name, size in results.metrics.items()
            if name.endswith(".elements")
        }
    )
    survived.table(["part", "elements"], [[name, number(size)] for name, size in sizes], "How much there is to damage.")
    page.section("How it was measured").text(*METHOD)
    numbers = page.section("All numbers")
    numbers.table(list(table[0]), [[_cell(value) for value in row.values()] for row in table])
    page.how_to_reproduce(config)
    return page.write(folder / "report.html")


def lead(config: Mapping[str, Any]) -> str:
    """What this page is about, in two sentences."""
    return (
        f"A growing share of a learned controller's elements is damaged, up to {max(config['shares']):.0%}, and "
        f"nothing is learned again. Each share is drawn {config['draws']} times; noise has a standard deviation of "
        f"{config['noise']:g} root mean squares of what it is added to."
    )


METHOD = (
    "Program: the d numbers of the raw sum that was learned. Codebooks: the table of role-bound sensor values and the "
    "stored results; conditions are encoded with the damaged table and the clean-up compares with the damaged "
    "results, while the program was learned with undamaged ones. Query: the encoded condition, damaged anew for each "
    "condition, the same one always in the same way.",
    "Beside them stand learners without hypervectors. MLP: weights and biases alike. Decision tree: thresholds "
    "(flipped: mirrored within the sensor's range; zero: its low end) and the decisions of its leaves (flipped: "
    "another command wins; zero: the first command). Noise is relative to the root mean square of the layer, or of "
    "all thresholds, or of all leaves.",
    "Damaged elements are drawn without replacement; a larger share damages those of a smaller one and more. "
    "Agreement: share of held-out samples, before the lamp was reached, on which the commands are the teacher's. "
    "Success: share of held-out starts from which the damaged robot reaches the lamp and stays; the draws of one "
    "damage share the starts, and the interval (Wilson's, 95 %) takes the episodes as independent.",
)
CAPTIONS = {
    "agreement": "Lines: mean over the draws of the damage. Bands: lowest to highest draw. Dashed: no hypervectors; "
    "the share is of their own parameters, and the same curve stands in each row.",
    "success_rate": "Dots: share of episodes that succeed. Bars: Wilson's 95 % interval. Dashed: no hypervectors.",
}


def survival(table: Sequence[Row], kept: float) -> list[Row]:
    """For each learner, part and damage: the largest share up to which `kept` of each measure is left.

    None where the measure was not taken on damaged elements, or was 0 without damage.
    """
    rows = []
    for learner, part, damage in dict.fromkeys((row["learner"], row["part"], row["damage"]) for row in table):
        own = _series(table, learner, part, damage)
        rows.append(
            {"learner": learner, "part": part, "damage": damage}
            | {measure: _survives([(row["share"], row[measure]) for row in own], kept) for measure in MEASURES}
        )
    return rows


def _survives(points: Sequence[tuple[float, float | None]], kept: float) -> float | None:
    measured = [(share, value) for share, value in points if value is not None]
    if len(measured) < 2 or measured[0][1] == 0 or measured[0][0] != 0:
        return None
    survived = 0.0
    for share, value in measured[1:]:
        if value < kept * measured[0][1]:
            break
        survived = share
    return survived


def answers(table: Sequence[Row], kept: float) -> list[str]:
    """One sentence for each kind of damage and part, from the numbers alone."""
    rows = survival(table, kept)
    sentences = []
    for measure, name in (("agreement", "agreement"), ("success_rate", "success")):
        for damage in dict.fromkeys(row["damage"] for row in rows):
            own = [row for row in rows if row["damage"] == damage and row[measure] is not None]
            if own:
                own.sort(key=lambda row: -row[measure])
                listed = ", ".join(f"`{row['learner']}` {row['part']} {_share(row[measure])}" for row in own)
                largest = f"the largest share that leaves {kept:.0%} of the {name}"
                sentences.append(f"{DAMAGES[damage].capitalize()}, {largest}: {listed}.")
    return sentences


def curves(table: Sequence[Row], measures: Sequence[str], noise: float) -> Figure:
    """Each measure against the share of damaged elements: a row for each part, a column for each damage."""
    parts = [part for part in dict.fromkeys(row["part"] for row in table) if part != "parameters"] or ["parameters"]
    damages = list(dict.fromkeys(row["damage"] for row in table))
    with matplotlib.rc_context(STYLE):
        lines = len(parts) * len(measures)
        figure = Figure(figsize=(1.2 + 2.9 * len(damages), 0.9 + 2.05 * lines), layout="constrained")
        grid = figure.subplots(lines, len(damages), sharex=True, sharey=True, squeeze=False)
        for line, (measure, part) in enumerate((m, p) for m in measures for p in parts):
            for axes, damage in zip(grid[line], damages, strict=True):
                for place, learner in enumerate(dict.fromkeys(row["learner"] for row in table)):
                    own = _series(table, learner, part, damage) or _series(table, learner, "parameters", damage)
                    _curve(axes, [row for row in own if row[measure] is not None], measure, learner, place)
                axes.set_ylim(-4, 104)
                axes.set_yticks(range(0, 101, 25))
                axes.grid()
            grid[line, 0].set_ylabel(f"damage to\n{PARTS[part]}\n\n{SHORT[measure]}")
        for axes, damage in zip(grid[0], damages, strict=True):
            axes.set_title(DAMAGES[damage] + (f" ({noise:g} rms)" if damage == "noise" else ""))
        for axes in grid[-1]:
            axes.set_xlabel("share of damaged elements (%)")
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(
            handles, [label.replace("_", " ") for label in labels], loc="outside lower center", ncols=len(labels)
        )
    return figure


def _curve(axes: Axes, rows: Sequence[Row], measure: str, learner: str, place: int) -> None:
    colour, line, marker = LOOKS.get(learner, (GREY, "-", "o"))
    low, high = ("agreement_min", "agreement_max") if measure == "agreement" else ("success_low", "success_high")
    shares, middle, bottom, top = (
        100 * np.array([row[column] for row in rows], dtype=float) for column in ("share", measure, low, high)
    )
    if measure == "agreement":
        axes.fill_between(shares, bottom, top, color=colour, alpha=0.15, linewidth=0)
    else:
        shares = shares + 0.5 * (place - 2)  # side by side, so that no interval hides another
        axes.vlines(shares, bottom, top, color=colour, alpha=0.4, linewidth=2)
    axes.plot(shares, middle, color=colour, linestyle=line, marker=marker, markersize=4, linewidth=1.4, label=learner)


def print_table(results: Results, console: Console) -> None:
    """Agreement and success against the share, rounded, for the terminal."""
    for measure, title in MEASURES.items():
        rows = [row for row in results.table if row[measure] is not None]
        if not rows:
            continue
        shares = list(dict.fromkeys(row["share"] for row in rows))
        table = Table(title=f"{title}, by share of damaged elements")
        for name in ("learner", "part", "damage"):
            table.add_column(name, no_wrap=True)
        for share in shares:
            table.add_column(f"{share:g}", justify="right", no_wrap=True)
        for learner, part, damage in dict.fromkeys((row["learner"], row["part"], row["damage"]) for row in rows):
            own = _series(rows, learner, part, damage)
            table.add_row(learner, part, damage, *(f"{100 * row[measure]:.1f}" for row in own))
        console.print(table)


def _series(table: Sequence[Row], learner: str, part: str, damage: str) -> list[Row]:
    return [row for row in table if (row["learner"], row["part"], row["damage"]) == (learner, part, damage)]


def _share(share: float | None) -> str:
    return "\u2013" if share is None else f"{share:.0%}"


def _cell(value: object) -> str:
    if isinstance(value, float) or value is None:
        return number(value)
    return str(value)
