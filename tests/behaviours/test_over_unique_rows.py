"""Equal readings are asked about once, and answered as if each had been asked alone."""

import math
from collections.abc import Callable
from typing import Any, cast

import pytest
import torch
from robots import random_pairs, same_bits, space
from torch import Tensor

from behaviours import POLICIES, BehaviourBank, OneShot, Recall, Space


def minds(made: Space) -> dict[str, Callable[[Any], Recall]]:
    bank = BehaviourBank(made)
    shown = random_pairs(12)
    bank.learn("low", shown.where([row < 6 for row in range(12)]), OneShot())
    bank.learn("high", shown.where([row >= 6 for row in range(12)]), OneShot())
    return {"low": bank["low"], **{name: cast(Any, policy)(bank) for name, policy in POLICIES.items()}}


def distinct() -> Tensor:
    """31 rows: some with unobserved sensors, and one with nothing else."""
    rows = torch.cat([random_pairs(30).sensors, torch.full((1, 3), math.nan, dtype=torch.float64)])
    rows[::7, 1] = torch.nan
    return rows


REPEATED = torch.randint(31, (400,), generator=torch.Generator().manual_seed(0))
"""The one of `distinct` in each of 400 rows."""


@pytest.mark.parametrize("mind", ["low", *POLICIES])
@pytest.mark.parametrize("vsa", ["MAP-C", "BSC"])
def test_repeated_readings_are_answered_as_alone(vsa: str, mind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    made = space(300, vsa)
    asked = minds(made)[mind]
    rows = distinct()[REPEATED]
    encoded: list[int] = []
    encode = made.encode
    monkeypatch.setattr(made, "encode", lambda cells: (encoded.append(len(cells)), encode(cells))[1])
    whole = asked(rows)
    assert sum(encoded) <= 31
    alone = [asked(row[None]) for row in distinct()]
    assert whole.commands.isnan().all(1).any()
    for field, value in whole._asdict().items():
        if value is not None:
            assert same_bits(value, torch.cat([getattr(recall, field) for recall in alone])[REPEATED])


def test_readings_that_all_differ_are_all_asked() -> None:
    asked = minds(space(300))["low"]
    rows = torch.linspace(0, 20, 130, dtype=torch.float64)[:, None].expand(-1, 3).clone()
    rows[:, 1] = rows[:, 1].flip(0)
    whole = asked(rows)
    assert same_bits(whole.similarity, torch.cat([asked(row[None]).similarity for row in rows]))


def test_a_graph_asks_about_all_of_them() -> None:
    behaviour = minds(space(300))["low"]
    rows = distinct()[REPEATED]
    compiled: Any = torch.compile(behaviour, fullgraph=True, backend="aot_eager")
    whole, graph = behaviour(rows), compiled(rows)
    assert all(same_bits(a, b) for a, b in zip(graph[:4], whole[:4], strict=True))
    torch.compiler.reset()
