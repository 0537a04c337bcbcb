"""What differs between two runs, or between runs with two values of a setting.

Rows that were measured on the same thing (a cell, a start) are compared in pairs, so that what both have in common does
not blur the difference.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from experiments.collecting.runs import Run, identities
from experiments.kit import Row, Study
from experiments.kit.intervals import bootstrap_nested
from experiments.kit.settings import written

Pair = tuple[Run, Run]
Samples = list[tuple[np.ndarray, np.ndarray]]
"""The values of both sides, for each pair of runs."""
FEWEST = 6
"""Differences that are needed to call one value higher: by chance, six have the same sign in 3 % of all cases, five in
6 %. With fewer pairs of runs the intervals are about the starts of these runs, with more also about other runs."""


@dataclass(frozen=True)
class Comparison:
    """What differs.

    Attributes:
        labels: of the two sides.
        pairs: how many pairs of runs were compared.
        settings: rows `setting`, `a`, `b`; also of the version and the commit.
        groups: the columns of `differences` that name a row.
        differences: rows with `metric`, the means `a` and `b` over what both have in common, `difference` (b - a),
            `low`, `high`, `common` (how many rows were compared) and `verdict`.
        metrics: rows `metric`, `a`, `b`, as each run reports them; means over the runs of each side.
        equal: how many metrics are the same in both.
        notes: what a reader has to know.
    """

    labels: tuple[str, str]
    pairs: int
    settings: list[Row] = field(default_factory=list)
    groups: list[str] = field(default_factory=list)
    differences: list[Row] = field(default_factory=list)
    metrics: list[Row] = field(default_factory=list)
    equal: int = 0
    notes: list[str] = field(default_factory=list)


def compare(pairs: Sequence[Pair], labels: tuple[str, str], study: Study | None) -> Comparison:
    """Compare the second run of each pair with the first."""
    found = Comparison(labels, len(pairs), _settings(pairs))
    keys = _identity(pairs, study)
    found.groups.extend(_groups(pairs, keys, study))
    samples: dict[tuple[tuple[Any, ...], str], Samples] = {}
    common = 0
    for a, b in pairs:
        first, second = _common(a.records, b.records, keys)
        common += len(first)
        if not len(first):
            continue
        place = list(identities(first, found.groups))
        for column in first.columns.intersection(second.columns).difference(keys, sort=False):
            values, others = _numbers(first[column]), _numbers(second[column])
            known = np.isfinite(values) & np.isfinite(others)
            for group in dict.fromkeys(one for one, use in zip(place, known, strict=True) if use):
                use = known & np.fromiter((one == group for one in place), bool, len(place))
                samples.setdefault((group, str(column)), []).append((values[use], others[use]))
    found.metrics.extend(_metrics(pairs))
    if not common:
        found.notes.append("No cell or start is common to both: the metrics are side by side, and nothing is marked.")
    rows = [
        _difference(dict(zip(found.groups, group, strict=True)), metric, samples[group, metric])
        for one in dict.fromkeys(group for group, _ in samples)
        for group, metric in samples
        if group == one
    ]
    found.differences.extend(row for row in rows if row["difference"] or row["low"] or row["high"])
    return Comparison(**{**vars(found), "equal": len(rows) - len(found.differences)})


def by_setting(runs: Sequence[Run], setting: str, values: tuple[str, str]) -> tuple[list[Pair], list[Run]]:
    """The pairs of runs that differ in this setting only, and the runs without a partner."""
    sides: tuple[dict[str, Run], dict[str, Run]] = {}, {}
    for run in runs:
        value = value_of(run, setting)
        if value in values:
            rest = {name: one for name, one in run.settings.items() if not _belongs(name, setting)}
            sides[values.index(value)].setdefault(json.dumps(rest, sort_keys=True), run)
    pairs = [(run, sides[1][rest]) for rest, run in sides[0].items() if rest in sides[1]]
    paired = {id(run) for pair in pairs for run in pair}
    return pairs, [run for side in sides for run in side.values() if id(run) not in paired]


def value_of(run: Run, setting: str) -> str | None:
    """The value of a setting as text; of a group, such as `vsa`, the name of its option."""
    for name in (setting, f"{setting}.name"):
        if name in run.settings:
            return written(run.settings[name])
    return None


def _belongs(name: str, setting: str) -> bool:
    """Whether a setting changes with the one that is compared: itself, and the options of the same part."""
    part = setting.removesuffix(".name")
    return name == setting or (name.startswith(f"{part}.") and name != setting)


def _settings(pairs: Sequence[Pair]) -> list[Row]:
    """The settings that differ within a pair, with the values of all pairs."""
    of_both = [[{**run.settings, "version": run.version, "commit": run.commit} for run in pair] for pair in pairs]
    rows = []
    for name in dict.fromkeys(name for pair in of_both for one in pair for name in one):
        if any(a.get(name) != b.get(name) for a, b in of_both):
            a, b = (", ".join(dict.fromkeys(_text(pair[side].get(name)) for pair in of_both)) for side in (0, 1))
            rows.append({"setting": name, "a": a, "b": b})
    return rows


def _text(value: Any) -> str:
    return "-" if value is None else written(value)


def _identity(pairs: Sequence[Pair], study: Study | None) -> list[str]:
    """The columns that say what a row was measured on, of those that all records have."""
    names = dict.fromkeys(name for pair in pairs for run in pair for cell in run.cells for name in cell)
    if study is not None:
        names |= dict.fromkeys([*study.keys, *study.units])
    return [name for name in names if all(name in run.records.columns for pair in pairs for run in pair)]


def _groups(pairs: Sequence[Pair], keys: Sequence[str], study: Study | None) -> list[str]:
    """The columns of the identity that name a row of the comparison: those of the study's table, and words."""
    of_table = () if study is None else study.keys
    words = [key for key in keys if all(isinstance(value, str) for pair in pairs for value in pair[0].records[key])]
    return [key for key in keys if key in of_table or key in words]


def _common(a: pd.DataFrame, b: pd.DataFrame, keys: Sequence[str]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The rows of both that were measured on the same, in the same order, without those that are not told apart."""
    if not keys:
        return a.iloc[:0], b.iloc[:0]
    places = []
    for frame in (a, b):
        named = list(identities(frame, keys))
        count = Counter(named)
        places.append({name: place for place, name in enumerate(named) if count[name] == 1})
    common = [name for name in places[0] if name in places[1]]
    first, second = (frame.iloc[[place[name] for name in common]] for frame, place in zip((a, b), places, strict=True))
    return first.reset_index(drop=True), second.reset_index(drop=True)


def _numbers(column: Any) -> np.ndarray:
    """A column as numbers; NaN where there is none, everywhere if it holds words."""
    known = column.dropna()
    if not all(isinstance(value, bool | int | float | np.number | np.bool_) for value in known):
        return np.full(len(column), np.nan)
    return np.array([np.nan if value is None or value is pd.NA else float(value) for value in column])


def _difference(group: Row, metric: str, found: Samples) -> Row:
    """A row of the comparison; each of the samples has a pair of runs' values."""
    a, b = (float(np.mean([np.mean(pair[side]) for pair in found])) for side in (0, 1))
    each = [(second - first).tolist() for first, second in found]
    count = sum(map(len, each))
    # Without a difference there is nothing to resample.
    low, high = bootstrap_nested(each, len(each) >= FEWEST) if any(map(np.any, each)) else (0.0, 0.0)
    verdict = f"fewer than {FEWEST}" if count < FEWEST else "not told apart"
    if count >= FEWEST and (low > 0 or high < 0):
        verdict = "higher" if low > 0 else "lower"
    known = low == low
    return {
        **group,
        "metric": metric,
        "a": a,
        "b": b,
        "difference": float(np.mean([np.mean(one) for one in each])),
        "low": low if known else None,
        "high": high if known else None,
        "common": count,
        "verdict": verdict,
    }


def _metrics(pairs: Sequence[Pair]) -> list[Row]:
    """The metrics that differ, as the runs report them."""
    rows = []
    for name in dict.fromkeys(name for pair in pairs for run in pair for name in run.metrics):
        sides: list[Any] = [[pair[side].metrics.get(name) for pair in pairs] for side in (0, 1)]
        if sides[0] == sides[1]:
            continue
        a, b = (float(np.mean(side)) if _all_numbers(side) else None for side in sides)
        rows.append({"metric": name, "a": a, "b": b, "difference": None if a is None or b is None else b - a})
    return rows


def _all_numbers(values: Sequence[Any]) -> bool:
    return all(isinstance(value, int | float) for value in values)
