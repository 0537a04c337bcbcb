"""Products of int8 matrices."""

import torch
from jaxtyping import Int8, Int32
from torch import Tensor
from torch.nn import functional

_FEWEST, _FEW = 3, 16
"""A CPU multiplies many rows of int8 fastest with one item at a time if they are so few, and else, if they are fewer
than the second number, with the items on its left."""
_WHOLE = 32
"""cuBLAS multiplies more than 16 rows of int8 whose sizes are multiples of 16, and refuses others or, in some versions,
answers wrongly (pytorch/pytorch#107671)."""


def integer_product(a: Int8[Tensor, "rows d"], b: Int8[Tensor, "k d"]) -> Int32[Tensor, "rows k"]:
    """`a @ b.T`, summed in int32 by the int8 units of a CPU (where d is above 1) or a GPU."""
    if a.device.type == "cuda":
        return by_whole_tiles(a, b)
    if len(b) <= _FEWEST and len(a) > _FEW:
        return torch.cat([torch.ops.aten._int_mm(a, item) for item in b.T.split(1, -1)], -1)
    if len(b) < _FEW < len(a):
        return torch.ops.aten._int_mm(b, a.T).T
    return torch.ops.aten._int_mm(a, b.T)


def by_whole_tiles(a: Int8[Tensor, "rows d"], b: Int8[Tensor, "k d"]) -> Int32[Tensor, "rows k"]:
    """`a @ b.T` of matrices that zeros fill up to multiples of a GPU's tiles."""
    return torch.ops.aten._int_mm(_filled_up(a), _filled_up(b).T)[: len(a), : len(b)]


def _filled_up(x: Int8[Tensor, "rows d"]) -> Int8[Tensor, "more_rows more_d"]:
    rows, columns = (_WHOLE * max(-(-size // _WHOLE), 1) - size for size in x.shape)
    return functional.pad(x, (0, columns, 0, rows)) if rows or columns else x.contiguous()
