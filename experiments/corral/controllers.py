"""The rows of the table: whatever drives the robot, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import sim
import torchvsa
from behaviours import Behaviour, BehaviourBank, Demonstrations, LearningReport, Policy, Space
from experiments.kit import parts
from experiments.models import hand_written
from experiments.models.baselines import CLASSIFIERS, Classified, RandomCommands
from experiments.tasks import corral
from experiments.tasks.agreement import share_right
from experiments.tasks.in_bullet import TWINS, there

if TYPE_CHECKING:
    from experiments.corral.settings import Corral

MANY_STARTS = ("teacher", "default", "bundled")
"""The rows that drive `starts` episodes; those on wheels drive `wheeled_starts`, all others `other_starts`."""


@dataclass(frozen=True)
class Material:
    """What all controllers learn from and are compared with.

    Attributes:
        settings: of the run.
        folder: where trajectories, maps and programs are kept for the page.
        train: all demonstrated samples.
        moving: those before the lamp was reached; all of a file, which does not say when that was.
        bank: what was learned over the codebooks of the run, see `learn`.
        examined: the teacher from the held-out starts.
        ppo: what was trained by reward, for the row `ppo`.
    """

    settings: Corral
    folder: Path
    train: Demonstrations
    moving: Demonstrations
    bank: BehaviourBank
    examined: sim.Rollout
    ppo: sim.ControllerLike | None = None


@dataclass(frozen=True)
class Controller:
    """One row of the table.

    Attributes:
        policy: what drives.
        pairs: in its program.
        reports: what its learning rule did, by behaviour.
        candidates: what was compared to choose its settings, a row for each.
    """

    policy: sim.ControllerLike
    pairs: int | None = None
    reports: dict[str, LearningReport] = field(default_factory=dict)
    candidates: list[dict[str, float]] = field(default_factory=list)

    @property
    def program(self) -> Behaviour | Policy | None:
        """The policy, if it drives by hypervectors."""
        return self.policy if isinstance(self.policy, Behaviour | Policy) else None

    @property
    def bins(self) -> int | None:
        """Bins per sensor, if readings are binned."""
        return None if self.program is None else bins_of(self.program.space)


def bins_of(space: Space) -> int | None:
    """Bins per sensor; None for an encoder of continuous readings."""
    return getattr(space.encoder, "bins", None) if space.encoder.discrete else None


def original(name: str) -> str:
    """The row that a row repeats in the physics engine, `teacher` for `teacher_wheeled`; else the row itself."""
    first, _, ending = name.rpartition("_")
    return first if ending in TWINS else name


def driving(settings: Corral, name: str) -> Corral:
    """The settings of the run with the engine and the body of a row."""
    body = TWINS.get(name.rpartition("_")[2])
    return settings if body is None else there(settings, body)


def starts(settings: Corral, name: str) -> int:
    """How many held-out starts a row drives."""
    if name.endswith("_wheeled"):
        return settings.wheeled_starts
    return settings.starts if name in MANY_STARTS else settings.other_starts


def learn(settings: Corral, train: Demonstrations) -> BehaviourBank:
    """Learn what the rows `default` and `bundled` need, with the rule and the codebooks of the run.

    `default` is shown everything; the behaviours of `bundled` are learned apart, each where its own rules of the
    teacher fire.
    """
    bank, rule = BehaviourBank(corral.space(settings)), parts.rule(settings.rule)
    if "default" in map(original, settings.controllers):
        bank.learn("default", train, rule)
    if "bundled" in settings.controllers:
        for name, samples in corral.by_behaviour(train).items():
            bank.learn(name, samples, rule)
    return bank


def printed_space(settings: Corral, bins: int | None = None, protection: parts.Options | None = None) -> Space:
    """Codebooks as printed, at the bins of the run or others, with another protection if one is given."""
    printed = settings.paper
    encoder = {**printed.encoder}
    if "bins" in encoder:
        encoder["bins"] = settings.encoder.get("bins", encoder["bins"]) if bins is None else bins
    chosen = printed.protection if protection is None else protection
    return parts.space(corral.schema(), settings.vsa, encoder, printed.record, chosen, settings.seed)


def one_program(name: str, behaviour: Behaviour) -> Controller:
    """A behaviour that drives by itself."""
    return Controller(behaviour, behaviour.report.pairs, reports={name: behaviour.report})


def paper(material: Material, bins: int | None = None, name: str = "paper") -> Controller:
    """The printed algorithms read literally, at the bins of `default` or others."""
    rule = parts.rule(material.settings.paper.rule)
    return one_program(name, rule.fit(printed_space(material.settings, bins), material.train))


def paper_best_bins(material: Material) -> Controller:
    """The same at the bins with the highest success on validation starts (then agreement; then the fewest).

    The validation starts are neither demonstrated nor held out.
    """
    settings = material.settings
    episodes = range(corral.FIRST_VALIDATION, corral.FIRST_VALIDATION + settings.validation_starts)
    at_hand = bins_of(printed_space(settings))
    programs, candidates = [], []
    for bins in sorted({*settings.paper_bins, at_hand or 0} - {0}):
        program = paper(material, bins, "paper_best_bins")
        rollout = corral.drive(settings, program.policy, episodes, corral.arena(settings.arena))
        success, agreement = float(rollout.success.mean()), share_right(program.policy, material.train)
        programs.append(program)
        candidates.append({"bins": bins, "validation_success": success, "train_agreement": agreement})
    order = [(row["validation_success"], row["train_agreement"]) for row in candidates]
    return replace(programs[order.index(max(order))], candidates=candidates)


def bundled(material: Material) -> Controller:
    """Three behaviours that were learned apart, combined without any further training."""
    bank = BehaviourBank(material.bank.space)
    for name in sim.BEHAVIOURS:
        bank.add(name, material.bank[name])
    reports = {name: bank[name].report for name in bank}
    pairs = sum(report.pairs for report in reports.values())
    return Controller(parts.policy(bank, material.settings.composition), pairs, reports=reports)


def written_by_hand(material: Material) -> Controller:
    """The teacher's rules as one hypervector, without learning."""
    vsa = torchvsa.architecture(**material.settings.vsa)
    return one_program("hand_written", hand_written.behaviour(vsa, material.settings.seed))


def classifier(name: str, material: Material) -> Classified:
    """One of scikit-learn's classifiers."""
    return Classified(CLASSIFIERS[name](material.settings.seed), material.train)


def by_reward(material: Material) -> Controller:
    """The reference that learns by reward instead of from demonstrations."""
    assert material.ppo is not None
    return Controller(material.ppo)


CONTROLLERS: dict[str, Callable[[Material], Controller]] = {
    "teacher": lambda material: Controller(sim.Teacher()),
    "default": lambda material: one_program("default", material.bank["default"]),
    "paper": paper,
    "paper_best_bins": paper_best_bins,
    "bundled": bundled,
    "hand_written": written_by_hand,
    "nearest_neighbour": lambda material: Controller(classifier("nearest_neighbour", material), len(material.train)),
    "decision_tree": lambda material: Controller(classifier("decision_tree", material)),
    "mlp": lambda material: Controller(classifier("mlp", material)),
    "ppo": by_reward,
    "random": lambda material: Controller(RandomCommands(material.settings.seed)),
}
CONTROLLERS |= {f"{name}_{twin}": CONTROLLERS[name] for twin in TWINS for name in ("teacher", "default")}
"""All rows by name; each is made from what it may learn from."""
DEFAULT_ROWS = [name for name in CONTROLLERS if name not in ("ppo", "default_wheeled")]
"""`ppo` needs a package of its own, and minutes; wheels cost more time than all other rows together."""
