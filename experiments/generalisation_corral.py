"""The corral, shown 1 to 50 times: what is commanded where the teacher was not watched.

Every combination of encoder, protection, record and rule learns from the same demonstrations and is compared with the
teacher in held-out runs. The default combination, those that differ from it in one part, and two rivals without
hypervectors also drive, from unseen starts and in arenas that none of them was shown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from rich.progress import Progress
from sklearn.neighbors import KNeighborsClassifier
from sklearn.tree import DecisionTreeClassifier

import sim
from behaviours import Demonstrations, Space
from behaviours.learning import no_convergence_warnings
from behaviours.ordered import distinct_rows
from experiments import presets
from experiments.agreement import right
from experiments.choices import check_chosen
from experiments.controllers import Classified
from experiments.driving import drive_here, pooled_success
from experiments.jobs import run_jobs
from experiments.lessons import FIRST_DEMONSTRATION, shown_in
from experiments.results import Row

PARTS = ("encoder", "protection", "record", "rule")
RIVALS: dict[str, Callable[[int], Any]] = {
    "nearest_neighbour": lambda seed: KNeighborsClassifier(1),
    "decision_tree": lambda seed: DecisionTreeClassifier(random_state=seed),
}
HOME = "default"
"""The arena in which the demonstrations were made."""


@dataclass(frozen=True)
class Combination:
    """What a program is made with: one name for each of `PARTS`."""

    encoder: str
    protection: str
    record: str
    rule: str

    @classmethod
    def default(cls, config: Mapping[str, Any]) -> Combination:
        """The first choice for each part."""
        return cls(*(config[part][0] for part in PARTS))

    @property
    def name(self) -> str:
        """`level/none/bind/error_driven`, say."""
        return "/".join(asdict(self).values())

    def changes(self, other: Combination) -> list[str]:
        """The parts in which the two differ."""
        return [part for part in PARTS if getattr(self, part) != getattr(other, part)]


@dataclass(frozen=True)
class Lesson:
    """Runs of the teacher: readings `[N, n]`, commands `[N, m]`, and the episode of each row."""

    sensors: NDArray[np.float64]
    commands: NDArray[np.float64]
    episodes: NDArray[np.int64]

    @classmethod
    def of(cls, rollout: sim.Rollout, moving: bool) -> Lesson:
        """The recorded steps of a rollout; those before the lamp was reached only, if `moving`."""
        shown, before = shown_in(rollout)
        keep = before if moving else np.ones(len(before), dtype=bool)
        return cls(shown.sensors.numpy()[keep], shown.commands.numpy()[keep], shown.episodes.numpy()[keep])

    def of_episodes(self, episodes: Sequence[int]) -> Lesson:
        """The rows of some episodes only."""
        keep = np.isin(self.episodes, episodes)
        return Lesson(self.sensors[keep], self.commands[keep], self.episodes[keep])

    @property
    def demonstrations(self) -> Demonstrations:
        """The same for a learner."""
        return Demonstrations(self.sensors, self.commands, self.episodes)


def episodes_shown(config: Mapping[str, Any], count: int, draw: int) -> list[int]:
    """The first `count` episodes of a draw: of one draw, the larger demonstrations contain the smaller ones."""
    first = FIRST_DEMONSTRATION + draw * max(config["demonstrations"])
    return list(range(first, first + count))


def check(config: Mapping[str, Any], seed: int, vsa: Mapping[str, Any]) -> None:
    """Raise, naming the setting, for what cannot be run."""
    counts, draws = list(config["demonstrations"]), list(config["draws"])
    if not counts or counts != sorted(set(counts)) or counts[0] < 1:
        raise ValueError(f"corral.demonstrations are growing numbers from 1 on; got {counts}")
    if len(draws) != len(counts) or min(draws) < 1:
        raise ValueError(f"corral.draws gives a number of 1 or more for each of {counts} demonstrations; got {draws}")
    for setting in ("starts", "variant_starts"):
        if config[setting] < max(draws):
            raise ValueError(
                f"corral.{setting}={config[setting]}: expected at least one for each of {max(draws)} draws"
            )
    if list(config["arenas"])[:1] != [HOME]:
        raise ValueError(f"corral.arenas begins with {HOME!r}, where the teacher is watched; got {config['arenas']}")
    for name in config["arenas"]:
        presets.arena({"preset": name, "change": {}})
    check_chosen("corral.rivals", config["rivals"], RIVALS, empty=True)
    for part in PARTS:
        check_chosen(f"corral.{part}", config[part], config["options"][part])
    for combination in combinations(config):
        _space(config, vsa, combination, seed)
        presets.rule(config["options"]["rule"][combination.rule])


def combinations(config: Mapping[str, Any]) -> list[Combination]:
    """All of them, the default first."""
    grid = [
        Combination(encoder, protection, record, rule)
        for encoder in config["encoder"]
        for protection in config["protection"]
        for record in config["record"]
        for rule in config["rule"]
    ]
    default = Combination.default(config)
    return sorted(grid, key=lambda one: len(one.changes(default)))


def run(config: Mapping[str, Any], executor: Executor, progress: Progress) -> list[Row]:
    """One record for each learner, number of demonstrations, draw and arena; `config` is that of the whole run."""
    own = config["corral"]
    sizes = list(zip(own["demonstrations"], own["draws"], strict=True))
    most = [max(count for count, draws in sizes if draws > draw) for draw in range(max(own["draws"]))]
    shown = [(HOME, episodes_shown(own, count, draw)) for draw, count in enumerate(most)]
    heldout = [(arena, list(range(own["starts"]))) for arena in own["arenas"]]
    drives = run_jobs(
        executor, progress, "corral: teacher", _teacher, [(config, arena, runs) for arena, runs in heldout + shown]
    )
    lessons = [Lesson.of(rollout, moving=False) for rollout in drives[len(heldout) :]]
    examined = {arena: Lesson.of(rollout, moving=True) for (arena, _), rollout in zip(heldout, drives, strict=False)}
    jobs = []
    for count, draws in sorted(sizes, reverse=True):
        for draw in range(draws):
            lesson = lessons[draw].of_episodes(episodes_shown(own, count, draw))
            for combination in combinations(own):
                jobs.append((config, combination, count, draw, draws, lesson, examined))
            jobs += [(config, rival, count, draw, draws, lesson, examined) for rival in own["rivals"]]
    records = [_teacher_record(arena, rollout) for (arena, _), rollout in zip(heldout, drives, strict=False)]
    for rows in run_jobs(executor, progress, "corral: learners", learn_and_ask, jobs):
        records += rows
    return records


def _teacher(config: Mapping[str, Any], arena: str, episodes: Sequence[int]) -> sim.Rollout:
    return drive_here(config, sim.Teacher(), episodes, arena, record=True)


def _space(config: Mapping[str, Any], vsa: Mapping[str, Any], one: Combination, seed: int) -> Space:
    parts = {part: config["options"][part][getattr(one, part)] for part in PARTS if part != "rule"}
    return presets.space(vsa, parts, seed)


def learn_and_ask(
    config: Mapping[str, Any],
    learner: Combination | str,
    count: int,
    draw: int,
    draws: int,
    lesson: Lesson,
    examined: Mapping[str, Lesson],
) -> list[Row]:
    """Fit one learner to one draw of demonstrations, ask it, and let it drive where it shall: a record per arena.

    The starts of an arena are shared by the draws: draw j of J drives from the starts j, j + J, j + 2J, ...
    """
    own, seed, shown = config["corral"], config["seed"], lesson.demonstrations
    default = Combination.default(own)
    if isinstance(learner, Combination):
        space = _space(own, config["vsa"], learner, seed)
        with no_convergence_warnings():  # the agreement says it
            policy = presets.rule(own["options"]["rule"][learner.rule]).fit(space, shown)
        changed = learner.changes(default)
    else:
        space = _space(own, config["vsa"], default, seed)
        policy, changed = Classified(RIVALS[learner](seed), shown), [learner]
    rows = []
    for arena in own["arenas"]:
        if len(changed) > 1 and arena != HOME:
            continue
        row = _record(learner, arena, count, draw) | _agreement(policy, space, lesson, examined[arena])
        # The default drives everywhere; with one part changed, in unseen arenas after the most demonstrations only.
        if len(changed) <= 1 and (arena == HOME or not changed or count == max(own["demonstrations"])):
            starts = own["variant_starts"] if changed else own["starts"]
            rollout = drive_here(config, policy, range(draw, starts, draws), arena)
            row |= {"episodes": len(rollout), "successes": int(rollout.success.sum())}
        rows.append(row)
    return rows


def _agreement(policy: sim.ControllerLike, space: Space, lesson: Lesson, examined: Lesson) -> Row:
    """Shares of held-out samples commanded as the teacher does: of all, and of conditions that were never met.

    The conditions of all learners, rivals included, are told apart at the same bins.
    """
    correct = right(policy, examined.demonstrations)
    bins = torch.cat([space.cells(lesson.sensors), space.cells(examined.sensors)])
    own = distinct_rows(bins)[1].numpy()
    met = np.unique(own[: len(lesson.sensors)])
    unseen = ~np.isin(own[len(lesson.sensors) :], met)
    return {
        "samples": len(lesson.sensors),
        "conditions": len(met),
        "heldout": float(correct.mean()),
        "unseen": float(correct[unseen].mean()) if unseen.any() else None,
        "unseen_share": float(unseen.mean()),
    }


def _record(learner: Combination | str, arena: str, count: int | None, draw: int | None) -> Row:
    parts: Row = asdict(learner) if isinstance(learner, Combination) else dict.fromkeys(PARTS)
    name = learner.name if isinstance(learner, Combination) else learner
    blank = dict.fromkeys(("samples", "conditions", "heldout", "unseen", "unseen_share", "episodes", "successes"))
    return {"learner": name, **parts, "arena": arena, "demonstrations": count, "draw": draw, **blank}


def _teacher_record(arena: str, rollout: sim.Rollout) -> Row:
    return _record("teacher", arena, None, None) | {
        "heldout": 1.0,
        "episodes": len(rollout),
        "successes": int(rollout.success.sum()),
    }


def table(records: Sequence[Row]) -> list[Row]:
    """One row for each learner, arena and number of demonstrations: medians and ranges over the draws.

    Success pools the draws, with Wilson's 95 % interval.
    """
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for record in records:
        groups.setdefault((record["learner"], record["arena"], record["demonstrations"]), []).append(record)
    rows = []
    for own in groups.values():
        keys = ("learner", *PARTS, "arena", "demonstrations")
        row: Row = {key: own[0][key] for key in keys} | {"draws": len(own)}
        for figure in ("heldout", "unseen"):
            values = [record[figure] for record in own if record[figure] is not None]
            row |= {figure: None, f"{figure}_min": None, f"{figure}_max": None}
            if values:
                row |= {figure: float(np.median(values)), f"{figure}_min": min(values), f"{figure}_max": max(values)}
        driven = [record for record in own if record["episodes"]]
        row |= pooled_success(*(sum(record[key] for record in driven) for key in ("episodes", "successes")))
        rows.append(row)
    return rows
