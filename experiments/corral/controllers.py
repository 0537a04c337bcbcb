"""The rows of the table: whatever drives the robot, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import torch

import sim
import torchvsa
from behaviours import Behaviour, BehaviourBank, Demonstrations, LearningReport, Policy, Space
from experiments.kit import parts
from experiments.models import hand_written
from experiments.models.baselines import CLASSIFIERS, Classified, RandomCommands
from experiments.tasks import corral
from experiments.tasks.agreement import share_right

if TYPE_CHECKING:
    from experiments.corral.settings import Corral

MANY_STARTS = ("teacher", "default", "bundled")
"""The rows that drive `starts` episodes; the wheeled teacher drives `wheeled_starts`, all others `other_starts`."""


@dataclass(frozen=True)
class Task:
    """What a controller learns from, and how it is tried before it is chosen.

    Attributes:
        settings: of the run.
        train: all demonstrated samples.
        bank: what was learned over the codebooks of the run, see `learn`.
    """

    settings: Corral
    train: Demonstrations
    bank: BehaviourBank

    def validate(self, policy: sim.ControllerLike) -> float:
        """The success of a candidate from starts that are neither demonstrated nor held out."""
        episodes = range(corral.FIRST_VALIDATION, corral.FIRST_VALIDATION + self.settings.validation_starts)
        rollout = corral.drive(self.settings, policy, episodes, corral.arena(self.settings.arena))
        return rollout.summary().success_rate


@dataclass(frozen=True)
class Controller:
    """One row of the table.

    Attributes:
        policy: what drives.
        pairs: in its program.
        body: the robot's body, if not that of the run.
        reports: what its learning rule did, by behaviour.
        candidates: what was compared to choose its settings, a row for each.
    """

    policy: sim.ControllerLike
    pairs: int | None = None
    body: str | None = None
    reports: dict[str, LearningReport] = field(default_factory=dict)
    candidates: list[dict[str, float]] = field(default_factory=list)

    @property
    def program(self) -> Behaviour | Policy | None:
        """The policy, if it drives by hypervectors."""
        return self.policy if isinstance(self.policy, Behaviour | Policy) else None

    @property
    def space(self) -> Space | None:
        """The codebooks of its program, if it has one."""
        return None if self.program is None else self.program.space

    @property
    def bins(self) -> int | None:
        """Bins per sensor, if readings are binned."""
        return None if self.space is None else bins_of(self.space)

    @property
    def bank(self) -> BehaviourBank | None:
        """What it learned over codebooks of its own, if it did."""
        if not isinstance(self.policy, Behaviour):
            return None
        bank = BehaviourBank(self.policy.space)
        for name in self.reports:
            bank.add(name, self.policy)
        return bank


def bins_of(space: Space) -> int | None:
    """Bins per sensor; None for an encoder of continuous readings."""
    return getattr(space.encoder, "bins", None) if space.encoder.discrete else None


def starts(settings: Corral, name: str) -> int:
    """How many held-out starts a row drives."""
    if name == "teacher_wheeled":
        return settings.wheeled_starts
    return settings.starts if name in MANY_STARTS else settings.other_starts


def learn(settings: Corral, train: Demonstrations, learned: Callable[[str], object]) -> BehaviourBank:
    """Learn what the rows `default` and `bundled` need, with the rule and the codebooks of the run.

    `default` is shown everything; the behaviours of `bundled` are learned apart, each where its own rules of the
    teacher fire. `learned` is called with the name of each behaviour.
    """
    bank, rule = BehaviourBank(corral.space(settings)), parts.rule(settings.rule)
    if "default" in settings.controllers:
        bank.learn("default", train, rule)
        learned("default")
    if "bundled" in settings.controllers:
        fires = sim.Teacher().rule(train.sensors.numpy())
        for name, rules in sim.BEHAVIOURS.items():
            chosen = torch.from_numpy(np.isin(fires, rules))
            if not chosen.any():
                raise ValueError(f"no demonstration shows {name!r}; give it more of them (demonstrations=...)")
            bank.learn(name, train.where(chosen), rule)
            learned(name)
    return bank


def printed_space(settings: Corral, bins: int | None = None, protection: parts.Options | None = None) -> Space:
    """Codebooks as printed, at the bins of the run or others, with another protection if one is given."""
    printed = settings.paper
    encoder = {**printed.encoder}
    if "bins" in encoder:
        encoder["bins"] = settings.encoder.get("bins", encoder["bins"]) if bins is None else bins
    chosen = printed.protection if protection is None else protection
    return parts.space(corral.schema(), settings.vsa, encoder, printed.record, chosen, settings.seed)


def paper(task: Task, bins: int | None = None, name: str = "paper") -> Controller:
    """The printed algorithms read literally, at the bins of `default` or others."""
    rule = parts.rule(task.settings.paper.rule)
    return one_program(name, rule.fit(printed_space(task.settings, bins), task.train))


def paper_best_bins(task: Task) -> Controller:
    """The same at the bins with the highest success on validation starts (then agreement; then the fewest)."""
    at_hand = printed_space(task.settings)
    choices = sorted({*task.settings.paper_bins, bins_of(at_hand) or 0} - {0})
    programs = [paper(task, bins, "paper_best_bins") for bins in choices]
    candidates = [
        {
            "bins": bins,
            "validation_success": task.validate(program.policy),
            "train_agreement": share_right(program.policy, task.train),
        }
        for bins, program in zip(choices, programs, strict=True)
    ]
    order = [(row["validation_success"], row["train_agreement"]) for row in candidates]
    best = programs[order.index(max(order))]
    return Controller(best.policy, best.pairs, reports=best.reports, candidates=candidates)


def bundled(task: Task) -> Controller:
    """Three behaviours that were learned apart, combined without any further training."""
    bank = BehaviourBank(task.bank.space)
    for name in sim.BEHAVIOURS:
        bank.add(name, task.bank[name])
    reports = {name: bank[name].report for name in bank}
    pairs = sum(report.pairs for report in reports.values())
    return Controller(parts.policy(bank, task.settings.composition), pairs, reports=reports)


def written_by_hand(task: Task) -> Controller:
    """The teacher's rules as one hypervector, without learning."""
    vsa = torchvsa.architecture(**task.settings.vsa)
    return one_program("hand_written", hand_written.behaviour(vsa, task.settings.seed))


def classifier(name: str, task: Task) -> Classified:
    """One of scikit-learn's classifiers."""
    return Classified(CLASSIFIERS[name](task.settings.seed), task.train)


def one_program(name: str, behaviour: Behaviour) -> Controller:
    """A behaviour that drives by itself."""
    return Controller(behaviour, behaviour.report.pairs, reports={name: behaviour.report})


CONTROLLERS: dict[str, Callable[[Task], Controller]] = {
    "teacher": lambda task: Controller(sim.Teacher()),
    "default": lambda task: one_program("default", task.bank["default"]),
    "paper": paper,
    "paper_best_bins": paper_best_bins,
    "bundled": bundled,
    "hand_written": written_by_hand,
    "nearest_neighbour": lambda task: Controller(classifier("nearest_neighbour", task), pairs=len(task.train)),
    "decision_tree": lambda task: Controller(classifier("decision_tree", task)),
    "random": lambda task: Controller(RandomCommands(task.settings.seed)),
    "teacher_wheeled": lambda task: Controller(sim.Teacher(), body="wheeled"),
}
"""All rows by name; each is made from what it may learn from."""
