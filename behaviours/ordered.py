"""Sets that keep the order of first insertion, as the clean-up memories of the paper do."""

import math

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor


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
    _, which = _comparable(rows).unique(dim=0, return_inverse=True)
    first = first_rows(which)
    order = first.argsort()
    return rows[first[order]], order.argsort()[which]


def _comparable(rows: Shaped[Tensor, "N c"]) -> Tensor:
    """Something to tell rows apart by that can be sorted, and fast: one integer per row if it holds them all."""
    if rows.is_complex():
        return torch.view_as_real(rows).flatten(1)
    if rows.dtype != torch.int64 or len(rows) == 0:
        return rows
    low, high = rows.aminmax(dim=0)
    sizes = (high - low + 1).tolist()
    if math.prod(sizes) >= 2**62:
        return rows
    key = torch.zeros_like(rows[:, 0])
    for column, size in enumerate(sizes):
        key = key * size + rows[:, column] - low[column]
    return key
