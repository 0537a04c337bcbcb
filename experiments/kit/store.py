"""What a run keeps in its folder: cells as they are done, then records, then results."""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

import pandas as pd
import torch

import torchvsa
from behaviours.storage import write_atomically
from experiments.kit.settings import NO_MATTER
from experiments.kit.study import Row

LIBRARIES = ("torch", "numpy", "scipy", "scikit-learn", "pybullet", "pandas")


class Cells:
    """The finished cells of a run, one line of JSON each in `cells.jsonl`, so that a stopped run can go on.

    A cell counts as finished if the same study, in the same version and with the same settings, wrote it. Settings on
    which no result depends may differ.
    """

    def __init__(
        self,
        folder: Path,
        study: str,
        config: Mapping[str, Any],
        fresh: bool = False,
        version: str = torchvsa.__version__,
    ) -> None:
        self.path = folder / "cells.jsonl"
        self._run = [study, version, relevant(config)]
        self._known: dict[str, list[Row]] = {}
        self._torn = ""
        if fresh:
            self.path.unlink(missing_ok=True)
        elif self.path.is_file():
            text = self.path.read_text()
            self._torn = "" if text.endswith("\n") else "\n"  # a line that was being written when the run was killed
            for line in text.splitlines():
                try:
                    content = json.loads(line)
                except json.JSONDecodeError:
                    continue
                self._known[content["key"]] = content["records"]

    def key(self, cell: Row) -> str:
        """What tells this cell of this run from all others."""
        return hashlib.sha256(json.dumps([*self._run, cell], sort_keys=True).encode()).hexdigest()

    def find(self, cell: Row) -> list[Row] | None:
        """The records of a finished cell; None if it is not finished."""
        return self._known.get(self.key(cell))

    def add(self, cell: Row, records: list[Row]) -> None:
        """Keep the records of a cell, on the disk before this returns."""
        key = self.key(cell)
        with self.path.open("a") as file:
            file.write(self._torn + json.dumps({"key": key, "cell": cell, "records": records}) + "\n")
            file.flush()
            os.fsync(file.fileno())
        self._known[key], self._torn = records, ""


class Begun:
    """What a run is about to measure: `run.json`, written first, so that what is missing can be told later.

    It holds the study, the version, the settings and the cells; and, once the run failed, the error in one line.
    """

    def __init__(self, folder: Path, study: str, config: Mapping[str, Any], cells: Sequence[Row]) -> None:
        self._path = folder / "run.json"
        self._content = {"study": study, "version": torchvsa.__version__, "config": config, "cells": list(cells)}
        write_results(self._path, self._content)

    def failed(self, error: Exception) -> None:
        """Add why the run ended."""
        text = " ".join(f"{type(error).__name__}: {error}".split())
        with suppress(OSError):  # the disk may be what failed
            write_results(self._path, {**self._content, "error": text})


def relevant(config: Mapping[str, Any]) -> Row:
    """The settings on which results depend."""
    return {key: value for key, value in config.items() if key not in NO_MATTER}


def write_frame(path: Path, frame: pd.DataFrame) -> None:
    """Write a data frame as Parquet, whole or not at all."""
    write_atomically(path, frame.to_parquet())


def write_results(path: Path, content: Mapping[str, Any]) -> None:
    """Write JSON, whole or not at all; what JSON lacks (NaN, infinity) becomes null."""
    write_atomically(path, (json.dumps(plain(content), indent=2, allow_nan=False) + "\n").encode())


def plain(value: Any) -> Any:
    """A value as JSON has it."""
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if hasattr(value, "item"):  # a number of NumPy's
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def provenance(study: str) -> Row:
    """Where results come from: commit, versions, date, machine, threads and the full command."""
    versions = {"python": platform.python_version(), "torchvsa": torchvsa.__version__}
    for name in LIBRARIES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return {
        "commit": commit(),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "host": socket.gethostname(),
        "platform": platform.platform(),
        "cpus": os.cpu_count(),
        "threads": torch.get_num_threads(),
        "command": ["torchvsa", study, *sys.argv[1:]],
        "versions": versions,
    }


def commit() -> str | None:
    """The commit of the checkout that runs, with `+` if files differ from it; None outside a checkout."""
    here = Path(__file__).parent

    def git(*arguments: str) -> str | None:
        try:
            found = subprocess.run(
                ["git", *arguments], cwd=here, capture_output=True, text=True, timeout=10, check=True
            )
        except (OSError, subprocess.SubprocessError):
            return None
        return found.stdout.strip()

    # A package that was installed into some other project's checkout has no commit of its own.
    if git("ls-files", "--error-unmatch", "store.py") is None or (head := git("rev-parse", "HEAD")) is None:
        return None
    return head + ("+" if git("status", "--porcelain", "--untracked-files=no") else "")


def plain_rows(found: Row | list[Row]) -> list[Row]:
    """What was measured as rows of plain data; infinite and missing numbers stay."""
    rows = found if isinstance(found, list) else [found]
    return [{key: value.item() if hasattr(value, "item") else value for key, value in row.items()} for row in rows]
