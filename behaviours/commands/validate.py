"""Cross-validation of a behaviour by run, beside scikit-learn's models."""

from collections.abc import Callable, Iterator
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
from behaviours.learning import Gradient, Rule, no_convergence_warnings
from behaviours.progress import Progress, no_progress, subrange
from behaviours.schema import Schema
from behaviours.space import Space
from torchvsa import MAP

OURS = "one hypervector"
RIVALS = ("nearest neighbours", "decision tree", "mean")
FOLDS = 5
_BATCH = 1024
"""Rows per answer, so that memory stays small."""
_FEW_RESULTS = 20
"""Up to this many different results, commands are classes rather than amounts, and the rivals are classifiers."""
_ROW_EPOCHS = 6_000_000
"""Rows times epochs: one thread trains about 40,000 a second, so that this takes minutes."""

Answer = Callable[[Float64[torch.Tensor, "B n"]], NDArray[np.float64]]


@dataclass(frozen=True)
class Validation:
    """What each model commands for rows `[N]` of runs that it was not shown."""

    shown: Demonstrations
    predicted: dict[str, Float64[np.ndarray, "N m"]]
    unfamiliar: Bool[np.ndarray, "N"]
    """Whether the readings resemble the demonstrated ones less than nearly all of these resemble themselves."""
    margin: Float64[np.ndarray, "N"]
    folds: Int64[np.ndarray, "N"]

    def errors(self, model: str) -> Float64[np.ndarray, "N m"]:
        """The absolute error of each command, in its unit."""
        return np.abs(self.predicted[model] - self.shown.commands.numpy())

    def agreement(self, model: str, schema: Schema) -> Bool[np.ndarray, "N m"]:
        """Whether each command has the level of the demonstrated one."""
        low, high = (np.array([getattr(part, end) for part in schema.actuators]) for end in ("low", "high"))
        given = torch.from_numpy(self.predicted[model].clip(low, high))
        return (schema.command_levels(given) == schema.command_levels(self.shown.commands)).numpy()


def default_rule(rows: int) -> Rule:
    """The rule that `torchvsa learn` uses: fewer epochs for very many rows, of which each epoch shows more."""
    return Gradient(sparse=True, epochs=min(Gradient.epochs, max(3, _ROW_EPOCHS // rows)))


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
    schema: Schema, shown: Demonstrations, folds: Int64[np.ndarray, "N"], seed: int, progress: Progress = no_progress
) -> Validation:
    """Learn all folds but one, and ask for the commands of the remaining one; likewise for each fold and model."""
    count = len(np.unique(folds))
    predicted = {name: np.empty(tuple(shown.commands.shape)) for name in (OURS, *RIVALS)}
    unfamiliar, margin = np.zeros(len(shown), dtype=np.bool_), np.zeros(len(shown))
    for number, (train, test) in enumerate(_splits(folds)):
        part, rest = shown.where(train), shown.where(test)
        behaviour = learned(Space(schema, seed=seed), part, subrange(progress, number / count, (number + 0.9) / count))
        predicted[OURS][test], familiarity, margin[test] = answers(behaviour, rest.sensors)
        unfamiliar[test] = familiarity < (behaviour.threshold or 0.0)
        for name, answer in rivals(schema, part, seed).items():
            predicted[name][test] = answer(rest.sensors)
        progress((number + 1) / count)
    return Validation(shown, predicted, unfamiliar, margin, folds)


def sweep(
    schema: Schema, shown: Demonstrations, folds: Int64[np.ndarray, "N"], seed: int, progress: Progress = no_progress
) -> list[dict[str, Any]]:
    """The mean absolute error of each actuator in the first fold, by dimensions and bins of the encoder."""
    settings = [(dim, 256) for dim in (500, 1000, 2000, 4000, 8000)] + [(4000, bins) for bins in (8, 32, 1024)]
    train, rest = map(shown.where, next(_splits(folds)))
    rows = []
    for number, (dim, bins) in enumerate(settings):
        space = Space(schema, default_encoder(schema, MAP(dim, dtype=torch.int8), bins), seed=seed)
        behaviour = learned(space, train)
        errors = np.abs(answers(behaviour, rest.sensors)[0] - rest.commands.numpy()).mean(0)
        names = [actuator.name for actuator in schema.actuators]
        rows.append({"dim": dim, "bins": bins} | dict(zip(names, errors.tolist(), strict=True)))
        progress((number + 1) / len(settings))
    return sorted(rows, key=lambda row: (row["bins"] != 256, row["dim"], row["bins"]))


@no_convergence_warnings()
def learned(space: Space, shown: Demonstrations, progress: Progress = no_progress) -> Behaviour:
    """A calibrated behaviour, with the default rule."""
    bank = BehaviourBank(space)
    bank.learn("learned", shown, default_rule(len(shown)), progress)
    return bank["learned"]


def answers(behaviour: Behaviour, readings: Float64[torch.Tensor, "B n"]) -> tuple[NDArray[np.float64], ...]:
    """Commands `[B, m]`, familiarity and margin `[B]`; rows in which nothing was observed are not familiar."""
    with torch.no_grad():
        recalls = [behaviour(rows) for rows in readings.split(_BATCH)]
    found = (torch.cat([getattr(r, name) for r in recalls]) for name in ("commands", "familiarity", "margin"))
    commands, familiarity, margin = (values.double().numpy() for values in found)
    middle = np.array([(part.low + part.high) / 2 for part in behaviour.space.schema.actuators])
    blind = np.isnan(commands)
    return np.where(blind, middle, commands), np.nan_to_num(familiarity), np.nan_to_num(margin, posinf=1e6)


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
