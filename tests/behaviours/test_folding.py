"""Programs folded into what they answer with: the same answers, whatever the size of their numbers."""

import copy
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import plain
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from robots import random_pairs, same_bits, space
from torch.testing import assert_close

from behaviours import Behaviour, ErrorDriven, OneShot, Recall, Reflex
from behaviours.folding import Folded, _digits, _joined
from torchvsa import ARCHITECTURES, MAP

READINGS = [*random_pairs(20).sensors.tolist(), [math.nan, 3.3, 19.0], [math.nan] * 3]


def same(a: Recall, b: Recall) -> bool:
    return all(same_bits(x, y) for x, y in zip(a[:4], b[:4], strict=True))


@given(st.lists(st.integers(-(2**40), 2**40), min_size=1, max_size=6))
@settings(max_examples=50, deadline=None)
def test_digits_are_the_numbers(numbers: list[int]) -> None:
    # As many rows of numbers of one element, and one row of many.
    for rows in (torch.tensor(numbers)[:, None], torch.tensor([numbers])):
        digits, weights = _digits(rows, 8)
        assert digits.dtype == torch.int8
        assert torch.equal(_joined(digits.T, weights).T, rows.to(torch.float64))


@pytest.mark.parametrize("largest", [1, 127, 128, 40_000, 2**31 - 1])
@pytest.mark.parametrize("vsa", ["MAP-C", "BSC", "MAP-B"])
def test_products_are_exact_for_programs_of_any_size(vsa: str, largest: int) -> None:
    made = space(301, vsa)
    generator = torch.Generator().manual_seed(0)
    program = torch.randint(-largest, largest + 1, (301,), generator=generator, dtype=torch.int64).to(torch.int32)
    results = OneShot().fit(made, random_pairs(20)).results
    items, conditions = made.items(results), made.encode(made.cells(READINGS[:20]))
    folded = Folded(made.vsa, program, program, items)
    assert folded.digital
    products = folded.products(conditions)
    codes = plain.wide(conditions).real
    noise = codes * program.double().numpy()
    lengths = (plain.wide(items).real ** 2).sum(1) ** 0.5
    assert_close(
        (products.items / folded.item_lengths).numpy(), noise @ plain.wide(items).real.T / lengths, rtol=1e-15, atol=0
    )
    assert_close(products.noise.numpy(), (noise**2).sum(1) ** 0.5, rtol=1e-15, atol=0)


def test_a_changed_program_is_folded_anew() -> None:
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


@pytest.mark.parametrize("part", ["program", "known", "space.results.codes", "space.results.roles", "memory.levels"])
@pytest.mark.parametrize("write", WRITES)
def test_answers_follow_what_is_written_by_whatever_way(write: str, part: str) -> None:
    behaviour = OneShot().fit(space(200), random_pairs(4))
    before = behaviour(READINGS)
    *owner, name = part.split(".")
    tensor = getattr(behaviour.get_submodule(".".join(owner)), name)
    WRITES[write](tensor)
    if part == "memory.levels":
        tensor.add_(2)  # levels 0 to 2 turned round
    behaviour.space.results.derive()  # what a codebook's owner does after writing into it
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


@pytest.mark.parametrize("vsa", ARCHITECTURES)
def test_a_reflex_answers_as_its_behaviour(vsa: str) -> None:
    behaviour = ErrorDriven().fit(space(200, vsa), random_pairs(20))
    expected = behaviour(READINGS)
    reflex = Reflex(behaviour)
    assert same(reflex(READINGS), expected)
    for row, reading in enumerate(READINGS):
        single = reflex([reading])
        for part, whole in zip(single[:4], expected[:4], strict=True):
            assert_close(part[0], whole[row], equal_nan=True)


def test_a_reflex_keeps_what_its_behaviour_was() -> None:
    behaviour = OneShot().fit(space(200), random_pairs(20))
    reflex, before = Reflex(behaviour), behaviour(READINGS)
    behaviour.program = torch.zeros_like(behaviour.program)
    assert same(reflex(READINGS), before)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:`torch.jit:DeprecationWarning")  # of its own parts
def test_a_compiled_reflex_answers_the_same() -> None:
    behaviour = OneShot().fit(space(512), random_pairs(20))
    tick: Any = torch.compile(Reflex(behaviour), fullgraph=True)
    for reading in READINGS[-4:]:
        row = torch.tensor([reading], dtype=torch.float64)
        assert same(tick(row), behaviour(row))


def test_conditions_in_a_wider_type_are_asked_the_plain_way() -> None:
    made = space(200, "MAP-I")
    behaviour = OneShot().fit(made, random_pairs(20))
    conditions = made.encode(made.cells(READINGS[:20]))
    assert isinstance(made.vsa, MAP)
    assert conditions.dtype == torch.int32
    for row, answer in enumerate(zip(*behaviour.ask(conditions)[:4], strict=True)):
        expected = plain.query(behaviour, READINGS[row])
        assert answer[0].tolist() == expected.commands
        for got, wanted in zip(answer[1:], expected[1:], strict=True):
            assert got.item() == pytest.approx(wanted, abs=1e-6)
