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

from experiments.kit import (
    Cell,
    Column,
    Drawing,
    Outcome,
    Row,
    Settings,
    Study,
    Table,
    aggregated,
    grid,
    pivot,
    setting,
)
from experiments.kit.figures import BLUE, VERMILION, legend_below
from experiments.models import torchhd
from experiments.models.classifiers import CLASSIFIERS, SLOWEST, accuracy, not_installed
from experiments.tasks.wall_following import FOLDS, SENSORS, SPLITS, samples

KEYS = ("model", "sensors", "split")
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
    columns = {
        "accuracy": ("accuracy", "mean"),
        "accuracy_min": ("accuracy", "min"),
        "accuracy_max": ("accuracy", "max"),
        "fit_s": ("fit_s", "sum"),
    }
    order = grid(model=settings.models, sensors=settings.sensors, split=settings.splits)
    return aggregated(records, KEYS, columns, order)


def metrics(settings: WallFollowing, records: pd.DataFrame, table: list[Row]) -> dict[str, float | None]:
    """Whether torch-hd could take part."""
    return {"torchhd_installed": float(torchhd.installed())}


def tables(outcome: Outcome) -> list[Table]:
    """A row for each model, and a column for each number of sensors and split."""
    found = dict.fromkeys(row["model"] for row in outcome.table)
    missing = [model for model in outcome.settings.models if model not in found]
    notes = f" {note(missing)}." if missing else ""
    best = f"Mean over the folds. The best of each column is marked.{notes}"
    time = "The sum over the folds, one thread each."
    model, fold = Column("model"), Column("split", format=lambda row: f"{row['sensors']}, {row['split']}")
    accuracy, seconds = Column("accuracy", format=".4f", best="max"), Column("fit_s", format=".1f")
    return [
        pivot("Wall following: accuracy", outcome.table, [model], fold, accuracy, best),
        pivot("Wall following: seconds to fit all folds", outcome.table, [model], fold, seconds, time),
    ]


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


LABELS = {"stratified": "random fifths (stratified)", "blocks": "fifths in time (blocks)"}


def dots(outcome: Outcome) -> Figure:
    """The accuracy of each model with the most sensors, and the range over the folds."""
    import seaborn  # takes a second to load

    sensors, models = max(outcome.settings.sensors), dict.fromkeys(row["model"] for row in outcome.table)
    records = outcome.records[outcome.records.sensors == sensors]
    records = records.assign(split=records.split.map(LABELS), model=records.model.str.replace("_", " "))
    figure = Figure(figsize=(7, 4.4), layout="constrained")
    axes = figure.subplots()
    look: Any = {
        "order": [name.replace("_", " ") for name in models],
        "hue_order": [LABELS[split] for split in outcome.settings.splits],
        "palette": [BLUE, VERMILION][: len(outcome.settings.splits)],
        "markers": ["o", "s"][: len(outcome.settings.splits)],
        "dodge": 0.24 if len(outcome.settings.splits) > 1 else False,
    }
    bars = {"linewidth": 2, "alpha": 0.5}
    seaborn.pointplot(
        records, x="accuracy", y="model", hue="split", errorbar=("pi", 100), err_kws=bars, linestyle="none",
        markersize=5, ax=axes, **look,
    )  # fmt: skip
    axes.set(title=f"Wall following, {sensors} sensors", xlabel="accuracy on the fifth left out", ylabel="")
    axes.grid(visible=False, axis="y")
    legend_below(figure)
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
    keys=KEYS,
    metrics=metrics,
    tables=tables,
    figures=[FIGURE],
    headline=headline,
    method=METHOD,
    presets={"quick": {"sensors": [2], "models": [OURS, "decision_tree"]}},
)
