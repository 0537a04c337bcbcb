"""What a run writes, and how runs are collected."""

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

import torchvsa
from behaviours.storage import write_atomically

Row = dict[str, Any]


@dataclass
class Results:
    """The results of one run: `table` for people, `metrics` for sweeps, `records` for whoever wants to dig."""

    experiment: str
    config: dict[str, Any]
    seed: int
    table: list[Row] = field(default_factory=list)
    metrics: dict[str, float | None] = field(default_factory=dict)
    records: list[Row] = field(default_factory=list)
    wall_time_s: float = 0.0

    def write(self, folder: Path) -> Path:
        """Write `records.parquet` and, last, `results.json`: whoever finds the latter finds a finished run."""
        buffer = pa.BufferOutputStream()
        pq.write_table(pa.Table.from_pylist(self.records), buffer)
        write_atomically(folder / "records.parquet", buffer.getvalue().to_pybytes())
        content = {
            "experiment": self.experiment,
            "version": torchvsa.__version__,
            "seed": self.seed,
            "wall_time_s": round(self.wall_time_s, 3),
            "metrics": self.metrics,
            "table": self.table,
            "config": self.config,
        }
        text = json.dumps(_plain(content), indent=2, allow_nan=False)
        return write_atomically(folder / "results.json", (text + "\n").encode())


def finished(folder: Path, config: dict[str, Any]) -> bool:
    """Whether `folder` holds the results of a run with this very config, so that it need not run again."""
    path = folder / "results.json"
    return path.is_file() and json.loads(path.read_text())["config"] == _plain(config)


def collect(folder: str | Path) -> list[dict[str, Any]]:
    """The contents of every `results.json` below a folder, by path; jobs that failed have none and are left out."""
    return [
        {"path": str(path.parent), **json.loads(path.read_text())}
        for path in sorted(Path(folder).rglob("results.json"))
    ]


def _plain(value: Any) -> Any:
    """The same with what JSON lacks replaced: NaN and infinity become null."""
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
