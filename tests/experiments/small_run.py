"""A tiny run of the main job, made in this process: everything that its report is written from."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import torch
from hydra import compose, initialize_config_module
from omegaconf import OmegaConf
from rich.progress import Progress

import sim
from behaviours import Demonstrations
from experiments import presets
from experiments.agreement import measure
from experiments.controllers import CONTROLLERS, Study
from experiments.corral import COLUMNS
from experiments.corral_report import CorralRun, write_report
from experiments.results import Results

SETTINGS = (
    "vsa.dim=600",
    "encoder.bins=8",
    "encoder.span=2",
    "seconds=10",
    "paper_bins=[2]",
    "starts=8",
    "rule.epochs=20",
)
STARTS = range(8)


@contextmanager
def one_thread() -> Iterator[None]:
    """Tests that run side by side would otherwise fight for the cores; no result depends on it."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@cache
@one_thread()
def small_run() -> CorralRun:
    """All controllers, 8 starts each."""
    with initialize_config_module("experiments.conf", version_base="1.3"):
        config: Any = OmegaConf.to_container(
            compose("corral", overrides=[*SETTINGS, f"starts={len(STARTS)}"]), resolve=True
        )
    reference = presets.space(config["vsa"], config, config["seed"])
    shown, shown_moving = _demonstrations(range(1000, 1006))
    heldout, moving = _demonstrations(STARTS)
    train = Demonstrations(shown.trajectory.sensors, shown.trajectory.commands, shown.step_episode)
    # Choosing the bins of `paper_best_bins` is not what is tested, so no candidate is driven.
    study = Study(config, reference, train, sim.Teacher().rule(train.sensors.numpy()), validate=lambda policy: heldout)
    controllers = {name: make(study) for name, make in CONTROLLERS.items()}
    rollouts = {name: _drive(one.policy, STARTS, one.body or "planar") for name, one in controllers.items()}
    agreements = {
        name: measure(one, shown_moving, moving, reference) for name, one in controllers.items()
    }  # fmt: skip
    table = []
    for name, one in controllers.items():
        summary = vars(rollouts[name].summary())
        agreement = agreements[name]
        row = summary | {
            "controller": name,
            "train_agreement": agreement.train,
            "heldout_agreement": agreement.heldout,
            "unseen_agreement": agreement.unseen,
            "pairs_stored": one.pairs,
            "bins": one.bins,
            "query_us": 100.0,
        }
        table.append({column: row[column] for column in COLUMNS})
    results = Results("corral", config, config["seed"], table)
    return CorralRun(Path(), results, controllers, rollouts, agreements, shown_moving, moving)


def report(folder: Path, *names: str, **config: object) -> str:
    """The page of the small run with only these controllers (all, if none is named) and some settings changed."""
    run = small_run()
    names = names or tuple(run.controllers)
    table = [row for row in run.results.table if row["controller"] in names]
    results = Results("corral", {**run.results.config, **config}, run.results.seed, table)
    controllers = {name: run.controllers[name] for name in names}
    rollouts = {name: run.rollouts[name] for name in names}
    agreements = {name: run.agreements[name] for name in names}
    with one_thread(), Progress(disable=True) as progress:
        return write_report(
            folder, results, controllers, rollouts, agreements, run.train, run.heldout, progress
        ).read_text()


def _drive(policy: sim.ControllerLike, episodes: range, body: str = "planar") -> sim.Rollout:
    return sim.rollout(policy, body=body, episodes=episodes, seconds=10, robots=8)


def _demonstrations(episodes: range) -> tuple[sim.Rollout, Demonstrations]:
    rollout = _drive(sim.Teacher(), episodes)
    path = rollout.trajectory
    moving = np.flatnonzero(~path.reached)
    return rollout, Demonstrations(path.sensors[moving], path.commands[moving], rollout.step_episode[moving])
