"""The learners of the observability study: what they learn from, how they remember, and how they are compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import torch
from sklearn.tree import DecisionTreeClassifier
from torch import Tensor

import sim
from behaviours import Behaviour, Demonstrations, Gradient, Schema, Space
from behaviours.learning import no_convergence_warnings
from experiments import presets
from experiments.observability_disturbances import Disturbance, Floats, Integers
from experiments.observability_lessons import Lessons, Memory
from torchvsa.encoders import Encoder, History

NO_MEMORY = Memory()
Answer = Callable[[Floats], Floats]
"""Commands `[B, m]` for windows of readings `[B, w]`."""


@dataclass(frozen=True)
class Study:
    """What a learner may learn from: the run's settings and codebooks, the teacher's runs, and one disturbance.

    `disturbances` are the strengths of that one, 0 first. Choices are made on `validation`.
    """

    config: Mapping[str, Any]
    space: Space
    shown: Lessons
    validation: Lessons
    disturbances: Sequence[Disturbance]


@dataclass(frozen=True)
class Learned:
    """What a learner made of its lessons: how it answers, its memory, and what it compared to choose that."""

    answer: Answer
    memory: Memory = NO_MEMORY
    tried: dict[str, float] = field(default_factory=dict)


class Remembering:
    """A learner that drives: a controller whose state is the past readings `[B, p, n]` of each robot."""

    def __init__(self, learned: Learned) -> None:
        self.answer, self.memory = learned.answer, learned.memory

    def start(self, episodes: Integers) -> Tensor:
        """See `sim.Controller`."""
        return self.memory.start(len(episodes))

    def step(self, readings: Floats, state: Tensor) -> tuple[Floats, Tensor]:
        """Commands `[B, m]` for readings `[B, n]`."""
        seen, state = self.memory.step(readings, state)
        return self.answer(seen), state


class OfWindows(Encoder):
    """A `History` that is given windows instead of readings: trees and programs of this study learn from the same."""

    name = "of_windows"

    def __init__(self, history: History) -> None:
        super().__init__()
        self.history = history
        self.vsa, self.sensors, self.discrete = history.vsa, history.width, history.discrete
        self._own(None)

    def own_layout(self) -> dict[str, Any]:
        """Nothing of its own."""
        return {}

    def _draw(self, generator: torch.Generator | None) -> dict[str, Tensor]:
        return {}

    def config(self) -> dict[str, Any]:
        """See `Part.config`."""
        return {"name": self.name, "history": self.history.config()}

    def cells(self, x: Tensor) -> Tensor:
        """See `Encoder.cells`."""
        return self.history.cells(x)

    def encode(self, cells: Tensor) -> Tensor:
        """See `Encoder.encode`."""
        return self.history.encode(cells)


def over_windows(space: Space, lags: Sequence[int]) -> Space:
    """The same codebooks, for windows of present and past readings."""
    history = History(space.encoder, lags)
    past = [replace(sensor, name=f"{sensor.name}, {lag} ago") for lag in lags for sensor in space.schema.sensors]
    schema = Schema([*space.schema.sensors, *past], space.schema.actuators)
    wide = Space(schema, OfWindows(history), protection=space.protect, seed=space.seed)
    wide.result_encoder = space.result_encoder
    return wide


class Asked:
    """A program that is asked; where it senses nothing at all it commands what it was shown most often."""

    def __init__(self, mind: Behaviour, shown: Demonstrations) -> None:
        self.mind = mind
        commands, counts = shown.commands.unique(dim=0, return_counts=True)
        self.usual = commands[int(counts.argmax())]

    @torch.no_grad()
    def __call__(self, seen: Floats) -> Floats:
        """Commands `[B, m]`."""
        answers = torch.cat([self.mind(block).commands for block in torch.from_numpy(seen).split(2048)])
        return torch.where(answers.isnan(), self.usual, answers).numpy()


class Tree:
    """A decision tree on the same windows of readings."""

    def __init__(self, shown: Demonstrations, leaf: int, seed: int) -> None:
        commands, labels = np.unique(shown.commands.numpy(), axis=0, return_inverse=True)
        self.commands: Floats = commands
        self.model = DecisionTreeClassifier(min_samples_leaf=leaf, random_state=seed)
        self.model.fit(shown.sensors.numpy(), labels.ravel())

    def __call__(self, seen: Floats) -> Floats:
        """Commands `[B, m]`."""
        return self.commands[np.asarray(self.model.predict(seen), dtype=np.int64)]


@dataclass(frozen=True)
class Agreement:
    """How often a learner commands what the teacher does, who sees the true readings.

    Attributes:
        samples: how many moments were compared.
        agreement: share of them.
        balanced_agreement: the mean of that share over the teacher's different commands, each counting alike.
        usual_share: share of the teacher's most usual command; what one gets who always gives it.
    """

    samples: int
    agreement: float
    balanced_agreement: float
    usual_share: float


def compare(learned: Learned, disturbance: Disturbance, lessons: Lessons, every: int) -> Agreement:
    """Ask the learner about every `every`-th step of the recorded runs, disturbed."""
    chosen = lessons.counts & (lessons.steps % every == 0)
    seen = lessons.seen([disturbance], learned.memory).numpy()[chosen]
    levels = presets.schema()
    wanted = levels.command_levels(lessons.commands[chosen])
    right = (levels.command_levels(learned.answer(seen)) == wanted).all(-1).numpy()
    _, kinds = wanted.unique(dim=0, return_inverse=True)
    counts = np.bincount(kinds)
    balanced = (np.bincount(kinds, weights=right) / counts).mean()
    return Agreement(len(right), float(right.mean()), float(balanced), float(counts.max() / counts.sum()))


def validated(study: Study, learned: Learned) -> float:
    """Mean balanced agreement over the strengths above 0, on the validation runs."""
    every = study.config["compare_every"]
    disturbed = [disturbance for disturbance in study.disturbances if disturbance.strength > 0]
    answers = [compare(learned, one, study.validation, every) for one in disturbed or study.disturbances]
    return float(np.mean([answer.balanced_agreement for answer in answers]))


def best(study: Study, candidates: Mapping[str, Callable[[], Learned]]) -> Learned:
    """The candidate with the highest balanced agreement on the validation runs; the first among equals."""
    if len(candidates) == 1:
        return next(iter(candidates.values()))()
    learned = {name: make() for name, make in candidates.items()}
    tried = {name: validated(study, one) for name, one in learned.items()}
    chosen = learned[max(tried, key=lambda name: tried[name])]
    return Learned(chosen.answer, chosen.memory, tried)


def _program(study: Study, memory: Memory) -> Learned:
    """One hypervector, shown disturbed demonstrations."""
    shown = study.shown.demonstrations(study.disturbances, memory)
    space = over_windows(study.space, memory.lags) if memory.lags else study.space
    rule = Gradient(epochs=study.config["epochs"], seed=study.config["seed"])
    with no_convergence_warnings():  # disturbed readings contradict each other; the study reports the agreement
        return Learned(Asked(rule.fit(space, shown), shown), memory)


def _teacher(study: Study) -> Learned:
    return Learned(sim.Teacher())


def _default(study: Study) -> Learned:
    undisturbed = [type(study.disturbances[0])(0, study.config["seed"])]
    shown = study.shown.demonstrations(undisturbed, NO_MEMORY)
    return Learned(Asked(presets.rule(study.config["rule"]).fit(study.space, shown), shown))


def _disturbed(study: Study) -> Learned:
    return _program(study, NO_MEMORY)


def _hold(study: Study) -> Learned:
    return _program(study, Memory(hold=True))


def _trace(study: Study, hold: bool = False) -> Learned:
    memories = [Memory(tuple(lags), hold) for lags in study.config["lags"]]
    return best(study, {str(memory): partial(_program, study, memory) for memory in memories})


def _held_trace(study: Study) -> Learned:
    return _trace(study, hold=True)


def _tree(study: Study) -> Learned:
    return _grown(study, [NO_MEMORY])


def _tree_memory(study: Study) -> Learned:
    holds = (False, True) if study.disturbances[0].gaps else (False,)
    return _grown(study, [Memory(tuple(lags), hold) for lags in study.config["lags"] for hold in holds])


def _grown(study: Study, memories: Sequence[Memory]) -> Learned:
    """The best tree with one of these memories and one of the sizes of leaves."""
    candidates = {
        f"{memory}, {leaf} a leaf": partial(_grow, study, memory, leaf)
        for memory in memories
        for leaf in study.config["leaves"]
    }
    return best(study, candidates)


def _grow(study: Study, memory: Memory, leaf: int) -> Learned:
    shown = study.shown.demonstrations(study.disturbances, memory)
    return Learned(Tree(shown, leaf, study.config["seed"]), memory)


@dataclass(frozen=True)
class Learner:
    """A row of the table: how it is made, and what it is. `gaps_only`: worth a row only where readings have gaps."""

    learn: Callable[[Study], Learned]
    about: str
    gaps_only: bool = False


LEARNERS = {
    "teacher": Learner(_teacher, "the hand-written rules on the disturbed readings; what is missing is not sensed"),
    "default": Learner(_default, "one hypervector, shown undisturbed demonstrations"),
    "disturbed": Learner(_disturbed, "one hypervector, shown disturbed demonstrations; no memory"),
    "trace": Learner(_trace, "the same with a memory: the present condition bundled with permuted past ones"),
    "hold": Learner(_hold, "the same with another memory: the last that arrived stands for what is missing", True),
    "held_trace": Learner(_held_trace, "both memories: gaps are filled, then present and past are bundled", True),
    "tree": Learner(_tree, "a decision tree, shown disturbed demonstrations; no memory"),
    "tree_memory": Learner(_tree_memory, "a decision tree on present and past readings, gaps filled if that helps"),
}
"""The rows, by name. Without gaps in the readings `hold` and `held_trace` are `disturbed` and `trace` over again."""
