"""Smooth commands: wheels that take any value, learned by one hypervector that interpolates between codes.

Two teachers whose commands vary without steps: one drives in the corral, one answers what a real robot sensed along
a wall. Beside the interpolating program stand the same codes with a few discrete levels and a clean-up memory, and
three regressors without hypervectors. What is compared is the error against the demonstrated values.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.progress import Progress
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import Ridge
from sklearn.neighbors import KNeighborsRegressor
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

import sim
from behaviours import BehaviourClassifier, BehaviourRegressor
from behaviours.data import load_wall_following
from experiments.choices import check_chosen
from experiments.driving import drive_here, pooled_success
from experiments.generalisation_wall_following import FOLDS, blocks
from experiments.jobs import run_jobs
from experiments.lessons import FIRST_DEMONSTRATION, shown_in
from experiments.results import Row
from sim.sensors import LIGHT_MAX

Floats = NDArray[np.float64]

NEAR = 0.5
"""The corral's smooth teacher turns away from walls below this distance, m; it solves the default arena with any
from 0.35 to 0.6."""


def corral_commands(sensors: Floats, *_: Any) -> Floats:
    """The corral's rules without their steps: commands `[B, 2]` in [-1, 1] for readings `[B, 3]`; a policy.

    The nearer the wall and the darker, the slower and the more to the left; the brighter one side, the more towards it.
    """
    left, right = 1 - sensors[:, 0] / LIGHT_MAX, 1 - sensors[:, 1] / LIGHT_MAX
    away = 2 * np.clip(1 - sensors[:, 2] / NEAR, 0, 1) * (1 - np.maximum(left, right))
    turn = 2 * (right - left) - away
    return np.clip(np.stack([1 - away + turn, 1 - away - turn], axis=1), -1, 1)


def wall_commands(front: Floats, left: Floats) -> Floats:
    """Follow the wall on the left at about 0.7 m: commands `[N, 2]` in [-1, 1] for two distances `[N]`, m.

    Drive unless something is near in front, steer by how far the wall is, and turn right where the way is blocked.
    """
    drive = 1 / (1 + np.exp(-(front - 0.9) / 0.15))
    turn = drive * np.tanh((left - 0.7) / 0.3) - (1 - drive)
    return np.clip(np.stack([drive - turn / 2, drive + turn / 2], axis=1), -1, 1)


class Levels:
    """Commands told apart at `levels` values between -1 and 1, recalled by a clean-up among those that were shown."""

    def __init__(self, levels: int, dim: int, seed: int) -> None:
        self.values = np.linspace(-1, 1, levels)
        self.model = BehaviourClassifier(dim=dim, random_state=seed)

    def rounded(self, commands: Floats) -> Floats:
        """The nearest level of each command."""
        return self.values[np.abs(commands[..., None] - self.values).argmin(-1)]

    def fit(self, X: Floats, y: Floats) -> Levels:  # noqa: N803 (scikit-learn's own name)
        """Learn readings `X` `[N, n]` and commands `y` `[N, m]`."""
        self.results, labels = np.unique(self.rounded(y), axis=0, return_inverse=True)
        self.model.fit(X, labels.ravel())
        return self

    def predict(self, X: Floats) -> Floats:  # noqa: N803
        """Commands `[B, m]`, each row one of the results that were shown."""
        return self.results[self.model.predict(X)]


PEERS = {
    "nearest_neighbours": lambda seed: KNeighborsRegressor(5),
    "ridge": lambda seed: Ridge(),
    "mlp": lambda seed: MLPRegressor(hidden_layer_sizes=(64,), max_iter=1000, random_state=seed),
}
TASKS = ("corral", "wall_following")
MODELS = ("one_hypervector", "levels", *PEERS)


class Regressed:
    """A regressor as a policy of the simulator."""

    def __init__(self, model: Any) -> None:
        self.model = model

    def __call__(self, sensors: Floats, *_: Any) -> Floats:
        """Commands `[B, 2]`, within what the wheels can do."""
        return np.clip(self.model.predict(sensors), -1, 1)


def check(config: Mapping[str, Any]) -> None:
    """Raise, naming the setting, for what is not there."""
    for setting, choices in (("tasks", TASKS), ("models", MODELS)):
        check_chosen(f"smooth.{setting}", config[setting], choices)
    for setting, least in (("dims", 1), ("levels", 2)):
        if not config[setting] or min(config[setting]) < least:
            raise ValueError(f"smooth.{setting} are numbers from {least} on; got {list(config[setting])}")
    if config["blocks"] > FOLDS:
        raise ValueError(f"smooth.blocks={config['blocks']}: there are {FOLDS}")
    for setting in ("demonstrations", "starts", "blocks"):
        if config[setting] < 1:
            raise ValueError(f"smooth.{setting}={config[setting]}: expected 1 or more")


def run(config: Mapping[str, Any], executor: Executor, progress: Progress) -> list[Row]:
    """One record for each task, model and fold; `config` is that of the whole run."""
    own = config["smooth"]
    data, test = [], None
    if "corral" in own["tasks"]:
        shown = range(FIRST_DEMONSTRATION, FIRST_DEMONSTRATION + own["demonstrations"])
        runs = [(config, list(shown)), (config, list(range(own["starts"])))]
        train, test = run_jobs(executor, progress, "smooth: teacher", _teacher, runs)
        data.append(("corral", 0, *_samples(train), *_samples(test)))
    if "wall_following" in own["tasks"]:
        readings, labels = load_wall_following(24)
        commands = wall_commands(*load_wall_following(2)[0].T)
        data += [
            ("wall_following", fold, readings[train], commands[train], readings[test], commands[test])
            for fold, (train, test) in enumerate(blocks(labels)[: own["blocks"]])
        ]
    jobs = [
        (config, model, dim, levels, *one)
        for model, dim, levels in sorted(_variants(own), key=lambda v: (-(v[2] or 0), -(v[1] or 0)))
        for one in data
    ]
    records = run_jobs(executor, progress, "smooth: models", fit_and_ask, jobs)
    if test is not None:
        blank = dict.fromkeys(records[0])
        success = {"episodes": len(test), "successes": int(test.success.sum())}
        records.insert(0, blank | {"task": "corral", "model": "teacher", "fold": 0, "rmse": 0.0, **success})
    return records


def _variants(config: Mapping[str, Any]) -> list[tuple[str, int | None, int | None]]:
    """(model, dimensions, levels): the interpolating program at all `dims`, those with levels at the largest."""
    variants: list[tuple[str, int | None, int | None]] = []
    for model in config["models"]:
        if model == "one_hypervector":
            variants += [(model, dim, None) for dim in config["dims"]]
        elif model == "levels":
            variants += [(model, max(config["dims"]), levels) for levels in config["levels"]]
        else:
            variants.append((model, None, None))
    return variants


def _teacher(config: Mapping[str, Any], episodes: Sequence[int]) -> sim.Rollout:
    return drive_here(config, corral_commands, episodes, record=True)


def _samples(rollout: sim.Rollout) -> tuple[Floats, Floats]:
    """Readings and commands before the lamp was reached; a robot at rest repeats one command."""
    shown, moving = shown_in(rollout)
    return shown.sensors.numpy()[moving], shown.commands.numpy()[moving]


def fit_and_ask(
    config: Mapping[str, Any],
    model: str,
    dim: int | None,
    levels: int | None,
    task: str,
    fold: int,
    *data: Floats,
) -> Row:
    """Fit a model to readings and commands, compare it on others, and let it drive if the task is the corral's."""
    readings, commands, new_readings, wanted = data
    seed = config["seed"]
    made: Any
    if model == "one_hypervector":
        assert dim is not None
        made = BehaviourRegressor(dim=dim, random_state=seed)
    elif model == "levels":
        assert dim is not None
        assert levels is not None
        made = Levels(levels, dim, seed)
    else:
        made = make_pipeline(StandardScaler(), PEERS[model](seed))
    began = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        made.fit(readings, commands)
    seconds = time.perf_counter() - began
    answers = np.concatenate([made.predict(block) for block in np.array_split(new_readings, -(-len(wanted) // 1024))])
    error, mean_error = _rmse(answers, wanted), _rmse(commands.mean(0), wanted)
    row: Row = {
        "task": task,
        "model": model,
        "dim": dim,
        "levels": levels,
        "fold": fold,
        "samples": len(wanted),
        "rmse": error,
        "mean_rmse": mean_error,
        "relative": error / mean_error,
        "rounding_rmse": _rmse(made.rounded(wanted), wanted) if isinstance(made, Levels) else None,
        "fit_s": seconds,
        "episodes": None,
        "successes": None,
    }
    if task == "corral" and (dim is None or dim == max(config["smooth"]["dims"])):
        rollout = drive_here(config, Regressed(made), range(config["smooth"]["starts"]))
        row |= {"episodes": len(rollout), "successes": int(rollout.success.sum())}
    return row


def _rmse(answers: Floats, wanted: Floats) -> float:
    return float(np.sqrt(np.mean((answers - wanted) ** 2)))


def table(records: Sequence[Row]) -> list[Row]:
    """One row for each task and model: means over the folds; success with Wilson's 95 % interval."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for record in records:
        groups.setdefault(tuple(record[key] for key in ("task", "model", "dim", "levels")), []).append(record)
    rows = []
    for own in groups.values():
        row: Row = {key: own[0][key] for key in ("task", "model", "dim", "levels")} | {"folds": len(own)}
        for figure in ("rmse", "mean_rmse", "relative", "rounding_rmse"):
            values = [record[figure] for record in own if record[figure] is not None]
            row[figure] = float(np.mean(values)) if values else None
        row |= pooled_success(own[0]["episodes"] or 0, own[0]["successes"] or 0)
        rows.append(row)
    order = {task: place for place, task in enumerate(TASKS)}
    models = {model: place for place, model in enumerate(("teacher", *MODELS))}
    return sorted(
        rows, key=lambda row: (order[row["task"]], models[row["model"]], -(row["dim"] or 0), row["levels"] or 0)
    )
