"""Frozen behaviours answer as the behaviours that they were made from."""

import copy
import math
import pickle
from collections.abc import Callable
from typing import Any

import pytest
import torch
from robots import random_pairs, same_bits, space
from torch.testing import assert_close

from behaviours import Controller, ErrorDriven, OneShot, Recall
from behaviours.testing._controllers import CONTROLLER_LAWS
from torchvsa import ARCHITECTURES, architecture_near

READINGS = [*random_pairs(20).sensors.tolist(), [math.nan, 3.3, 19.0], [math.nan] * 3]


def same(a: Recall, b: Recall) -> bool:
    return all(same_bits(x, y) for x, y in zip(a[:4], b[:4], strict=True))


@pytest.mark.parametrize("protection", ["self_shift", "fixed_shift", "none"])
@pytest.mark.parametrize("combine", ["sum", "product", "subset_product", "threshold_features"])
@pytest.mark.parametrize("vsa", ARCHITECTURES)
def test_a_frozen_behaviour_answers_as_its_behaviour(vsa: str, combine: str, protection: str) -> None:
    algebra = architecture_near(vsa, 200)
    if not (algebra.elementwise or combine != "subset_product") or not (
        algebra.negatable or combine != "threshold_features"
    ):
        pytest.skip("subsets of sensors need element-wise binding, threshold features negatives")
    behaviour = ErrorDriven().fit(space(200, vsa, combine=combine, protection=protection), random_pairs(8))
    expected, frozen = behaviour(READINGS), behaviour.freeze()
    assert same(frozen(READINGS), expected)
    for row, reading in enumerate(READINGS):
        single = frozen([reading])
        for part, whole in zip(single[:4], expected[:4], strict=True):
            if behaviour.space.vsa.integer:
                assert same_bits(part[0], whole[row])
            assert_close(part[0], whole[row], equal_nan=True)


def test_it_keeps_what_its_behaviour_was() -> None:
    behaviour = OneShot().fit(space(200), random_pairs(20))
    frozen, before = behaviour.freeze(), behaviour(READINGS)
    ticks = [frozen([reading]) for reading in READINGS]
    for tensor in (behaviour.program, behaviour.known, *behaviour.space.state_dict().values()):
        tensor.zero_()
    assert same(frozen(READINGS), before)
    assert all(same(frozen([reading]), tick) for reading, tick in zip(READINGS, ticks, strict=True))


def test_it_is_read_only() -> None:
    frozen = ErrorDriven().fit(space(200), random_pairs(4)).trainable().freeze()
    assert not list(frozen.parameters())
    assert not any(tensor.requires_grad for tensor in frozen.buffers())


def test_copies_and_other_types_answer_alike() -> None:
    frozen = OneShot().fit(space(200), random_pairs(20)).freeze()
    for twin in (copy.deepcopy(frozen), frozen.to("cpu")):
        assert same(twin(READINGS), frozen(READINGS))
        assert same(twin([READINGS[3]]), frozen([READINGS[3]]))


@pytest.mark.parametrize("vsa", ["MAP-C", "HRR", "BSC"])
@pytest.mark.parametrize("law", CONTROLLER_LAWS, ids=lambda law: law.__name__)
def test_it_keeps_the_laws_of_controllers(law: Callable[[Controller], None], vsa: str) -> None:
    law(ErrorDriven().fit(space(500, vsa, protection="none"), random_pairs(8)).freeze())


def test_it_moves_to_another_process() -> None:
    frozen = OneShot().fit(space(200), random_pairs(20)).freeze()
    assert same(pickle.loads(pickle.dumps(frozen))([READINGS[3]]), frozen([READINGS[3]]))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:`torch.jit:DeprecationWarning")  # of its own parts
def test_a_compiled_one_answers_the_same() -> None:
    behaviour = OneShot().fit(space(512), random_pairs(20))
    tick: Any = torch.compile(behaviour.freeze(), fullgraph=True)
    for reading in READINGS[-4:]:
        row = torch.tensor([reading], dtype=torch.float64)
        assert same(tick(row), behaviour(row))
