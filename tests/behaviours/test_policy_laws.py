"""What every policy promises: one joins by being registered in POLICIES."""

from collections.abc import Callable

import pytest
import torch
from robots import KINDS, SCHEMA, random_pairs, same_bits, space

import torchvsa
from behaviours import POLICIES, BehaviourBank, Blending, Bundle, OneShot, Policy, Priority, Recall, Space
from behaviours.testing import check_policy
from torchvsa import MAP
from torchvsa.encoders import History, RandomFourier

Make = Callable[[BehaviourBank], Policy]

policies = pytest.mark.parametrize("make", POLICIES.values(), ids=POLICIES.keys())
COMBINATIONS = [
    pytest.param(make, vsa, id=f"{name}-{vsa}")
    for name, make in POLICIES.items()
    for vsa in KINDS
    if not isinstance(make, type) or make.supports(torchvsa.architecture_near(vsa, 8))
]
combinations = pytest.mark.parametrize(("make", "vsa"), COMBINATIONS)
# Each policy in two architectures, of which one is no MAP, and each architecture with several policies: the laws take
# seconds, and answers in every combination are tested below.
SOME = [
    combination
    for turn, name in enumerate(POLICIES)
    for place, vsa in enumerate(KINDS)
    for combination in COMBINATIONS
    if combination.id == f"{name}-{vsa}" and place % 3 == turn % 3
]


def bank(vsa: str = "MAP-C", dim: int = 2000) -> BehaviourBank:
    made = BehaviourBank(space(dim, vsa, protection={"name": "self_shift", "width": "sum"}))
    shown = random_pairs(12)
    made.learn("low", shown.where([row < 6 for row in range(12)]), OneShot())
    made.learn("high", shown.where([row >= 6 for row in range(12)]), OneShot())
    return made


def parts(recall: Recall) -> list[torch.Tensor]:
    assert recall.speaker is not None
    return [recall.commands, recall.similarity, recall.margin, recall.familiarity, recall.speaker]


@pytest.mark.parametrize(("make", "vsa"), SOME)
def test_every_policy_keeps_the_laws(make: Make, vsa: str) -> None:
    check_policy(make, space(1000, vsa, protection={"name": "self_shift", "width": "sum"}))


@pytest.mark.parametrize(
    "make",
    [
        lambda bank: Bundle(bank, {"high": 3, "low": -1}),
        lambda bank: Bundle(bank, {"high": 0.3}),
        lambda bank: Priority(bank, ["high", "low"]),
        lambda bank: Priority(bank, ["high"], {"high": 0.2}),
    ],
)
def test_their_options_keep_the_laws(make: Make) -> None:
    def or_refuse(bank: BehaviourBank) -> Policy:
        if not bank.names:
            raise ValueError("nothing to combine")
        return make(bank)

    check_policy(or_refuse)


# Half of them, with and without a memory of their own: all ask the same space.
@pytest.mark.parametrize("make", list(POLICIES.values())[::2], ids=list(POLICIES)[::2])
def test_they_keep_the_laws_over_a_memory_of_continuous_readings(make: Make) -> None:
    check_policy(make, Space(SCHEMA, History(RandomFourier(MAP(1000), 3), [1])))


@combinations
def test_each_condition_is_answered_by_who_learned_it(make: Make, vsa: str) -> None:
    shown = random_pairs(12)
    recall = make(bank(vsa))(shown.sensors)
    # Blending leaves a small weight to the others.
    torch.testing.assert_close(recall.commands, shown.commands, rtol=0, atol=0 if make is not Blending else 0.2)
    assert recall.speaker is not None
    assert recall.speaker.tolist() == [0] * 6 + [1] * 6
    assert (recall.similarity > 0).all()
    assert (recall.margin > 0).all()


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
    query = made.query
    monkeypatch.setattr(made, "query", lambda conditions: asked.append(len(conditions[0])) or query(conditions))
    readings = random_pairs(1500, seed=2).sensors
    whole = parts(made(readings))
    assert sum(asked) == 1500
    assert max(asked) <= 2**22 // 4000
    pieces = zip(*(parts(made(rows)) for rows in readings.split(400)), strict=True)
    assert all(same_bits(torch.cat(piece), part) for piece, part in zip(pieces, whole, strict=True))


@policies
def test_an_empty_bank_has_nothing_to_combine(make: Make) -> None:
    with pytest.raises(ValueError, match="needs at least one behaviour"):
        make(BehaviourBank(space(64)))


@policies
def test_readings_are_checked(make: Make) -> None:
    with pytest.raises(ValueError, match="sensor 'left' reads 99 in row 0"):
        make(bank(dim=64))([[99.0, 0, 0]])
