"""Where a learned behaviour errs, what contradicts, and what to demonstrate next, by regions of the readings."""

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from behaviours import Sensor
from behaviours.commands.learn import Learned
from behaviours.commands.validate import RIVALS

REGIONS = 8
"""The readings of a sensor are divided into at most so many regions."""
_LEAST_ROWS = 10
"""Regions with fewer rows say little."""
_MOST_ROWS = 8
"""The longest list of regions."""
_APART = 0.25
"""Commands that differ by more than this share of the range contradict each other."""
Rows = list[dict[str, Any]]


def regions(learned: Learned) -> pd.DataFrame:
    """The error of each model and actuator by region of each sensor, one row each.

    `share` is the largest difference between the errors of a sensor's regions, relative to the range of the actuator.
    """
    rows: Rows = []
    errors = {model: learned.validation.errors(model) for model in (learned.kind, *RIVALS[:2])}
    for sensor, column in _columns(learned):
        places, labels, middles = divided(sensor, column)
        for place in range(len(labels)):
            here = places == place
            for model, off in errors.items():
                means = off[here].mean(0) if here.any() else []
                for actuator, error in zip(learned.schema.actuators, means, strict=False):
                    name = labels[place] if sensor.kind in ("categorical", "binary") else ""
                    rows.append(
                        {"sensor": sensor.name, "actuator": actuator.name, "model": model, "reading": middles[place],
                         "label": name, "rows": int(here.sum()), "error": error,
                         "relative": error / (actuator.high - actuator.low)}
                    )  # fmt: skip
    frame = pd.DataFrame(rows)
    spread = frame.groupby(["sensor", "actuator", "model"])["relative"].transform(lambda x: x.max() - x.min())
    return frame.assign(share=spread)


def runs(learned: Learned) -> Rows:
    """The error of each model and actuator by run, or by stretch of time."""
    validation = learned.validation
    groups = learned.validation.shown.episodes.numpy() if learned.by else validation.folds
    errors = {model: validation.errors(model) for model in (learned.kind, *RIVALS)}
    rows = []
    for group in np.unique(groups):
        here = groups == group
        row: dict[str, Any] = {"run": str(group), "rows": int(here.sum())}
        for model, off in errors.items():
            names = (f"{model} {actuator.name}" for actuator in learned.schema.actuators)
            row |= dict(zip(names, off[here].mean(0).tolist(), strict=True))
        rows.append(row)
    return rows


def next_demonstrations(learned: Learned) -> Rows:
    """The regions with a large share of the error, or with unfamiliar readings, the most promising first."""
    validation = learned.validation
    errors = validation.relative(learned.kind, learned.schema)
    strange, mean, found = validation.unfamiliar, errors.mean(), []
    for sensor, column in _columns(learned):
        places, labels, _ = divided(sensor, column)
        for place, label in enumerate(labels):
            here = places == place
            if here.sum() < _LEAST_ROWS:
                continue
            off = errors[here].mean() / mean if mean > 0 else 0.0
            # Much of the error in few rows is worth most.
            gain = errors[here].sum() / max(errors.sum(), 1e-12) - here.mean()
            if off > 1.25 or strange[here].mean() > 2 * strange.mean() > 0:
                found.append(
                    {"where": f"{sensor.name}: {label}", "rows": int(here.sum()), "off": off, "gain": gain,
                     "share": errors[here].sum() / max(errors.sum(), 1e-12), "unfamiliar": strange[here].mean()}
                )  # fmt: skip
    return sorted(found, key=lambda row: (-row["gain"], row["where"]))[:_MOST_ROWS]


def contradictions(learned: Learned) -> tuple[float, Rows]:
    """The share of rows whose neighbours were commanded otherwise, and the cells with the most of them.

    Neighbours are the rows in the same region of every sensor.
    """
    shown, schema = learned.validation.shown, learned.schema
    parts, names = [], []
    for sensor, column in _columns(learned):
        places, labels, _ = divided(sensor, column)
        parts.append(places)
        names.append(labels)
    cells, inverse = np.unique(np.stack(parts, 1), axis=0, return_inverse=True)
    inverse = inverse.ravel()
    ranges = np.array([actuator.high - actuator.low for actuator in schema.actuators])
    commands = pd.DataFrame(shown.commands.numpy() / ranges)
    grouped = commands.groupby(inverse)
    far = ((commands - grouped.transform("median")).abs() > _APART).any(axis=1).to_numpy()
    counts = np.bincount(inverse, far, minlength=len(cells))
    found: Rows = []
    for cell in np.argsort(-counts, kind="stable")[:_MOST_ROWS]:
        if counts[cell] < 2:
            break
        where = ", ".join(
            f"{sensor.name} {names[place][value]}" if value >= 0 else f"{sensor.name} not observed"
            for place, (sensor, value) in enumerate(zip(schema.sensors, cells[cell], strict=True))
        )
        here = shown.commands.numpy()[inverse == cell]
        quartiles = np.quantile(here, (0.05, 0.5, 0.95), axis=0).T
        ends = (
            f"{actuator.name} {low:.3g} / {middle:.3g} / {high:.3g}"
            for actuator, (low, middle, high) in zip(schema.actuators, quartiles, strict=True)
        )
        found.append({"where": where, "rows": len(here), "commands": ", ".join(ends)})
    return float(far.mean()), found


def divided(sensor: Sensor, column: NDArray[np.float64]) -> tuple[NDArray[np.int64], list[str], list[float]]:
    """The region of each reading `[N]`, -1 if it was not observed, and the name and the middle of each region."""
    places = np.full(len(column), -1, dtype=np.int64)
    seen = ~np.isnan(column)
    if sensor.kind in ("categorical", "binary"):
        places[seen] = column[seen].astype(np.int64)
        values = sensor.values if sensor.values else (0, 1)
        return places, [str(value) for value in values], [float(place) for place in range(len(values))]
    readings = column[seen].clip(sensor.low, sensor.high) if sensor.out_of_range == "clip" else column[seen]
    if len(readings) == 0:
        return places, [], []
    edges = np.unique(np.quantile(readings, np.linspace(0, 1, REGIONS + 1)[1:-1]))
    places[seen] = np.searchsorted(edges, readings, side="right")
    # Where a value repeats, a region may be empty.
    used, place = np.unique(places[seen], return_inverse=True)
    places[seen] = place.ravel()
    ends = [readings.min(), *edges, readings.max()]
    unit = f" {sensor.unit}" if sensor.unit else ""
    pairs = ((f"{ends[k]:.3g}", f"{ends[k + 1]:.3g}") for k in used)
    labels = [f"{low}{unit}" if low == high else f"{low} to {high}{unit}" for low, high in pairs]
    return places, labels, [float(np.median(readings[place.ravel() == k])) for k in range(len(used))]


def _columns(learned: Learned) -> list[tuple[Sensor, NDArray[np.float64]]]:
    readings = learned.validation.shown.sensors.numpy()
    return list(zip(learned.schema.sensors, readings.T, strict=True))
