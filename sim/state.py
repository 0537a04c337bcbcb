"""States of controllers: nested tuples, lists and dictionaries of arrays or tensors, one row per robot.

Only methods of tensors are used, so that this module does not import PyTorch.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray


def check_rows(state: Any, batch: int) -> None:
    """Raise `ValueError` unless `state` holds only arrays and tensors with `batch` rows."""
    _map(lambda leaf: _check_leaf(leaf, batch), state)


def check_alike(state: Any, earlier: Any) -> None:
    """Raise `ValueError` unless two states have the same structure, dtypes and shapes of rows."""
    now, before = (_map(lambda leaf: (leaf.dtype, tuple(leaf.shape[1:])), tree) for tree in (state, earlier))
    if now != before:
        raise ValueError(
            f"the state holds {now}, earlier it held {before}; its structure, types and shapes must not change"
        )


def is_empty(state: Any) -> bool:
    """Whether the state holds no number, so that the robots have no memory."""
    sizes: list[int] = []
    _map(lambda leaf: sizes.append(math.prod(leaf.shape)), state)
    return not any(sizes)


def rows_of(state: Any, index: slice | NDArray[np.int64]) -> Any:
    """The state of the robots at `index`, in that order."""
    return _map(lambda leaf: leaf[index], state)


def join(state: Any, more: Any) -> Any:
    """Append the rows of `more` to those of `state`; both must pass `check_alike`."""
    return _map(_concatenate, state, more)


def _map(function: Callable[..., Any], *states: Any) -> Any:
    """Apply `function` to the leaves of states with the same structure."""
    first = states[0]
    if first is None:
        return None
    if isinstance(first, dict):
        return {name: _map(function, *(state[name] for state in states)) for name in first}
    if isinstance(first, tuple | list):
        parts = [_map(function, *leaves) for leaves in zip(*states, strict=True)]
        # A named tuple takes its fields as separate arguments.
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
