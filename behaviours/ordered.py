"""Unique values and rows in order of first appearance, which is the order of the clean-up memories of the paper."""

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor

from torchvsa._numerics import real_parts


def first_rows(values: Int64[Tensor, "N"]) -> Int64[Tensor, "k"]:
    """The first row of each of the values 0 to k-1, all of which must occur."""
    rows = torch.arange(len(values), device=values.device)
    first = torch.full((int(values.max()) + 1,), len(values), device=values.device)
    return first.scatter_reduce(0, values, rows, "amin")


def in_order_of_appearance(values: Int64[Tensor, "N"]) -> Int64[Tensor, "k"]:
    """The distinct values in order of first appearance."""
    distinct, index = values.unique(return_inverse=True)
    return distinct[first_rows(index).argsort()]


def distinct_rows(rows: Shaped[Tensor, "N c"]) -> tuple[Shaped[Tensor, "k c"], Int64[Tensor, "N"]]:
    """The distinct rows in order of first appearance, and the index of each row into them."""
    keys = _sort_keys(rows)
    # Sorting numbers is several times faster than sorting rows.
    _, index = keys.unique(return_inverse=True) if keys.dim() == 1 else keys.unique(dim=0, return_inverse=True)
    first = first_rows(index)
    if len(first) == len(rows):
        return rows, torch.arange(len(rows), device=rows.device)
    order = first.argsort()
    return rows[first[order]], order.argsort()[index]


def _sort_keys(rows: Shaped[Tensor, "N c"]) -> Tensor:
    """A sortable key per row: one integer for rows of int64, else the row itself."""
    if rows.is_complex():
        return real_parts(rows)
    if rows.dtype != torch.int64 or rows.numel() == 0:
        return rows
    key, values = torch.zeros_like(rows[:, 0]), 1
    for column in rows.unbind(1):
        low, high = (int(end) for end in column.aminmax())
        if values * (high - low + 1) >= 2**62:
            # Ranks keep the keys below the number of rows.
            key, values = _ranks(key)
            column, high = _ranks(column)
            low, high = 0, high - 1
        key, values = key * (high - low + 1) + (column - low), values * (high - low + 1)
    return key


def _ranks(values: Int64[Tensor, "N"]) -> tuple[Int64[Tensor, "N"], int]:
    """The rank of each value among the distinct values, and the number of distinct values."""
    distinct, rank = values.unique(return_inverse=True)
    return rank, len(distinct)
