"""The learners of the observability study: what they learn from, how they choose, and how they are compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from sklearn.tree import DecisionTreeClassifier

import sim
from behaviours import Gradient, Rule, Space
from behaviours.learning import no_convergence_warnings
from experiments.kit import parts
from experiments.models.baselines import Classified
from experiments.models.disturbances import Disturbance
from experiments.observability.memory import Memory, TeacherRuns
from experiments.observability.windows import Answer, ProgramAnswer, over_windows
from experiments.tasks import corral

NO_MEMORY = Memory()


@dataclass(frozen=True)
class Task:
    """What a learner may learn from: the settings, the codebooks, the teacher's runs, and one disturbance.

    `disturbances` are the strengths of that one, 0 first. Choices are made on `validation`.
    """

    settings: Any
    space: Space
    train: TeacherRuns
    validation: TeacherRuns
    disturbances: Sequence[Disturbance]


@dataclass(frozen=True)
class Learned:
    """How a learner answers, its memory, and the validation figures of what it chose from."""

    answer: Answer
    memory: Memory = NO_MEMORY
    tried: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Agreement:
    """How often a learner commands what the teacher does, who sees the true readings.

    Attributes:
        samples: how many steps were compared.
        agreement: share of them.
        balanced_agreement: the mean of that share over the teacher's different commands, each counting alike.
        usual_share: share of the teacher's most usual command: the agreement of always giving it.
    """

    samples: int
    agreement: float
    balanced_agreement: float
    usual_share: float


def compare(learned: Learned, disturbance: Disturbance, runs: TeacherRuns, every: int) -> Agreement:
    """Compare with the teacher at every `every`-th recorded step, with the disturbance applied."""
    chosen = runs.moving & (runs.steps % every == 0)
    seen = runs.windows([disturbance], learned.memory).numpy()[chosen]
    levels = corral.schema()
    target = levels.command_levels(runs.commands[chosen])
    right = (levels.command_levels(learned.answer(seen)) == target).all(-1).numpy()
    _, kinds = target.unique(dim=0, return_inverse=True)
    counts = np.bincount(kinds)
    balanced = (np.bincount(kinds, weights=right) / counts).mean()
    return Agreement(len(right), float(right.mean()), float(balanced), float(counts.max() / counts.sum()))


def best(task: Task, candidates: Mapping[str, Callable[[], Learned]]) -> Learned:
    """The candidate with the highest balanced agreement on the validation runs; the first among equals.

    The figure is the mean over the strengths above 0.
    """
    if len(candidates) == 1:
        return next(iter(candidates.values()))()
    every = task.settings.compare_every
    disturbed = [one for one in task.disturbances if one.strength > 0] or task.disturbances
    learned = {name: make() for name, make in candidates.items()}
    tried = {
        name: float(np.mean([compare(model, one, task.validation, every).balanced_agreement for one in disturbed]))
        for name, model in learned.items()
    }
    return replace(learned[max(tried, key=lambda name: tried[name])], tried=tried)


def disturbed_rule(settings: Any) -> Rule:
    """The rule of the programs that learn disturbed demonstrations."""
    return Gradient(epochs=settings.epochs, seed=settings.seed)


def _teacher(task: Task) -> Learned:
    return Learned(sim.Teacher())


def _default(task: Task) -> Learned:
    undisturbed = [type(task.disturbances[0])(0, task.settings.seed)]
    train = task.train.demonstrations(undisturbed, NO_MEMORY)
    return Learned(ProgramAnswer(parts.rule(task.settings.rule).fit(task.space, train), train))


def _program(task: Task, memory: Memory) -> Learned:
    train = task.train.demonstrations(task.disturbances, memory)
    space = over_windows(task.space, memory.lags) if memory.lags else task.space
    with no_convergence_warnings():  # disturbed readings contradict each other; the study reports the agreement
        return Learned(ProgramAnswer(disturbed_rule(task.settings).fit(space, train), train), memory)


def _trace(task: Task, hold: bool = False) -> Learned:
    memories = [Memory(tuple(lags), hold) for lags in task.settings.lags]
    return best(task, {str(memory): partial(_program, task, memory) for memory in memories})


def _tree(task: Task, memories: Sequence[Memory] = (NO_MEMORY,)) -> Learned:
    """The best tree with one of these memories and one of the sizes of leaves."""

    def grow(memory: Memory, leaf: int) -> Learned:
        train = task.train.demonstrations(task.disturbances, memory)
        model = DecisionTreeClassifier(min_samples_leaf=leaf, random_state=task.settings.seed)
        return Learned(Classified(model, train), memory)

    leaves = task.settings.leaves
    return best(
        task, {f"{memory}, {leaf} a leaf": partial(grow, memory, leaf) for memory in memories for leaf in leaves}
    )


def _tree_memory(task: Task) -> Learned:
    holds = (False, True) if task.disturbances[0].gaps else (False,)
    return _tree(task, [Memory(tuple(lags), hold) for lags in task.settings.lags for hold in holds])


@dataclass(frozen=True)
class Learner:
    """A row of the table.

    Attributes:
        learn: how it is made.
        about: what it is.
        cost: how long it takes compared with the others, roughly.
        gaps_only: whether it differs from other learners only where readings have gaps.
    """

    learn: Callable[[Task], Learned]
    about: str
    cost: float
    gaps_only: bool = False


LEARNERS = {
    "teacher": Learner(_teacher, "the hand-written rules on the disturbed readings; what is missing is not sensed", 1),
    "default": Learner(_default, "one hypervector that learns undisturbed demonstrations", 2),
    "disturbed": Learner(
        lambda task: _program(task, NO_MEMORY), "one hypervector that learns disturbed demonstrations; no memory", 3
    ),
    "trace": Learner(_trace, "the same with a memory: the present condition bundled with permuted past ones", 8),
    "hold": Learner(
        lambda task: _program(task, Memory(hold=True)),
        "the same with another memory: the last reading that arrived replaces a missing one", 3, gaps_only=True,
    ),
    "held_trace": Learner(
        partial(_trace, hold=True), "both memories: gaps are filled, then present and past are bundled", 8,
        gaps_only=True,
    ),
    "tree": Learner(_tree, "a decision tree that learns disturbed demonstrations; no memory", 1),
    "tree_memory": Learner(_tree_memory, "a decision tree on present and past readings, gaps filled if that helps", 2),
}  # fmt: skip
"""The rows, by name. Without gaps in the readings `hold` and `held_trace` equal `disturbed` and `trace`."""
