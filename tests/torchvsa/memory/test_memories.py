"""Memories that complete queries: the laws of all, and the values of each against NumPy."""

from typing import Any

import numpy as np
import pytest
import torch
from readings import seeded
from torch import Tensor

import torchvsa
from torchvsa import MAP, MEMORIES, ClassicalHopfield, CleanUp, Hopfield, SparseDistributedMemory
from torchvsa.testing import check_memory

BIPOLAR = MAP(300, dtype=torch.int8)


@pytest.mark.parametrize("name", MEMORIES)
@pytest.mark.parametrize("architecture", ["MAP-C", "MAP-I", "HRR", "FHRR", "BSC"])
def test_every_memory_keeps_the_laws(name: str, architecture: str) -> None:
    check_memory(MEMORIES[name], torchvsa.architecture(architecture, 400))


@pytest.mark.parametrize(
    "options", [{"order": "asynchronous"}, {"rule": "projection"}, {"rule": "projection", "order": "asynchronous"}]
)
def test_other_rules_and_orders_keep_the_laws(options: dict[str, Any]) -> None:
    check_memory(lambda items: ClassicalHopfield(items, **options), BIPOLAR)


class Forgetful(CleanUp):
    """Answers the first item."""

    def forward(self, queries: Tensor) -> torchvsa.Match:
        match = super().forward(queries)
        return match._replace(index=torch.zeros_like(match.index))


def test_a_broken_memory_is_told_its_law() -> None:
    with pytest.raises(AssertionError, match=r"Forgetful of MAP-C.* breaks the law: each item is found by itself"):
        check_memory(Forgetful, BIPOLAR)


def noisy(items: Tensor, share: float, seed: int = 1) -> Tensor:
    flipped = torch.rand(items.shape, generator=seeded(seed)) < share
    return torch.where(flipped, -items, items)


def test_hopfield_is_equation_3() -> None:
    items, queries = torch.randn(5, 20, generator=seeded(0)), torch.randn(4, 20, generator=seeded(1))
    x, state = items.double().numpy(), queries.double().numpy()
    x, state = (rows / np.linalg.norm(rows, axis=1, keepdims=True) for rows in (x, state))
    for _ in range(3):
        weights = np.exp(3.0 * state @ x.T)
        state = weights / weights.sum(1, keepdims=True) @ x
    found = Hopfield(items, beta=3.0, steps=3).retrieve(queries)
    assert found.numpy() == pytest.approx(state, abs=1e-6)
    with pytest.raises(ValueError, match="beta is positive"):
        Hopfield(items, beta=0)


@pytest.mark.parametrize("rule", ["outer", "projection"])
@pytest.mark.parametrize("order", ["synchronous", "asynchronous"])
def test_the_classical_network_is_its_weight_matrix(rule: Any, order: Any) -> None:
    items = MAP(60, dtype=torch.int8).random(5, generator=seeded(0))
    queries = noisy(items, 0.25)
    x = items.numpy().astype(float)
    weights = x.T @ x if rule == "outer" else np.linalg.pinv(x) @ x
    np.fill_diagonal(weights, 0)
    memory = ClassicalHopfield(items, rule, order, steps=3, seed=4)
    orders = [torch.randperm(60, generator=generator).tolist() for generator in [seeded(4)] for _ in range(3)]
    for row, found in zip(queries.numpy().astype(float), memory.complete(queries).state, strict=True):
        state = row.copy()
        for sequence in orders:
            for neurons in [sequence] if order == "synchronous" else [[neuron] for neuron in sequence]:
                total = (weights @ state)[neurons].round(6)
                state[neurons] = np.where(total == 0, state[neurons], np.sign(total))
        assert found.tolist() == state.tolist()
    energy = -np.einsum("bi,ij,bj->b", queries, weights, queries) / 2
    assert memory.energy(queries).numpy() == pytest.approx(energy)


@pytest.mark.parametrize("rule", ["outer", "projection"])
def test_one_by_one_the_energy_never_rises(rule: Any) -> None:
    items = MAP(80, dtype=torch.int8).random(12, generator=seeded(0))
    queries = MAP(80, dtype=torch.int8).random(20, generator=seeded(1))
    energies = [ClassicalHopfield(items, rule).energy(queries)]
    for steps in range(1, 8):
        memory = ClassicalHopfield(items, rule, "asynchronous", steps=steps)
        energies.append(memory.energy(memory.complete(queries).state))
    assert (torch.stack(energies).diff(dim=0) <= 1e-9).all()
    assert ClassicalHopfield(items, rule, "asynchronous").complete(queries).settled.all()


def test_a_cycle_has_not_settled() -> None:
    """Two neurons that disagree exchange their states for ever: W = [[0, 1], [1, 0]]."""
    memory = ClassicalHopfield(torch.tensor([[1, 1]]), steps=7)
    found = memory.complete(torch.tensor([[1, -1], [1, 1]]))
    assert found.settled.tolist() == [False, True]
    assert found.state[0].tolist() == [-1, 1]
    assert found.steps.tolist() == [7, 0]


def test_the_projection_rule_holds_more_items() -> None:
    items = BIPOLAR.random(100, generator=seeded(0))
    queries = noisy(items, 0.05)
    right = [
        (ClassicalHopfield(items, rule)(queries).index == torch.arange(100)).double().mean()
        for rule in ("outer", "projection")
    ]
    kept = [
        (ClassicalHopfield(items, rule).complete(items).state == items).all(1).double().mean()
        for rule in ("outer", "projection")
    ]
    assert kept[0] < 0.1
    assert kept[1] == 1
    assert right[1] > right[0]
    with pytest.raises(ValueError, match="linearly independent"):
        ClassicalHopfield(torch.cat([items[:2], -items[:1]]), "projection")


def test_sparse_distributed_memory_reads_what_was_written() -> None:
    items = MAP(100, dtype=torch.int8).random(6, generator=seeded(0))
    memory = SparseDistributedMemory(items, locations=300, radius=44, steps=1)
    x, a = items.numpy().astype(int), memory.addresses.numpy().astype(int)
    near = (x[:, None] != a).sum(-1) <= 44
    assert near.any()
    counters = np.einsum("km,kd->md", near.astype(int), x)
    assert (memory.counters.numpy() == counters).all()
    queries = noisy(items, 0.1).numpy().astype(int)
    total = ((queries[:, None] != a).sum(-1) <= 44).astype(int) @ counters
    expected = np.where(total == 0, queries, np.sign(total))
    assert (memory.retrieve(torch.from_numpy(queries)).numpy() == expected).all()
    with pytest.raises(ValueError, match=r"sparse distributed memory of 10,000,000,000 locations .* take fewer"):
        SparseDistributedMemory(items, locations=10**10)


def test_noisy_copies_are_completed_to_what_they_are_copies_of() -> None:
    """Kanerva 1988: the memory never saw the item itself."""
    item = MAP(500, dtype=torch.int8).random(1, generator=seeded(0))
    copies = noisy(item.expand(30, -1), 0.2)
    found = SparseDistributedMemory(copies, locations=1000)(copies[:1])
    state = SparseDistributedMemory(copies, locations=1000).retrieve(copies[:1])
    assert found.index.shape == (1,)
    assert torch.cosine_similarity(state, item.float()).item() > 0.85
    assert torch.cosine_similarity(copies[:1].float(), item.float()).item() < 0.65
