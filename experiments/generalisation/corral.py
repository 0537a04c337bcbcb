"""The corral, shown 1 to 50 times: what does a program command where the teacher was not watched?

Every combination of encoder, protection, record and rule learns from the same demonstrations and is compared with the
teacher in held-out runs. The default combination, those that differ from it in one part, and two baselines without
hypervectors also drive, from unseen starts and in arenas that none of them was shown.

    torchvsa generalisation
    torchvsa generalisation records=[product,sum] rules=[error_driven,gradient]
    torchvsa generalisation --multirun vsa.dim=1000,4000 seed=0,1
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

import sim
from behaviours import Demonstrations, Space
from behaviours.learning import no_convergence_warnings
from behaviours.ordered import distinct_rows
from experiments.generalisation.combinations import (
    ENCODERS,
    PROTECTIONS,
    RECORDS,
    RULES,
    Combination,
    Options,
    codebooks,
    combine,
    rule,
)
from experiments.generalisation.corral_results import FIGURE, HOME, TEACHER, headline, summarise, tables
from experiments.kit import Cell, Part, Row, Study, part, parts, setting, settings
from experiments.models.baselines import CLASSIFIERS, Classified
from experiments.tasks import in_bullet
from experiments.tasks.agreement import right
from experiments.tasks.corral import (
    FIRST_DEMONSTRATION,
    arenas,
    drive,
    drive_together,
    episodes,
    moving,
    shown_in,
)


@dataclass
class Generalisation(in_bullet.InBullet):
    """The settings of this study."""

    vsa: Part = part("vsa", "map_c", "the architecture")
    demonstrations: list[int] = episodes(
        [1, 2, 5, 10, 50], "episodes of the teacher, growing; larger ones contain the smaller", distinct=True
    )
    draws: list[int] = setting([3, 3, 2, 1, 1], "how many times each of them is drawn anew", low=1)
    encoders: list[str] = setting(
        list(ENCODERS),
        "codes of one reading; the first encoder, protection, record and rule make the default",
        choices=ENCODERS,
        distinct=True,
    )
    protections: list[str] = setting(
        list(PROTECTIONS), "what is done to a condition before it is bound", choices=PROTECTIONS, distinct=True
    )
    records: list[str] = setting(
        list(RECORDS), "how the codes of all sensors become a condition", choices=RECORDS, distinct=True
    )
    rules: list[str] = setting(list(RULES), "how a program is learned", choices=RULES, distinct=True)
    options: Options = settings(Options, "what these names mean")
    baselines: list[str] = setting(
        ["nearest_neighbour", "decision_tree"],
        "learners without hypervectors",
        choices=CLASSIFIERS,
        distinct=True,
        empty=True,
    )
    arenas: list[str] = setting(
        ["default", "narrow", "offset_lamp", "large"], "`default` first, then unseen ones", choices=arenas,
        distinct=True,
    )  # fmt: skip
    starts: int = episodes(48, "held-out starts in each arena for the teacher and the default, shared by the draws")
    variant_starts: int = episodes(18, "starts for the baselines and the combinations with one part changed")

    def combinations(self) -> list[Combination]:
        """All of them, the default first."""
        return combine(self.encoders, self.protections, self.records, self.rules)


def check(settings: Generalisation) -> None:
    """Raise for what cannot be run."""
    in_bullet.check(settings)
    counts, draws = settings.demonstrations, settings.draws
    if counts != sorted(counts):
        raise ValueError(f"demonstrations are growing numbers; got {counts}")
    if len(draws) != len(counts):
        raise ValueError(f"draws gives a number for each of {counts} demonstrations; got {draws}")
    for name in ("starts", "variant_starts"):
        if getattr(settings, name) < max(draws):
            raise ValueError(f"{name}={getattr(settings, name)}: expected at least one for each of {max(draws)} draws")
    if settings.arenas[0] != HOME:
        raise ValueError(f"arenas begins with {HOME!r}, where the teacher is watched; got {settings.arenas}")
    for combination in settings.combinations():
        space = codebooks(settings.options, settings.vsa, combination, settings.seed)
        parts.refuse_unsupported(rule(settings.options, combination), space)


@dataclass(frozen=True)
class Material:
    """What all cells share.

    Attributes:
        settings: of the study.
        shown: the most demonstrations of each draw.
        heldout: the teacher's samples before the lamp, by arena.
        teacher: its rows of the records.
    """

    settings: Generalisation
    shown: list[Demonstrations]
    heldout: Mapping[str, Demonstrations]
    teacher: list[Row]


def prepare(settings: Generalisation, folder: Path, progress: Any) -> Material:
    """Drive the teacher: held-out runs in each arena, and demonstrations."""
    starts, teacher = range(settings.starts), sim.Teacher()
    heldout, rows, shown = {}, [], []
    for arena in settings.arenas:
        rollout = drive_together(settings, f"teacher, {arena}", teacher, starts, progress, arena)
        heldout[arena] = moving(rollout)
        rows.append({"arena": arena, "heldout": 1.0, **counts_of(rollout)})
    for draw in range(max(settings.draws)):
        sizes = zip(settings.demonstrations, settings.draws, strict=True)
        most = max(count for count, draws in sizes if draws > draw)
        episodes = episodes_of(settings, most, draw)
        shown.append(shown_in(drive_together(settings, f"demonstrations {draw + 1}", teacher, episodes, progress))[0])
    return Material(settings, shown, heldout, rows)


def episodes_of(settings: Generalisation, count: int, draw: int) -> range:
    """The first `count` episodes of a draw: within one draw, the larger demonstrations contain the smaller ones."""
    first = FIRST_DEMONSTRATION + draw * max(settings.demonstrations)
    return range(first, first + count)


def counts_of(rollout: sim.Rollout) -> Row:
    """Episodes and successes of a rollout."""
    return {"episodes": len(rollout), "successes": int(rollout.success.sum())}


def cells(settings: Generalisation) -> list[Cell]:
    """A cell for each learner, number of demonstrations and draw: the most demonstrations first, and the teacher."""
    learners = [*(combination.name for combination in settings.combinations()), *settings.baselines]
    sizes = sorted(zip(settings.demonstrations, settings.draws, strict=True), reverse=True)
    keys = [(learner, count, draw) for count, draws in sizes for draw in range(draws) for learner in learners]
    return [
        {"learner": learner, "demonstrations": count, "draw": draw}
        for learner, count, draw in [(TEACHER, None, None), *keys]
    ]


def measure(material: Material, cell: Cell) -> list[Row]:
    """Fit one learner to one draw of demonstrations, compare it, and let it drive: a row for each arena.

    The draws share the starts of an arena: draw j of J drives from the starts j, j + J, j + 2J, ...
    """
    settings, learner, count, draw = material.settings, cell["learner"], cell["demonstrations"], cell["draw"]
    if learner == TEACHER:
        return material.teacher
    shown, most = material.shown[draw], max(settings.demonstrations)
    train = shown.where(np.isin(shown.episodes.numpy(), episodes_of(settings, count, draw)))
    default = settings.combinations()[0]
    combination = default if learner in settings.baselines else Combination.parse(learner)
    space = codebooks(settings.options, settings.vsa, combination, settings.seed)
    if learner in settings.baselines:
        controller: sim.ControllerLike = Classified(CLASSIFIERS[learner](settings.seed), train)
        changes, named = 1, {}
    else:
        with no_convergence_warnings():  # the agreement says it
            controller = rule(settings.options, combination).fit(space, train)
        changes, named = len(combination.changes(default)), asdict(combination)
    starts = settings.variant_starts if changes else settings.starts
    episodes = range(draw, starts, settings.draws[settings.demonstrations.index(count)])
    rows = []
    for arena in settings.arenas if changes <= 1 else [HOME]:
        row = {"arena": arena, **named, **agreement(controller, space, train, material.heldout[arena])}
        # The default drives everywhere; with one part changed, in unseen arenas after the most demonstrations only.
        if changes == 0 or (changes == 1 and (arena == HOME or count == most)):
            rollout = drive(settings, controller, episodes, arena)
            row |= counts_of(rollout)
            if changes == 0 and count == most:
                row |= in_bullet.counted(in_bullet.effects(settings, controller, rollout, arena))
        rows.append(row)
    return rows


def agreement(controller: sim.ControllerLike, space: Space, train: Demonstrations, heldout: Demonstrations) -> Row:
    """Shares of held-out samples commanded as the teacher does: of all, and of conditions that were not demonstrated.

    The conditions of all learners, baselines included, are told apart at the bins of `space`.
    """
    correct = right(controller, heldout)
    conditions = distinct_rows(torch.cat([space.cells(train.sensors), space.cells(heldout.sensors)]))[1].numpy()
    known = np.unique(conditions[: len(train)])
    unseen = ~np.isin(conditions[len(train) :], known)
    return {
        "samples": len(train),
        "conditions": len(known),
        "heldout": float(correct.mean()),
        "unseen": float(correct[unseen].mean()) if unseen.any() else None,
        "unseen_share": float(unseen.mean()),
    }


METHOD = """
Every learner sees the same demonstrations, the larger ones containing the smaller. Agreement: the share of held-out
samples, before the lamp was reached, in which it commands what the teacher does. A condition was not demonstrated if
its bins were in no demonstration.

Learners are named encoder/protection/record/rule. All combinations are compared with the teacher, and those drive that
differ from the default, which is the first, in one part at most. Success: the robot reaches the lamp and stays. The
default drives from `starts` starts in each arena, all others from `variant_starts`, which are the first of those, and
in unseen arenas after the most demonstrations only. After those the default drives in the physics engine, too.
"""

study = Study(
    name="generalisation",
    about="What does a program command from unseen starts and in unseen arenas, after a few demonstrations?",
    settings=Generalisation,
    check=check,
    cells=cells,
    prepare=prepare,
    measure=measure,
    summarise=summarise,
    keys=("learner", "arena", "demonstrations"),
    tables=tables,
    figures=[FIGURE],
    headline=headline,
    method=METHOD,
    presets={
        "quick": {
            "demonstrations": [1, 5],
            "draws": [1, 1],
            "encoders": ["level"],
            "protections": ["none"],
            "records": ["product"],
            "rules": ["error_driven", "one_shot"],
            "bullet_starts": 0,
            "wheeled_starts": 0,
        }
    },
)
