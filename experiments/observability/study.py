"""How robust is a learned behaviour to states that are observed in part, and does a memory help?

Something comes between the robot's sensors and its program: readings are missing, stuck, delayed or noisy, or sensors
are gone, so that different states look alike. Programs that learned undisturbed or disturbed demonstrations, with and
without a memory of past conditions, are compared with the teacher, who sees the true readings, on held-out runs, and
then drive. What a learner may choose, it chooses on validation runs; the held-out ones are for the final figures.

    torchvsa observability
    torchvsa observability --multirun vsa.dim=1000,4000 seed=0,1
    torchvsa observability disturbances=[missing] learners=[disturbed,trace,hold] starts=0
"""

from dataclasses import asdict, dataclass
from pathlib import Path

import pandas as pd
from rich.progress import Progress

import sim
from behaviours import Space
from experiments.kit import Cell, Row, Study, grid, parts, setting, settings
from experiments.models.disturbances import DISTURBANCES, Aliased, Disturbance
from experiments.observability import results
from experiments.observability.learners import LEARNERS, Task, compare, disturbed_rule
from experiments.observability.memory import TeacherRuns
from experiments.observability.windows import WindowPolicy
from experiments.tasks import corral, in_bullet
from torchvsa.encoders.history import check_lags

KEYS = ("disturbance", "strength", "learner")
MEASURED = ("lags", "hold", "samples", "agreement", "balanced_agreement", "usual_share")
EPISODE = ("episode", "success", "escaped", "time_to_light_s")


@dataclass
class Strengths:
    """The strengths of each disturbance, in rising order; 0 is undisturbed.

    A learner of disturbed demonstrations gets them in turns, one per episode.
    """

    missing: list[float] = setting([0, 0.25, 0.5, 0.75], "share of readings lost", low=0, high=1)
    stuck: list[float] = setting(
        [0, 0.25, 0.5, 0.75], "share of sensors that repeat one reading from some step on", low=0, high=1
    )
    delayed: list[int] = setting([0, 1, 2, 4], "control steps of 50 ms", low=0)
    noisy: list[float] = setting(
        [0, 0.1, 0.2, 0.4], "standard deviation, as a share of the sensor's range", low=0, high=1
    )
    aliased: list[int] = setting(
        [0, 1, 2, 3], "what is gone: 0 nothing, 1 distance, 2 light left, 3 light right, 4 both lights",
        choices=range(len(Aliased.WITHOUT)),
    )  # fmt: skip


@dataclass
class Observability(corral.InOneArena, in_bullet.InBullet):
    """The settings of this study. `rule` is that of `default`; the others follow the gradient."""

    seconds: float = setting(40.0, "longest duration of an episode, s", low=1 / sim.CONTROL_HZ)
    learners: list[str] = setting(
        list(LEARNERS), "rows, in this order; `hold` and `held_trace` only where readings have gaps",
        choices=LEARNERS, distinct=True,
    )  # fmt: skip
    disturbances: list[str] = setting(
        list(DISTURBANCES), "what comes between sensors and program", choices=DISTURBANCES, distinct=True
    )
    strengths: Strengths = settings(Strengths, "strengths of each disturbance, rising from 0, which is undisturbed")
    demonstrations: int = corral.episodes(80, "episodes of the teacher to learn from")
    validation: int = corral.episodes(40, "other ones, on which learners choose their memory")
    heldout: int = corral.episodes(40, "held-out ones, on which commands are compared")
    compare_every: int = setting(4, "compare at every n-th control step: neighbours hardly differ", low=1)
    starts: int = corral.episodes(80, "held-out starts per learner, disturbance and strength; 0: none drives", low=0)
    bullet_learners: list[str] = setting(
        ["default"], "those of the learners whose robots drive in the physics engine, too", choices=LEARNERS,
        distinct=True, empty=True,
    )  # fmt: skip
    # Readings that fail contradict each other, and the gradient weighs the samples against each other. On validation
    # runs 30 epochs raised a balanced agreement by at most .02 over 10.
    epochs: int = setting(10, "epochs of the programs that learn disturbed demonstrations", low=1)
    lags: list[list[int]] = setting([[1], [1, 2], [1, 2, 4, 8]], "memories to choose from: control steps ago")
    leaves: list[int] = setting(
        [5, 20], "samples per leaf that a tree may choose from; fewer would learn single disturbances by heart", low=1
    )


def check(settings: Observability) -> None:
    """Raise for strengths and memories without a meaning, and for rules that cannot train the programs."""
    for name in settings.disturbances:
        strengths = getattr(settings.strengths, name)
        if strengths[0] != 0 or sorted(set(strengths)) != strengths:
            raise ValueError(f"strengths.{name} grow from 0 (undisturbed) on; got {strengths}")
    for lags in settings.lags:
        check_lags(lags)
    corral.arena(settings.arena)
    in_bullet.check(settings, bool(settings.starts and settings.bullet_learners))
    parts.refuse_unsupported(disturbed_rule(settings), corral.check_learning(settings))


def disturbances(settings: Observability, name: str) -> list[Disturbance]:
    """One disturbance at all its strengths, 0 first."""
    return [DISTURBANCES[name](strength, settings.seed) for strength in getattr(settings.strengths, name)]


def rows(settings: Observability) -> list[Cell]:
    """The disturbances and learners, in the table's order."""
    found = grid(disturbance=settings.disturbances, learner=settings.learners)
    return [cell for cell in found if DISTURBANCES[cell["disturbance"]].gaps or not LEARNERS[cell["learner"]].gaps_only]


def cells(settings: Observability) -> list[Cell]:
    """A cell for each disturbance and learner, which learns all its strengths together; the slowest first."""
    return sorted(rows(settings), key=lambda cell: -LEARNERS[cell["learner"]].cost)


@dataclass(frozen=True)
class Material:
    """What all cells share: the settings, the codebooks and the teacher's runs."""

    settings: Observability
    space: Space
    train: TeacherRuns
    validation: TeacherRuns
    heldout: TeacherRuns


def prepare(settings: Observability, folder: Path, progress: Progress) -> Material:
    """Let the teacher drive."""

    def runs(what: str, first: int, count: int) -> TeacherRuns:
        episodes, where = range(first, first + count), corral.arena(settings.arena)
        return TeacherRuns.of(corral.drive_together(settings, what, sim.Teacher(), episodes, progress, where))

    return Material(
        settings,
        corral.space(settings),
        runs("teacher demonstrates", corral.FIRST_DEMONSTRATION, settings.demonstrations),
        runs("teacher, validation", corral.FIRST_VALIDATION, settings.validation),
        runs("teacher, held out", 0, settings.heldout),
    )


def measure(material: Material, cell: Cell) -> list[Row]:
    """A row for each strength and episode that was driven, and one for each choice compared on validation runs.

    Rows of one strength repeat its agreement; without starts each strength has one row.
    """
    settings = material.settings
    strengths = disturbances(settings, cell["disturbance"])
    task = Task(settings, material.space, material.train, material.validation, strengths)
    learned = LEARNERS[cell["learner"]].learn(task)
    found: list[Row] = [{"choice": choice, "validation": value} for choice, value in learned.tried.items()]
    memory = {"lags": list(learned.memory.lags), "hold": learned.memory.hold}
    for disturbance in strengths:
        agreement = compare(learned, disturbance, material.heldout, settings.compare_every)
        row = {"strength": float(disturbance.strength), **memory, **asdict(agreement)}
        policy = WindowPolicy(disturbance, learned.answer, learned.memory)
        in_both = cell["learner"] in settings.bullet_learners
        found += [{**row, **episode} for episode in driven(settings, policy, in_both)]
    return found


def driven(settings: Observability, policy: sim.Controller, in_both: bool) -> list[Row]:
    """A row for each episode that the policy drives from the held-out starts; one without values if there are none.

    Where it drives `in_both` engines, the row says what the physics engine makes of the start.
    """
    if not settings.starts:
        return [dict.fromkeys(EPISODE)]
    arena = corral.arena(settings.arena)
    rollout = corral.drive(settings, policy, range(settings.starts), arena)
    columns = rollout.episode, rollout.success, rollout.escaped, rollout.time_to_light
    values = zip(*(column.tolist() for column in columns), strict=True)
    rows: list[Row] = [dict(zip(EPISODE, one, strict=True)) for one in values]
    if in_both:
        for body, each in in_bullet.effects(settings, policy, rollout, arena).items():
            for row, effect in zip(rows, each, strict=False):  # of the first starts
                row |= in_bullet.counted({body: [effect]})
    return rows


def summarise(settings: Observability, records: pd.DataFrame) -> list[Row]:
    """One row for each disturbance, learner and strength, with Wilson's interval of its success."""
    groups = dict(iter(records.groupby(list(KEYS))))
    table: list[Row] = []
    for cell in rows(settings):
        for strength in map(float, getattr(settings.strengths, cell["disturbance"])):
            group = groups[cell["disturbance"], strength, cell["learner"]]
            label = DISTURBANCES[cell["disturbance"]].label(strength)
            first = group.iloc[0]
            figures = {name: first[name] for name in MEASURED} | {"samples": int(first.samples)}
            episodes = int(group.episode.count())
            success = corral.success(episodes, group.success.sum())
            escapes = {"escape_rate": group.escaped.sum() / episodes if episodes else None}
            there = in_bullet.differences(group)
            table.append({**cell, "strength": strength, "label": label, **figures, **success, **escapes, **there})
    return table


def metrics(settings: Observability, records: pd.DataFrame, table: list[Row]) -> dict[str, float | None]:
    """The validation figure of each choice."""
    return {
        f"{row['disturbance']}.{row['learner']}.validation.{row['choice']}": row["validation"]
        for row in results.choices(records)
    }


study = Study(
    name="observability",
    about="How robust is a learned behaviour to states that are observed in part, and does a memory help?",
    settings=Observability,
    check=check,
    cells=cells,
    prepare=prepare,
    measure=measure,
    summarise=summarise,
    keys=KEYS,
    metrics=metrics,
    tables=results.tables,
    figures=[results.FIGURE],
    headline=results.headline,
    method=results.METHOD,
    presets={"quick": {"disturbances": ["missing"], "starts": 0}},
)
