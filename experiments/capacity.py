"""How many (condition, result) pairs does one hypervector hold?

A robot with 3 sensors of 20 values and 2 actuators of 3 values is shown random pairs, all conditions distinct, and
asked each condition again. A number of pairs is *held* if at least 99 % of them are recalled. Superposing each pair
once, as the paper does, stands beside programs that are trained, and beside the closed form for sums of random pairs.

    python -m experiments.capacity
    python -m experiments.capacity dims=[500,1000] pairs=[10,100,500] rows=[OneShot_sum,Gradient]
    python -m experiments.capacity --multirun seed=0,1,2
"""

import time
from collections.abc import Mapping
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

import hydra
import numpy as np
import torch
from omegaconf import DictConfig
from rich.console import Console

from experiments.choices import check_chosen, check_differ
from experiments.command_line import errors_in_one_line, job
from experiments.driving import progress_bars, workers
from experiments.pairs_held import CLOSED_FORM, CONDITIONS, Row, bracket, expected, halve, measure, parts, recalls
from experiments.results import Results


def study(config: dict[str, Any], folder: Path, console: Console) -> Results:
    """Measure all rows and write the results to `folder`."""
    began = time.perf_counter()
    check(config)
    results = Results("capacity", config, config["seed"])
    tasks = [(row, dim, n) for row in config["rows"] for dim in config["dims"] for n in range(config["repeats"])]
    # The longest first, so that no process is left alone with one at the end.
    tasks.sort(key=lambda task: -config["learners"][task[0]]["about"] * task[1] ** 2)
    found: dict[tuple[str, int, int], int] = {}
    records: dict[tuple[str, int, int], list[Row]] = {}
    with workers(config["workers"]) as executor, progress_bars(console) as progress:
        futures = {executor.submit(measure, config, *task): task for task in tasks}
        for future in progress.track(as_completed(futures), total=len(tasks), description="learn and ask"):
            task = futures[future]
            found[task], records[task] = future.result()
    results.records = [row for task in sorted(records) for row in records[task]]
    results.table = _table(config, found, results.records)
    results.metrics = _metrics(config, results.table, results.records)

    from experiments.capacity_report import write_report  # matplotlib is slow to load, and only needed here

    write_report(folder, results)
    results.wall_time_s = time.perf_counter() - began
    results.write(folder)
    return results


def check(config: Mapping[str, Any]) -> None:
    """Raise, naming the setting, for what cannot be measured."""
    check_chosen("rows", config["rows"], config["learners"])
    for setting, most in (("dims", None), ("pairs", CONDITIONS)):
        check_differ(setting, config[setting])
        if not config[setting]:
            raise ValueError(f"{setting} is empty; name at least one number")
        for number in config[setting]:
            if number < 1 or (most is not None and number > most):
                raise ValueError(f"{setting} are whole numbers from 1{f' to {most}' if most else ''}; got {number}")
    if not (0 < config["accuracy"] < 1 and 0 <= config["precision"] < 1 and config["repeats"] >= 1):
        raise ValueError(
            "accuracy is a share between 0 and 1, precision one from 0 on, repeats at least 1; "
            f"got {config['accuracy']}, {config['precision']} and {config['repeats']}"
        )
    # Settings that cannot be built are found before anything is learned.
    for row in config["rows"]:
        rule, space = parts(config, row, 16, config["seed"])
        if not rule.supports(space.vsa):
            raise ValueError(f"{row}: the rule {rule.name} cannot train programs of {space.vsa.name}")


def predicted(dim: int, accuracy: float) -> int:
    """The most pairs that the closed form recalls with `accuracy`."""

    def holds(pairs: int) -> bool:
        return expected(dim, pairs) >= accuracy

    return halve(holds, *bracket(holds, max(dim // 50, 1), 0, 1_000_000), precision=0.0)


def _table(config: Mapping[str, Any], found: Mapping[tuple[str, int, int], int], records: list[Row]) -> list[Row]:
    """One row for each learner and dimension, and the closed form below them."""
    table: list[Row] = []
    for learner in config["rows"]:
        for dim in config["dims"]:
            counts = [found[learner, dim, repeat] for repeat in range(config["repeats"])]
            # The time of the programs that held the most.
            seconds = [
                row["seconds"]
                for row in records
                if (row["learner"], row["dim"]) == (learner, dim) and row["pairs"] == counts[row["repeat"]]
            ]
            table.append(
                {
                    "learner": learner,
                    "dim": dim,
                    "pairs": float(np.median(counts)),
                    "pairs_min": min(counts),
                    "pairs_max": max(counts),
                    "pairs_per_dim": float(np.median(counts)) / dim,
                    "seconds": float(np.median(seconds)) if seconds else None,
                }
            )
    for dim in config["dims"]:
        pairs = predicted(dim, config["accuracy"])
        table.append({"learner": CLOSED_FORM, "dim": dim, "pairs": float(pairs), "pairs_min": None, "pairs_max": None})
        table[-1] |= {"pairs_per_dim": pairs / dim, "seconds": None}
    return table


def _metrics(config: Mapping[str, Any], table: list[Row], records: list[Row]) -> dict[str, float | None]:
    metrics: dict[str, float | None] = {}
    held = f"pairs_at_{100 * config['accuracy']:g}"
    for row in table:
        name = f"capacity.{row['learner']}.{row['dim']}.{held}"
        metrics[name] = row["pairs"]
        if row["learner"] != CLOSED_FORM:
            metrics |= {f"{name}_min": row["pairs_min"], f"{name}_max": row["pairs_max"]}
    dim = max(config["dims"])
    for pairs in sorted(config["pairs"]):
        for learner in config["rows"]:
            if shares := recalls(records, learner, dim, pairs):
                metrics[f"capacity.{learner}.{dim}.recall_of_{pairs}"] = float(np.median(shares))
        metrics[f"capacity.{CLOSED_FORM}.{dim}.recall_of_{pairs}"] = expected(dim, pairs)
    return metrics


@hydra.main(version_base="1.3", config_path="pkg://experiments.conf", config_name="capacity")
def run(cfg: DictConfig) -> None:
    """One job."""
    from experiments.capacity_report import print_table

    torch.set_num_threads(1)  # the workers need the other core
    job(cfg, "capacity", study, print_table)


def main() -> None:
    """The command `python -m experiments.capacity`."""
    with errors_in_one_line("capacity"):
        run()


if __name__ == "__main__":
    main()
