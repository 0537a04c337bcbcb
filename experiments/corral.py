"""The main job: show the corral escape, learn it as one hypervector, drive, and compare.

The teacher (the paper's five if-else rules) drives a simulated robot with real-valued sensors. Its runs are the
demonstrations. Each controller of the table learns from them or is a reference point, is asked about held-out runs
of the teacher (agreement), and then drives by itself from held-out starts (success).

    python -m experiments.corral
    python -m experiments.corral --multirun vsa.dim=1000,4000 seed=0,1
    python -m experiments.corral controllers=[teacher,default] encoder.bins=16
"""

import statistics
import time
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import hydra
import numpy as np
from omegaconf import DictConfig
from rich.console import Console
from rich.table import Table

import sim
from behaviours import Behaviour, BehaviourBank, Policy, Space
from experiments import presets
from experiments.agreement import Agreement, measure
from experiments.choices import check_chosen
from experiments.command_line import errors_in_one_line, job
from experiments.controllers import CONTROLLERS, Study, TableRow
from experiments.driving import Driver, progress_bars, workers
from experiments.lessons import FIRST_DEMONSTRATION, FIRST_VALIDATION, from_file, shown_in
from experiments.models import hand_written
from experiments.results import Results, Row

COLUMNS = (
    "controller",
    "episodes",
    "success_rate",
    "success_low",
    "success_high",
    "escape_rate",
    "time_to_light_s",
    "dwell_fraction",
    "collision_fraction",
    "train_agreement",
    "heldout_agreement",
    "unseen_agreement",
    "pairs_stored",
    "bins",
    "query_us",
)


def study(config: dict[str, Any], folder: Path, console: Console) -> Results:
    """Run the whole comparison and write it to `folder`."""
    began = time.perf_counter()
    results = Results("corral", config, config["seed"])
    check_chosen("controllers", config["controllers"], CONTROLLERS)
    # Settings that cannot be built are found before anything is driven.
    reference = presets.space(config["vsa"], config, config["seed"])
    presets.rule(config["rule"])
    if "hand_written" in config["controllers"]:
        hand_written.behaviour(reference.vsa, config["seed"])
    train = None if config["demonstrations_file"] is None else from_file(config["demonstrations_file"])
    with workers(config["workers"]) as executor, progress_bars(console) as progress:
        driver = Driver(config, executor, progress)
        if train is None:
            numbers = range(FIRST_DEMONSTRATION, FIRST_DEMONSTRATION + config["demonstrations"])
            train, moves = shown_in(driver.drive("teacher demonstrates", sim.Teacher(), numbers, record=True))
            moving = train.where(moves.tolist())
        else:
            moving = train  # a file does not say when the lamp was reached
        validation = range(FIRST_VALIDATION, FIRST_VALIDATION + config["validation_starts"])
        learn_from = Study(
            config,
            reference,
            train,
            sim.Teacher().rule(train.sensors.numpy()),
            validate=lambda policy: driver.drive("bins for paper_best_bins", policy, validation),
        )
        examined = driver.drive("teacher, held out", sim.Teacher(), range(config["starts"]), record=True)
        heldout, moves = shown_in(examined)
        heldout = heldout.where(moves.tolist())

        controllers, rollouts, agreements = {}, {}, {}
        for name in config["controllers"]:
            controller = CONTROLLERS[name](learn_from)
            agreements[name] = measure(controller, moving, heldout, reference)
            if name == "teacher" and config["body"]["name"] == examined.body:
                rollouts[name] = examined
            else:
                episodes = range(_starts(config, name))
                rollouts[name] = driver.drive(name, controller.policy, episodes, controller.body, record=True)
            controllers[name] = controller
    for name, controller in controllers.items():
        query = _query_seconds(controller.policy, heldout.sensors.numpy())
        results.table.append(_row(controller, rollouts[name], agreements[name], query * 1e6))
        results.records += _records(name, rollouts[name])
    results.metrics = _metrics(results.table, rollouts, agreements, controllers)

    from experiments.corral_report import write_report  # matplotlib is slow to load, and only needed here

    with progress_bars(console) as progress:
        write_report(folder, results, controllers, rollouts, agreements, moving, heldout, progress)
    train.save(folder / "demonstrations.safetensors")
    _bank(reference, controllers).save(folder / "behaviours.safetensors")
    results.wall_time_s = time.perf_counter() - began
    results.write(folder)
    return results


def _bank(space: Space, controllers: Mapping[str, TableRow]) -> BehaviourBank:
    """What was learned over the run's codebooks: the default, and the behaviours that were bundled."""
    bank = BehaviourBank(space)
    for name, controller in controllers.items():
        if isinstance(controller.mind, Behaviour) and controller.space is space:
            bank.add(name, controller.mind)
        if isinstance(controller.mind, Policy):
            for part, behaviour in zip(controller.mind.names, controller.mind.parts, strict=True):
                bank.add(part, behaviour)
    return bank


def _starts(config: Mapping[str, Any], name: str) -> int:
    if name == "teacher_wheeled":
        return config["wheeled_starts"]
    return config["starts"] if name in ("teacher", "default", "bundled") else config["other_starts"]


def _query_seconds(policy: sim.ControllerLike, readings: np.ndarray, calls: int = 200) -> float:
    """Median time of one answer to one robot, over readings that the teacher met."""
    rows = readings[np.linspace(0, len(readings) - 1, calls).astype(int)]
    controller = sim.as_controller(policy)
    state = controller.start(np.zeros(1, dtype=np.int64))
    times = []
    for row in rows:
        start = time.perf_counter()
        _, state = controller.step(row[None], state)
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def _row(controller: TableRow, rollout: sim.Rollout, agreement: Agreement, query_us: float) -> Row:
    row = {
        **asdict(rollout.summary()),
        "controller": controller.name,
        "train_agreement": agreement.train,
        "heldout_agreement": agreement.heldout,
        "unseen_agreement": agreement.unseen,
        "pairs_stored": controller.pairs,
        "bins": controller.bins,
        "query_us": round(query_us, 1),
    }
    return {column: row[column] for column in COLUMNS}


def _records(name: str, rollout: sim.Rollout) -> list[Row]:
    columns = {
        "episode": rollout.episode,
        "success": rollout.success,
        "escaped": rollout.escaped,
        "time_to_light_s": rollout.time_to_light,
        "steps": rollout.steps,
        "dwell_fraction": rollout.dwell,
        "collision_fraction": rollout.collisions,
        "start_x": rollout.start[:, 0],
        "start_y": rollout.start[:, 1],
        "start_heading": rollout.start[:, 2],
    }
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return [{"controller": name, "body": rollout.body, **dict(zip(columns, row, strict=True))} for row in rows]


def _metrics(
    table: list[Row],
    rollouts: Mapping[str, sim.Rollout],
    agreements: Mapping[str, Agreement],
    controllers: Mapping[str, TableRow],
) -> dict[str, float | None]:
    """Every number of the table as `controller.column`, and what the table has no room for."""
    metrics: dict[str, float | None] = {}
    for row in table:
        name = row["controller"]
        metrics |= {f"{name}.{column}": row[column] for column in COLUMNS[1:]}
        agreement = agreements[name]
        metrics[f"{name}.train_agreement_all"] = agreement.train_all
        metrics[f"{name}.heldout_agreement_distinct"] = agreement.heldout_distinct
        metrics[f"{name}.unseen_share"] = agreement.unseen_share
        metrics |= {f"{name}.heldout_agreement.{rule}": share for rule, share in agreement.by_rule.items()}
        for part, report in controllers[name].reports.items():
            counts = {key: value for key, value in report.to_dict().items() if key != "rule"}
            metrics |= {f"{name}.learning.{part}.{key}": float(value) for key, value in counts.items()}
    if {"teacher", "teacher_wheeled"} <= set(rollouts):
        wheeled, planar = rollouts["teacher_wheeled"], rollouts["teacher"]
        same = np.isin(planar.episode, wheeled.episode)
        metrics["wheeled_minus_planar_success"] = float(wheeled.success.mean() - planar.success[same].mean())
    return metrics


def print_table(results: Results, console: Console) -> None:
    """The table, rounded, for the terminal."""
    table = Table(title="Corral escape")
    titles = ("controller", "episodes", "success [95 %]", "escape", "time s", "dwell", "collide", "train", "held out")
    for title in (*titles, "unseen", "pairs", "bins", "µs"):
        table.add_column(title, justify="left" if title == "controller" else "right", no_wrap=True)
    for row in results.table:
        cells = {key: _cell(value) for key, value in row.items()} | {"query_us": f"{row['query_us']:.0f}"}
        seconds = row["time_to_light_s"]
        cells["time_to_light_s"] = "-" if seconds is None else f"{seconds:.1f}"
        low, high = cells.pop("success_low"), cells.pop("success_high")
        cells["success_rate"] += f" [{low}, {high}]"
        table.add_row(*cells.values())
    console.print(table)


def _cell(value: object) -> str:
    if value is None:
        return "-"
    return f"{value:.3f}" if isinstance(value, float) else str(value)


@hydra.main(version_base="1.3", config_path="pkg://experiments.conf", config_name="corral")
def run(cfg: DictConfig) -> None:
    """One job."""
    job(cfg, "torchvsa-corral", study, print_table)


def main() -> None:
    """The console command `torchvsa-corral`."""
    with errors_in_one_line("torchvsa-corral"):
        run()


if __name__ == "__main__":
    main()
