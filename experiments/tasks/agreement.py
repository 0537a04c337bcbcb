"""How often a controller does what the teacher does in the same condition.

Samples after the lamp was reached are left out by the caller: a robot at rest repeats one condition and would
flatter every learner.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

import sim
from behaviours import Demonstrations, Space
from behaviours.ordered import distinct_rows
from experiments.tasks.corral import schema


@dataclass(frozen=True)
class Agreement:
    """Shares of samples in which the controller commands what the teacher does.

    Attributes:
        train: of the demonstrated samples whose condition was never shown with two commands.
        train_all: of all demonstrated samples.
        heldout: of the samples of held-out episodes.
        heldout_distinct: the same, each distinct condition counting once.
        unseen: of the held-out samples whose condition was never demonstrated; None if there is none.
        unseen_share: how many of the held-out samples those are.
        by_rule: of the held-out samples in which each of the teacher's rules fires, by its name.
    """

    train: float
    train_all: float
    heldout: float
    heldout_distinct: float
    unseen: float | None
    unseen_share: float
    by_rule: dict[str, float]


def right(policy: sim.ControllerLike, samples: Demonstrations) -> NDArray[np.bool_]:
    """For each sample, whether the policy's commands have the levels of the teacher's, `[N]`.

    A controller with a state sees the samples of each episode one after the other, from its start.
    """
    commands = torch.from_numpy(sim.replay(policy, samples.sensors.numpy(), samples.episodes.numpy()))
    levels = schema()
    return (levels.command_levels(commands) == levels.command_levels(samples.commands)).all(-1).numpy()


def share_right(policy: sim.ControllerLike, samples: Demonstrations) -> float:
    """The share of samples for which `right` holds."""
    return float(right(policy, samples).mean())


def compare(
    policy: sim.ControllerLike, own: Space | None, train: Demonstrations, heldout: Demonstrations, reference: Space
) -> Agreement:
    """Compare a controller with the teacher, at the bins of its `own` space; without one, at those of `reference`.

    Distinct conditions are counted at the bins of `reference` for all, so that the figures compare.
    """
    space = own or reference
    conditions = torch.cat([space.cells(train.sensors), space.cells(heldout.sensors)])
    found = distinct_rows(conditions)[1].numpy()
    train_own, heldout_own = found[: len(train)], found[len(train) :]
    train_right = right(policy, train)
    heldout_right = right(policy, heldout)
    # Raw readings do not contradict each other; binned ones can.
    agreed = np.ones(len(train), dtype=bool)
    if own is not None:
        agreed = _consistent(train_own, train)[train_own]
    unseen = ~np.isin(heldout_own, train_own)
    distinct = distinct_rows(reference.cells(heldout.sensors))[1].numpy()
    per_condition = np.bincount(distinct, weights=heldout_right) / np.bincount(distinct)
    fires = sim.Teacher().rule(heldout.sensors.numpy())
    return Agreement(
        train=float(train_right[agreed].mean()),
        train_all=float(train_right.mean()),
        heldout=float(heldout_right.mean()),
        heldout_distinct=float(per_condition.mean()),
        unseen=float(heldout_right[unseen].mean()) if unseen.any() else None,
        unseen_share=float(unseen.mean()),
        by_rule={
            name: float(heldout_right[fires == rule].mean())
            for rule, name in enumerate(sim.TEACHER_RULES)
            if (fires == rule).any()
        },
    )


def _consistent(conditions: NDArray[np.int64], samples: Demonstrations) -> NDArray[np.bool_]:
    """For each condition, whether all its samples have the same command."""
    levels = schema().command_levels(samples.commands)
    results = distinct_rows(levels)[1].numpy()
    pairs = np.unique(np.stack([conditions, results]), axis=1)
    return np.bincount(pairs[0], minlength=conditions.max() + 1) == 1
