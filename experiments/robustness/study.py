"""What is left of a behaviour when a growing share of what it is made of is damaged?

Hypervectors are said to be robust to noise, and the paper claims that behaviours made of them are, too. Elements are
drawn at random and have their sign flipped, are set to zero, or get Gaussian noise. What is damaged is the program,
the codebooks, or the query; an MLP and a decision tree with the same share of their parameters damaged are compared
with them. Nothing is trained on damaged parts.

    torchvsa robustness
    torchvsa robustness --multirun vsa.dim=500,1000,4000
    torchvsa robustness learners=[default,mlp] damages=[flip] draws=2 drive_shares=[0]
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from rich.progress import Progress

import sim
import torchvsa
from behaviours import Demonstrations, Space
from experiments.kit import Cell, Row, Study, aggregated, grid, parts, setting, settings
from experiments.models import hand_written
from experiments.models.damage import DAMAGES, PARAMETERS, PARTS, Damage, Learner
from experiments.robustness import results
from experiments.robustness.baselines import network, tree
from experiments.robustness.programs import Program, refuse_undamageable
from experiments.tasks import corral, in_bullet
from experiments.tasks.agreement import share_right

KEYS = ("learner", "part", "damage", "share")
TEACHER = "teacher"


@dataclass
class Robustness(corral.InOneArena, in_bullet.InBullet):
    """The settings of this study; those of `Learning` are the learner `default`."""

    one_shot: corral.Printed = settings(
        corral.Printed, "the learner `one_shot`: the paper's codes, of the same architecture"
    )
    learners: list[str] = setting(
        ["default", "one_shot", "hand_written", "mlp", "decision_tree"], "rows, in this order",
        choices=lambda: LEARNERS, distinct=True,
    )  # fmt: skip
    parts: list[str] = setting(
        list(PARTS), "what is damaged of learners with hypervectors; of others, it is their parameters",
        choices=PARTS, distinct=True,
    )  # fmt: skip
    damages: list[str] = setting(list(DAMAGES), "what happens to an element", choices=DAMAGES, distinct=True)
    shares: list[float] = setting(
        [0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5], "shares of the elements; they rise from 0", low=0, high=1
    )
    noise: float = setting(3.0, "standard deviation of noise, in root mean squares of the undamaged elements", low=0)
    draws: int = setting(5, "draws of the damaged elements, for each share", low=1)
    drive_shares: list[float] = setting([0.0, 0.1, 0.3], "those of the shares at which robots drive", empty=True)
    bullet_learners: list[str] = setting(
        ["default"], "those of the learners whose robots drive in the physics engine, too", choices=lambda: LEARNERS,
        distinct=True, empty=True,
    )  # fmt: skip
    starts: int = corral.episodes(100, "held-out starts, spread over the draws")
    demonstrations: int = corral.episodes(60, "episodes of the teacher to learn from")
    hidden: int = setting(64, "units of the MLP", low=1)
    mlp_epochs: int = setting(60, "at most, over the demonstrations", low=1)
    kept: float = setting(
        0.95, "a share is survived if this much of the undamaged agreement or success is left", above=0, high=1
    )


def check(settings: Robustness) -> None:
    """Raise for shares that make no sense, and for learners that cannot be built, trained or damaged."""
    shares = settings.shares
    if shares != sorted(set(shares)) or shares[0] != 0:
        raise ValueError(f"shares begin with 0 and rise; got {shares}")
    if unknown := [share for share in settings.drive_shares if share not in shares]:
        raise ValueError(f"drive_shares are some of the shares {shares}; got {unknown}")
    corral.arena(settings.arena)
    in_bullet.check(settings, bool(settings.bullet_learners))
    for name, options in (("default", settings), ("one_shot", settings.one_shot)):
        if name in settings.learners:
            space = space_of(settings, options)
            refuse_undamageable(space)
            parts.refuse_unsupported(parts.rule(options.rule), space)
    if "hand_written" in settings.learners:
        _hand_written(settings, None)


def space_of(settings: Robustness, options: Robustness | corral.Printed) -> Space:
    """The codebooks of `default` or `one_shot`."""
    vsa, protection = settings.vsa, options.protection
    return parts.space(corral.schema(), vsa, options.encoder, options.record, protection, settings.seed)


def _program(settings: Robustness, options: Robustness | corral.Printed, train: Demonstrations) -> Learner:
    return Program(parts.rule(options.rule).fit(space_of(settings, options), train))


def _hand_written(settings: Robustness, train: Any) -> Learner:
    return Program(hand_written.behaviour(torchvsa.architecture(**settings.vsa), settings.seed))


HYPERVECTORS = ("default", "one_shot", "hand_written")
LEARNERS: dict[str, Callable[[Robustness, Any], Learner]] = {
    "default": lambda settings, train: _program(settings, settings, train),
    "one_shot": lambda settings, train: _program(settings, settings.one_shot, train),
    "hand_written": _hand_written,
    "mlp": lambda settings, train: network(train, settings.seed, settings.hidden, settings.mlp_epochs),
    "decision_tree": lambda settings, train: tree(train, settings.seed),
}
"""How each learner is made from demonstrations."""


def cases(settings: Robustness) -> list[Cell]:
    """The rows of the table, in its order."""
    found: list[Cell] = []
    for name in settings.learners:
        damaged = settings.parts if name in HYPERVECTORS else [PARAMETERS]
        found += grid(learner=[name], part=damaged, damage=settings.damages, share=settings.shares)
    return found


def cells(settings: Robustness) -> list[Cell]:
    """A cell for each case; one for each undamaged learner, which is the same in all cases. Those that drive first."""
    undamaged = grid(learner=[TEACHER, *settings.learners], share=[0.0])
    found = [*undamaged, *(case for case in cases(settings) if case["share"])]
    return sorted(found, key=lambda cell: (cell["share"] not in settings.drive_shares, cell.get("part") != "query"))


@dataclass(frozen=True)
class Material:
    """What all cells share: the learners, and the teacher's held-out runs."""

    settings: Robustness
    learners: dict[str, Learner]
    heldout: Demonstrations
    teacher: Row


def prepare(settings: Robustness, folder: Path, progress: Progress) -> Material:
    """Let the teacher drive, and learn from it."""

    def drive(what: str, episodes: range) -> sim.Rollout:
        where = corral.arena(settings.arena)
        return corral.drive_together(settings, what, sim.Teacher(), episodes, progress, where)

    first = corral.FIRST_DEMONSTRATION
    train, _ = corral.shown_in(drive("teacher demonstrates", range(first, first + settings.demonstrations)))
    heldout = drive("teacher, held out", range(settings.starts))
    names = progress.track(settings.learners, description="learn")
    learners = {name: LEARNERS[name](settings, train) for name in names}
    return Material(settings, learners, corral.moving(heldout), corral.driven(heldout))


def measure(material: Material, cell: Cell) -> list[Row]:
    """A row for each draw of the damage: its agreement with the teacher, and how its robots drove.

    The draws share the starts: draw j of J drives from the starts j, j + J, j + 2J, ...
    """
    settings, share = material.settings, cell["share"]
    if cell["learner"] == TEACHER:
        return [material.teacher]
    learner = material.learners[cell["learner"]]
    # Nothing is drawn where nothing is damaged, so that any part and damage will do.
    those = [cell] if share else [case for case in cases(settings) if cell.items() <= case.items()]
    draws = settings.draws if share else 1
    rows: list[Row] = []
    for draw in range(draws):
        damage = Damage(those[0]["damage"], share, settings.noise, (settings.seed, draw))
        copy = learner.damaged(those[0]["part"], damage)
        found = {"draw": draw, "agreement": share_right(copy, material.heldout), "episodes": 0, "successes": 0}
        starts = range(draw, settings.starts, draws)
        if share in settings.drive_shares and starts:
            arena = corral.arena(settings.arena)
            rollout = corral.drive(settings, copy, starts, arena)
            found |= {"episodes": len(rollout), "successes": int(rollout.success.sum())}
            if cell["learner"] in settings.bullet_learners:
                found |= in_bullet.counted(in_bullet.effects(settings, copy, rollout, arena))
        for case in those:
            size = learner.elements(case["part"])
            rows.append({**case, "elements": size, "damaged": damage.count(size), **found})
    return rows


def summarise(settings: Robustness, records: pd.DataFrame) -> list[Row]:
    """One row for each case, the draws together; and one for the teacher."""
    teacher = records[records.learner == TEACHER].iloc[0]
    table: list[Row] = [{"learner": TEACHER, **corral.success(teacher.episodes, teacher.successes)}]
    columns = {
        "episodes": ("episodes", "sum"),
        "successes": ("successes", "sum"),
        "agreement": ("agreement", "mean"),
        "agreement_min": ("agreement", "min"),
        "agreement_max": ("agreement", "max"),
    }
    found = aggregated(records.loc[records.learner != TEACHER], KEYS, columns, cases(settings))
    groups: Any = records.groupby(list(KEYS), dropna=False)
    for row in found:
        row |= corral.success(row["episodes"], row.pop("successes"))
        row |= in_bullet.differences(groups.get_group(tuple(row[key] for key in KEYS)))
    return table + found


def metrics(settings: Robustness, records: pd.DataFrame, table: list[Row]) -> dict[str, float | None]:
    """How many elements each part has."""
    sizes = records.dropna(subset="part").drop_duplicates(["learner", "part"])
    names = zip(sizes.learner, sizes.part, sizes.elements, strict=True)
    return {f"{learner}.{part}.elements": float(size) for learner, part, size in names}


study = Study(
    name="robustness",
    about="What is left of a behaviour when a growing share of what it is made of is damaged?",
    settings=Robustness,
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
    presets={
        "quick": {"draws": 1, "starts": 20, "bullet_learners": [], "shares": [0.0, 0.2, 0.4], "drive_shares": [0.0]}
    },
)
