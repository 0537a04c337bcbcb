"""What is measured of sums of programs: how often they are right, why, and what joint samples change."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from jaxtyping import Float64
from numpy.typing import NDArray
from torch import Tensor

from behaviours import Behaviour, BehaviourBank, Demonstrations, Rule
from behaviours.ordered import distinct_rows
from experiments.composition.measure import Moments, distinct
from experiments.composition.rows import Shown, demonstrated
from experiments.composition.settings import Apart, Combining
from experiments.kit import Cell, Row, parts
from experiments.tasks import corral

if TYPE_CHECKING:
    from experiments.composition.interference import Interference

SEVERAL, RIGHT, OTHER, NOBODY = "several", "right_one", "other", "nobody"
KNOWERS = (SEVERAL, RIGHT, OTHER, NOBODY)
"""Who was shown the condition of a moment: several behaviours, only the one whose rule fires there, only another one,
or none."""
ANYWHERE, SHARED = "anywhere", "shared"
SOURCES = (ANYWHERE, SHARED)
"""Where joint samples are drawn: from all demonstrations, or from those in conditions that several behaviours know."""


@dataclass(frozen=True)
class Material:
    """What all cells share.

    Attributes:
        settings: of the run.
        shown: demonstrations, and by behaviour.
        moments: held-out moments.
        owner: `[M]`, the behaviour that fires at each of them.
        knows: `[M, b]`, whether each behaviour was shown the condition.
        shared: `[N]`, whether several behaviours know the condition of each demonstrated sample.
    """

    settings: Interference
    shown: Shown
    moments: Moments
    owner: NDArray[np.int64]
    knows: NDArray[np.bool_]
    shared: NDArray[np.bool_]

    @property
    def knowers(self) -> NDArray[np.str_]:
        """One of `KNOWERS` for each moment."""
        count, own = self.knows.sum(1), self.knows[np.arange(len(self.owner)), self.owner]
        return np.select([count > 1, own, count == 1], [SEVERAL, RIGHT, OTHER], NOBODY)


def combining(settings: Interference) -> Combining:
    """The settings with which the behaviours are demonstrated and learned apart."""
    return Combining(**{field.name: getattr(settings, field.name) for field in fields(Apart)})


def prepare(settings: Interference, folder: Path, progress: Any) -> Material:
    """Let the behaviours demonstrate, and drive held-out starts."""
    shown, arena = demonstrated(combining(settings), progress), corral.arena(settings.arena)
    asked = corral.drive_together(settings, "held out", shown.rules, range(settings.heldout), progress, arena)
    return material(settings, shown, corral.moving(asked))


def material(settings: Interference, shown: Shown, heldout: Demonstrations) -> Material:
    """What all cells share, from demonstrated moments, and from held-out ones in which a behaviour fires."""
    fires = shown.rules.first(heldout.sensors.numpy()) < len(shown.rules.names)
    moments = distinct(shown, heldout.where(fires))
    space, asked = shown.space(0), moments.shown.sensors
    known = [space.cells(part.sensors) for part in shown.apart.values()]
    shared = _within(space.cells(shown.train.sensors), known).sum(1) > 1
    owner = shown.rules.first(asked.numpy())
    return Material(settings, shown, moments, owner, _within(space.cells(asked), known), shared)


def _within(cells: Tensor, known: list[Tensor]) -> NDArray[np.bool_]:
    """Whether each row of cells is among those of each behaviour, `[N, b]`."""
    place = distinct_rows(torch.cat([cells, *known]))[1].numpy()
    own, *others = np.split(place, np.cumsum([len(cells), *map(len, known)])[:-1])
    return np.stack([np.isin(own, other) for other in others], 1)


class Questions:
    """The held-out moments, encoded with one draw of the codebooks."""

    def __init__(self, given: Material, codebook: int) -> None:
        self.given, self.space = given, given.shown.space(codebook)
        self.conditions = self.space.encode(self.space.cells(given.moments.shown.sensors))
        self.levels = corral.schema().command_levels(given.moments.shown.commands)

    def right(self, behaviour: Behaviour) -> NDArray[np.bool_]:
        """Whether a behaviour commands what the teacher does, `[M]`."""
        answer = behaviour.readout().match(self.conditions).index
        return (behaviour.results[answer] == self.levels).all(1).numpy()

    def scores(self, behaviour: Behaviour, results: Tensor) -> Float64[Tensor, "M r"]:
        """The scores that a behaviour gives to results, as recall compares them."""
        return self.space.vsa.readout(behaviour.program, self.space.items(results))(self.conditions)

    def shares(self, right: NDArray[np.bool_]) -> Row:
        """Agreement, also where the teacher avoids and by cell; and the wrong moments by who knows the condition."""
        moments, knowers = self.given.moments, self.given.knowers
        count = moments.count
        return {
            **moments.agreement(right),
            **{f"wrong_{who}": float(count[~right & (knowers == who)].sum() / count.sum()) for who in KNOWERS},
        }


def apart(given: Material, rule: Rule, codebook: int, silence: bool = False) -> BehaviourBank:
    """The behaviours learned apart; with `silence` each has no opinion where only others know."""
    bank = BehaviourBank(given.shown.space(codebook))
    bank.learn_apart(given.shown.apart, rule, silence)
    return bank


def added(bank: BehaviourBank) -> Behaviour:
    """The plain sum of all behaviours of a bank."""
    return Behaviour.sum([bank[name] for name in bank])


def rules(given: Material, cell: Cell) -> list[Row]:
    """Learned apart and added, with silence and without, and learned jointly: a row each."""
    rule, codebook = parts.rule(given.settings.learners[cell["learner"]]), cell["codebook"]
    asked = Questions(given, codebook)
    made = {"sum": added(apart(given, rule, codebook)), "joint": rule.fit(asked.space, given.shown.train)}
    if rule.supports_silence:
        made["silent_sum"] = added(apart(given, rule, codebook, silence=True))
    return [{"how": how, **asked.shares(asked.right(behaviour))} for how, behaviour in made.items()]


def repair(given: Material, cell: Cell) -> list[Row]:
    """The plain sum trained further on joint samples, and the same samples learned by themselves: a row each."""
    settings, codebook, train = given.settings, cell["codebook"], given.shown.train
    asked, before = Questions(given, codebook), added(apart(given, parts.rule(settings.rule), codebook))
    rule = parts.rule(settings.repairs[cell["repair"]])
    rows = []
    for source in settings.sources:
        pool = np.flatnonzero(given.shared) if source == SHARED else np.arange(len(train))
        for draw in range(settings.draws):
            order = np.random.default_rng([settings.seed, codebook, draw]).permutation(pool)
            for count in settings.joint:
                if count > len(pool):
                    continue
                chosen = np.zeros(len(train), dtype=bool)
                chosen[order[:count]] = True
                after = rule.partial_fit(before, train.where(chosen)) if count else before
                row = {"source": source, "draw": draw, "joint": count, **asked.shares(asked.right(after))}
                alone = asked.right(rule.fit(asked.space, train.where(chosen))) if count else None
                row["alone"] = None if alone is None else asked.shares(alone)["agreement"]
                rows.append({**row, "corrections": after.report.updates - before.report.updates})
    return rows


def reason(given: Material, cell: Cell) -> list[Row]:
    """For each held-out moment the lead of the right result in the plain sum, and what each program adds to it.

    The lead is that over the best other result, in stored pairs. `own` is the part of the behaviour whose rule fires,
    `rival` that of others that know the condition, `bystander` that of others that do not. Scores add up, so that
    their sum is the lead. `against` is the other behaviour that adds least.
    """
    codebook, rule = cell["codebook"], parts.rule(given.settings.rule)
    asked, bank = Questions(given, codebook), apart(given, rule, codebook)
    total = added(bank)
    results = distinct_rows(torch.cat([total.results, asked.levels]))[0]
    scores, of_sum = [asked.scores(bank[name], results) for name in bank], asked.scores(total, results)
    right = (results == asked.levels[:, None]).all(-1)
    rival = of_sum.masked_fill(right, -torch.inf).argmax(1)
    rows = torch.arange(len(rival))
    # What a stored pair of the right result gives itself: |r|²/|r|, since conditions are of -1 and +1.
    pair = asked.space.items(results).double().norm(dim=1)[right.to(torch.int8).argmax(1)]

    # Equal scores go to the first result, as in recall; adding must not break a tie by rounding.
    best = np.round(torch.stack(scores).sum(0)[:, : len(total.results)].numpy(), 6).argmax(1)

    def lead(table: Float64[Tensor, "M r"]) -> NDArray[np.float64]:
        return ((table[right] - table[rows, rival]) / pair).numpy()

    leads = np.stack([lead(table) for table in scores], 1)
    owns = np.eye(len(bank.names), dtype=bool)[given.owner]
    names = np.array(bank.names)
    found = {
        "count": given.moments.count,
        "cell": given.moments.cell,
        "knowers": given.knowers,
        "owner": names[given.owner],
        "against": names[np.where(owns, np.inf, leads).argmin(1)],
        "avoid": given.moments.avoid,
        "own": (leads * owns).sum(1),
        "rival": (leads * (~owns & given.knows)).sum(1),
        "bystander": (leads * (~owns & ~given.knows)).sum(1),
        "lead": lead(of_sum),
        "predicted": right.numpy()[rows, best],
        "right": asked.right(total),
        "right_joint": asked.right(rule.fit(asked.space, given.shown.train)),
    }
    return [dict(zip(found, values, strict=True)) for values in zip(*(v.tolist() for v in found.values()), strict=True)]
