"""Entries of tables, looked up and put together row by row."""

from collections.abc import Callable, Iterator
from functools import reduce
from typing import Any, Literal

import torch
from jaxtyping import Int, Shaped
from torch import Tensor

from torchvsa.operators.common import MANY, at_once, differentiated, stacked


def looked_up(
    table: Shaped[Tensor, "n entries d"],
    places: Int[Tensor, "batch n"],
    how: Literal["clipped sum", "product", "exclusive or"],
) -> Shaped[Tensor, "batch d"]:
    """The entries `table[i, places[:, i]]` put together: their sum, clipped to [-1, 1], product or exclusive or.

    In the table's own type, which sums must fit.
    """
    plain = torch.compiler.is_compiling() or table.device.type != "cpu" or differentiated(table)
    if plain or places.shape[0] < MANY:
        whole = reduce(_STEPS[how], entries(table, places))
        return whole.clamp(-1, 1) if how == "clipped sum" else whole
    return torch.ops.torchvsa.look_up(table, places, how)


_STEPS: dict[str, Callable[[Tensor, Tensor], Tensor]] = {
    "clipped sum": Tensor.add_,
    "product": Tensor.mul_,
    "exclusive or": Tensor.bitwise_xor_,
}


def entries(
    table: Shaped[Tensor, "n entries d"], places: Int[Tensor, "batch n"]
) -> Iterator[Shaped[Tensor, "batch d"]]:
    """`table[i, places[:, i]]` for one i after the other; copied row by row, far faster than by plain indexing."""
    return (one.index_select(0, column) for one, column in zip(table, places.unbind(1), strict=True))


@torch.library.custom_op("torchvsa::look_up", mutates_args=())
def _look_up(table: Tensor, places: Tensor, how: str) -> Tensor:
    answer = table.new_empty(places.shape[0], table.shape[2])
    some = at_once(answer)
    entry = answer.new_empty(min(some, len(answer)), answer.shape[1])
    for start in range(0, len(answer), some):
        block, columns = answer[start : start + some], places[start : start + some].unbind(1)
        torch.index_select(table[0], 0, columns[0], out=block)
        for one, column in zip(table[1:], columns[1:], strict=True):
            _STEPS[how](block, torch.index_select(one, 0, column, out=entry[: len(block)]))
        if how == "clipped sum":
            block.clamp_(-1, 1)
    return answer


@_look_up.register_fake
def _(table: Tensor, places: Tensor, how: str) -> Tensor:
    return table.new_empty(places.shape[0], table.shape[2])


@_look_up.register_vmap
def _(info: Any, in_dims: tuple[int | None, ...], table: Tensor, places: Tensor, how: str) -> tuple[Tensor, int]:
    if in_dims[0] is None:
        places = places.movedim(in_dims[1] or 0, 0)
    else:
        # The lists of all mapped tables become one.
        table, places = stacked(info, in_dims[:2], table, places)
        places = places + torch.arange(info.batch_size, device=places.device)[:, None, None] * table.shape[2]
        table = table.transpose(0, 1).flatten(1, 2)
    return _look_up(table, places.flatten(0, 1), how).unflatten(0, (info.batch_size, -1)), 0
