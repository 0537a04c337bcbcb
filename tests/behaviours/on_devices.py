"""Compare answers of the CPU with those of the pretended device."""

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor, nn
from torch.testing import assert_close

TOLERANCE = 1e-5


def same(work: Callable[..., Any], *arguments: Tensor | nn.Module, exact: bool = True, waits: bool = False) -> None:
    """`work` answers alike on both devices, where its arguments are, and does not wait for the device unless it may."""
    from pretended import brought_back, moved, waited

    copies = [moved(argument) for argument in arguments]
    waited.clear()
    away = work(*copies)
    assert waits or waited == []
    close(brought_back(away), brought(work(*arguments)), exact)


def close(answer: Any, expected: Any, exact: bool) -> None:
    """The same numbers in the same type, or nearly so."""
    tolerance = 0 if exact else TOLERANCE
    assert_close(answer, expected, atol=tolerance, rtol=tolerance, equal_nan=True)


def brought(answer: Any) -> Any:
    """A (named) tuple without what it leaves empty; a tensor as it is."""
    return tuple(brought(part) for part in answer if part is not None) if isinstance(answer, tuple) else answer


def seeded(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)
