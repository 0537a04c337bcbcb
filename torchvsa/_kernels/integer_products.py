"""Products of int8 matrices.

The plain line is `a.double() @ b.double().T`. A device with integer units takes a quarter of its time. A CPU without
them multiplies integers 20 times slower than floats. Measured with `python -m benchmarks --only cleanup`.
"""

from functools import reduce

import torch
from jaxtyping import Float32, Int8, Int32, Shaped
from torch import Tensor, cpu
from torch.nn import functional

_BY_COLUMN, _TRANSPOSED = 3, 16
"""For many rows on a CPU, `_int_mm` is fastest item by item up to 3 items, and transposed below 16 items."""
_TILE = 32
"""Sizes are padded to multiples of this. cuBLAS needs more than 16 rows and sizes that are multiples of 16; it refuses
others or, in some versions, returns wrong results (pytorch/pytorch#107671)."""

_INT8_TERMS = 2**17 - 32
"""This many products of int8 numbers, at most 2^14 each, sum up within int32; a multiple of `_TILE`."""
FLOAT_TERMS = 1023
"""This many products of int8 numbers sum up exactly in float32, below 2^24."""
_HAS_UNITS = cpu._is_vnni_supported()
"""Whether the CPU has integer units (VNNI)."""


def integer_products(a: Int8[Tensor, "rows d"], b: Int8[Tensor, "k d"]) -> Shaped[Tensor, "rows k"]:
    """`a @ b.T`, exact: in int32, or in int64 from d = 131,041 on."""
    units = a.device.type == "cuda" or (a.device.type == "cpu" and _HAS_UNITS and a.shape[1] > 1)
    most, product = (_INT8_TERMS, by_units) if units else (FLOAT_TERMS, by_floats)
    wide = torch.int32 if a.shape[1] <= _INT8_TERMS else torch.int64
    if a.shape[1] <= most:
        return product(a, b).to(wide)
    parts = zip(a.split(most, 1), b.split(most, 1), strict=True)
    # The integer units of a CPU return wrong results for d = 1, which the last part can have.
    sums = (product(x, y) if x.shape[1] > 1 else by_floats(x, y) for x, y in parts)
    return reduce(Tensor.add_, (part.to(wide) for part in sums))


def by_floats(a: Int8[Tensor, "rows d"], b: Int8[Tensor, "k d"]) -> Float32[Tensor, "rows k"]:
    """`a @ b.T` in float32, exact for `FLOAT_TERMS` elements."""
    return a.to(torch.float32) @ b.to(torch.float32).T


def by_units(a: Int8[Tensor, "rows d"], b: Int8[Tensor, "k d"]) -> Int32[Tensor, "rows k"]:
    """`a @ b.T` in int32, by the integer units of a GPU, or of a CPU for d above 1."""
    if a.device.type == "cuda":
        return by_whole_tiles(a, b)
    if len(b) <= _BY_COLUMN and len(a) > _TRANSPOSED:
        return torch.cat([torch.ops.aten._int_mm(a, item) for item in b.T.split(1, -1)], -1)
    if len(b) < _TRANSPOSED < len(a):
        return torch.ops.aten._int_mm(b, a.T).T
    return torch.ops.aten._int_mm(a, b.T)


def by_whole_tiles(a: Int8[Tensor, "rows d"], b: Int8[Tensor, "k d"]) -> Int32[Tensor, "rows k"]:
    """`a @ b.T` of matrices padded with zeros to multiples of `_TILE`."""
    return torch.ops.aten._int_mm(_padded(a), _padded(b).T)[: len(a), : len(b)]


def _padded(x: Int8[Tensor, "rows d"]) -> Int8[Tensor, "more_rows more_d"]:
    rows, columns = (_TILE * max(-(-size // _TILE), 1) - size for size in x.shape)
    return functional.pad(x, (0, columns, 0, rows)) if rows or columns else x.contiguous()
