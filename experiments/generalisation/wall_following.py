"""Real data: which command did a robot that follows a wall give, from its 24, 4 or 2 distances?

Each model learns four of five parts of the rows and is tested on the fifth. Stratified folds are drawn at random, so
that the neighbours in time of a tested row are known; blocks are stretches of time.

    torchvsa wall_following
    torchvsa wall_following sensors=[24] models=[one_hypervector_chosen]
    torchvsa wall_following sensors=[2] models=[one_hypervector,decision_tree]
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from experiments.kit import Cell, Column, Drawing, Outcome, Row, Settings, Study, Table, grid, setting
from experiments.kit.figures import BLACK, BLUE, GREY, legend_below
from experiments.models import torchhd
from experiments.models.classifiers import CLASSIFIERS, SLOWEST, accuracy, not_installed
from experiments.tasks.wall_following import FOLDS, SENSORS, SPLITS, samples

OURS = "one_hypervector"
MODELS = [name for name in CLASSIFIERS if name != "one_hypervector_chosen"]


@dataclass
class WallFollowing(Settings):
    """The settings of this study."""

    dim: int = setting(4000, "dimension of the hypervectors, torch-hd's included", low=1)
    sensors: list[int] = setting(list(SENSORS), "numbers of distances", choices=SENSORS, distinct=True)
    splits: list[str] = setting(list(SPLITS), "how the rows are split into folds", choices=SPLITS, distinct=True)
    models: list[str] = setting(MODELS, "what learns", choices=CLASSIFIERS, distinct=True)
    stratified_only: list[str] = setting(
        ["torchhd_lehdc"], "models too slow for the other splits", choices=CLASSIFIERS, distinct=True, empty=True
    )
    torchhd_epochs: int | None = setting(10, "as in torch-hd's own example; null: its default, 120", low=1)


def cells(settings: WallFollowing) -> list[Cell]:
    """A cell for each model, number of sensors, split and fold; the slowest models first."""
    missing = not_installed(settings.models)
    models = [model for model in settings.models if model not in missing]
    found = grid(model=models, sensors=settings.sensors, split=settings.splits, fold=range(FOLDS))
    left = [c for c in found if c["split"] == "stratified" or c["model"] not in settings.stratified_only]
    order = {model: place for place, model in enumerate(SLOWEST)}
    return sorted(left, key=lambda cell: order.get(cell["model"], len(order)))


def check(settings: WallFollowing) -> None:
    """Raise if no model is left."""
    if not cells(settings):
        missing = not_installed(settings.models)
        reason = note(missing) if missing else f"stratified_only leaves none of them for splits={settings.splits}"
        raise ValueError(f"models: there is nothing to measure; {reason}")


def prepare(settings: WallFollowing, folder: Path, progress: Any) -> WallFollowing:
    """Tell which models are left out; there is nothing else to prepare."""
    if missing := not_installed(settings.models):
        progress.console.print(note(missing), soft_wrap=True)
    return settings


def note(missing: list[str]) -> str:
    """What a reader has to know about models that are not there."""
    return f"{torchhd.MISSING} ({', '.join(missing)})"


def measure(settings: WallFollowing, cell: Cell) -> Row:
    """Fit a model to the training rows of one fold, and test it on the others."""
    model = CLASSIFIERS[cell["model"]](settings.dim, settings.torchhd_epochs, settings.seed)
    readings, labels = samples(cell["sensors"])
    return accuracy(model, readings, labels, SPLITS[cell["split"]](labels)[cell["fold"]])


def summarise(settings: WallFollowing, records: pd.DataFrame) -> list[Row]:
    """One row for each model, number of sensors and split: the mean over the folds, and the time of all fits."""
    table: list[Row] = []
    for cell in grid(model=settings.models, sensors=settings.sensors, split=settings.splits):
        group = records[(records[list(cell)] == list(cell.values())).all(axis=1)]
        if len(group):
            ends = {"accuracy_min": group.accuracy.min(), "accuracy_max": group.accuracy.max()}
            table.append({**cell, "accuracy": group.accuracy.mean(), **ends, "fit_s": group.fit_s.sum()})
    return table


def metrics(settings: WallFollowing, records: pd.DataFrame, table: list[Row]) -> dict[str, float | None]:
    """Whether torch-hd could take part."""
    return {"torchhd_installed": float(torchhd.installed())}


def tables(outcome: Outcome) -> list[Table]:
    """A row for each model, and a column for each number of sensors and split."""
    names = list(dict.fromkeys(_column(row) for row in outcome.table))
    accuracies = [Column(name, format=".4f", best="max") for name in names]
    seconds = [Column(name, format=".1f") for name in names]
    found = dict.fromkeys(row["model"] for row in outcome.table)
    missing = [model for model in outcome.settings.models if model not in found]
    notes = f" {note(missing)}." if missing else ""
    return [
        Table(f"Wall following: {title}", [Column("model"), *columns], caption).show(_pivot(outcome.table, value))
        for value, title, columns, caption in (
            ("accuracy", "accuracy", accuracies, f"Mean over the folds. The best of each column is marked.{notes}"),
            ("fit_s", "seconds to fit all folds", seconds, "The sum over the folds, one thread each."),
        )
    ]


def _column(row: Row) -> str:
    return f"{row['sensors']}, {row['split']}"


def _pivot(table: list[Row], value: str) -> list[Row]:
    """A row for each model, with a value for each number of sensors and split."""
    rows: dict[str, Row] = {}
    for row in table:
        rows.setdefault(row["model"], {"model": row["model"]})[_column(row)] = row[value]
    return list(rows.values())


def headline(outcome: Outcome) -> str:
    """What the hypervector and the best of the others get from the most sensors."""
    sensors = max(outcome.settings.sensors)
    parts = []
    for split in outcome.settings.splits:
        rows = [row for row in outcome.table if (row["sensors"], row["split"]) == (sensors, split)]
        best = sorted(rows, key=lambda row: -row["accuracy"])[:3]
        named = [row for row in rows if row["model"] == OURS and row not in best]
        parts.append(f"{split}: " + ", ".join(f"`{row['model']}` {row['accuracy']:.3f}" for row in [*best, *named]))
    return f"Accuracy with {sensors} sensors. {'; '.join(parts)}."


SHAPES = {"stratified": ("o", -0.12, "random fifths (stratified)"), "blocks": ("s", 0.12, "fifths in time (blocks)")}
"""Marker, shift and label of each split."""


def dots(outcome: Outcome) -> Figure:
    """The accuracy of each model with the most sensors, and the range over the folds."""
    sensors = max(outcome.settings.sensors)
    rows = [row for row in outcome.table if row["sensors"] == sensors]
    names = list(dict.fromkeys(row["model"] for row in rows))
    figure = Figure(figsize=(7, 4.4), layout="constrained")
    axes = figure.subplots()
    for split in outcome.settings.splits:
        marker, shift, label = SHAPES[split]
        filled = split == "stratified"
        for row in (row for row in rows if row["split"] == split):
            place = names.index(row["model"]) + shift
            colour = BLUE if row["model"] == OURS else GREY
            ends = [row["accuracy_min"], row["accuracy_max"]]
            axes.plot(ends, [place, place], color=colour, linewidth=2.5, alpha=0.4)
            face = colour if filled else "white"
            axes.plot(row["accuracy"], place, marker, color=colour, markerfacecolor=face, markersize=6)
        axes.plot([], [], marker, color=BLACK, markerfacecolor=BLACK if filled else "white", label=label)
    axes.set_yticks(range(len(names)), [name.replace("_", " ") for name in names])
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set(title=f"Wall following, {sensors} sensors", xlabel="accuracy on the fifth left out")
    axes.grid(visible=False, axis="y")
    legend_below(figure, axes)
    return figure


METHOD = """
The data are a real robot's distances and the command that it gave (UCI, "Wall-Following Robot Navigation",
DOI 10.24432/C57C8W). Each model learns four fifths of the rows and is tested on the fifth left out, five times.
Stratified folds put neighbours in time on both sides; blocks hold back whole stretches of it.

`one_hypervector` is a `BehaviourClassifier` whose other settings are the defaults of the library;
`one_hypervector_chosen` is the same with its `subset` chosen inside the training rows of every fold. Models that
compare or weigh features see them in units of the training rows' standard deviation. torch-hd's classifiers run as in
its own example: `torchhd_epochs` epochs, defaults otherwise. Each fit has one thread, while other processes work.
"""
FIGURE = Drawing(
    "wall_following",
    dots,
    "accuracy of each model on random fifths and on fifths in time",
    "Dots: mean over the folds. Bars: lowest to highest.",
)

study = Study(
    name="wall_following",
    about="Which command did a robot that follows a wall give, from its 24, 4 or 2 distances?",
    settings=WallFollowing,
    check=check,
    cells=cells,
    prepare=prepare,
    measure=measure,
    summarise=summarise,
    keys=("model", "sensors", "split"),
    metrics=metrics,
    tables=tables,
    figures=[FIGURE],
    headline=headline,
    method=METHOD,
    presets={"quick": {"sensors": [2], "models": [OURS, "decision_tree"]}},
)
