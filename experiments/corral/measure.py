"""What is measured of a controller: it learns, is asked, and drives; what the page shows beyond numbers is kept."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import pandas as pd
from rich.progress import Progress

import sim
from behaviours import Behaviour, BehaviourBank, Demonstrations
from experiments.corral.command_map import ambiguous_share, command_maps
from experiments.corral.controllers import CONTROLLERS, Controller, Material, driving, learn, original, starts
from experiments.corral.forgetting import learners, recalled
from experiments.corral.settings import Corral
from experiments.corral.trajectories import SHOWN, control_steps, episodes_of, mistakes, with_recall
from experiments.kit import Cell, Row
from experiments.kit.store import write_frame
from experiments.tasks import corral
from experiments.tasks.agreement import compare
from experiments.tasks.timing import query_seconds


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
    bank = learn(settings, train)
    progress.remove_task(bar)
    train.save(folder / "demonstrations.safetensors")
    bank.save(folder / "behaviours.safetensors")
    examined = corral.drive_together(settings, "teacher, held out", teacher, range(settings.starts), progress, arena)
    ppo = train_ppo(settings, progress) if "ppo" in settings.controllers else None
    return Material(settings, folder, train, moving, bank, examined, ppo)


def train_ppo(settings: Corral, progress: Progress) -> sim.ControllerLike:
    """Train the row `ppo` in the arena and the engine of the run."""
    from experiments.models.ppo import trained  # needs a package that no other row does

    bar = progress.add_task("ppo trains", total=settings.ppo_steps)
    return trained(
        settings.ppo_steps, settings.seed, corral.arena(settings.arena), settings.seconds,
        progress=lambda count: progress.advance(bar, count), engine=settings.engine, body=settings.body,
    )  # fmt: skip


def measure(material: Material, cell: Cell) -> list[Row]:
    """Learn, ask, drive.

    A row of the kind `controller` comes first; then one for each behaviour that was learned (`learning`), for each
    `candidate` that was compared to choose settings, for each kind of `mistake`, and for each `episode`.
    """
    name, settings = cell["controller"], material.settings
    controller = CONTROLLERS[name](material)
    held_out = corral.moving(material.examined)
    rollout = material.examined
    if name != "teacher":
        episodes, arena = range(starts(settings, name)), corral.arena(settings.arena)
        rollout = corral.drive(driving(settings, name), controller.policy, episodes, arena, record=True)
    steps = control_steps(rollout)
    driven = episodes_of(rollout, steps)
    keep(material, name, controller, steps.loc[steps.episode.isin(rollout.episode[:SHOWN])], held_out)
    about = {
        **asdict(rollout.summary()),
        **agreement(material, controller, held_out),
        "pairs_stored": controller.pairs,
        "bins": controller.bins,
        "query_us": round(1e6 * query_seconds(controller.policy, held_out.sensors.numpy()), 1),
    }
    rows = {
        "controller": [about],
        "learning": [{"behaviour": name, **report.to_dict()} for name, report in controller.reports.items()],
        "candidate": controller.candidates,
        "mistake": mistakes(steps.loc[steps.episode.isin(driven.episode[~driven.success])]),
        "episode": driven.to_dict(orient="records"),
    }
    return [{"kind": kind, **row} for kind, found in rows.items() for row in found]


def keep(material: Material, name: str, controller: Controller, shown: pd.DataFrame, held_out: Demonstrations) -> None:
    """Write what the page shows of a controller beyond numbers, and what it learned over codebooks of its own."""
    folder, program, bins = material.folder, controller.program, controller.bins
    for kind in ("trajectories", "maps", "recall"):
        (folder / kind).mkdir(exist_ok=True)
    shown = shown if program is None else with_recall(shown, program)
    write_frame(folder / "trajectories" / f"{name}.parquet", shown)
    if original(name) != name:
        return
    if isinstance(program, Behaviour) and name != "default":
        bank = BehaviourBank(program.space)
        bank.add(name, program)
        bank.save(folder / f"{name}.safetensors")
    if program is not None and bins is not None:
        write_frame(folder / "maps" / f"{name}.parquet", command_maps(program, bins, held_out))
    if name in ("paper", "paper_best_bins") and bins is not None:
        found = recalled(learners(material.settings, bins), material.moving)
        write_frame(folder / "recall" / f"{name}.parquet", found.assign(bins=bins))


def agreement(material: Material, controller: Controller, held_out: Demonstrations) -> Row:
    """How often a controller does what the teacher does, and how much of the rest no program could get right."""
    program = controller.program
    space = None if program is None else program.space
    found = compare(controller.policy, space, material.moving, held_out, material.bank.space)
    return {
        "train_agreement": found.train,
        "heldout_agreement": found.heldout,
        "unseen_agreement": found.unseen,
        "train_agreement_all": found.train_all,
        "heldout_agreement_distinct": found.heldout_distinct,
        "unseen_share": found.unseen_share,
        "ambiguous_share": None if program is None else ambiguous_share(program, material.moving, held_out),
        **{f"heldout_agreement.{rule}": share for rule, share in found.by_rule.items()},
    }
