"""States of controllers: nested tuples, lists and dictionaries of arrays or tensors, one row per robot.

Tensors are handled by their own methods, so that nothing here imports PyTorch.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray


def check_rows(state: Any, batch: int) -> None:
    """Raise `ValueError` unless all that `state` holds are arrays and tensors of `batch` rows."""
    _map(lambda leaf: _check_leaf(leaf, batch), state)


def check_alike(state: Any, earlier: Any) -> None:
    """Raise `ValueError` unless two states have the same structure, types of numbers and shapes of rows."""
    ours, theirs = (_map(lambda leaf: (leaf.dtype, tuple(leaf.shape[1:])), one) for one in (state, earlier))
    if ours != theirs:
        raise ValueError(f"the state holds {ours}, earlier it held {theirs}; its structure, types and shapes must stay")


def is_empty(state: Any) -> bool:
    """Whether the state holds no number: the robots remember nothing."""
    sizes: list[int] = []
    _map(lambda leaf: sizes.append(math.prod(leaf.shape)), state)
    return not any(sizes)


def rows_of(state: Any, index: slice | NDArray[np.int64]) -> Any:
    """The state of the robots at `index`, in that order."""
    return _map(lambda leaf: leaf[index], state)


def join(state: Any, more: Any) -> Any:
    """The rows of `state` followed by those of `more`, which must be alike (see `check_alike`)."""
    return _map(_concatenate, state, more)


def _map(function: Callable[..., Any], *states: Any) -> Any:
    """A state built like the first, with `function` of what the states hold at each place."""
    first = states[0]
    if first is None:
        return None
    if isinstance(first, dict):
        return {name: _map(function, *(state[name] for state in states)) for name in first}
    if isinstance(first, tuple | list):
        parts = [_map(function, *leaves) for leaves in zip(*states, strict=True)]
        # A named tuple takes its fields one by one.
        return type(first)(*parts) if hasattr(first, "_fields") else type(first)(parts)
    return function(*states)


def _concatenate(rows: Any, more: Any) -> Any:
    if isinstance(rows, np.ndarray):
        return np.concatenate([rows, more])
    joined = rows.new_empty((len(rows) + len(more), *rows.shape[1:]))
    joined[: len(rows)], joined[len(rows) :] = rows, more
    return joined


def _check_leaf(leaf: Any, batch: int) -> None:
    if not hasattr(leaf, "shape") or not hasattr(leaf, "dtype"):
        raise ValueError(
            f"the state holds {leaf!r}; expected arrays or tensors with one row per robot, in tuples, lists or "
            "dictionaries, or None"
        )
    if not leaf.shape or leaf.shape[0] != batch:
        raise ValueError(
            f"the state holds an array of shape {tuple(leaf.shape)}; expected one row per robot, {batch} in all"
        )
