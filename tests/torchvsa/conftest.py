"""The spaces on which every law is tested: a listed architecture joins by being listed."""

from collections.abc import Callable
from contextlib import suppress

import pytest
import torch
from torch import Tensor

import torchvsa
from torchvsa import VSA

DIM = 2000


def _spaces() -> list[VSA]:
    """Every architecture in its own type, and in int8 where it offers integer codes."""
    spaces = []
    for name in torchvsa.ARCHITECTURES:
        spaces.append(torchvsa.architecture(name, DIM))
        with suppress(ValueError):
            spaces.append(torchvsa.architecture(name, DIM, torch.int8))
    return spaces


@pytest.fixture(scope="session", params=_spaces(), ids=lambda vsa: f"{vsa.name}-{vsa.config()['dtype']}")
def vsa(request: pytest.FixtureRequest) -> VSA:
    return request.param


@pytest.fixture(scope="session")
def draw(vsa: VSA) -> Callable[..., Tensor]:
    """`draw(*shape, seed=0)`: random hypervectors of the space under test."""

    def draw(*shape: int, seed: int = 0) -> Tensor:
        return vsa.random(*shape, generator=torch.Generator().manual_seed(seed))

    return draw


@pytest.fixture(scope="session")
def chance(vsa: VSA) -> float:
    """Five standard deviations of the similarity of unrelated hypervectors, which is about 1/√d."""
    return 5 / vsa.dim**0.5
