"""Propose the sensors and actuators of a robot from what it recorded."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from jaxtyping import Float64

from behaviours.columns import Column, as_episodes, as_numbers, has_text, is_missing, require
from behaviours.parts import Actuator, Sensor, span
from behaviours.tables import columns_of

_MOST_VALUES = 32
"""A column of text with more different values is a remark rather than the state of something."""
_FEW_ROWS = 100
"""Fewer rows do not tell outliers from rare readings."""
_MOST_LEVELS = 64
"""Commands with at most this many evenly spaced values keep each of them as a level."""
_TURNS = {360.0: "deg", 2 * math.pi: "rad"}
_ANGLES = re.compile(r"head|yaw|bear|azim|angle|theta|direction|orient", re.IGNORECASE)


@dataclass
class Proposal:
    """Sensors and actuators, and in words what each column is taken for, or why it is left out."""

    sensors: list[Sensor] = field(default_factory=list)
    actuators: list[Actuator] = field(default_factory=list)
    notes: dict[str, str] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)

    def lines(self) -> list[str]:
        """One line per column."""
        taken = [f"{name}: {note}" for name, note in self.notes.items()]
        return [*taken, *(f"{name}: left out, {why}" for name, why in self.left_out.items())]


def propose(
    data: Any,
    sensors: Sequence[str] | None = None,
    actuators: Sequence[str] | None = None,
    by: str | None = None,
    changes: Mapping[str, Mapping[str, Any] | None] | None = None,
) -> Proposal:
    """Propose sensors and actuators, see `Schema.from_data`."""
    columns, changes = columns_of(data), dict(changes or {})
    units, ranges = getattr(data, "units", {}), getattr(data, "ranges", {})
    rows = len(next(iter(columns.values())))
    if rows == 0:
        raise ValueError(f"the data have no rows, only the columns {', '.join(columns)}")
    if actuators is None:
        actuators = getattr(data, "actuators", None)
    if not actuators:
        raise ValueError(f"which columns are commands? name the actuators among {', '.join(columns)}")
    if sensors is None:
        sensors = getattr(data, "sensors", None)
    for name in (*(sensors or ()), *actuators, *changes, *([] if by is None else [by])):
        require(name, list(columns))
    if both := [name for name in (sensors or ()) if name in actuators]:
        raise ValueError(f"column {both[0]!r} cannot be both a sensor and an actuator")
    if by is not None and by in (*(sensors or ()), *actuators):
        raise ValueError(f"column {by!r} names the runs, so that it can be neither a sensor nor an actuator")
    found = Proposal(left_out=dict(getattr(data, "left_out", {})))
    runs = np.zeros(rows, np.int64) if by is None else as_episodes(columns[by], by)
    for name in columns if sensors is None else sensors:
        if name in actuators:
            continue
        why = _reason(columns[name], runs, asked=sensors is not None) if name != by else "it names the runs"
        change = changes.get(name, {})
        if change is None or (why and not change):
            found.left_out[name] = "as asked" if change is None else why
            continue
        options, note = _sensor(name, columns[name], units.get(name, ""), ranges.get(name))
        sensor = _changed(Sensor, name, options, change, columns[name])
        found.sensors.append(sensor)
        found.notes[name] = f"sensor, {sensor.kind}; {'as asked' if change else note or sensor.describe()}"
    for name in columns:
        if sensors is not None and name not in (*sensors, *actuators) and name not in found.left_out:
            found.left_out[name] = "it names the runs" if name == by else "not among the sensors that were named"
    for name in actuators:
        change = changes.get(name, {})
        if change is None:
            raise ValueError(f"actuator {name!r} is left out by changes; leave it out of the actuators instead")
        options = _actuator(name, columns[name], units.get(name, ""))
        actuator = _changed(Actuator, name, options, change, columns[name])
        found.actuators.append(actuator)
        found.notes[name] = f"actuator; {span(actuator)} in {actuator.levels} levels"
    if not found.sensors:
        raise ValueError(f"no column is left as a sensor: {'; '.join(found.lines()) or 'there are none'}")
    return found


def _reason(column: Column, runs: np.ndarray[Any, Any], asked: bool) -> str:
    """Why a column is no sensor; "" if it may be one."""
    present = column[~is_missing(column)]
    if len(present) == 0:
        return "it has no values"
    if present.dtype.kind == "O":
        present = present.astype(str)
    distinct = np.unique(present)
    if len(distinct) == 1:
        return f"it is always {distinct[0]}"
    if has_text(column):
        if len(distinct) > _MOST_VALUES and not _mostly_numbers(column):
            return f"it is text with {len(distinct)} different values"
    elif not asked and len(present) == len(column) and _counts_up(as_numbers(column, ""), runs):
        return "it grows from row to row within each run, as time does"
    return ""


def _mostly_numbers(column: Column) -> bool:
    """Whether nearly all texts of a column are numbers: then the others are mistakes."""
    number = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*")
    texts, counts = np.unique(column[~is_missing(column)].astype(str), return_counts=True)
    matches = np.array([number.fullmatch(text) is not None for text in texts.tolist()], dtype=np.bool_)
    return bool(counts[matches].sum() > 0.9 * counts.sum())


def _counts_up(numbers: Float64[np.ndarray, "N"], runs: np.ndarray[Any, Any]) -> bool:
    """Whether each value is larger than the one before it in its run; two rows are too few to tell."""
    same = runs[1:] == runs[:-1]
    return same.sum() > 1 and bool((np.diff(numbers)[same] > 0).all())


def _sensor(name: str, column: Column, unit: str, known: Any) -> tuple[dict[str, Any], str]:
    """The arguments of a sensor, and what is worth saying about it."""
    missing = is_missing(column)
    if has_text(column) and not _mostly_numbers(column):
        texts = np.unique(column[~missing].astype(str))
        return {"kind": "categorical", "values": tuple(texts.tolist()), "unit": unit}, ""
    numbers = as_numbers(column, name)[~missing]
    if np.isinf(numbers).any():
        row = int(np.flatnonzero(~missing)[np.isinf(numbers)][0])
        raise ValueError(f"column {name!r} is infinite in row {row}; leave the field empty for 'not observed'")
    if len(numbers) and np.isin(numbers, (0, 1)).all():
        return {"kind": "binary", "unit": unit}, ""
    low, high = (float(numbers.min()), float(numbers.max())) if len(numbers) else (0.0, 0.0)
    if turn := _turn(name, unit, low, high):
        return {"kind": "angle", "low": turn[0], "high": turn[1], "unit": unit or _TURNS[turn[1] - turn[0]]}, ""
    if known is not None and math.isfinite(known[1] - known[0]) and known[0] < known[1]:
        return {"low": float(known[0]), "high": float(known[1]), "unit": unit, "out_of_range": "clip"}, ""
    inner = _without_outliers(numbers)
    note = ""
    if (outside := int(((numbers < inner[0]) | (numbers > inner[1])).sum())) > 0:
        far = high if high > inner[1] else low
        note = f"{inner[0]:g} to {inner[1]:g}; {outside} readings beyond, such as {far:g}, count as the nearest end"
    low, high = inner if inner[0] < inner[1] else (low - 1, high + 1)
    return {"low": low, "high": high, "unit": unit, "out_of_range": "clip"}, note


def _without_outliers(numbers: Float64[np.ndarray, "N"]) -> tuple[float, float]:
    """The range without readings that are farther beyond the middle 98 % than half of their width."""
    if len(numbers) == 0:
        return 0.0, 0.0
    low, high = np.quantile(numbers, (0.01, 0.99))
    if len(numbers) < _FEW_ROWS or low == high:
        return float(numbers.min()), float(numbers.max())
    far = (high - low) / 2
    inner = numbers[(numbers >= low - far) & (numbers <= high + far)]
    return float(inner.min()), float(inner.max())


def _turn(name: str, unit: str, low: float, high: float) -> tuple[float, float] | None:
    """The range of a full turn that these readings fill, if the name is that of an angle."""
    if not _ANGLES.search(name):
        return None
    for turn, called in _TURNS.items():
        for start in (-turn / 2, 0.0):
            inside = start - 1e-3 * turn <= low and high <= start + 1.001 * turn
            if inside and high - low > 0.9 * turn and unit in ("", called):
                return start, start + turn
    return None


def _actuator(name: str, column: Column, unit: str) -> dict[str, Any]:
    """The arguments of an actuator."""
    if has_text(column) and not _mostly_numbers(column):
        raise ValueError(f"actuator {name!r} holds text, such as {str(column[0])!r:.40}; commands are numbers")
    numbers = as_numbers(column, name)
    if not np.isfinite(numbers).all():
        row = int((~np.isfinite(numbers)).argmax())
        raise ValueError(f"actuator {name!r} has no finite command in row {row}; every row needs one")
    values = np.unique(numbers)
    if len(values) == 1:
        raise ValueError(f"actuator {name!r} is always {values[0]:g}, so that there is nothing to learn")
    options = {"low": float(values[0]), "high": float(values[-1]), "unit": unit}
    if len(values) <= _MOST_LEVELS:
        steps = (values - values[0]) / np.diff(values).min()
        if steps[-1] <= 4 * _MOST_LEVELS and np.allclose(steps, steps.round(), atol=1e-3):
            options["levels"] = round(steps[-1]) + 1
    return options


def _changed(kind: type[Any], name: str, options: dict[str, Any], change: Mapping[str, Any], column: Column) -> Any:
    """A sensor or actuator with these options, some of which are changed."""
    known = [field.name for field in fields(kind) if field.name != "name"]
    if wrong := [key for key in change if key not in known]:
        raise ValueError(f"column {name!r} has no option {wrong[0]!r} to change; there are {', '.join(known)}")
    if (new := change.get("kind", options.get("kind", "real"))) != options.get("kind", "real"):
        # What was proposed for another kind does not apply.
        options = {"unit": options["unit"]}
        if new == "categorical" and "values" not in change:
            present = column[~is_missing(column)]
            options["values"] = tuple(np.unique(present.astype(str) if has_text(column) else present).tolist())
        elif new in ("real", "angle"):
            numbers = as_numbers(column, name)
            options |= {"low": float(np.nanmin(numbers)), "high": float(np.nanmax(numbers))}
    return kind(name, **options | dict(change))
