"""Check what callers give: whole numbers, types, and values where looking at them is cheap."""

import operator
from typing import Any, cast

import torch
from torch import Tensor

INTEGERS = (torch.int8, torch.uint8, torch.int16, torch.int32, torch.int64)
"""The types that shifts, indices and integer weights may have; PyTorch computes little with the other unsigned ones."""
INT32_MAX = 2**31 - 1
_INT64_MAX = 2**63 - 1


def whole_number(value: Any, what: str) -> int:
    """`value` as a plain int (NumPy integers too); raises `ValueError` for anything else, truth values included."""
    try:
        if isinstance(value, bool):
            raise TypeError
        return operator.index(value)
    except TypeError:
        raise ValueError(f"{what}; got {value!r}") from None


_C = cast(Any, torch._C)


def mapped(*tensors: Tensor) -> bool:
    """Whether one of the tensors is one that `vmap` or another transform looks through."""
    return not torch.compiler.is_compiling() and any(map(_C._functorch.is_functorch_wrapped_tensor, tensors))


def _mapped_or_traced(x: Tensor) -> bool:
    """Whether a graph is being made, or the tensor is one that `vmap` or another transform looks through."""
    return torch.compiler.is_compiling() or _C._get_tracing_state() is not None or mapped(x)


def readable(*tensors: Tensor) -> bool:
    """Whether the values can be looked at now: on a CPU, outside of compiled and exported graphs and of `vmap`.

    On another device that would wait for all of its work, and in a graph or in `vmap` there are no values yet.
    """
    return all(x.device.type == "cpu" and not _mapped_or_traced(x) for x in tensors)


def assertable(x: Tensor) -> bool:
    """Whether another device than the CPU can check the values by itself, without being waited for."""
    return x.device.type != "cpu" and not _mapped_or_traced(x)


def largest(x: Tensor) -> int:
    """The largest absolute value of an integer tensor, exactly; 0 for an empty one."""
    if x.numel() == 0:
        return 0
    low, high = torch.aminmax(x)
    return max(-int(low), int(high))


def type_bound(dtype: torch.dtype) -> int:
    """The largest absolute value that an integer type holds."""
    return 1 if dtype == torch.bool else -min(torch.iinfo(dtype).min, -torch.iinfo(dtype).max)


def fits(bound: int, what: str) -> None:
    """Raise `ValueError` if intermediate results up to `bound` cannot be computed in int64."""
    if bound > _INT64_MAX:
        raise ValueError(f"{what} can reach {bound:,}, beyond int64 (2^63 - 1), in which it is computed; use floats")


def narrowed(x: Tensor, dtype: torch.dtype, what: str) -> Tensor:
    """`x` in a smaller integer type; raises `ValueError` if it does not fit, where values can be looked at."""
    limit = torch.iinfo(dtype).max
    if readable(x) and (reached := largest(x)) > limit:
        name = str(dtype).removeprefix("torch.")
        raise ValueError(f"{what} reaches {reached:,}, beyond the limit of {name}, {limit:,}; use smaller numbers")
    return x.to(dtype)


def refuse_nan(x: Tensor, what: str) -> None:
    """Raise `ValueError` if `x` holds NaN, where values can be looked at."""
    if readable(x) and x.isnan().any():
        raise ValueError(f"{what} holds NaN, which has no sign")
