"""A study without science, for tests of the kit: it counts, writes down what it measured, and fails when told to."""

import os
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.kit import Cell, Column, Drawing, Outcome, Part, Row, Settings, Study, Table, grid, part, setting
from experiments.kit.figures import lines


@dataclass
class Counting(Settings):
    rule: Part = part("rule", "error_driven", "a learning rule, which is not used")
    names: list[str] = setting(["a", "b"], "what is counted", choices=["a", "b", "c"], distinct=True)
    repeats: int = setting(2, "how often", low=1, high=100)
    share: float = setting(0.5, "a share", above=0, below=1)
    log: str = setting("", "a file that gets a line per measured cell")
    fail_at: int = setting(-1, "the repeat that cannot be measured")
    seconds: float = setting(0.0, "how long a cell takes", low=0)
    drawable: bool = setting(True, "whether the figure can be drawn")


def measure(settings: Counting, cell: Cell) -> Row:
    if settings.log:
        with open(settings.log, "a") as file:
            file.write(f"{cell['name']}{cell['repeat']} {os.getpid()}\n")
    time.sleep(settings.seconds)
    if cell["repeat"] == settings.fail_at:
        raise RuntimeError("this cell cannot be measured")
    return {"count": cell["repeat"] + len(cell["name"]), "half": cell["repeat"] / 2}


def summarise(settings: Counting, records: pd.DataFrame) -> list[Row]:
    means = [(name, records.loc[records["name"] == name, "count"].mean()) for name in settings.names]
    return [{"name": name, "mean": mean, "missing": None} for name, mean in means]


def curve(outcome: Outcome) -> Any:
    from matplotlib.figure import Figure

    if not outcome.settings.drawable:
        raise RuntimeError("no ink")
    figure = Figure()
    lines(figure.subplots(), outcome.records, "repeat", "count", "name")
    return figure


def metrics(settings: Counting, records: pd.DataFrame, table: list[Row]) -> Mapping[str, Any]:
    return {"most": records["count"].max()}


def prepare(settings: Counting, folder: Path, progress: object) -> Counting:
    (folder / "prepared.txt").write_text("yes")
    return settings


study = Study(
    name="counting",
    about="How far does a study count?",
    settings=Counting,
    prepare=prepare,
    cells=lambda settings: grid(name=settings.names, repeat=range(settings.repeats)),
    measure=measure,
    summarise=summarise,
    keys=("name",),
    metrics=metrics,
    table=Table("Counts", [Column("name"), Column("mean", format=".1f", best="max", about="over the repeats")]),
    figures=[Drawing("counts", curve, "counts by repeat")],
    headline=lambda outcome: f"It counts to {outcome.metrics['most']}.",
    method="By counting.\n\nTwice.",
    presets={
        "quick": {"repeats": 1},
        "printed": {"defaults": [{"override /rule": "literal"}], "share": 0.25},
    },
    objective="most",
)

if __name__ == "__main__":
    import sys

    from experiments.kit.command import run_study

    run_study(study, sys.argv[1:])
