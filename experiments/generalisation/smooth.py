"""Smooth commands: how close does one hypervector come to wheels that take any value?

Two teachers command without steps: one drives in the corral, one answers what a real robot sensed along a wall. A
program that interpolates between codes is compared with the same codes with a few discrete levels and a clean-up
memory, and with three regressors without hypervectors, by the error against the demonstrated values.

    torchvsa smooth
    torchvsa smooth tasks=[wall_following] models=[one_hypervector,ridge]
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

import sim
from behaviours import Demonstrations
from experiments.kit import Cell, Column, Drawing, Outcome, Row, Study, Table, aggregated, setting
from experiments.kit.figures import BLACK, GREEN, VERMILION
from experiments.models.regressors import LEVELS, OURS, REGRESSORS, RegressorController, errors, regressor
from experiments.tasks import in_bullet
from experiments.tasks.corral import (
    FIRST_DEMONSTRATION,
    drive,
    drive_together,
    driven,
    episodes,
    moving,
    success,
)
from experiments.tasks.smooth_corral import corral_commands
from experiments.tasks.wall_following import FOLDS, blocks, samples, wall_commands

Floats = NDArray[Any]

CORRAL, WALL = "corral", "wall_following"
TASKS = (CORRAL, WALL)
TEACHER = "teacher"


@dataclass
class Smooth(in_bullet.InBullet):
    """The settings of this study."""

    tasks: list[str] = setting(list(TASKS), "whose commands are learned", choices=TASKS, distinct=True)
    models: list[str] = setting(list(REGRESSORS), "what learns", choices=REGRESSORS, distinct=True)
    dims: list[int] = setting(
        [250, 1000, 4000], "dimensions of the program; the largest also for levels and driving", low=1, distinct=True
    )
    levels: list[int] = setting([3, 5, 9, 21], "discrete levels per wheel", low=2, distinct=True)
    demonstrations: int = episodes(20, "episodes of the corral's teacher to learn from")
    starts: int = episodes(48, "held-out starts in the corral")
    blocks: int = setting(3, "blocks of the real data that are held back in turn", low=1, high=FOLDS)
    bullet_starts: int = episodes(
        32, "the first of these starts, in the physics engine, too, of all that drive; 0: none", low=0
    )
    wheeled_starts: int = episodes(16, "the same on the wheeled body", low=0)


def check(settings: Smooth) -> None:
    """Raise for an engine that is not installed, or does not have the body."""
    in_bullet.check(settings, CORRAL in settings.tasks)


@dataclass(frozen=True)
class Material:
    """What all cells share: the settings, and the runs of the corral's teacher, if that task is chosen."""

    settings: Smooth
    train: Demonstrations | None = None
    heldout: Demonstrations | None = None
    teacher: Row | None = None


def prepare(settings: Smooth, folder: Path, progress: Any) -> Material:
    """Drive the corral's teacher."""
    if CORRAL not in settings.tasks:
        return Material(settings)
    shown = range(FIRST_DEMONSTRATION, FIRST_DEMONSTRATION + settings.demonstrations)
    train = drive_together(settings, "demonstrations", corral_commands, shown, progress)
    heldout = drive_together(settings, "held-out runs", corral_commands, range(settings.starts), progress)
    teacher = {"rmse": 0.0, **_counts(settings, corral_commands, heldout)}
    return Material(settings, moving(train), moving(heldout), teacher)


def cells(settings: Smooth) -> list[Cell]:
    """A cell for each task, model and fold: the interpolating program at all dims, levels at the largest."""
    variants = [(TEACHER, None, None)] if CORRAL in settings.tasks else []
    for model in settings.models:
        if model == OURS:
            variants += [(model, dim, None) for dim in settings.dims]
        elif model == LEVELS:
            variants += [(model, max(settings.dims), levels) for levels in settings.levels]
        else:
            variants.append((model, None, None))
    variants.sort(key=lambda variant: (-(variant[2] or 0), -(variant[1] or 0)))
    folds = [(CORRAL, 0)] if CORRAL in settings.tasks else []
    folds += [(WALL, fold) for fold in range(settings.blocks)] if WALL in settings.tasks else []
    return [
        {"task": task, "model": model, "dim": dim, "levels": levels, "fold": fold}
        for model, dim, levels in variants
        for task, fold in folds
        if model != TEACHER or task == CORRAL
    ]


def measure(material: Material, cell: Cell) -> Row:
    """Fit a model, compare its commands on held-out readings, and let it drive if the task is the corral's."""
    settings, dim = material.settings, cell["dim"]
    if cell["model"] == TEACHER:
        assert material.teacher is not None
        return material.teacher
    model = regressor(cell["model"], dim, cell["levels"], settings.seed)
    row = errors(model, *split(material, cell["task"], cell["fold"]))
    if cell["task"] == CORRAL and dim in (None, max(settings.dims)):
        controller = RegressorController(model)
        row |= _counts(settings, controller, drive(settings, controller, range(settings.starts)))
    return row


def split(material: Material, task: str, fold: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Readings and commands to learn, and readings and commands that are held back."""
    if task == CORRAL:
        train, heldout = material.train, material.heldout
        assert train is not None
        assert heldout is not None
        return train.sensors.numpy(), train.commands.numpy(), heldout.sensors.numpy(), heldout.commands.numpy()
    readings, labels = samples(24)
    commands = wall_commands(*samples(2)[0].T)
    train_rows, test_rows = blocks(labels)[fold]
    return readings[train_rows], commands[train_rows], readings[test_rows], commands[test_rows]


def _counts(settings: Smooth, controller: sim.ControllerLike, rollout: sim.Rollout) -> Row:
    counts = {key: value for key, value in driven(rollout).items() if key != "escapes"}
    return counts | in_bullet.counted(in_bullet.effects(settings, controller, rollout))


def summarise(settings: Smooth, records: pd.DataFrame) -> list[Row]:
    """One row for each task and model: means over the folds; success with Wilson's 95 % interval."""
    keys, means = ["task", "model", "dim", "levels"], ["rmse", "mean_rmse", "relative", "rounding_rmse"]
    groups: Any = records.groupby(keys, dropna=False)
    records = records.reindex(columns=[*keys, *means, "episodes", "successes"])
    columns = {name: (name, "mean") for name in means} | {"folds": ("task", "count")}
    columns |= {name: (name, "sum") for name in ("episodes", "successes")}
    table = aggregated(records, keys, columns)
    for row in table:
        row |= success(row["episodes"], row.pop("successes"))
        row |= in_bullet.differences(groups.get_group(tuple(row[key] for key in keys)))
    order = (TEACHER, *REGRESSORS)
    return sorted(
        table,
        key=lambda row: (TASKS.index(row["task"]), order.index(row["model"]), -(row["dim"] or 0), row["levels"] or 0),
    )


def headline(outcome: Outcome) -> str:
    """The errors of each task, as shares of that of the mean command."""
    texts = []
    for task in dict.fromkeys(row["task"] for row in outcome.table):
        rows = [row for row in outcome.table if row["task"] == task and row["relative"] is not None]
        best = {}
        for row in sorted(rows, key=lambda row: row["relative"]):
            best.setdefault(row["model"], f"`{row['model']}` {row['relative']:.3f}")
        texts.append(f"{task.replace('_', ' ')}: {', '.join(best.values())}")
    return f"Error as a share of that of the mean command. {'; '.join(texts)}."


COLOURS = {CORRAL: GREEN, WALL: VERMILION}
STYLES: dict[str, Any] = {OURS: "-", "nearest_neighbours": "--", "mlp": ":", "ridge": "-."}
NAMES = {OURS: "one hypervector, interpolating", "mlp": "MLP"}


def by_levels(outcome: Outcome) -> Figure:
    """Error against the number of levels, and lines for the models without levels."""
    figure = Figure(figsize=(7, 4.6), layout="constrained")
    axes = figure.subplots()
    tasks = list(dict.fromkeys(row["task"] for row in outcome.table))
    for task in tasks:
        rows, colour = [row for row in outcome.table if row["task"] == task], COLOURS[task]
        discrete = [row for row in rows if row["levels"] is not None]
        axes.plot([r["levels"] for r in discrete], [r["relative"] for r in discrete], "o", color=colour, ms=7)
        for row in rows:
            if row["model"] in STYLES and row["dim"] in (max(outcome.settings.dims), None):
                width = 2.4 if row["model"] == OURS else 1.2
                axes.axhline(row["relative"], color=colour, linestyle=STYLES[row["model"]], linewidth=width)
    handles = [Line2D([], [], color=COLOURS[task], lw=5, label=f"teacher: {task.replace('_', ' ')}") for task in tasks]
    handles.append(Line2D([], [], color=BLACK, marker="o", ls="", label="one hypervector, discrete levels"))
    handles += [
        Line2D([], [], color=BLACK, linestyle=style, label=NAMES.get(model, model.replace("_", " ")))
        for model, style in STYLES.items()
        if model in outcome.settings.models
    ]
    levels = sorted(outcome.settings.levels)
    axes.set_xscale("log")
    axes.set_xticks(levels, [str(level) for level in levels])
    axes.minorticks_off()
    axes.set_ylim(bottom=0)
    axes.set(title="Smooth commands: error", xlabel="levels per wheel")
    axes.set_ylabel("error, as a share of that of the mean command")
    figure.legend(handles=handles, loc="outside right upper", fontsize=7)
    return figure


TABLE = Table(
    "Smooth commands",
    [
        Column("task", "teacher"),
        Column("model"),
        Column("dim", "d", ",d"),
        Column("levels"),
        Column("rmse", "error", ".4f", about="root mean square error against the teacher's commands in [-1, 1]"),
        Column("relative", format=".4f", about="the error as a share of that of always commanding the mean"),
        Column("rounding_rmse", "rounding alone", ".4f", about="the error of rounding the target to the levels"),
        Column("success_rate", "success", ".2f", ("success_low", "success_high"), about="with Wilson's 95 % interval"),
    ],
)


def tables(outcome: Outcome) -> list[Table]:
    """What was measured, and the same in the physics engine."""
    about = "All that drive in the corral, from its first starts."
    keys = [Column("model"), Column("levels")]
    return [TABLE.show(outcome.table), *in_bullet.tables(keys, outcome.table, about)]


METHOD = """
Commands of two teachers without steps: `corral_commands`, which drives in the corral, and `wall_commands`, which
answers the real robot's distances in front and to the left and is to be learned from the 24 raw ones. The held-out
samples are those of unseen starts before the lamp was reached, and blocks in time.

`one_hypervector` is a `BehaviourRegressor`, which interpolates; `levels` are the same codes with a clean-up among the
commands that were shown, rounded to a number of levels per wheel. nearest_neighbours (5), ridge and mlp (64 hidden) see
readings in units of the training rows' standard deviation. Models drive in the corral from unseen starts, from the
first `bullet_starts` and `wheeled_starts` in the physics engine, too; of the program only the largest dimension drives.
"""
FIGURE = Drawing(
    "smooth",
    by_levels,
    "error against the number of levels, with lines for models that interpolate",
    "Dots: levels with a clean-up. Lines: models whose commands take any value. Means over the folds.",
)

study = Study(
    name="smooth",
    about="How close does one hypervector come to wheel commands that take any value?",
    settings=Smooth,
    check=check,
    cells=cells,
    prepare=prepare,
    measure=measure,
    summarise=summarise,
    keys=("task", "model", "dim", "levels"),
    tables=tables,
    figures=[FIGURE],
    headline=headline,
    method=METHOD,
    presets={"quick": {"tasks": [WALL], "models": [OURS, "ridge"], "dims": [250], "blocks": 1}},
)
