"""What is measured of a controller: it learns, is asked, and drives; what the page shows beyond numbers is kept."""

from __future__ import annotations

import statistics
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.progress import Progress

import sim
from behaviours import Demonstrations
from experiments.corral.command_map import command_maps
from experiments.corral.controllers import CONTROLLERS, Controller, Task, learn, starts
from experiments.corral.failures import ambiguous_share, ends, mistakes, unlike_teacher
from experiments.corral.forgetting import learners, recalled
from experiments.corral.settings import Corral
from experiments.corral.trajectories import SHOWN, behaviours_called, control_steps
from experiments.kit import Cell, Row
from experiments.kit.store import write_frame
from experiments.tasks import corral
from experiments.tasks.agreement import compare


@dataclass(frozen=True)
class Material:
    """What all cells share.

    Attributes:
        task: what controllers learn from.
        folder: where trajectories, maps and programs are kept for the page.
        moving: the demonstrated samples before the lamp was reached; all of a file, which does not say when that was.
        examined: the teacher from the held-out starts.
    """

    task: Task
    folder: Path
    moving: Demonstrations
    examined: sim.Rollout


def prepare(settings: Corral, folder: Path, progress: Progress) -> Material:
    """Let the teacher demonstrate, learn over the codebooks of the run, and drive the held-out starts."""
    arena, teacher = corral.arena(settings.arena), sim.Teacher()
    if settings.demonstrations_file is None:
        episodes = range(corral.FIRST_DEMONSTRATION, corral.FIRST_DEMONSTRATION + settings.demonstrations)
        shown = corral.drive_together(settings, "teacher demonstrates", teacher, episodes, progress, arena)
        train, moving = corral.shown_in(shown)[0], corral.moving(shown)
    else:
        train = moving = corral.from_file(settings.demonstrations_file)
    bar = progress.add_task("learn", total=None)
    bank = learn(settings, train, lambda name: progress.update(bar, description=f"learned {name}"))
    train.save(folder / "demonstrations.safetensors")
    bank.save(folder / "behaviours.safetensors")
    progress.remove_task(bar)
    held_out = range(settings.starts)
    examined = corral.drive_together(settings, "teacher, held out", teacher, held_out, progress, arena)
    return Material(Task(settings, train, bank), folder, moving, examined)


def measure(material: Material, cell: Cell) -> list[Row]:
    """Learn, ask, drive.

    A row of the kind `controller` comes first; then one for each behaviour that was learned (`learning`), for each
    `candidate` that was compared to choose settings, for each kind of `mistake`, and for each `episode`.
    """
    name, settings = cell["controller"], material.task.settings
    controller = CONTROLLERS[name](material.task)
    held_out = corral.moving(material.examined)
    rollout = material.examined
    if name != "teacher":
        episodes = range(starts(settings, name))
        arena = corral.arena(settings.arena)
        rollout = corral.drive(settings, controller.policy, episodes, arena, controller.body, record=True)
    keep(material, name, controller, rollout, held_out)
    about = {
        **asdict(rollout.summary()),
        **agreement(material, controller, held_out),
        "pairs_stored": controller.pairs,
        "bins": controller.bins,
        "query_us": round(1e6 * query_seconds(controller.policy, held_out.sensors.numpy()), 1),
    }
    learned = [{"behaviour": name, **report.to_dict()} for name, report in controller.reports.items()]
    return [
        {"kind": "controller", **about},
        *({"kind": "learning", **row} for row in learned),
        *({"kind": "candidate", **row} for row in controller.candidates),
        *({"kind": "mistake", **row} for row in mistakes(rollout)),
        *({"kind": "episode", **row} for row in driven(rollout)),
    ]


def keep(material: Material, name: str, controller: Controller, rollout: sim.Rollout, held_out: Demonstrations) -> None:
    """Write what the page shows of a controller beyond numbers, and what it learned over codebooks of its own."""
    folder, program = material.folder, controller.program
    for kind in ("trajectories", "maps", "recall"):
        (folder / kind).mkdir(exist_ok=True)
    shown = rollout.episode[:SHOWN].tolist()
    write_frame(folder / "trajectories" / f"{name}.parquet", control_steps(rollout, shown, program))
    if program is not None and controller.bins is not None:
        write_frame(folder / "maps" / f"{name}.parquet", command_maps(program, controller.bins, held_out))
    if controller.bank is not None and name != "default":
        controller.bank.save(folder / f"{name}.safetensors")
    if name in ("paper", "paper_best_bins") and controller.bins is not None:
        found = recalled(learners(material.task.settings, controller.bins), material.moving)
        write_frame(folder / "recall" / f"{name}.parquet", found.assign(bins=controller.bins))


def agreement(material: Material, controller: Controller, held_out: Demonstrations) -> Row:
    """How often a controller does what the teacher does, and how much of the rest no program could get right."""
    program = controller.program
    found = compare(controller.policy, controller.space, material.moving, held_out, material.task.bank.space)
    ambiguous = None if program is None else ambiguous_share(program, material.moving, held_out)
    return {
        "train_agreement": found.train,
        "heldout_agreement": found.heldout,
        "unseen_agreement": found.unseen,
        "train_agreement_all": found.train_all,
        "heldout_agreement_distinct": found.heldout_distinct,
        "unseen_share": found.unseen_share,
        "ambiguous_share": ambiguous,
        **{f"heldout_agreement.{rule}": share for rule, share in found.by_rule.items()},
    }


def query_seconds(policy: sim.ControllerLike, readings: np.ndarray[Any, Any], calls: int = 200) -> float:
    """Median time of one answer to one robot in the form that drives, over readings of the teacher's runs."""
    rows = readings[np.linspace(0, len(readings) - 1, calls).astype(int)]
    controller = sim.as_controller(corral.frozen(policy))
    state = controller.start(np.zeros(1, dtype=np.int64))
    times = []
    for row in rows:
        start = time.perf_counter()
        _, state = controller.step(row[None], state)
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def driven(rollout: sim.Rollout) -> list[Row]:
    """A row for each episode."""
    columns = {
        "body": [rollout.body] * len(rollout),
        "episode": rollout.episode.tolist(),
        "success": rollout.success.tolist(),
        "escaped": rollout.escaped.tolist(),
        "time_to_light_s": rollout.time_to_light.tolist(),
        "steps": rollout.steps.tolist(),
        "dwell_fraction": rollout.dwell.tolist(),
        "collision_fraction": rollout.collisions.tolist(),
        "start_x": rollout.start[:, 0].tolist(),
        "start_y": rollout.start[:, 1].tolist(),
        "start_heading": rollout.start[:, 2].tolist(),
        "end": ends(rollout),
        "steps_unlike_teacher": unlike_teacher(rollout).tolist(),
        "behaviours_called": behaviours_called(rollout).tolist(),
    }
    return pd.DataFrame(columns).to_dict("records")
