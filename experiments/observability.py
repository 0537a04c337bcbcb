"""How robust is a learned behaviour to states that are observed in part, and does a memory help?

Something comes between the robot's sensors and its program: readings are missing, stuck, delayed or noisy, or sensors
are gone, so that different states look alike. Programs that were shown undisturbed or disturbed demonstrations, with
and without a memory of past conditions, are asked about held-out runs of the teacher, who sees the true readings, and
then drive. What a learner may choose, it chooses on validation runs; the held-out ones are for the final figures.

    python -m experiments.observability
    python -m experiments.observability --multirun vsa.dim=1000,4000 seed=0,1
    python -m experiments.observability disturbances=[missing] learners=[disturbed,trace,hold] starts=0
"""

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import hydra
import torch
from omegaconf import DictConfig
from rich.console import Console

import sim
from experiments import presets
from experiments.choices import check_chosen
from experiments.command_line import errors_in_one_line, job
from experiments.driving import Driver, drive_here, progress_bars, workers
from experiments.jobs import run_jobs
from experiments.lessons import FIRST_DEMONSTRATION, FIRST_VALIDATION
from experiments.observability_disturbances import DISTURBANCES, Disturbance, Disturbed
from experiments.observability_learners import LEARNERS, Remembering, Study, compare
from experiments.observability_lessons import Lessons
from experiments.results import Results, Row
from torchvsa.encoders.history import check_lags

FIGURES = ("agreement", "balanced_agreement", "success_rate")


@dataclass(frozen=True)
class Examined:
    """What came of one learner under one disturbance: a row per strength, one per driven episode, and its choices."""

    name: str
    rows: list[Row]
    episodes: list[Row]
    tried: dict[str, float]


def study(config: dict[str, Any], folder: Path, console: Console) -> Results:
    """Run the whole comparison and write it to `folder`."""
    began = time.perf_counter()
    check(config)
    results = Results("observability", config, config["seed"])
    # Settings that cannot be built are found before anything is driven.
    space = presets.space(config["vsa"], config, config["seed"])
    presets.rule(config["rule"])
    with workers(config["workers"]) as executor, progress_bars(console) as progress:
        driver = Driver(config, executor, progress)

        def runs(what: str, first: int, count: int) -> Lessons:
            return Lessons.of(driver.drive(what, sim.Teacher(), range(first, first + count), record=True))

        shown = runs("teacher demonstrates", FIRST_DEMONSTRATION, config["demonstrations"])
        validation = runs("teacher, validation", FIRST_VALIDATION, config["validation"])
        heldout = runs("teacher, held out", 0, config["heldout"])
        # A job each, so that no process waits for another.
        jobs = [
            (learner, Study(config, space, shown, validation, disturbances(config, name)), heldout)
            for name in config["disturbances"]
            for learner in config["learners"]
            if DISTURBANCES[name].gaps or not LEARNERS[learner].gaps_only
        ]
        examined = run_jobs(executor, progress, "learn, ask and drive", examine, jobs)
    for outcome in examined:
        results.table += outcome.rows
        results.records += outcome.episodes
        for row in outcome.rows:
            place = f"{row['disturbance']}.{row['strength']:g}.{row['learner']}"
            results.metrics |= {f"{place}.{figure}": row[figure] for figure in FIGURES}
        results.metrics |= {f"{outcome.name}.validation.{choice}": found for choice, found in outcome.tried.items()}

    from experiments.observability_report import write_report  # matplotlib is slow to load, and only needed here

    write_report(folder, results)
    results.wall_time_s = time.perf_counter() - began
    results.write(folder)
    return results


def disturbances(config: Mapping[str, Any], name: str) -> list[Disturbance]:
    """One disturbance at all its strengths, 0 first."""
    return [DISTURBANCES[name](strength, config["seed"]) for strength in config["strengths"][name]]


def examine(learner: str, material: Study, heldout: Lessons) -> Examined:
    """Learn, be asked about held-out runs, and drive, at every strength of the disturbance."""
    config = material.config
    learned = LEARNERS[learner].learn(material)
    rows, episodes = [], []
    arena = presets.arena(config["arena"])
    for disturbance in material.disturbances:
        strength = disturbance.strength
        which = {"learner": learner, "disturbance": disturbance.name, "strength": float(strength)}
        asked = compare(learned, disturbance, heldout, config["compare_every"])
        rollout = (
            drive_here(config, Disturbed(disturbance, Remembering(learned)), range(config["starts"]), arena)
            if config["starts"]
            else None
        )
        memory = {"lags": list(learned.memory.lags), "hold": learned.memory.hold}
        rows.append({**which, "label": disturbance.label(strength), **memory, **asdict(asked), **_driven(rollout)})
        episodes += [] if rollout is None else [{**which, **row} for row in _episodes(rollout)]
    return Examined(f"{material.disturbances[0].name}.{learner}", rows, episodes, learned.tried)


def _driven(rollout: sim.Rollout | None) -> Row:
    summary = None if rollout is None else rollout.summary()
    names = ("success_rate", "success_low", "success_high", "escape_rate")
    return {"episodes": summary.episodes if summary else 0, **{name: getattr(summary, name, None) for name in names}}


def _episodes(rollout: sim.Rollout) -> list[Row]:
    columns = (rollout.episode, rollout.success, rollout.escaped, rollout.time_to_light)
    names = ("episode", "success", "escaped", "time_to_light_s")
    values = zip(*(column.tolist() for column in columns), strict=True)
    return [dict(zip(names, value, strict=True)) for value in values]


def check(config: Mapping[str, Any]) -> None:
    """Raise `ValueError` for settings that name what is not there, before anything is driven."""
    check_chosen("learners", config["learners"], LEARNERS)
    check_chosen("disturbances", config["disturbances"], DISTURBANCES)
    for name in config["disturbances"]:
        strengths = config["strengths"][name]
        if not strengths or strengths[0] != 0 or sorted(set(strengths)) != list(strengths):
            raise ValueError(f"strengths.{name} grow from 0 (undisturbed) on; got {strengths}")
        for strength in strengths:
            DISTURBANCES[name].check(strength)
    for setting in ("demonstrations", "validation", "heldout", "compare_every", "starts"):
        least = 0 if setting == "starts" else 1
        if config[setting] < least:
            raise ValueError(f"{setting}={config[setting]}: expected {least} or more")
    for setting in ("lags", "leaves"):
        if not config[setting]:
            raise ValueError(f"{setting} is empty; name at least one choice")
    for lags in config["lags"]:
        check_lags(lags)


@hydra.main(version_base="1.3", config_path="pkg://experiments.conf", config_name="observability")
def run(cfg: DictConfig) -> None:
    """One job."""
    from experiments.observability_report import print_table

    torch.set_num_threads(1)  # the workers need the cores
    job(cfg, "observability", study, print_table)


def main() -> None:
    """The command `python -m experiments.observability`."""
    with errors_in_one_line("observability"):
        run()


if __name__ == "__main__":
    main()
