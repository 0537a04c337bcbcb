"""What does one hypervector do where it was not shown?

Three parts. `corral`: 1 to 50 demonstrations of the escape, then unseen starts and unseen arenas, with every
combination of encoder, protection, record and rule. `wall_following`: the readings of a real robot, beside nearest
neighbour, trees, an MLP, logistic regression and torch-hd's classifiers. `smooth`: wheels that take any value, decoded
by interpolation between codes. A fourth, `fit_times`, is run alone: how long learning takes, beside torch-hd's AdaptHD.

    python -m experiments.generalisation
    python -m experiments.generalisation parts=[fit_times]
    python -m experiments.generalisation parts=[wall_following] wall_following.sensors=[24]
    python -m experiments.generalisation --multirun parts=[corral] vsa.dim=1000,4000 seed=0,1
"""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import hydra
import torch
from omegaconf import DictConfig
from rich.console import Console

from experiments import generalisation_corral as corral
from experiments import generalisation_fit_times as fit_times
from experiments import generalisation_smooth as smooth
from experiments import generalisation_wall_following as wall_following
from experiments.choices import check_chosen
from experiments.command_line import errors_in_one_line, job
from experiments.driving import progress_bars, workers
from experiments.models import torchhd as torchhd_classifiers
from experiments.results import Results, Row

PARTS = ("corral", "wall_following", "smooth", "fit_times")


def study(config: dict[str, Any], folder: Path, console: Console) -> Results:
    """Run the chosen parts and write them to `folder`."""
    began = time.perf_counter()
    check(config)
    results = Results("generalisation", config, config["seed"])
    for note in notes(config):
        console.print(note, soft_wrap=True)
    # Jobs run in processes of one thread each; this one only hands them out.
    torch.set_num_threads(1)
    with workers(config["workers"]) as executor, progress_bars(console) as progress:
        for part in config["parts"]:
            records, table = _run(part, config, executor, progress)
            results.records += [{"part": part, **record} for record in records]
            results.table += [{"part": part, **row} for row in table]
            results.metrics |= _metrics(part, table)
    results.records = _aligned(results.records)
    if "wall_following" in config["parts"]:
        results.metrics["wall_following.torchhd_installed"] = float(torchhd_classifiers.installed())

    from experiments.generalisation_report import write_report  # matplotlib is slow to load, and only needed here

    results.wall_time_s = time.perf_counter() - began
    write_report(folder, results, notes(config))
    results.wall_time_s = time.perf_counter() - began
    results.write(folder)
    return results


def check(config: Mapping[str, Any]) -> None:
    """Raise, naming the setting, for what cannot be run, before anything is."""
    parts = list(config["parts"])
    check_chosen("parts", parts, PARTS)
    if "fit_times" in parts and len(parts) > 1:
        raise ValueError(f"fit_times wants the machine to itself: parts=[fit_times]; got {parts}")
    for setting in ("workers", "robots"):
        if config[setting] < 1:
            raise ValueError(f"{setting}={config[setting]}: expected 1 or more")
    if "corral" in parts:
        corral.check(config["corral"], config["seed"], config["vsa"])
    if "wall_following" in parts:
        wall_following.check(config["wall_following"])
    if "smooth" in parts:
        smooth.check(config["smooth"])
    if "fit_times" in parts:
        fit_times.check(config["fit_times"])


def notes(config: Mapping[str, Any]) -> list[str]:
    """What a reader has to know about rows that are not there."""
    gone = wall_following.left_out(config["wall_following"]) if "wall_following" in config["parts"] else []
    return [f"{torchhd_classifiers.MISSING} ({', '.join(gone)})"] if gone else []


def _run(part: str, config: Mapping[str, Any], executor: Any, progress: Any) -> tuple[list[Row], list[Row]]:
    """Records and table of one part."""
    if part == "corral":
        records = corral.run(config, executor, progress)
        return records, corral.table(records)
    if part == "smooth":
        records = smooth.run(config, executor, progress)
        return records, smooth.table(records)
    if part == "wall_following":
        records = wall_following.run(config, executor, progress)
        return records, wall_following.table(records, config[part]["models"])
    records = fit_times.run(config, executor, progress)
    return records, wall_following.table(records, fit_times.MODELS)


KEYS = {
    "corral": ("learner", "arena", "demonstrations"),
    "wall_following": ("model", "sensors", "split"),
    "smooth": ("task", "model", "dim", "levels"),
    "fit_times": ("model", "sensors", "split"),
}
"""What names a row of each part; the rest are its figures."""

FIGURES = {
    "corral": ("heldout", "unseen", "success_rate"),
    "wall_following": ("accuracy", "fit_s"),
    "smooth": ("rmse", "relative", "success_rate"),
    "fit_times": ("accuracy", "fit_s"),
}


def _metrics(part: str, table: Sequence[Row]) -> dict[str, float | None]:
    """Every figure of a part's table as `part.key.key.figure`; keys that a row does not have are left out."""
    metrics: dict[str, float | None] = {}
    for row in table:
        name = ".".join([part, *(str(row[key]) for key in KEYS[part] if row[key] is not None)])
        metrics |= {f"{name}.{figure}": row[figure] for figure in FIGURES[part]}
    return metrics


def _aligned(records: Sequence[Row]) -> list[Row]:
    """The same with all columns in all rows, None where a part has no such column."""
    columns = dict.fromkeys(key for record in records for key in record)
    return [{**columns, **record} for record in records]


def print_table(results: Results, console: Console) -> None:
    """The tables of the parts, rounded, for the terminal."""
    from experiments.generalisation_report import tables

    for shown in tables(results.table):
        console.print(shown.for_terminal())


@hydra.main(version_base="1.3", config_path="pkg://experiments.conf", config_name="generalisation")
def run(cfg: DictConfig) -> None:
    """One job."""
    job(cfg, "generalisation", study, print_table)


def main() -> None:
    """The command `python -m experiments.generalisation`."""
    with errors_in_one_line("generalisation"):
        run()


if __name__ == "__main__":
    main()
