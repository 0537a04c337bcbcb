"""Cross-validation of a behaviour by run, beside scikit-learn's models."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float64, Int64
from numpy.typing import NDArray

from behaviours.bank import BehaviourBank
from behaviours.behaviour import Behaviour
from behaviours.default_encoder import default_encoder
from behaviours.demonstrations import Demonstrations
from behaviours.learning import Gradient, LeastSquares, Rule, no_convergence_warnings
from behaviours.progress import Progress, no_progress, subrange
from behaviours.schema import Schema
from behaviours.space import Space
from torchvsa import MAP

LEVELS, SMOOTH = "one hypervector", "one hypervector, smooth"
OURS = (LEVELS, SMOOTH)
"""A command is one of the levels, which `Gradient` learns as classes; or any value, which `LeastSquares` fits."""
RIVALS = ("nearest neighbours", "decision tree", "mean")
FOLDS = 5
_BATCH = 1024
"""Rows per answer, so that memory stays small."""
_FEW_RESULTS = 20
"""Up to this many different results, commands are classes rather than amounts, and the rivals are classifiers."""
_ROW_EPOCHS = 6_000_000
"""Rows times epochs: one thread trains about 40,000 a second, so that this takes minutes."""
_SMOOTH_ROWS = 200_000
"""Smooth commands are learned from at most this many rows, evenly spread: one thread fits 2,000 a second."""

Answer = Callable[[Float64[torch.Tensor, "B n"]], NDArray[np.float64]]


@dataclass(frozen=True)
class Validation:
    """What each model commands for rows `[N]` of runs that it was not shown."""

    shown: Demonstrations
    predicted: dict[str, Float64[np.ndarray, "N m"]]
    unfamiliar: Bool[np.ndarray, "N"]
    """Whether the readings resemble the demonstrated ones less than nearly all of these resemble themselves."""
    folds: Int64[np.ndarray, "N"]

    def errors(self, model: str) -> Float64[np.ndarray, "N m"]:
        """The absolute error of each command, in its unit."""
        return np.abs(self.predicted[model] - self.shown.commands.numpy())

    def relative(self, model: str, schema: Schema) -> Float64[np.ndarray, "N"]:
        """The absolute error of each row, relative to the range of each actuator; the mean over them."""
        ranges = np.array([actuator.high - actuator.low for actuator in schema.actuators])
        return (self.errors(model) / ranges).mean(1)

    def agreement(self, model: str, schema: Schema) -> Bool[np.ndarray, "N m"]:
        """Whether each command has the level of the demonstrated one."""
        low, high = (np.array([getattr(part, end) for part in schema.actuators]) for end in ("low", "high"))
        given = torch.from_numpy(self.predicted[model].clip(low, high))
        return (schema.command_levels(given) == schema.command_levels(self.shown.commands)).numpy()


def default_rule(kind: str, rows: int) -> Rule:
    """The rule that `torchvsa learn` uses for levels or smooth commands.

    Levels get fewer epochs for very many rows, of which each epoch shows more.
    """
    if kind == SMOOTH:
        return LeastSquares(smooth=True)
    return Gradient(sparse=True, epochs=min(Gradient.epochs, max(3, _ROW_EPOCHS // rows)))


def taught(kind: str, shown: Demonstrations) -> Demonstrations:
    """The rows that are learned from: all, or evenly spread ones if there are too many for smooth commands."""
    return thinned(shown, _SMOOTH_ROWS) if kind == SMOOTH else shown


def thinned(shown: Demonstrations, most: int) -> Demonstrations:
    """At most this many rows, evenly spread."""
    if len(shown) <= most:
        return shown
    keep = torch.zeros(len(shown), dtype=torch.bool)
    keep[torch.linspace(0, len(shown) - 1, most, dtype=torch.float64).long()] = True
    return shown.where(keep)


def is_smooth(schema: Schema, shown: Demonstrations) -> bool:
    """Whether commands have values between the levels of their actuator."""
    return any(
        len(column.unique()) > actuator.levels
        for actuator, column in zip(schema.actuators, shown.commands.T, strict=True)
    )


def folds_of(shown: Demonstrations, by: str | None) -> Int64[np.ndarray, "N"]:
    """The fold of each row: whole runs, or without runs contiguous stretches of time.

    Raises `ValueError` if there is one run only.
    """
    if by is None:
        if len(shown) < 2 * FOLDS:
            raise ValueError(f"{len(shown)} rows are too few to hold some of them out; at least {2 * FOLDS} are needed")
        return np.arange(len(shown)) * FOLDS // len(shown)
    runs, index = np.unique(shown.episodes.numpy(), return_inverse=True)
    if len(runs) < 2:
        raise ValueError(
            f"column {by!r} names one run only, so that no run can be held out; record another one, or leave out "
            "--by to hold out stretches of time"
        )
    return index.ravel() % FOLDS


def cross_validate(
    space: Space,
    shown: Demonstrations,
    folds: Int64[np.ndarray, "N"],
    kinds: Sequence[str],
    progress: Progress = no_progress,
) -> Validation:
    """Learn all folds but one, and ask for the commands of the remaining one; likewise for each fold and model."""
    schema, count = space.schema, len(np.unique(folds))
    predicted = {name: np.empty(tuple(shown.commands.shape)) for name in (*kinds, *RIVALS)}
    unfamiliar = np.zeros(len(shown), dtype=np.bool_)
    for number, (train, test) in enumerate(_splits(folds)):
        part, rest = shown.where(train), shown.where(test)
        for place, kind in enumerate(kinds):
            began = number + 0.9 * place / len(kinds)
            behaviour = learned(
                space, part, kind, subrange(progress, began / count, (began + 0.9 / len(kinds)) / count)
            )
            predicted[kind][test], familiarity = answers(behaviour, rest.sensors)
            unfamiliar[test] = familiarity < (behaviour.threshold or 0.0)
        for name, answer in rivals(schema, part, space.seed).items():
            predicted[name][test] = answer(rest.sensors)
        progress((number + 1) / count)
    return Validation(shown, predicted, unfamiliar, folds)


def sweep(
    space: Space, shown: Demonstrations, folds: Int64[np.ndarray, "N"], kind: str, progress: Progress = no_progress
) -> list[dict[str, Any]]:
    """The mean absolute error of each actuator in the first fold, by dimensions and bins of the encoder."""
    settings = [(dim, 256) for dim in (500, 1000, 2000, 4000, 8000)] + [(4000, bins) for bins in (8, 32, 1024)]
    train, rest = map(shown.where, next(_splits(folds)))
    rows = []
    for number, (dim, bins) in enumerate(settings):
        behaviour = learned(space_of(space.schema, dim, space.seed, bins), train, kind)
        errors = np.abs(answers(behaviour, rest.sensors)[0] - rest.commands.numpy()).mean(0)
        names = [actuator.name for actuator in space.schema.actuators]
        rows.append({"dim": dim, "bins": bins} | dict(zip(names, errors.tolist(), strict=True)))
        progress((number + 1) / len(settings))
    return sorted(rows, key=lambda row: (row["bins"] != 256, row["dim"], row["bins"]))


def space_of(schema: Schema, dim: int, seed: int, bins: int = 256) -> Space:
    """The space with the default encoder, over int8."""
    return Space(schema, default_encoder(schema, MAP(dim, dtype=torch.int8), bins), seed=seed)


@no_convergence_warnings()
def learned(space: Space, shown: Demonstrations, kind: str, progress: Progress = no_progress) -> Behaviour:
    """A calibrated behaviour, with the default rule."""
    bank = BehaviourBank(space)
    bank.learn("learned", taught(kind, shown), default_rule(kind, len(shown)), progress)
    return bank["learned"]


def answers(behaviour: Behaviour, readings: Float64[torch.Tensor, "B n"]) -> tuple[NDArray[np.float64], ...]:
    """Commands `[B, m]` and familiarity `[B]`; rows in which nothing was observed are not familiar."""
    with torch.no_grad():
        recalls = [behaviour(rows) for rows in readings.split(_BATCH)]
    commands, familiarity = (
        torch.cat([getattr(recall, name) for recall in recalls]).double().numpy()
        for name in ("commands", "familiarity")
    )
    middle = np.array([(part.low + part.high) / 2 for part in behaviour.space.schema.actuators])
    return np.where(np.isnan(commands), middle, commands), np.nan_to_num(familiarity)


def rivals(schema: Schema, shown: Demonstrations, seed: int) -> dict[str, Answer]:
    """scikit-learn's models with its defaults (5 neighbours), fitted. Needs scikit-learn."""
    try:
        from sklearn.impute import SimpleImputer
        from sklearn.neighbors import KNeighborsClassifier, KNeighborsRegressor
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import StandardScaler
        from sklearn.tree import DecisionTreeClassifier, DecisionTreeRegressor
    except ModuleNotFoundError as error:
        raise ImportError("comparing needs scikit-learn: pip install 'torchvsa[sklearn]'", name="sklearn") from error
    x, commands = features(schema, shown.sensors), shown.commands.numpy()
    results, labels = np.unique(commands, axis=0, return_inverse=True)
    classes = len(results) <= _FEW_RESULTS
    near: Any = (KNeighborsClassifier if classes else KNeighborsRegressor)(min(5, len(shown)))
    tree: Any = (DecisionTreeClassifier if classes else DecisionTreeRegressor)(random_state=seed)
    near = make_pipeline(SimpleImputer(strategy="median", keep_empty_features=True), StandardScaler(), near)
    for model in (near, tree):
        model.fit(x, labels.ravel() if classes else commands)

    def answer(model: Any) -> Answer:
        def commanded(readings: torch.Tensor) -> NDArray[np.float64]:
            found = model.predict(features(schema, readings))
            return results[found] if classes else np.asarray(found).reshape(len(readings), -1)

        return commanded

    mean = commands.mean(0)
    return dict(
        zip(RIVALS, (answer(near), answer(tree), lambda readings: np.tile(mean, (len(readings), 1))), strict=True)
    )


def features(schema: Schema, readings: Float64[torch.Tensor, "B n"]) -> Float64[np.ndarray, "B f"]:
    """Readings for models of numbers: a column per category, sine and cosine of angles; NaN is not observed."""
    columns = []
    for sensor, column in zip(schema.sensors, schema.normalise(readings).T.numpy(), strict=True):
        if sensor.kind == "categorical":
            place = np.floor(column * len(sensor.values))
            columns += [(place == value).astype(np.float64) for value in range(len(sensor.values))]
        elif sensor.kind == "angle":
            columns += [np.sin(2 * np.pi * column), np.cos(2 * np.pi * column)]
        else:
            columns.append(column)
    return np.stack(columns, 1)


def _splits(folds: Int64[np.ndarray, "N"]) -> Iterator[tuple[NDArray[np.bool_], NDArray[np.bool_]]]:
    for fold in np.unique(folds):
        yield folds != fold, folds == fold
