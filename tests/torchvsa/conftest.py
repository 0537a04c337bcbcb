"""The fixture `vsa`: every space in turn."""

from collections.abc import Callable

import pytest
import torch
from spaces import SPACES, name_of
from torch import Tensor

from torchvsa import VSA


@pytest.fixture(scope="session", params=SPACES, ids=name_of)
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
    """Five standard deviations of the similarity of unrelated hypervectors, about 1/√d; eight for a Poisson tail."""
    return (8 if vsa.sparse else 5) / vsa.dim**0.5
