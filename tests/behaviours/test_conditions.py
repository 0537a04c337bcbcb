"""Conditions that are encoded when they are asked for are those that are held."""

from typing import Any

import pytest
import torch
from robots import random_pairs, same_bits, space

from behaviours import RULES, Demonstrations, ErrorDriven, Gradient
from behaviours.learning import conditions
from behaviours.learning.conditions import LazyConditions
from behaviours.learning.samples import Samples


def shown() -> Demonstrations:
    pairs = random_pairs(60)
    rows = torch.randint(60, (300,), generator=torch.Generator().manual_seed(1))
    return Demonstrations(pairs.sensors[rows], pairs.commands[rows])


def rule(name: str) -> Any:
    short = {"gradient": Gradient(epochs=3), "error_driven": ErrorDriven(epochs=3)}
    return short[name] if name in short else RULES[name]()


@pytest.mark.parametrize("name", RULES)
@pytest.mark.parametrize("dim", [8, 300])  # among 8 elements, many conditions of other bins are the same
@pytest.mark.filterwarnings("ignore::behaviours.learning.ConvergenceWarning")
def test_every_rule_learns_the_same_program(name: str, dim: int, monkeypatch: pytest.MonkeyPatch) -> None:
    made = space(dim)
    held = rule(name).fit(made, shown())
    monkeypatch.setattr(conditions, "HELD_BYTES", 0)
    monkeypatch.setattr(conditions, "_ROWS", 7)
    asked_for = rule(name).fit(made, shown())
    assert same_bits(asked_for.program, held.program)
    assert same_bits(asked_for.known, held.known)
    assert asked_for.report == held.report


@pytest.mark.parametrize("vsa", ["MAP-C", "HRR", "FHRR", "BSC", "MAP-I"])
def test_they_are_indexed_like_a_tensor(vsa: str, monkeypatch: pytest.MonkeyPatch) -> None:
    made = space(16, vsa)
    held = Samples.of(made, shown())
    monkeypatch.setattr(conditions, "HELD_BYTES", 0)
    shares: list[float] = []
    lazy = Samples.of(made, shown(), shares.append)
    assert isinstance(held.conditions, torch.Tensor)
    assert isinstance(lazy.conditions, LazyConditions)
    assert shares == [1.0]
    assert torch.equal(lazy.condition, held.condition)
    assert len(lazy.conditions) == len(held.conditions)
    some = torch.tensor([3, 0, 3])
    torch.testing.assert_close(lazy.conditions[:], held.conditions)
    torch.testing.assert_close(lazy.conditions[2], held.conditions[2])
    torch.testing.assert_close(lazy.conditions[some], held.conditions[some])
    torch.testing.assert_close(lazy.conditions.index_select(0, some), held.conditions[some])
    torch.testing.assert_close(torch.cat(list(lazy.conditions.split(5))), held.conditions)


def test_equal_fingerprints_of_different_conditions_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    made = space(64)
    held = Samples.of(made, shown())
    real, seeds = conditions._fingerprints, []

    def blunt(encoded: torch.Tensor, seed: int) -> torch.Tensor:
        seeds.append(seed)
        return torch.zeros(len(encoded), 8, dtype=torch.int64) if seed == 0 else real(encoded, seed)

    monkeypatch.setattr(conditions, "HELD_BYTES", 0)
    monkeypatch.setattr(conditions, "_fingerprints", blunt)
    assert torch.equal(Samples.of(made, shown()).condition, held.condition)
    assert seeds == [0, 1]
