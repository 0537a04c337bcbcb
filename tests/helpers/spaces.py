"""The spaces on which every law is tested: a listed architecture joins by being listed."""

from contextlib import suppress

import pytest
import torch

import torchvsa
from torchvsa import VSA

DIM = 2000


def _spaces() -> list[VSA]:
    """Every architecture in its own type, and in int8 where it offers integer codes."""
    spaces = []
    for name in torchvsa.ARCHITECTURES:
        spaces.append(torchvsa.architecture_near(name, DIM))
        with suppress(ValueError):
            spaces.append(torchvsa.architecture(name, DIM, torch.int8))
    return list(dict.fromkeys(spaces))


SPACES = _spaces()
ELEMENTWISE = [vsa.name for vsa in SPACES if vsa.elementwise and vsa == torchvsa.architecture_near(vsa.name, DIM)]


def name_of(vsa: VSA) -> str:
    """The name and the type of a space."""
    return f"{vsa.name}-{vsa.config()['dtype']}"


with_negatives = pytest.mark.parametrize("vsa", [vsa for vsa in SPACES if vsa.negatable], indirect=True, ids=name_of)
"""Limits the fixture `vsa` to the spaces in which hypervectors have a negative."""
