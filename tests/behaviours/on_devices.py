"""Compare answers of the CPU with those of another device."""

from collections.abc import Callable
from typing import Any

import torch
from devices import other
from torch import Tensor, nn
from torch.testing import assert_close


def same(work: Callable[..., Any], *arguments: Tensor | nn.Module, exact: bool = True, waits: bool = False) -> None:
    """`work` answers alike on both devices, where its arguments are, and does not wait for the device unless it may."""
    copies = [other().moved(argument) for argument in arguments]
    other().waited.clear()
    away = work(*copies)
    assert waits or other().waited == []
    close(other().brought_back(away), brought(work(*arguments)), exact)


def close(answer: Any, expected: Any, exact: bool = False, tolerance: float | None = None) -> None:
    """The same numbers in the same type, or as nearly so as the device rounds like the CPU."""
    allowed = 0 if exact else other().TOLERANCE if tolerance is None else tolerance
    assert_close(answer, expected, atol=allowed, rtol=allowed, equal_nan=True)


def brought(answer: Any) -> Any:
    """A (named) tuple without what it leaves empty; a tensor as it is."""
    return tuple(brought(part) for part in answer if part is not None) if isinstance(answer, tuple) else answer


def seeded(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)
