"""What is measured of a row: it drives in every arena, and is asked about the teacher's moments there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray
from rich.progress import Progress

import sim
from behaviours import Demonstrations, Policy
from behaviours.learning import no_convergence_warnings
from experiments.composition.rows import Shown, demonstrated, line_of
from experiments.kit import Cell, Row
from experiments.kit.intervals import bootstrap
from experiments.kit.store import write_frame
from experiments.tasks import agreement as agreeing
from experiments.tasks import corral
from experiments.tasks.asked_once import AskedOnce, EachAskedOnce
from experiments.tasks.in_bullet import TWINS, there, twin_starts
from experiments.tasks.recorded import frame_of
from sim.statistics import wilson

if TYPE_CHECKING:
    from experiments.composition.settings import Composition

FULL = ("default", "large")
"""The arenas with `starts` starts; others have `other_starts`."""
PATHS_IN, PATHS = "large", 4
"""The arena whose paths are kept for the page, and how many."""


@dataclass(frozen=True)
class Moments:
    """Distinct moments of the teacher's runs in one arena.

    Attributes:
        shown: a reading for each, and the teacher's commands.
        count: how often each occurs.
        cell: the index of its condition at the bins of the run.
        avoid: whether the teacher avoids an obstacle.
    """

    shown: Demonstrations
    count: NDArray[np.int64]
    cell: NDArray[np.int64]
    avoid: NDArray[np.bool_]

    def agreement(self, right: NDArray[np.bool_]) -> Row:
        """Agreement, given the moments `[M]` answered as the teacher does: of all, where it avoids, and by cell.

        `agreement_distinct` counts each condition once.
        """
        by_cell = np.bincount(self.cell, right * self.count) / np.bincount(self.cell, self.count)
        avoid = self.avoid
        return {
            "agreement": float(np.average(right, weights=self.count)),
            "agreement_avoid": float(np.average(right[avoid], weights=self.count[avoid])) if avoid.any() else None,
            "agreement_distinct": float(by_cell.mean()),
        }

    @property
    def ceiling(self) -> float:
        """The agreement of the best function of the bins."""
        levels = torch.unique(corral.schema().command_levels(self.shown.commands), dim=0, return_inverse=True)[1]
        votes = np.zeros((self.cell.max() + 1, int(levels.max()) + 1))
        np.add.at(votes, (self.cell, levels.numpy()), self.count)
        return float(votes.max(1).sum() / votes.sum())


@dataclass(frozen=True)
class Material:
    """What all cells share: the settings, where files go, what is learned from, and the moments of each arena."""

    settings: Composition
    folder: Path
    shown: Shown
    moments: dict[str, Moments]


def prepare(settings: Composition, folder: Path, progress: Progress) -> Material:
    """Let the teacher demonstrate in `default`, and drive held-out starts in every arena."""
    shown = demonstrated(settings, progress).with_banks([*settings.rows, *settings.bullet_rows], progress)
    moments = {}
    for name in settings.arenas:
        what, asked = f"held out in {name}", range(settings.heldout)
        driven = corral.drive_together(settings, what, shown.rules, asked, progress, sim.find_arena(name))
        moments[name] = distinct(shown, corral.moving(driven))
    return Material(settings, folder, shown, moments)


def distinct(shown: Shown, samples: Demonstrations) -> Moments:
    """The moments of recorded runs that differ at the bins of the run, or in what the teacher does."""
    cells = shown.space(0).cells(samples.sensors)
    levels = corral.schema().command_levels(samples.commands)
    avoid = [number for number, name in enumerate(shown.rules.names) if name == "avoid"]
    fires = np.isin(shown.rules.first(samples.sensors.numpy()), avoid)
    key = torch.cat([cells, levels, torch.from_numpy(fires)[:, None]], 1).numpy()
    _, first, count = np.unique(key, axis=0, return_index=True, return_counts=True)
    chosen = torch.from_numpy(first)
    cell = torch.unique(cells[chosen], dim=0, return_inverse=True)[1].numpy()
    rows = Demonstrations(samples.sensors[chosen], samples.commands[chosen], np.arange(len(chosen)))
    return Moments(rows, count, cell, fires[first])


def measure(material: Material, cell: Cell) -> list[Row]:
    """A record for each arena and codebook: success, agreement with the teacher, collisions."""
    settings, line = material.settings, line_of(cell["row"])
    draws = range(settings.codebooks if line.codebooks else 1)
    with no_convergence_warnings():
        made = [line.make(material.shown, codebook) for codebook in draws]
    together = EachAskedOnce(made) if all(map(AskedOnce.possible, made)) else None
    drivers = made if together is None else [together]
    asked = made if together is None else [together.alone(codebook) for codebook in draws]
    # The moments first: robots meet most of their conditions again, and many are asked faster at once.
    agreed = {name: [agreement(one, material.moments[name]) for one in asked] for name in settings.arenas}
    body = TWINS.get(cell["engine"])
    driving = settings if body is None else there(settings, body)
    found = []
    for name in settings.arenas:
        keep = name == PATHS_IN and cell["engine"] == "vector"
        count = starts(settings, cell, name)
        runs = drive_each(driving, drivers, count, name, keep)
        if keep:
            write_paths(material.folder, cell["row"], made, runs, count)
        for codebook in draws:
            run = runs[codebook % len(runs)]
            own = run.episode % len(draws) == codebook
            again = {engine: own & (run.episode < twin_starts(settings, engine)) for engine in TWINS}
            found.append(
                {
                    "arena": name,
                    "codebook": codebook,
                    "episodes": int(own.sum()),
                    "successes": int(run.success[own].sum()),
                    "collisions": float(run.collisions[own].mean()) if own.any() else None,
                    **agreed[name][codebook],
                    **{f"{engine}_successes": int(run.success[chosen].sum()) for engine, chosen in again.items()},
                }
            )
    return found


def drive_each(settings: Composition, made: list[Any], starts: int, arena: str, record: bool) -> list[sim.Rollout]:
    """A rollout for each controller: start e drives with controller e mod their number."""
    where = sim.find_arena(arena)
    owned = [range(number, starts, len(made)) for number in range(len(made))]
    return [corral.drive(settings, one, own, where, record) for one, own in zip(made, owned, strict=True)]


def starts(settings: Composition, cell: Cell, arena: str) -> int:
    """How many held-out starts a cell drives in an arena."""
    full = settings.starts if arena in FULL else settings.other_starts
    return min(full, twin_starts(settings, cell["engine"])) if cell["engine"] in TWINS else full


def agreement(controller: Any, moments: Moments) -> Row:
    """The shares of `Moments.agreement` for a controller, and the best that a function of the bins could reach."""
    return {**moments.agreement(agreeing.right(controller, moments.shown)), "ceiling": moments.ceiling}


def write_paths(folder: Path, row: str, made: list[Any], runs: list[sim.Rollout], starts: int) -> None:
    """Keep the first paths, with who spoke at each step and how well the condition was known."""
    paths = []
    for episode in range(min(PATHS, starts)):
        controller, run = made[episode % len(made)], runs[episode % len(runs)]
        steps = run.slice(episode)
        path = frame_of(steps).assign(episode=episode, success=bool(run.success[run.episode == episode][0]))
        if isinstance(controller, Policy):
            recalls = answers(controller, steps.sensors, episode)
            speaker = np.concatenate([recall.speaker for recall in recalls])
            path["speaker"] = np.array([*controller.names, ""])[speaker]
            path["familiarity"] = np.concatenate([recall.familiarity for recall in recalls])
        paths.append(path)
    (folder / "paths").mkdir(exist_ok=True)
    write_frame(folder / "paths" / f"{row}.parquet", pd.concat(paths))


def answers(policy: Policy, readings: NDArray[np.float64], episode: int) -> list[Any]:
    """What a policy answers along one episode; one with a memory is asked step by step."""
    if AskedOnce.possible(policy):
        return [policy(readings)]
    state, found = policy.start([episode]), []
    for row in readings:
        answer, state = policy.step(row[None], state)
        found.append(answer)
    return found


def success_interval(own: pd.DataFrame) -> tuple[float, float]:
    """The wider of Wilson's interval over the starts and the bootstrap's over the codebooks."""
    low, high = wilson(int(own.successes.sum()), int(own.episodes.sum()))
    driven = own.loc[own.episodes > 0]
    rates = driven.successes.to_numpy() / driven.episodes.to_numpy()
    if len(rates) > 1:
        least, most = bootstrap(rates)
        low, high = min(low, least), max(high, most)
    return low, high
