"""The rows of the corral's table: whatever drives the robot, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from sklearn.neighbors import KNeighborsClassifier
from sklearn.tree import DecisionTreeClassifier

import sim
import torchvsa
from behaviours import Behaviour, BehaviourBank, Demonstrations, LearningReport, Policy, Space
from experiments import presets
from experiments.agreement import share_right
from experiments.models import draws, hand_written


@dataclass(frozen=True)
class Study:
    """What a controller may learn from, and how it may try itself."""

    config: Mapping[str, Any]
    space: Space
    """The codebooks that the learners of this run share, so that their programs can be added."""
    train: Demonstrations
    fires: NDArray[np.int64]
    """Which of the teacher's rules fired in each row of `train`."""
    validate: Callable[[sim.ControllerLike], sim.Rollout]
    """Drives a candidate from starts that are neither demonstrated nor held out."""


@dataclass(frozen=True)
class TableRow:
    """One row of the table."""

    name: str
    policy: sim.ControllerLike
    pairs: int | None = None
    body: str | None = None
    """The robot's body, if not that of the run."""
    reports: dict[str, LearningReport] = field(default_factory=dict)
    tried: list[dict[str, float]] = field(default_factory=list)
    """What was compared to choose this controller's settings."""

    @property
    def mind(self) -> Behaviour | Policy | None:
        """The policy where it drives by hypervectors, else None."""
        return self.policy if isinstance(self.policy, Behaviour | Policy) else None

    @property
    def space(self) -> Space | None:
        """The codebooks behind the policy, if any."""
        return None if self.mind is None else self.mind.space

    @property
    def bins(self) -> int | None:
        """Bins per sensor, if readings are binned."""
        return None if self.space is None else self.space.encoder.bins


class Classified:
    """A scikit-learn classifier over the distinct commands, as a policy of the simulator."""

    def __init__(self, model: KNeighborsClassifier | DecisionTreeClassifier, train: Demonstrations) -> None:
        commands, labels = np.unique(train.commands.numpy(), axis=0, return_inverse=True)
        self.commands: NDArray[np.float64] = commands
        self.model = model.fit(train.sensors.numpy(), labels.ravel())

    def __call__(self, sensors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Commands `[B, 2]` for readings `[B, 3]`."""
        return self.commands[np.asarray(self.model.predict(sensors), dtype=np.int64)]


class RandomCommands:
    """Both wheels uniform in [-1, 1] at every step, drawn from (seed, episode): the same in any batch."""

    def __init__(self, seed: int) -> None:
        self.seed = seed

    def start(self, episodes: NDArray[np.int64]) -> draws.Drawn:
        """See `sim.Controller`."""
        return draws.start([(self.seed, episode) for episode in episodes.tolist()], _uniform)

    def step(self, readings: NDArray[np.float64], state: draws.Drawn) -> tuple[NDArray[np.float64], draws.Drawn]:
        """Commands `[B, 2]`, whatever the readings."""
        return draws.step(state, _uniform)


def _uniform(generator: np.random.Generator, rows: int) -> NDArray[np.float64]:
    return generator.uniform(-1, 1, (rows, len(sim.ACTUATORS)))


def _teacher(study: Study) -> TableRow:
    return TableRow("teacher", sim.Teacher())


def _teacher_wheeled(study: Study) -> TableRow:
    return TableRow("teacher_wheeled", sim.Teacher(), body="wheeled")


def _default(study: Study) -> TableRow:
    """The rule and the codebooks of this run's settings."""
    return _learned("default", presets.rule(study.config["rule"]).fit(study.space, study.train))


def _paper(study: Study, bins: int | None = None, name: str = "paper") -> TableRow:
    """The printed algorithms read literally, at the bins of the default."""
    bins = study.config["encoder"]["bins"] if bins is None else bins
    space = presets.space(study.config["vsa"], study.config["paper"], study.config["seed"], bins)
    behaviour = presets.rule(study.config["paper"]["rule"]).fit(space, study.train)
    return _learned(name, behaviour)


def _paper_best_bins(study: Study) -> TableRow:
    """The same at the bins with the highest success on validation starts (then agreement; then the fewest)."""
    choices = sorted({*study.config["paper_bins"], study.config["encoder"]["bins"]})
    candidates = [_paper(study, bins, "paper_best_bins") for bins in choices]
    tried = [
        {
            "bins": bins,
            "validation_success": study.validate(candidate.policy).summary().success_rate,
            "train_agreement": share_right(candidate.policy, study.train),
        }
        for bins, candidate in zip(choices, candidates, strict=True)
    ]
    order = [(row["validation_success"], row["train_agreement"]) for row in tried]
    best = candidates[order.index(max(order))]
    return TableRow(best.name, best.policy, best.pairs, reports=best.reports, tried=tried)


def _bundled(study: Study) -> TableRow:
    """Three behaviours, each learned alone where its own rules fire, combined without any further training."""
    bank = BehaviourBank(study.space)
    for name, rules in sim.BEHAVIOURS.items():
        own = torch.from_numpy(np.isin(study.fires, rules))
        if not own.any():
            raise ValueError(f"no demonstration shows {name!r}; give it more of them (demonstrations=...)")
        bank.learn(name, study.train.where(own), presets.rule(study.config["rule"]))
    policy = presets.policy(bank, study.config["composition"])
    reports = {name: bank[name].report for name in bank}
    pairs = sum(report.pairs for report in reports.values())
    return TableRow("bundled", policy, pairs, reports=reports)


def _hand_written(study: Study) -> TableRow:
    vsa = torchvsa.architecture(**study.config["vsa"])
    return _learned("hand_written", hand_written.behaviour(vsa, study.config["seed"]))


def _nearest_neighbour(study: Study) -> TableRow:
    return TableRow("nearest_neighbour", Classified(KNeighborsClassifier(1), study.train), pairs=len(study.train))


def _decision_tree(study: Study) -> TableRow:
    model = DecisionTreeClassifier(random_state=study.config["seed"])
    return TableRow("decision_tree", Classified(model, study.train))


def _random(study: Study) -> TableRow:
    return TableRow("random", RandomCommands(study.config["seed"]))


def _learned(name: str, behaviour: Behaviour) -> TableRow:
    return TableRow(name, behaviour, behaviour.report.pairs, reports={name: behaviour.report})


CONTROLLERS: dict[str, Callable[[Study], TableRow]] = {
    "teacher": _teacher,
    "default": _default,
    "paper": _paper,
    "paper_best_bins": _paper_best_bins,
    "bundled": _bundled,
    "hand_written": _hand_written,
    "nearest_neighbour": _nearest_neighbour,
    "decision_tree": _decision_tree,
    "random": _random,
    "teacher_wheeled": _teacher_wheeled,
}
