"""Sums and products of integer hypervectors and raw accumulators, exact or refused with an error."""

from collections.abc import Sequence
from typing import Any

import torch
from jaxtyping import Shaped
from torch import Tensor

from torchvsa._checks import INT32_MAX, INTEGERS, fits, largest, narrowed, readable, type_bound, whole_number
from torchvsa._numerics import as_bipolar, is_integer
from torchvsa.errors import ShapeError

Summands = Shaped[Tensor, "..."] | Sequence[Shaped[Tensor, "..."]]
"""Hypervectors to bundle: stacked in one tensor, or in a list or tuple."""


def stacked(xs: Any, dim: Any) -> tuple[Shaped[Tensor, "..."], int]:
    """The summands as one tensor (a list or tuple is stacked on dimension -2), and the dimension to sum over."""
    if isinstance(dim, Tensor):
        raise ValueError("dim is the number of a dimension, but a tensor was given; to bundle a and b write [a, b]")
    if isinstance(xs, list | tuple):
        if not xs or not all(isinstance(x, Tensor) for x in xs):
            raise ValueError("a list of hypervectors to bundle must hold at least one tensor, and nothing else")
        if len({x.dtype for x in xs}) > 1:
            xs = [as_bipolar(x) for x in xs]  # together with accumulators of votes, bits count as votes
        try:
            xs = torch.stack(torch.broadcast_tensors(*xs), -2)
        except RuntimeError:
            shapes = ", ".join(str(tuple(x.shape)) for x in xs)
            raise ShapeError(f"hypervectors in a list must have shapes that broadcast; got {shapes}") from None
    if not isinstance(xs, Tensor):
        raise ValueError(f"xs must be a tensor [..., k, d] or a list of tensors [..., d]; got {type(xs).__name__}")
    return xs, dim if isinstance(dim, int) else whole_number(dim, "dim is the number of a dimension")


def check_weights(weights: Tensor, votes: Tensor, count: int) -> None:
    """Raise an error unless there is one weight of a suitable type per summand."""
    if weights.dim() == 0 or weights.shape[-1] != count:
        raise ShapeError(f"weights must hold one number for each of {count} summands; got shape {tuple(weights.shape)}")
    real = weights.is_floating_point() or weights.dtype == torch.bool or weights.dtype in INTEGERS
    if not real and not (weights.is_complex() and votes.is_complex()):
        raise ValueError(f"weights must be real or signed integers for {votes.dtype} summands; got {weights.dtype}")


def weighted(votes: Shaped[Tensor, "..."], dim: int, weights: Tensor) -> Shaped[Tensor, "..."]:
    """The weighted sum over `dim` of floats or complex numbers, or of integers with float weights."""
    if is_integer(votes):
        # Half precision has too few digits for sums.
        votes = votes.to(torch.promote_types(weights.dtype, torch.float32))
    weights = weights.to(votes.dtype)
    if readable(weights) and not weights.isfinite().all():
        raise ValueError(f"weights must be finite in the summands' type, {votes.dtype}; NaN or infinity found")
    return (votes.movedim(dim, -2) * weights[..., None]).sum(-2)


def integer_sum(votes: Shaped[Tensor, "..."], dim: int, weights: Tensor | None) -> Shaped[Tensor, "..."]:
    """The exact sum over `dim` in int32. Raises `ValueError` if it does not fit, where values are readable.

    The types and the number of summands mostly prove that it fits; only otherwise are values read.
    """
    wide = torch.int32
    scale = 1 if weights is None else type_bound(weights.dtype)
    bound = votes.shape[dim] * type_bound(votes.dtype)
    if bound * scale > INT32_MAX and readable(votes, *_given(weights)):
        scale = 1 if weights is None else largest(weights)
        if bound * scale > INT32_MAX and (bound := votes.shape[dim] * largest(votes)) * scale > INT32_MAX:
            fits(bound * scale, "the sum")
            wide = torch.int64
    if weights is None:
        total = votes.sum(dim, dtype=wide)
    else:
        total = (votes.to(wide).movedim(dim, -2) * weights.to(wide)[..., None]).sum(-2, dtype=wide)
    return total if wide == torch.int32 else narrowed(total, torch.int32, "the sum")


def _given(weights: Tensor | None) -> Sequence[Tensor]:
    return () if weights is None else (weights,)


def multiplied(a: Shaped[Tensor, "*#batch d"], b: Shaped[Tensor, "*#batch d"]) -> Shaped[Tensor, "*#batch d"]:
    """`a * b`. Raises `ValueError` if a product of two integer accumulators does not fit, where values are readable.

    Hypervectors in int8 need no check: a product with -1, 0 or +1 always fits.
    """
    narrow = a.dtype.itemsize == 1 or b.dtype.itemsize == 1
    if narrow or not (is_integer(a) and is_integer(b) and readable(a, b)):
        return a * b
    dtype = torch.promote_types(a.dtype, b.dtype)
    bound = largest(a) * largest(b)
    if bound <= torch.iinfo(dtype).max:
        return a * b
    fits(bound, "the product")
    return narrowed(a.to(torch.int64) * b, dtype, "the product")
