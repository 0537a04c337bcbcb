"""The report of the observability study: the figure, what it says in words, and all numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from behaviours.storage import write_atomically
from experiments.figures import png
from experiments.observability_curves import FIGURES, curves
from experiments.observability_disturbances import DISTURBANCES
from experiments.observability_learners import LEARNERS
from experiments.report import Cell, Page
from experiments.results import Results, Row

MEMORIES = ("trace", "hold", "held_trace")


def write_report(folder: Path, results: Results) -> Path:
    """Write `report.html` and its figure under `figures/`."""
    (folder / "figures").mkdir(exist_ok=True)
    content = png(curves(results.table), dpi=100)
    write_atomically(folder / "figures" / "observability.png", content)
    config: Mapping[str, Any] = results.config
    page = Page(
        "Partly observable states, and memory",
        "Something comes between the sensors and the program. How much of the behaviour is left, and does a memory of "
        "past conditions help?",
    )
    section = page.section("Agreement and success against the strength of the disturbance")
    section.picture(
        content, "Agreement and success of each learner against the strength of each disturbance", caption(config)
    )
    section.terms({learner: LEARNERS[learner].about for learner in config["learners"]})
    page.section("What it says").terms(sentences(results.table))
    section = page.section("The table")
    for name in dict.fromkeys(row["disturbance"] for row in results.table):
        own = [row for row in results.table if row["disturbance"] == name]
        section.table(["learner", *_columns(own)], _rows(own), f"{name}: {DISTURBANCES[name].axis}. {_CELLS}")
    if tried := _tried(results.metrics):
        section = page.section("What was chosen on validation runs")
        section.table(
            ["disturbance", "learner", "choice", "balanced agreement"],
            tried,
            "Mean over the strengths above 0. Green: the choice that was taken.",
            words=True,
        )
    page.how_to_reproduce(config)
    return page.write(folder / "report.html")


def caption(config: Mapping[str, Any]) -> str:
    """How the figure is to be read."""
    text = (
        f"Balanced agreement: how often the learner, who sees disturbed readings, commands what the teacher does, who "
        f"sees the true ones, in {config['heldout']} held-out runs of the teacher before the lamp; the mean over the "
        "teacher's different commands, each counting alike. Agreement: the share of all moments, most of which are "
        "straight runs; the dotted line is for always giving the most usual command."
    )
    if config["starts"]:
        text += (
            f" Success: share of {config['starts']} held-out starts from which the robot reaches the lamp within "
            f"{config['seconds']:g} s and stays, with Wilson's 95 % interval."
        )
    return text


def mean_over(table: Sequence[Row], disturbance: str, learner: str, value: str) -> float | None:
    """A learner's mean over the strengths above 0; None where it was not measured."""
    figures = [
        row[value]
        for row in table
        if (row["disturbance"], row["learner"]) == (disturbance, learner)
        and row["strength"] > 0
        and row[value] is not None
    ]
    return float(np.mean(figures)) if figures else None


def sentences(table: Sequence[Row]) -> dict[str, str]:
    """For each disturbance, what training on it and a memory change, in means over its strengths above 0."""
    return {name: _sentence(table, name) for name in dict.fromkeys(row["disturbance"] for row in table)}


def _sentence(table: Sequence[Row], name: str) -> str:
    learners = list(dict.fromkeys(row["learner"] for row in table))
    parts = []
    for value in ("balanced_agreement", "success_rate"):
        means = {learner: mean_over(table, name, learner, value) for learner in learners}
        known: dict[str, float] = {learner: mean for learner, mean in means.items() if mean is not None}
        if not known:
            continue
        best = max(known, key=lambda learner: known[learner])
        text = f"{FIGURES[value]}: highest for `{best}` ({known[best]:.2f})"
        if {"default", "disturbed"} <= set(known):
            text += f"; {_change(known['default'], known['disturbed'])} by showing disturbed demonstrations"
        memories = [learner for learner in MEMORIES if learner in known]
        if memories and "disturbed" in known:
            changes = [f"{_change(known['disturbed'], known[memory])} by `{memory}`" for memory in memories]
            text += f"; then {', '.join(changes)}"
        parts.append(text)
    return f"Means over the strengths above 0. {'. '.join(part[0].upper() + part[1:] for part in parts)}."


def _change(before: float, after: float) -> str:
    difference = round(after, 2) - round(before, 2)
    if abs(difference) < 0.005:
        return f"unchanged ({after:.2f})"
    return f"{'raised' if difference > 0 else 'lowered'} from {before:.2f} to {after:.2f}"


_CELLS = "Agreement / balanced agreement / success, if driven. Green: the highest balanced agreement."


def _columns(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row["label"] for row in rows))


def _rows(rows: Sequence[Row]) -> list[list[str | Cell]]:
    best = {label: max(row["balanced_agreement"] for row in rows if row["label"] == label) for label in _columns(rows)}
    lines: dict[str, list[str | Cell]] = {}
    for row in rows:
        driven = "" if row["success_rate"] is None else f" / {row['success_rate']:.2f}"
        text = f"{row['agreement']:.3f} / {row['balanced_agreement']:.2f}{driven}"
        mark = "best" if row["balanced_agreement"] == best[row["label"]] else ""
        lines.setdefault(row["learner"], [row["learner"]]).append(Cell(text, mark))
    return list(lines.values())


def _tried(metrics: Mapping[str, float | None]) -> list[list[str | Cell]]:
    """What each learner compared, from the metrics `disturbance.learner.validation.choice`."""
    compared: dict[tuple[str, str], dict[str, float]] = {}
    for key, value in metrics.items():
        disturbance, learner, kind, *choice = key.split(".", 3)
        if kind == "validation" and value is not None:
            compared.setdefault((disturbance, learner), {})[choice[0]] = value
    rows: list[list[str | Cell]] = []
    for (disturbance, learner), choices in compared.items():
        taken = max(choices, key=lambda choice: choices[choice])
        for choice, value in choices.items():
            rows.append([disturbance, learner, choice, Cell(f"{value:.3f}", "best" if choice == taken else "")])
    return rows


def print_table(results: Results, console: Console) -> None:
    """The table, rounded, for the terminal."""
    table = Table(title="Partly observable states")
    for title in ("disturbance", "strength", "learner", "agreement", "balanced", "success [95 %]", "episodes"):
        table.add_column(title, justify="left" if title in ("disturbance", "learner") else "right", no_wrap=True)
    for row in results.table:
        success = "-"
        if row["success_rate"] is not None:
            success = f"{row['success_rate']:.2f} [{row['success_low']:.2f}, {row['success_high']:.2f}]"
        figures = (f"{row['agreement']:.3f}", f"{row['balanced_agreement']:.3f}", success, str(row["episodes"] or "-"))
        table.add_row(row["disturbance"], row["label"], row["learner"], *figures)
    console.print(table)
