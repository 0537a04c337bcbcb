"""What every policy promises: one joins by being listed in POLICIES."""

import math
from collections.abc import Callable
from copy import deepcopy

import pytest
import torch
from robots import random_pairs, same_bits, space

from behaviours import POLICIES, BehaviourBank, OneShot, Policy, Recall
from torchvsa import ARCHITECTURES

Make = Callable[[BehaviourBank], Policy]

policies = pytest.mark.parametrize("make", POLICIES.values(), ids=POLICIES.keys())
architectures = pytest.mark.parametrize("vsa", ARCHITECTURES)


def bank(vsa: str = "MAP-C", dim: int = 2000) -> BehaviourBank:
    made = BehaviourBank(space(dim, vsa, protection={"name": "self_shift", "width": "sum"}))
    shown = random_pairs(12)
    made.learn("low", shown.where([row < 6 for row in range(12)]), OneShot())
    made.learn("high", shown.where([row >= 6 for row in range(12)]), OneShot())
    return made


def parts(recall: Recall) -> list[torch.Tensor]:
    assert recall.speaker is not None
    return [recall.commands, recall.similarity, recall.margin, recall.familiarity, recall.speaker]


@policies
@architectures
def test_each_condition_is_answered_by_who_learned_it(make: Make, vsa: str) -> None:
    shown = random_pairs(12)
    recall = make(bank(vsa))(shown.sensors)
    assert recall.commands.tolist() == shown.commands.tolist()
    assert recall.speaker is not None
    assert recall.speaker.tolist() == [0] * 6 + [1] * 6
    assert (recall.similarity > 0).all()
    assert (recall.margin > 0).all()


@policies
@architectures
def test_nothing_observed_nobody_speaks(make: Make, vsa: str) -> None:
    seen = random_pairs(12).sensors[0].tolist()
    recall = make(bank(vsa))([seen, [math.nan] * 3, [seen[0], math.nan, seen[2]]])
    assert recall.commands.isnan().all(1).tolist() == [False, True, False]
    assert [part[1].item() for part in parts(recall)[1:]] == [0, 0, 0, -1]
    assert (parts(recall)[-1][[0, 2]] >= 0).all()


@policies
def test_chunks_change_no_bit(make: Make) -> None:
    made = make(bank(dim=500))
    readings = random_pairs(40, seed=2).sensors
    whole = parts(made(readings))
    for chunk in (1, 7):
        pieces = zip(*(parts(made(rows)) for rows in readings.split(chunk)), strict=True)
        assert all(same_bits(torch.cat(piece), part) for piece, part in zip(pieces, whole, strict=True))


@policies
def test_many_rows_are_asked_some_at_a_time(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    made, asked = make(bank(dim=4000)), []
    ask = made.ask
    monkeypatch.setattr(made, "ask", lambda conditions: asked.append(len(conditions)) or ask(conditions))
    readings = random_pairs(1500, seed=2).sensors
    whole = parts(made(readings))
    assert sum(asked) == 1500
    assert max(asked) <= 2**22 // 4000
    pieces = zip(*(parts(made(rows)) for rows in readings.split(400)), strict=True)
    assert all(same_bits(torch.cat(piece), part) for piece, part in zip(pieces, whole, strict=True))


@policies
def test_a_copy_answers_alike(make: Make) -> None:
    made = make(bank(dim=500))
    readings = random_pairs(20, seed=2).sensors
    assert all(map(same_bits, parts(deepcopy(made)(readings)), parts(made(readings))))


@policies
def test_an_empty_bank_has_nothing_to_combine(make: Make) -> None:
    with pytest.raises(ValueError, match="needs at least one behaviour"):
        make(BehaviourBank(space(64)))


@policies
def test_readings_are_checked(make: Make) -> None:
    with pytest.raises(ValueError, match="sensor 'left' reads 99 in row 0"):
        make(bank(dim=64))([[99.0, 0, 0]])
