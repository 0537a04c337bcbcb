"""Products of int8 matrices.

The plain line is `a.double() @ b.double().T`. Integer units take a quarter of its time, where a device has them; a CPU
without any is 20 times slower at integers than at floats. Measured by `python -m benchmarks --only cleanup`.
"""

from functools import reduce

import torch
from jaxtyping import Float32, Int8, Int32, Shaped
from torch import Tensor, cpu
from torch.nn import functional

_FEWEST, _FEW = 3, 16
"""A CPU multiplies many rows of int8 fastest with one item at a time if they are so few, and else, if they are fewer
than the second number, with the items on its left."""
_WHOLE = 32
"""cuBLAS multiplies more than 16 rows of int8 whose sizes are multiples of 16, and refuses others or, in some versions,
answers wrongly (pytorch/pytorch#107671)."""


_INT8_TERMS = 2**17 - 32
"""Products of two int8 numbers, at most 2^14 each, whose sum fits int32; a multiple of a GPU's tiles."""
_FLOAT_TERMS = 1023
"""Products of two int8 numbers whose sum is exact in float32, below 2^24."""
_UNITS = cpu._is_vnni_supported()
"""Whether the CPU has units for int8 (VNNI)."""


def integer_products(a: Int8[Tensor, "rows d"], b: Int8[Tensor, "k d"]) -> Shaped[Tensor, "rows k"]:
    """`a @ b.T`, exact: in int32, or in int64 from d = 131,041 on."""
    units = a.device.type == "cuda" or (a.device.type == "cpu" and _UNITS and a.shape[1] > 1)
    most, product = (_INT8_TERMS, by_units) if units else (_FLOAT_TERMS, by_floats)
    wide = torch.int32 if a.shape[1] <= _INT8_TERMS else torch.int64
    if a.shape[1] <= most:
        return product(a, b).to(wide)
    parts = zip(a.split(most, 1), b.split(most, 1), strict=True)
    # Units of a CPU answer nonsense where d = 1, as in a last part of one element.
    sums = (product(x, y) if x.shape[1] > 1 else by_floats(x, y) for x, y in parts)
    return reduce(Tensor.add_, (part.to(wide) for part in sums))


def by_floats(a: Int8[Tensor, "rows d"], b: Int8[Tensor, "k d"]) -> Float32[Tensor, "rows k"]:
    """`a @ b.T` in float32, exact for `_FLOAT_TERMS` elements."""
    return a.to(torch.float32) @ b.to(torch.float32).T


def by_units(a: Int8[Tensor, "rows d"], b: Int8[Tensor, "k d"]) -> Int32[Tensor, "rows k"]:
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
