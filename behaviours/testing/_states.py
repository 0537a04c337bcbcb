"""States of controllers: nested tuples, lists and dictionaries of tensors or arrays, one row per robot."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch

from behaviours.testing._material import bits
from torchvsa.testing._laws import require, same


def each(function: Callable[..., Any], *states: Any) -> Any:
    """Apply `function` to the corresponding leaves of states of equal structure."""
    first = states[0]
    if first is None:
        return None
    if isinstance(first, dict):
        return {name: each(function, *(state[name] for state in states)) for name in first}
    if isinstance(first, tuple | list):
        parts = [each(function, *leaves) for leaves in zip(*states, strict=True)]
        # A named tuple takes its fields as separate arguments.
        return type(first)(*parts) if hasattr(first, "_fields") else type(first)(parts)
    return function(*states)


def leaves(state: Any) -> list[Any]:
    """The tensors and arrays of a state, in order."""
    found: list[Any] = []
    each(found.append, state)
    return found


def form(state: Any) -> Any:
    """The structure of a state, with the type and row shape of each leaf."""
    return each(lambda leaf: (leaf.dtype, tuple(leaf.shape[1:])), state)


def check_rows(state: Any, robots: int) -> None:
    """Raise `AssertionError` unless the state holds arrays and tensors with one row per robot."""
    for leaf in leaves(state):
        held = isinstance(leaf, torch.Tensor | np.ndarray)
        require(
            held and leaf.ndim > 0 and len(leaf) == robots,
            f"the state holds {tuple(leaf.shape) if held else leaf!r}; expected tensors or arrays with one row per "
            f"robot, {robots} in all, in tuples, lists or dictionaries, or None",
        )


def rows_of(state: Any, robots: Sequence[int]) -> Any:
    """The state of these robots, in this order."""
    return each(lambda leaf: leaf[list(robots)], state)


def join(state: Any, more: Any) -> Any:
    """The robots of `state`, followed by those of `more`."""
    return each(_concatenated, state, more)


def _concatenated(rows: Any, more: Any) -> Any:
    return np.concatenate([rows, more]) if isinstance(rows, np.ndarray) else torch.cat([rows, more])


def copied(state: Any) -> Any:
    """A copy of a state."""
    return each(lambda leaf: leaf.copy() if isinstance(leaf, np.ndarray) else leaf.clone(), state)


def same_state(a: Any, b: Any) -> None:
    """Raise `AssertionError` unless both states have the same values, types, shapes and structure."""
    require(form(a) == form(b), f"states have different forms: {form(a)} and {form(b)}")
    for first, second in zip(leaves(a), leaves(b), strict=True):
        same(bits(first), bits(second))
