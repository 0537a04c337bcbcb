"""Adding pairs block by block is adding them one by one, wherever a block ends."""

import pytest
import torch
from robots import random_pairs, same_bits, space

from behaviours import Behaviour, Demonstrations, OneShot
from behaviours.learning import pair_accumulator

rules = pytest.mark.parametrize(
    "rule",
    [
        OneShot(novelty, sigmas=3.0, clip_each_step=clip)
        for novelty in ("exact", "similarity")
        for clip in (False, True)
    ],
)


def shown() -> Demonstrations:
    """40 pairs, met 400 times in a random order, some with another command."""
    pairs = random_pairs(40)
    generator = torch.Generator().manual_seed(0)
    rows = torch.randint(40, (400,), generator=generator)
    other = torch.randint(40, (400,), generator=generator)
    commands = torch.where(torch.rand(400, 1, generator=generator) < 0.1, pairs.commands[other], pairs.commands[rows])
    return Demonstrations(pairs.sensors[rows], commands)


def fit(rule: OneShot, vsa: str = "MAP-C") -> Behaviour:
    return rule.fit(space(256, vsa), shown())


@rules
@pytest.mark.parametrize(("distinct", "block"), [(1, 1), (3, 400), (40, 7), (39, 400)])
def test_no_bit_depends_on_where_blocks_end(
    rule: OneShot, distinct: int, block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = fit(rule)
    monkeypatch.setattr(pair_accumulator, "_DISTINCT", distinct)
    monkeypatch.setattr(pair_accumulator, "_BLOCK", block)
    parts = fit(rule)
    assert same_bits(parts.program, whole.program)
    assert same_bits(parts.known, whole.known)
    assert same_bits(parts.results, whole.results)
    assert parts.report == whole.report


@pytest.mark.parametrize("vsa", ["HRR", "FHRR", "BSC", "MAP-B", "MAP-I"])
@rules
def test_other_architectures_decide_the_same_wherever_blocks_end(
    rule: OneShot, vsa: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = fit(rule, vsa)
    monkeypatch.setattr(pair_accumulator, "_DISTINCT", 5)
    parts = fit(rule, vsa)
    assert parts.report == whole.report
    torch.testing.assert_close(parts.program, whole.program, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(parts.known, whole.known, atol=1e-4, rtol=1e-4)
