"""Programs of integers drive frozen, each condition asked once; the pool gives the rollout of one process."""

import copy

import numpy as np
import torch
from kits import composed
from rich.progress import Progress

import sim
from behaviours import Behaviour, BehaviourBank, Bundle, Demonstrations, Gradient, OneShot, Space
from behaviours.frozen import FrozenBehaviour
from behaviours.learning import no_convergence_warnings
from experiments.corral import study
from experiments.tasks import corral
from experiments.tasks.asked_once import AskedOnce
from torchvsa.encoders import History


def learned(gradient: bool = False) -> Behaviour:
    settings = composed(study, "vsa.dim=500")
    shown, _ = corral.shown_in(sim.rollout(sim.Teacher(), episodes=range(1_000_000, 1_000_003), seconds=20))
    rule = Gradient(epochs=1) if gradient else corral.parts.rule(settings.rule)
    with no_convergence_warnings():
        return rule.fit(corral.space(settings), shown)


def test_integers_drive_frozen_with_the_same_bits() -> None:
    settings, behaviour = composed(study, "seconds=10"), learned()
    assert isinstance(corral.frozen(behaviour), FrozenBehaviour)
    fast = corral.drive(settings, behaviour, range(5), record=True)
    plain = sim.rollout(behaviour, episodes=range(5), seconds=10)
    for column in ("x", "y", "heading", "commands"):
        assert np.array_equal(getattr(fast.trajectory, column), getattr(plain.trajectory, column))


def test_floats_drive_as_they_are() -> None:
    behaviour = learned(gradient=True)
    assert behaviour.program.dtype == torch.float32
    assert corral.frozen(behaviour) is behaviour
    teacher = sim.Teacher()
    assert corral.frozen(teacher) is teacher


def test_each_condition_is_asked_once() -> None:
    behaviour = learned()
    bank = BehaviourBank(behaviour.space)
    bank.add("all", behaviour)
    rows = torch.rand(300, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    rows[::50] = torch.nan
    for controller in (behaviour, behaviour.freeze(), Bundle(bank)):
        asked: list[int] = []
        answer = controller.answer
        controller.answer = lambda cells, answer=answer, asked=asked: (asked.append(len(cells)), answer(cells))[1]  # pyright: ignore[reportAttributeAccessIssue] (counted)
        once = AskedOnce(controller)
        for _ in range(2):
            found, right = once(rows.numpy()), answer(controller.space.cells(rows))
            for column in ("commands", "similarity", "margin", "familiarity"):
                assert torch.equal(getattr(found, column).nan_to_num(9.0), getattr(right, column).nan_to_num(9.0))
            if isinstance(controller, Bundle):
                assert torch.equal(torch.as_tensor(found.speaker), torch.as_tensor(right.speaker))
        assert asked == [len(controller.space.cells(rows).unique(dim=0))]


def test_what_has_a_memory_is_asked_at_every_step() -> None:
    behaviour = learned()
    memory = History(copy.deepcopy(behaviour.space.encoder), [1, 2], seed=0)
    space = Space(corral.schema(), memory)
    remembering = OneShot().fit(space, Demonstrations([[0.1, 0.2, 0.3]], [[1.0, 1.0]], [0]))
    assert AskedOnce.possible(behaviour)
    assert not AskedOnce.possible(remembering)
    assert not AskedOnce.possible(sim.Teacher())
    assert isinstance(corral.driving(remembering), FrozenBehaviour)


def test_driving_together_gives_the_bits_of_one_process() -> None:
    rollouts = []
    for workers in (1, 2):
        settings = composed(study, f"workers={workers}", "seconds=3", "robots=2")
        with Progress(disable=True) as progress:
            rollouts.append(corral.drive_together(settings, "teacher", sim.Teacher(), range(6), progress))
    one, two = (rollout.trajectory for rollout in rollouts)
    assert np.array_equal(one.x, two.x)
    assert np.array_equal(one.sensors, two.sensors)
