"""Codes for values: the kernel that each kind must show."""

from collections.abc import Callable
from itertools import pairwise

import pytest
import torch
from torch import Tensor
from torch.testing import assert_close

import torchvsa
from torchvsa import VSA, level, lookup
from torchvsa.encoding import VALUES

Codes = Callable[..., Tensor]


def seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def kernel(vsa: VSA, codes: Tensor) -> Tensor:
    return vsa.similarity(codes[:, None], codes)


def distances(levels: int) -> Tensor:
    return (torch.arange(levels)[:, None] - torch.arange(levels)).abs()


def test_lookup_codes_resemble_only_themselves(vsa: VSA, chance: float) -> None:
    assert_close(kernel(vsa, lookup(vsa, 9, seeded())), torch.eye(9), atol=chance, rtol=0)


# 3 and 4 divide 12 levels into stretches; 5 leaves a part of one; 20 reaches beyond the last level.
@pytest.mark.parametrize("span", [None, 2, 3, 4, 5, 12, 20])
def test_level_codes_fall_linearly_over_their_span(vsa: VSA, chance: float, span: int | None) -> None:
    codes = level(vsa, 13, seeded(), span=span)
    expected = (1 - distances(13) / (span or 12)).clamp(min=0)
    assert_close(kernel(vsa, codes), expected, atol=chance, rtol=0)


def test_a_span_of_one_is_the_lookup_table(vsa: VSA, chance: float) -> None:
    codes = level(vsa, 9, seeded(), span=1)
    assert_close(kernel(vsa, codes), torch.eye(9), atol=chance, rtol=0)
    assert torch.equal(codes, lookup(vsa, 9, seeded()))


@pytest.mark.parametrize("dim", [1, 7, 1000, 1001])
@pytest.mark.parametrize("levels", [2, 4, 8])
def test_exactly_the_due_elements_have_changed_over(dim: int, levels: int) -> None:
    codes = level(torchvsa.HRR(dim), levels, seeded())
    steps = levels - 1
    # Elements of two normal vectors differ, so that each element tells which end it comes from.
    changed = [(code != codes[0]).sum().item() for code in codes]
    assert changed == [-(-dim * step // steps) for step in range(levels)]
    for before, after in pairwise(codes):
        assert ((before == codes[0]) | (after == codes[-1])).all()


@pytest.mark.parametrize("name", VALUES)
def test_one_code_per_level_from_the_generator_alone(vsa: VSA, name: str) -> None:
    for levels in (1, 2, 5):
        codes = VALUES[name](vsa, levels, generator=seeded())
        assert codes.shape == (levels, vsa.dim)
        assert codes.dtype == vsa.dtype
        assert torch.equal(codes, VALUES[name](vsa, levels, generator=seeded()))
        assert not torch.equal(codes, VALUES[name](vsa, levels, generator=seeded(1)))
