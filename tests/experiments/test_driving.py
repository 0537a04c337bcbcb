"""Behaviours of integers drive frozen, with the same bits; the pool gives the same rollout as one process."""

import numpy as np
import torch
from kits import composed
from rich.progress import Progress

import sim
from behaviours import Behaviour, Gradient
from behaviours.frozen import FrozenBehaviour
from behaviours.learning import no_convergence_warnings
from experiments.corral import study
from experiments.tasks import corral


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


def test_driving_together_gives_the_bits_of_one_process() -> None:
    rollouts = []
    for workers in (1, 2):
        settings = composed(study, f"workers={workers}", "seconds=3", "robots=2")
        with Progress(disable=True) as progress:
            rollouts.append(corral.drive_together(settings, "teacher", sim.Teacher(), range(6), progress))
    one, two = (rollout.trajectory for rollout in rollouts)
    assert np.array_equal(one.x, two.x)
    assert np.array_equal(one.sensors, two.sensors)
