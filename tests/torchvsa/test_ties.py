"""Split votes: what decides an even number of voters in the architectures that keep only a majority."""

import numpy as np
import pytest
import torch
from torch import Tensor

import torchvsa
from torchvsa import VSA
from torchvsa._numerics import as_bipolar

DIM = 1000
MAJORITY = {
    "MAP-B": torchvsa.architecture("MAP-B", DIM),
    "MAP-B int8": torchvsa.architecture("MAP-B", DIM, "int8"),
    "BSC": torchvsa.architecture("BSC", DIM),
}


@pytest.fixture(params=list(MAJORITY.values()), ids=list(MAJORITY))
def majority(request: pytest.FixtureRequest) -> VSA:
    return request.param


def votes(xs: Tensor) -> np.ndarray:
    return as_bipolar(xs).to(torch.int64).numpy()


@pytest.mark.parametrize("k", [1, 2, 3, 4, 9, 10])
def test_an_even_number_of_voters_gets_one_more(majority: VSA, k: int) -> None:
    xs = majority.random(20, k, generator=torch.Generator().manual_seed(k))
    ballots = votes(xs)
    if k % 2 == 0:
        extra = np.roll(ballots[:, 0] * ballots[:, 1], 1, axis=-1)
        ballots = np.concatenate([ballots, extra[:, None]], axis=1)
    expected = np.sign(ballots.sum(1))
    assert (votes(majority.bundle(xs)) == expected).all()
    assert torch.equal(majority.bundle(xs), majority.bundle(xs.clone()))


@pytest.mark.parametrize("k", [2, 4])
def test_unrelated_records_of_an_even_number_of_voters_stay_unrelated(majority: VSA, k: int) -> None:
    records = majority.bundle(majority.random(2, 100, k, generator=torch.Generator().manual_seed(0)))
    mean = majority.similarity(records[0], records[1]).mean()
    assert abs(mean) < 5 / (100 * DIM) ** 0.5


def test_a_fixed_tie_vector_would_relate_unrelated_records(majority: VSA) -> None:
    generator = torch.Generator().manual_seed(0)
    pairs, tie = majority.random(2, 100, 2, generator=generator), majority.random(generator=generator)
    fixed = np.sign(votes(pairs).sum(2) + votes(tie))
    # A quarter of the elements are split in both records.
    assert (fixed[0] * fixed[1]).mean() == pytest.approx(0.25, abs=0.02)


def test_only_split_votes_depend_on_who_votes_first(majority: VSA) -> None:
    xs = majority.random(4, generator=torch.Generator().manual_seed(0))
    split = votes(xs).sum(0) == 0
    here, there = votes(majority.bundle(xs)), votes(majority.bundle(xs.flip(0)))
    assert (here == there)[~split].all()
    assert (majority.bundle(xs) == majority.bundle(xs[[1, 0, 3, 2]])).all()


def test_a_raw_sum_without_its_voters_is_decided_by_its_own_majority(majority: VSA) -> None:
    raw = majority.superpose(majority.random(4, generator=torch.Generator().manual_seed(0)))
    counts = raw.to(torch.int64).numpy()
    expected = np.where(counts == 0, np.roll(np.where(counts >= 0, 1, -1), 1), np.sign(counts))
    assert (votes(majority.normalize(raw)) == expected).all()
