"""The hand-written program does what the teacher does, for any random codebooks, or says that it cannot."""

from itertools import product

import numpy as np
import pytest
import torch

import sim
import torchvsa
from behaviours import Behaviour, Controller
from experiments.models import hand_written
from sim.teachers.escape import TEACHER_COMMANDS

READINGS = np.array(list(product([0.5, 5.0], [0.5, 5.0], [0.1, 0.9])))
KINDS = [(name, None) for name in torchvsa.ARCHITECTURES] + [(f"MAP-{variant}", "int8") for variant in "BCI"]


def right(behaviour: Controller) -> np.ndarray:
    """In which of the eight cases the behaviour commands what the teacher does."""
    return (behaviour(READINGS).commands.numpy() == sim.Teacher()(READINGS)).all(1)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("name", "dtype"), KINDS)
def test_all_eight_cases(name: str, dtype: str | None, seed: int) -> None:
    vsa = torchvsa.architecture_near(name, 4000, dtype)
    if isinstance(vsa, torchvsa.BSDC) and seed == 1:
        # Two of the cases have the same width by chance: 28 pairs of cases, 4,000 widths.
        cases = hand_written.space(vsa, seed).encode(torch.tensor(hand_written.CASES))
        assert len(vsa.width(cases).unique()) == 7
        with pytest.raises(ValueError, match="no weights of the 8 rules"):
            hand_written.behaviour(vsa, seed)
        return
    behaviour = hand_written.behaviour(vsa, seed)
    assert right(behaviour).all()
    assert right(behaviour.freeze()).all()


@pytest.mark.parametrize("name", torchvsa.ARCHITECTURES)
def test_few_dimensions_are_refused_rather_than_wrong(name: str) -> None:
    written, refusals = [], []
    for seed in range(20):
        try:
            written.append(hand_written.behaviour(torchvsa.architecture_near(name, 24), seed))
        except ValueError as error:
            refusals.append(str(error))
    assert all(right(behaviour).all() for behaviour in written)
    assert refusals
    assert all("no weights of the" in refusal for refusal in refusals)


@pytest.mark.parametrize(("name", "dtype"), KINDS)
def test_the_program_is_the_sum_of_the_rules_with_whole_weights(name: str, dtype: str | None) -> None:
    behaviour = hand_written.behaviour(torchvsa.architecture_near(name, 4000, dtype), 0)
    pairs = rules(behaviour)
    weights = torch.linalg.lstsq(as_columns(pairs), as_columns(behaviour.program[None])).solution[:, 0]
    torch.testing.assert_close(weights, weights.round(), atol=1e-4, rtol=0)
    assert (weights.round() >= 1).all()


# Conditions that are shifts do not resemble each other, so that rules do not disturb each other either.
@pytest.mark.parametrize("name", [name for name in torchvsa.ARCHITECTURES if name != "BSDC-S"])
def test_the_weights_are_needed(name: str) -> None:
    """With equal weights the five rules shout each other down in at least one of the eight cases."""
    behaviour = hand_written.behaviour(torchvsa.architecture_near(name, 4000), 0)
    behaviour.program = behaviour.space.vsa.superpose(rules(behaviour))
    assert not right(behaviour).all()


@pytest.mark.parametrize("variant", ["C", "I"])
def test_the_weights_found_by_hand_suit_sums(variant: str) -> None:
    behaviour = hand_written.behaviour(torchvsa.architecture(f"MAP-{variant}", 4000, "int8"), 0)
    program = behaviour.space.vsa.superpose(rules(behaviour), weights=torch.tensor(hand_written.BY_HAND))
    assert torch.equal(behaviour.program, program)


def test_one_hypervector_of_five_rules() -> None:
    behaviour = hand_written.behaviour(torchvsa.MAP(1000, dtype=torch.int8), 0)
    assert behaviour.program.shape == (1000,)
    assert behaviour.report.pairs == len(hand_written.RULES) == len(sim.TEACHER_RULES)


def rules(behaviour: Behaviour) -> torch.Tensor:
    """The pairs of condition and result `[5, d]`, or `[8, d]`."""
    space = behaviour.space
    items = space.items(space.schema.command_levels(TEACHER_COMMANDS))
    conditions = hand_written.written(space.vsa)
    fired = [next(i for i, rule in enumerate(hand_written.RULES) if holds(rule, case)) for case in conditions]
    return space.vsa.bind(items[fired], space.encode(torch.tensor(conditions)))


def holds(rule: tuple[int, ...], case: tuple[int, ...]) -> bool:
    """Whether a rule speaks in a case, or is it."""
    return all(a in (b, hand_written.EITHER) for a, b in zip(rule, case, strict=True))


def as_columns(rows: torch.Tensor) -> torch.Tensor:
    """Real columns `[e, k]`; bits count as votes, and a complex number as two."""
    if rows.dtype == torch.bool:
        rows = 1 - 2 * rows.int()
    return (torch.view_as_real(rows).flatten(1) if rows.is_complex() else rows).double().T
