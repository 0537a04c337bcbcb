"""The distance of programs tells how often behaviours disagree."""

from typing import Any

import pytest
import torch
from if_else import Rules, learned, readings, space, variants
from robots import KINDS, random_pairs
from robots import space as other_space
from scipy.stats import spearmanr

from behaviours import BehaviourBank, Demonstrations, OneShot, distance, distances


@pytest.mark.slow
def test_distance_follows_disagreement() -> None:
    rules = variants(14)
    bank = learned({str(number): rule for number, rule in enumerate(rules)}, shown=300)
    x = readings(2000, seed=9)
    commands = torch.stack([rule(x) for rule in rules])
    disagree = (commands[:, None] != commands).any(-1).double().mean(-1)
    pairs = torch.triu_indices(len(rules), len(rules), 1).unbind()
    ranked: Any = spearmanr(distances(bank)[pairs], disagree[pairs])
    assert ranked.statistic >= 0.90


@pytest.mark.parametrize("vsa", KINDS)
def test_distances_are_those_of_each_two(vsa: str) -> None:
    bank = BehaviourBank(other_space(200, vsa))
    for number in range(3):
        bank.learn(str(number), random_pairs(5, seed=number), OneShot())
    found = distances(bank)
    assert found.dtype == torch.float64
    assert torch.equal(found, found.T)
    assert torch.equal(found.diag(), torch.zeros(3, dtype=torch.float64))
    for row, one in enumerate(bank):
        for column, two in enumerate(bank):
            assert distance(bank[one], bank[two]) == pytest.approx(float(found[row, column]), abs=1e-6)


def test_the_ends_of_the_scale() -> None:
    bank = learned({"seek": Rules(), "flee": Rules(turn=-1)}, shown=50)
    seek = bank["seek"]
    assert distance(seek, seek) == 0
    assert distance(seek, 3 * seek) == pytest.approx(0, abs=1e-6)
    assert distance(seek, -seek) == pytest.approx(2, abs=1e-6)
    # Weights do not matter, readings are not asked.
    assert distance(2 * seek, bank["flee"]) == pytest.approx(distance(seek, bank["flee"]), abs=1e-6)


def test_programs_over_different_spaces_have_no_distance() -> None:
    x = readings(5)
    one, two = (OneShot().fit(space(dim=64, seed=seed), Demonstrations(x, Rules()(x))) for seed in (0, 1))
    with pytest.raises(ValueError, match="different spaces"):
        distance(one, two)
    with pytest.raises(ValueError, match="empty"):
        distances(BehaviourBank(one.space))
