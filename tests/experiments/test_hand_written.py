"""The hand-written program does what the teacher does, for any random codebooks."""

from itertools import product

import numpy as np
import pytest
import torch

import sim
import torchvsa
from experiments import hand_written


@pytest.mark.parametrize("seed", range(10))
def test_all_eight_cases(seed: int) -> None:
    behaviour = hand_written.behaviour(torchvsa.MAP(4000, dtype=torch.int8), seed)
    readings = np.array(list(product([0.5, 5.0], [0.5, 5.0], [0.1, 0.9])))
    np.testing.assert_array_equal(behaviour(readings).commands.numpy(), sim.Teacher()(readings))


def test_the_weights_are_needed() -> None:
    """With equal weights the five rules shout each other down in at least one of the eight cases."""
    behaviour = hand_written.behaviour(torchvsa.MAP(4000, dtype=torch.int8), 0)
    space = behaviour.space
    conditions = space.encode(torch.tensor([condition for condition, _ in hand_written.RULES]))
    results = space.items(
        space.schema.command_levels(
            sim.Teacher()(np.array([[0.5, 0.5, 0.9], [0.5, 5, 0.9], [5, 0.5, 0.9], [5, 5, 0.1], [5, 5, 0.9]]))
        )
    )
    behaviour.program = space.vsa.superpose(space.vsa.bind(conditions, results))
    readings = np.array(list(product([0.5, 5.0], [0.5, 5.0], [0.1, 0.9])))
    assert (behaviour(readings).commands.numpy() != sim.Teacher()(readings)).any()


def test_one_hypervector_of_five_rules() -> None:
    behaviour = hand_written.behaviour(torchvsa.MAP(1000, dtype=torch.int8), 0)
    assert behaviour.program.shape == (1000,)
    assert behaviour.report.pairs == len(hand_written.RULES) == len(sim.TEACHER_RULES)
