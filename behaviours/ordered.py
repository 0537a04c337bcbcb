"""Sets that keep the order of first insertion, as the clean-up memories of the paper do."""

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor

from torchvsa._numerics import real_parts


def first_rows(values: Int64[Tensor, "N"]) -> Int64[Tensor, "k"]:
    """For each of the values 0 .. k-1, all of which occur, the row in which it occurs first."""
    rows = torch.arange(len(values), device=values.device)
    first = torch.full((int(values.max()) + 1,), len(values), device=values.device)
    return first.scatter_reduce(0, values, rows, "amin")


def in_order_of_appearance(values: Int64[Tensor, "N"]) -> Int64[Tensor, "k"]:
    """The distinct values, in the order in which they first occur."""
    distinct, which = values.unique(return_inverse=True)
    return distinct[first_rows(which).argsort()]


def distinct_rows(rows: Shaped[Tensor, "N c"]) -> tuple[Shaped[Tensor, "k c"], Int64[Tensor, "N"]]:
    """The distinct rows in order of first appearance, and for each row which of them it is."""
    keys = _comparable(rows)
    # Flat keys are found by sorting numbers, several times faster than sorting rows.
    _, which = keys.unique(return_inverse=True) if keys.dim() == 1 else keys.unique(dim=0, return_inverse=True)
    first = first_rows(which)
    if len(first) == len(rows):
        return rows, torch.arange(len(rows), device=rows.device)
    order = first.argsort()
    return rows[first[order]], order.argsort()[which]


def _comparable(rows: Shaped[Tensor, "N c"]) -> Tensor:
    """Something to tell rows apart by that can be sorted, and fast: one number per row if they are integers."""
    if rows.is_complex():
        return real_parts(rows)
    if rows.dtype != torch.int64 or rows.numel() == 0:
        return rows
    key, values = torch.zeros_like(rows[:, 0]), 1
    for column in rows.unbind(1):
        low, high = (int(end) for end in column.aminmax())
        if values * (high - low + 1) >= 2**62:
            # Numbered anew, the rows so far take no more numbers than there are rows; so do the values of a column.
            key, values = _numbered(key)
            column, high = _numbered(column)
            low, high = 0, high - 1
        key, values = key * (high - low + 1) + (column - low), values * (high - low + 1)
    return key


def _numbered(values: Int64[Tensor, "N"]) -> tuple[Int64[Tensor, "N"], int]:
    """The rank of each value among the distinct ones, and how many these are."""
    distinct, rank = values.unique(return_inverse=True)
    return rank, len(distinct)
