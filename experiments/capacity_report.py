"""The report of the capacity study: how many pairs each learner holds, in figures, a table and words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from behaviours.storage import write_atomically
from experiments.corral_tables import number
from experiments.figures import BLACK, BLUE, GREEN, GREY, ORANGE, PINK, SKY, STYLE, VERMILION, png
from experiments.pairs_held import CLOSED_FORM, LEVELS, RESULTS, SCHEMA, VALUES, expected, recalls
from experiments.report import Page
from experiments.results import Results, Row

LOOKS = {
    "literal": (VERMILION, "v"),
    "OneShot_mean": (ORANGE, "^"),
    "OneShot_sum": (SKY, "s"),
    "OneShot": (GREEN, "o"),
    "LeastSquares": (PINK, "P"),
    "ErrorDriven": ("#7B5EA7", "X"),
    "Gradient_sum": ("#5B6875", "d"),
    "Gradient": (BLUE, "D"),
}
"""Colour and marker of each row."""

COLUMNS = {
    "learner": "learner",
    "dim": "d",
    "pairs": "pairs held (median)",
    "pairs_min": "least",
    "pairs_max": "most",
    "pairs_per_dim": "pairs per dimension",
    "seconds": "training (s)",
}


def write_report(folder: Path, results: Results) -> Path:
    """Write `report.html` and its figure under `figures/`."""
    config, table = results.config, results.table
    (folder / "figures").mkdir(exist_ok=True)
    page = Page("Capacity: how many pairs one hypervector holds", lead(config))
    section = page.section("What fits")
    section.text(*answers(config, table))
    content = png(curves(config, table, results.records))
    write_atomically(folder / "figures" / "capacity.png", content)
    section.picture(
        content,
        "recall against the number of pairs, and pairs held against the dimension",
        "Lines: median over the repeats. Bands and bars: lowest to highest. Dotted: the closed form. A curve on the "
        f"left ends with the first recall below {config['until']:.0%}.",
    )
    section.table(
        list(COLUMNS.values()),
        [[_cell(row[column]) for column in COLUMNS] for row in table],
        f"Pairs held: at least {config['accuracy']:.0%} of them are recalled. Training: median seconds of one thread "
        "for that many.",
    )
    page.section("How it was measured").text(*method(config))
    page.how_to_reproduce(config)
    return page.write(folder / "report.html")


def lead(config: Mapping[str, Any]) -> str:
    """What this page is about, in two sentences."""
    return (
        f"One program is taught random pairs: conditions of {len(SCHEMA.sensors)} sensors of {VALUES} values, all "
        f"distinct, and {RESULTS} results from {len(SCHEMA.actuators)} actuators of {LEVELS} values. A number of pairs "
        f"is held if at least {config['accuracy']:.0%} of them are recalled with both commands."
    )


def answers(config: Mapping[str, Any], table: Sequence[Row]) -> list[str]:
    """What the largest dimension holds, from the numbers alone."""
    dim = max(config["dims"])
    own = sorted((row for row in table if row["dim"] == dim), key=lambda row: -row["pairs"])
    return [f"With d = {dim:,}: " + ", ".join(f"`{row['learner']}` {row['pairs']:,.0f}" for row in own) + " pairs."]


def method(config: Mapping[str, Any]) -> list[str]:
    """How the numbers came about."""
    codes = [
        f"`{row}`: rule `{learner['rule']['name']}`, codes `{learner['codes']}`."
        for row, learner in ((row, config["learners"][row]) for row in config["rows"])
    ]
    return [
        f"Each of {config['repeats']} repeats draws its own pairs and codebooks; fewer pairs are the first of more. "
        "The number held is searched: from a guess up or down by a quarter until one number holds and one fails (with "
        "the largest dimension: along the numbers of the curve), then by halving until they are within "
        f"{config['precision']:.0%}. The smaller one is reported.",
        "The closed form is that of a raw sum of pairs whose conditions are unrelated, asked for the two values of its "
        "results one by one (MAP-I, 2k bound values for k pairs, the best of 3, both to be right). Of the rows, "
        "`OneShot_sum` is nearest to that; conditions that share a shift width resemble each other, which is rare "
        "there and common in `OneShot_mean`. The results of `OneShot` are spaced farther apart than random ones. The "
        "closed form says when the mean recall passes the line; below 100 pairs 99 % means all of one draw, which may "
        "be lucky.",
        " ".join(codes) + " Each names an entry in the settings below.",
    ]


def curves(config: Mapping[str, Any], table: Sequence[Row], records: list[Row]) -> Figure:
    """Recall against the number of pairs with the largest dimension, and pairs held against the dimension."""
    dim = max(config["dims"])
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(10.5, 4.6), layout="constrained")
        left, right = figure.subplots(1, 2)
        for learner in config["rows"]:
            colour, marker = LOOKS.get(learner, (GREY, "o"))
            asked = [pairs for pairs in sorted(config["pairs"]) if recalls(records, learner, dim, pairs)]
            # Repeats end at different numbers: the band is of those that were measured.
            shares = [100 * np.array(recalls(records, learner, dim, pairs)) for pairs in asked]
            low, middle, high = (np.array([at(s) for s in shares]) for at in (np.min, np.median, np.max))
            left.fill_between(asked, low, high, color=colour, alpha=0.15, linewidth=0)
            left.plot(asked, middle, color=colour, marker=marker, markersize=4.5, linewidth=1.4, label=learner)
            own = [row for row in table if row["learner"] == learner]
            dims, held = [row["dim"] for row in own], [row["pairs"] for row in own]
            right.vlines(
                dims,
                [row["pairs_min"] for row in own],
                [row["pairs_max"] for row in own],
                color=colour,
                alpha=0.5,
                linewidth=3,
            )
            right.plot(dims, held, color=colour, marker=marker, markersize=4.5, linewidth=1.4)
        closed = [row for row in table if row["learner"] == CLOSED_FORM]
        right.plot(
            [row["dim"] for row in closed], [row["pairs"] for row in closed], ":", color=BLACK, linewidth=1.6, zorder=5
        )
        counts = np.unique(np.geomspace(min(config["pairs"]), max(config["pairs"]), 80).round()).astype(int).tolist()
        shown = [(count, 100 * expected(dim, count)) for count in counts]
        shown = [(count, share) for count, share in shown if share >= 100 * config["until"]]
        left.plot(*zip(*shown, strict=True), ":", color=BLACK, linewidth=1.6, label="closed form", zorder=5)
        left.axhline(100 * config["accuracy"], color=GREY, linewidth=0.8)
        left.set_xscale("log")
        left.set_ylim(bottom=100 * config["until"] - 8, top=102)
        left.set_xlabel("pairs shown")
        left.set_ylabel("pairs recalled (%)")
        left.set_title(f"recall with d = {dim:,}")
        right.set_xscale("log", base=2)
        right.set_yscale("log")
        right.set_xticks(config["dims"], [f"{d:,}" for d in config["dims"]])
        right.set_xlabel("dimensions d")
        right.set_ylabel(f"pairs recalled at {config['accuracy']:.0%}")
        right.set_title("pairs held")
        for axes in (left, right):
            axes.grid()
            axes.set_axisbelow(True)
        handles, labels = left.get_legend_handles_labels()
        names = [label.replace("_", ", ") for label in labels]
        figure.legend(handles, names, loc="outside lower center", ncols=len(labels))
    return figure


def print_table(results: Results, console: Console) -> None:
    """Pairs held by each learner for each dimension, for the terminal."""
    config = results.config
    table = Table(title=f"pairs recalled at {config['accuracy']:.0%} (least to most of {config['repeats']})")
    table.add_column("learner", no_wrap=True)
    for dim in config["dims"]:
        table.add_column(f"d = {dim:,}", justify="right", no_wrap=True)
    for learner in dict.fromkeys(row["learner"] for row in results.table):
        cells = []
        for row in (row for row in results.table if row["learner"] == learner):
            spread = "" if row["pairs_min"] is None else f" ({row['pairs_min']:,} to {row['pairs_max']:,})"
            cells.append(f"{row['pairs']:,.0f}{spread}")
        table.add_row(learner, *cells)
    console.print(table)


def _cell(value: object) -> str:
    if isinstance(value, float) and value.is_integer():
        return number(int(value))
    return value if isinstance(value, str) else number(value if isinstance(value, int | float) else None)
