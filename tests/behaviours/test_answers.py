"""Behaviours answer by what their tensors hold now, whatever the size of the numbers."""

import copy
import math
from collections.abc import Callable

import numpy as np
import plain
import pytest
import torch
from robots import random_pairs, same_bits, space
from throwaway import Hashed, Turned
from torch.testing import assert_close

from behaviours import Behaviour, ErrorDriven, Gradient, OneShot, Recall, Rule
from torchvsa import MAP, VSA

READINGS = [*random_pairs(20).sensors.tolist(), [math.nan, 3.3, 19.0], [math.nan] * 3]


def same(a: Recall, b: Recall) -> bool:
    return all(same_bits(x, y) for x, y in zip(a[:4], b[:4], strict=True))


def test_a_changed_program_answers_at_once() -> None:
    behaviour = OneShot().fit(space(200), random_pairs(20))
    before = behaviour(READINGS)
    behaviour.program.mul_(-1)
    fresh = Behaviour(behaviour.space, behaviour.program.clone(), behaviour.known, behaviour.results, behaviour.report)
    assert same(behaviour(READINGS), fresh(READINGS))
    assert not same(behaviour(READINGS), before)
    other = ErrorDriven().fit(behaviour.space, random_pairs(20, seed=1))
    behaviour.program = other.program
    behaviour.known = other.known
    behaviour.memory = other.memory
    assert same(behaviour(READINGS), other(READINGS))
    twin = copy.deepcopy(behaviour)
    twin.program.zero_()
    assert (twin(READINGS).similarity == 0).all()
    assert same(behaviour(READINGS), other(READINGS))


WRITES: dict[str, Callable[[torch.Tensor], object]] = {
    "data": lambda tensor: tensor.data.mul_(-1),
    "numpy": lambda tensor: np.negative(tensor.numpy(), out=tensor.numpy()),
    "dlpack": lambda tensor: torch.from_dlpack(tensor).mul_(-1),
}


@pytest.mark.parametrize(
    "part", ["program", "known", "space.result_encoder.codes", "space.result_encoder.roles", "memory.levels"]
)
@pytest.mark.parametrize("write", WRITES)
def test_answers_follow_what_is_written_by_whatever_way(write: str, part: str) -> None:
    behaviour = OneShot().fit(space(200), random_pairs(4))
    before = behaviour(READINGS)
    *owner, name = part.split(".")
    tensor = getattr(behaviour.get_submodule(".".join(owner)), name)
    WRITES[write](tensor)
    if part == "memory.levels":
        tensor.add_(2)  # levels 0 to 2 turned round
    behaviour.space.result_encoder.derive()  # what a codebook's owner does after writing into it
    fresh = Behaviour(behaviour.space, behaviour.program, behaviour.known, behaviour.results, behaviour.report)
    assert same(behaviour(READINGS), fresh(READINGS))
    assert not same(behaviour(READINGS), before)


@pytest.mark.parametrize("scale", [1e-300, 1e-30, 1e25, 1e300])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_cosines_do_not_depend_on_the_size_of_a_program(dtype: torch.dtype, scale: float) -> None:
    if dtype == torch.float32 and not 1e-36 < scale < 1e36:
        pytest.skip("float32 holds no such numbers")
    behaviour = OneShot().fit(space(200), random_pairs(20))
    program, known = (vector.to(dtype) * scale for vector in (behaviour.program, behaviour.known))
    large = Behaviour(behaviour.space, program, known, behaviour.results, behaviour.report)
    for expected, got in zip(behaviour(READINGS)[:4], large(READINGS)[:4], strict=True):
        assert_close(torch.as_tensor(got), torch.as_tensor(expected), rtol=1e-5, atol=1e-6, equal_nan=True)


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
def test_behaviours_of_half_precision_answer_alike(dtype: torch.dtype) -> None:
    behaviour = OneShot().fit(space(4000, dtype="float32", protection="none"), random_pairs(20))
    before = behaviour(READINGS)
    after = behaviour.to(dtype)(READINGS)
    assert same_bits(after.commands, before.commands)
    for expected, got in zip(before[1:4], after[1:4], strict=True):
        assert_close(torch.as_tensor(got), torch.as_tensor(expected), rtol=1e-2, atol=1e-3)


def test_programs_made_without_versions_are_asked_as_well() -> None:
    with torch.inference_mode():
        behaviour = OneShot().fit(space(200), random_pairs(20))
        recall = behaviour(READINGS)
    assert same(recall, OneShot().fit(space(200), random_pairs(20))(READINGS))


def test_conditions_in_a_wider_type_are_asked_the_plain_way() -> None:
    made = space(200, "MAP-I")
    behaviour = OneShot().fit(made, random_pairs(20))
    conditions = made.encode(made.cells(READINGS[:20]))
    assert isinstance(made.vsa, MAP)
    assert conditions.dtype == torch.int32
    for row, answer in enumerate(zip(*behaviour.query(conditions)[:4], strict=True)):
        expected = plain.query(behaviour, READINGS[row])
        assert answer[0].tolist() == expected.commands
        for got, wanted in zip(answer[1:], expected[1:], strict=True):
            assert got.item() == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize("rule", [OneShot(), ErrorDriven(), Gradient()], ids=lambda rule: rule.name)
@pytest.mark.parametrize("vsa", [Turned(2000), Turned(2000, torch.float32), Hashed(2000)], ids=repr)
@pytest.mark.parametrize("protection", ["none", "self_shift"])
def test_what_does_not_commute_or_is_not_bilinear_learns_and_answers(vsa: VSA, rule: Rule, protection: str) -> None:
    shown = random_pairs(20)
    behaviour = rule.fit(space(vsa=vsa, protection=protection), shown)
    recall = behaviour(shown.sensors)
    right = (recall.commands == shown.commands).all(1).double().mean()
    # Pairs that are only added once disturb each other where conditions share readings.
    assert right > 0.8 if isinstance(rule, OneShot) else right == 1
    assert (recall.familiarity > 0.1).all()
    other = rule.fit(behaviour.space, random_pairs(20, seed=1))
    assert not torch.equal(other(shown.sensors).commands, shown.commands)
    for row, reading in enumerate(shown.sensors.tolist()):
        assert torch.equal(behaviour([reading]).commands[0], recall.commands[row])
