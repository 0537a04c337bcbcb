"""The runs below a folder: what each of them measured, or why there is nothing to gather."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.kit import Cell, Row, store
from experiments.kit.run import read_results
from experiments.kit.settings import NO_MATTER, written

FILES = ("run.json", "results.json", "records.parquet", "cells.jsonl")
"""A folder that holds one of these is a run's."""


@dataclass(frozen=True)
class Run:
    """One run.

    Attributes:
        name: its folder, relative to where the search began.
        state: "finished", "failed" (an error ended it), "unfinished" (it was stopped, or is still running) or
            "damaged" (its files cannot be read).
        why: what is known about a run that did not finish, and notes on one that did.
        settings: those on which results depend, by their dotted names.
        cells: what it was to measure; empty if that is not known.
        missing: the cells that were not measured.
        table, metrics, records: of a finished run.
    """

    folder: Path
    name: str
    state: str
    why: str = ""
    study: str = ""
    version: str = ""
    commit: str = ""
    settings: dict[str, Any] = field(default_factory=dict)
    cells: Sequence[Cell] = ()
    missing: Sequence[Cell] = ()
    table: Sequence[Row] = ()
    metrics: Mapping[str, Any] = field(default_factory=dict)
    records: pd.DataFrame = field(default_factory=pd.DataFrame)

    @property
    def same(self) -> str:
        """Equal for runs of the same study with the same settings."""
        return json.dumps([self.study, self.settings], sort_keys=True, default=str)


def find(folder: Path) -> list[Run]:
    """All runs in a folder and below it, in the order of their names.

    Raises `ValueError` if there are none.
    """
    if not folder.is_dir():
        raise ValueError(f"there is no folder {folder}")
    found = sorted(Path(place) for place, _, files in os.walk(folder) if not set(FILES).isdisjoint(files))
    if not found:
        raise ValueError(f"{folder} holds no run: no folder below it has {', '.join(FILES[:-1])} or {FILES[-1]}")
    return [read(place, place.relative_to(folder).as_posix()) for place in found]


def read(folder: Path, name: str) -> Run:
    """The run of a folder, whatever its state."""
    try:
        return _read(folder, name)
    except (ValueError, TypeError, LookupError, AttributeError, OSError, RecursionError) as error:
        return Run(folder, name, "damaged", " ".join(f"{error}".split()) or type(error).__name__)


def _read(folder: Path, name: str) -> Run:
    begun = _begun(folder / "run.json")
    if not (folder / "results.json").is_file():
        if not begun and not (folder / "cells.jsonl").is_file():
            return Run(folder, name, "damaged", "records.parquet is there, results.json is not")
        return _unfinished(folder, name, begun, "")
    content = read_results(folder)
    config = store.relevant(content["config"])
    if begun and (begun["study"], begun["version"], store.relevant(begun["config"])) != (
        content["study"], content["version"], config,
    ):  # fmt: skip
        return _unfinished(folder, name, begun, "results.json is of other settings, or of another version; ")
    records = _records(folder / "records.parquet")
    cells = begun["cells"] if begun else _kept_cells(folder / "cells.jsonl")
    empty = _without_rows(cells, records)
    return Run(
        folder,
        name,
        "finished",
        f"{len(empty)} of {len(cells)} cells have no row" if empty else "",
        content["study"],
        content["version"],
        str(content["provenance"].get("commit") or ""),
        flat(config),
        cells,
        empty,
        [dict(row) for row in content["table"]],
        content["metrics"],
        records,
    )


def _begun(path: Path) -> dict[str, Any]:
    """The content of `run.json`; empty if there is none, as in runs of earlier versions."""
    if not path.is_file():
        return {}
    try:
        content = json.loads(path.read_text())
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path.name} is not JSON: {error}") from error
    kinds = {"study": str, "version": str, "config": dict, "cells": list}
    if not isinstance(content, dict) or not all(isinstance(content.get(key), kind) for key, kind in kinds.items()):
        raise ValueError(f"{path.name} does not say what a run was to measure")
    return content


def _unfinished(folder: Path, name: str, begun: Mapping[str, Any], before: str) -> Run:
    if not begun:
        done = len(_kept_cells(folder / "cells.jsonl"))
        return Run(folder, name, "unfinished", f"{done} cells were measured; how many there are is not known")
    kept = store.Cells(folder, begun["study"], begun["config"], version=begun["version"])
    missing = [cell for cell in begun["cells"] if kept.find(cell) is None]
    done = f"{len(begun['cells']) - len(missing)} of {len(begun['cells'])} cells were measured"
    error = begun.get("error")
    return Run(
        folder,
        name,
        "failed" if error else "unfinished",
        f"{before}{done}; {error}" if error else f"{before}{done}; stopped, or still running",
        begun["study"],
        begun["version"],
        "",
        flat(store.relevant(begun["config"])),
        begun["cells"],
        missing,
    )


def _records(path: Path) -> pd.DataFrame:
    if not path.is_file():
        raise ValueError(f"{path.name} is not there")
    try:
        return pd.read_parquet(path)
    except (ValueError, OSError) as error:
        raise ValueError(f"{path.name} cannot be read: {error}") from error


def _kept_cells(path: Path) -> list[Cell]:
    """The cells of the complete lines of `cells.jsonl`."""
    found = []
    for line in path.read_text().splitlines() if path.is_file() else ():
        try:
            found.append(json.loads(line)["cell"])
        except json.JSONDecodeError:  # it was being written when the run was killed
            continue
    return found


def _without_rows(cells: Sequence[Cell], records: pd.DataFrame) -> list[Cell]:
    """The cells of which the records have no row."""
    factors = list(dict.fromkeys(name for cell in cells for name in cell))
    if not set(factors) <= set(records.columns):
        return [] if len(records) or not cells else list(cells)
    there = set(identities(records, factors))
    return [cell for cell in cells if tuple(plain(cell.get(name)) for name in factors) not in there]


def identities(records: pd.DataFrame, columns: Sequence[str]) -> Iterator[tuple[Any, ...]]:
    """The values of some columns in each row, equal where they mean the same: a missing value is None."""
    values = [[plain(value) for value in records[column].tolist()] for column in columns]
    return zip(*values, strict=True) if values else iter([()] * len(records))


def plain(value: Any) -> Any:
    """A value that can be compared and hashed: a missing one is None, and a list is text."""
    if value is None or value != value:
        return None
    return value if isinstance(value, str | int | float | bool) else str(value)


def flat(config: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Settings by their dotted names; a list is written as on the command line."""
    found: dict[str, Any] = {}
    for key, value in config.items():
        if not prefix and key in NO_MATTER:
            continue
        if isinstance(value, Mapping) and value:
            found |= flat(value, f"{prefix}{key}.")
        else:
            found[f"{prefix}{key}"] = written(value) if isinstance(value, list | dict) else value
    return found
