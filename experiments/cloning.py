"""Behaviour cloning: how well does a learner drive after it was shown a few episodes of an expert?

One hypervector, a decision tree, nearest neighbours and an MLP learn from the same episodes, with their defaults, and
drive from the same starts in classic control tasks.

    torchvsa cloning
    torchvsa cloning tasks=[CartPole-v1] episodes=[1,5] draws=3
"""

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from sklearn.exceptions import ConvergenceWarning
from sklearn.neighbors import KNeighborsClassifier, KNeighborsRegressor
from sklearn.neural_network import MLPClassifier, MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeClassifier, DecisionTreeRegressor

from behaviours import BehaviourClassifier, BehaviourRegressor
from experiments.kit import Cell, Column, Drawing, Outcome, Row, Settings, Study, Table, grid, setting
from experiments.kit.figures import legend_below, lines
from experiments.kit.intervals import mean
from experiments.tasks.control import EXPERTS, run
from experiments.tasks.seeds import seed_of

OURS, EXPERT = "one_hypervector", "expert"
Model = Callable[[int], Any]
LEARNERS: dict[str, tuple[Model, Model]] = {
    OURS: (
        lambda seed: BehaviourClassifier(random_state=seed),
        lambda seed: BehaviourRegressor(random_state=seed),
    ),
    "decision_tree": (
        lambda seed: DecisionTreeClassifier(random_state=seed),
        lambda seed: DecisionTreeRegressor(random_state=seed),
    ),
    "nearest_neighbour": (
        lambda seed: make_pipeline(StandardScaler(), KNeighborsClassifier(1)),
        lambda seed: make_pipeline(StandardScaler(), KNeighborsRegressor(1)),
    ),
    "mlp": (
        lambda seed: make_pipeline(
            StandardScaler(), MLPClassifier(hidden_layer_sizes=(64,), max_iter=500, random_state=seed)
        ),
        lambda seed: make_pipeline(
            StandardScaler(), MLPRegressor(hidden_layer_sizes=(64,), max_iter=500, random_state=seed)
        ),
    ),
}
"""For commands out of a few, and for commands of any value."""
FIRST = 1_000_000
"""Starts that are shown; those that are driven from are 0, 1, ..."""


@dataclass
class Cloning(Settings):
    """The settings of this study."""

    tasks: list[str] = setting(list(EXPERTS), "tasks of Gymnasium", choices=EXPERTS, distinct=True)
    episodes: list[int] = setting([1, 5, 20], "episodes of the expert that are shown", low=1, distinct=True)
    learners: list[str] = setting(list(LEARNERS), "learners", choices=LEARNERS, distinct=True)
    draws: int = setting(5, "draws of the episodes shown; the larger ones contain the smaller", low=1)
    starts: int = setting(100, "starts, the same for all", low=1)


def check(settings: Cloning) -> None:
    """Raise for a task whose physics is not installed."""
    if "LunarLander-v3" in settings.tasks and find_spec("Box2D") is None:
        raise ValueError("tasks: LunarLander-v3 needs Box2D: pip install 'torchvsa[control]'")


def cells(settings: Cloning) -> list[Cell]:
    """A cell for each task, learner, number of episodes and draw; the most episodes first."""
    most = sorted(settings.episodes, reverse=True)
    learned = grid(task=settings.tasks, learner=settings.learners, episodes=most, draw=range(settings.draws))
    return grid(task=settings.tasks, learner=[EXPERT], episodes=[None], draw=[0]) + learned


def measure(settings: Cloning, cell: Cell) -> Row:
    """The mean return over the starts, and the seconds of learning."""
    task, starts = cell["task"], range(settings.starts)
    expert = EXPERTS[task]
    if cell["learner"] == EXPERT:
        return {"mean_return": float(run(task, expert, starts).returns.mean()), "fit_s": None, "rows": None}
    first = FIRST + 1000 * (settings.draws * settings.seed + cell["draw"])
    shown = run(task, expert, range(first, first + cell["episodes"]))
    continuous = shown.actions.ndim > 1
    model = LEARNERS[cell["learner"]][continuous](seed_of(settings.seed, cell["draw"]) % 2**31)
    began = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # the MLP's, at its last pass
        model.fit(shown.observations, shown.actions.ravel())
    seconds = time.perf_counter() - began

    def drive(seen: Any) -> Any:
        answer = model.predict(seen)
        return (
            np.clip(answer, shown.actions.min(), shown.actions.max())[:, None].astype(np.float32)
            if continuous
            else answer
        )

    found = run(task, drive, starts)
    return {"mean_return": float(found.returns.mean()), "fit_s": seconds, "rows": len(shown.observations)}


def summarise(settings: Cloning, records: pd.DataFrame) -> list[Row]:
    """A row for each task and number of episodes: the mean return of each learner over the draws, and the rank."""
    rows = []
    for cell in grid(task=settings.tasks, episodes=settings.episodes):
        own = records[(records.task == cell["task"]) & (records.episodes == cell["episodes"])]
        row: Row = {**cell, "rows": own.rows.mean()}
        for learner in settings.learners:
            values = own.loc[own.learner == learner, "mean_return"].to_numpy()
            row |= mean(learner, values)
            row[f"{learner}_s"] = own.loc[own.learner == learner, "fit_s"].median()
        expert = records[(records.task == cell["task"]) & (records.learner == EXPERT)]
        rows.append({**row, EXPERT: expert.mean_return.iloc[0], **ranks(row, settings.learners)})
    return rows


def ranks(row: Row, learners: list[str]) -> Row:
    """Whether one hypervector returns at least the median of the others, and at least the best of them."""
    others = [row[name] for name in learners if name != OURS]
    if OURS not in learners or not others:
        return {}
    return {"at_least_median": bool(row[OURS] >= np.median(others)), "at_least_best": bool(row[OURS] >= max(others))}


def headline(outcome: Outcome) -> str:
    """How often one hypervector is as good as the others."""
    ranked = [row for row in outcome.table if "at_least_median" in row]
    if not ranked:
        return ""
    median, best = (sum(row[name] for row in ranked) for name in ("at_least_median", "at_least_best"))
    return (
        f"In {median} of {len(ranked)} cells one hypervector returns at least the median of the other learners, and in "
        f"{best} at least the best of them."
    )


def curves(outcome: Outcome) -> Figure:
    """The mean return against the number of episodes, a panel per task; the expert's as a dotted line."""
    settings = outcome.settings
    figure = Figure(figsize=(3.1 * len(settings.tasks), 3.2), layout="constrained")
    panels = figure.subplots(1, len(settings.tasks), squeeze=False)[0]
    learned = outcome.records.loc[outcome.records.learner != EXPERT]
    for axes, task in zip(panels, settings.tasks, strict=True):
        lines(axes, learned.loc[learned.task == task], "episodes", "mean_return", "learner", order=settings.learners)
        axes.axhline(next(row[EXPERT] for row in outcome.table if row["task"] == task), color="grey", linestyle=":")
        axes.set(xscale="log", title=task, xlabel="episodes shown", ylabel="mean return" if axes is panels[0] else "")
        axes.set_xticks(settings.episodes, [str(count) for count in settings.episodes])
        axes.minorticks_off()
    legend_below(figure, panels[0], 4)
    return figure


def tables(outcome: Outcome) -> list[Table]:
    """The return of each learner, and how long it learned."""
    learners = outcome.settings.learners
    head = [Column("task"), Column("episodes", format=",", about="shown"), Column("rows", format=",.0f", about="shown")]
    returns = [Column(name, format=".0f", interval=(f"{name}_low", f"{name}_high")) for name in learners]
    times = [Column(f"{name}_s", f"{name} (s)", ".2f") for name in learners]
    ranked = [Column("at_least_median", "≥ median"), Column("at_least_best", "≥ best")]
    return [
        Table("Mean return", [*head, *returns, Column(EXPERT, format=".0f"), *ranked]).show(outcome.table),
        Table("Seconds of learning", [*head, *times]).show(outcome.table),
    ]


METHOD = """
Each draw shows other episodes of the expert; all learners see the same ones. Returns are means over the starts, which
no draw shows; their intervals are bootstrapped over the draws. All learners have their defaults; nearest neighbours and
the MLP (64 hidden units) see features in units of their standard deviation. Pendulum has commands of any value.
"""
FIGURE = Drawing("cloning", curves, "mean return against the number of episodes shown, for each task and learner")
QUICK = {"tasks": ["CartPole-v1", "MountainCar-v0"], "episodes": [1, 5], "draws": 2, "starts": 20}

study = Study(
    name="cloning",
    about="How well does a learner drive after it was shown a few episodes of an expert?",
    settings=Cloning,
    check=check,
    cells=cells,
    measure=measure,
    summarise=summarise,
    keys=("task", "episodes"),
    tables=tables,
    figures=[FIGURE],
    headline=headline,
    method=METHOD,
    presets={"quick": QUICK},
)
