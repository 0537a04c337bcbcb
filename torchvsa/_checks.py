"""Check arguments: whole numbers, types, and values where reading them is cheap."""

import operator
from collections.abc import Callable
from typing import Any, cast

import torch
from torch import Tensor

INTEGERS = (torch.int8, torch.uint8, torch.int16, torch.int32, torch.int64)
"""The types of shifts, indices and integer weights. PyTorch computes little with the other unsigned types."""
INT32_MAX = 2**31 - 1
_INT64_MAX = 2**63 - 1


def whole_number(value: Any, what: str) -> int:
    """An int or a NumPy integer as an int. Raises `ValueError` that begins with `what` for anything else."""
    try:
        if isinstance(value, bool):
            raise TypeError
        return operator.index(value)
    except TypeError:
        raise ValueError(f"{what}; got {value!r}") from None


def positive_integer(name: str, value: Any) -> int:
    """`value` as an int. Raises `ValueError` that names the option unless it is a whole number above 0."""
    what = f"{name} is a positive integer"
    if (number := whole_number(value, what)) < 1:
        raise ValueError(f"{what}; got {value!r}")
    return number


_SEARCHED = 2**20
"""How far `nearest` searches in each direction; about a second."""


def nearest(allows: Callable[[int], bool], number: int) -> str:
    """Text that names the nearest positive numbers below and above `number` for which `allows` holds."""
    below, above = range(number - 1, 0, -1)[:_SEARCHED], range(number + 1, number + 1 + _SEARCHED)
    found = [next(filter(allows, side), None) for side in (below, above)]
    names = [str(other) for other in found if other is not None]
    return f"the nearest allowed: {' and '.join(names)}" if names else f"none within {_SEARCHED:,} of it is allowed"


_C = cast(Any, torch._C)


def mapped(*tensors: Tensor) -> bool:
    """Whether one of the tensors is wrapped by `vmap` or another transform of `torch.func`."""
    return not torch.compiler.is_compiling() and any(map(_C._functorch.is_functorch_wrapped_tensor, tensors))


def _mapped_or_traced(x: Tensor) -> bool:
    """Whether a graph is being compiled or traced, or the tensor is wrapped by a transform of `torch.func`."""
    return torch.compiler.is_compiling() or _C._get_tracing_state() is not None or mapped(x)


def readable(*tensors: Tensor) -> bool:
    """Whether values can be read without cost: on a CPU, outside of compiled and exported graphs and of `vmap`.

    Another device would have to finish its work first, and a graph or `vmap` has no values yet.
    """
    return all(x.device.type == "cpu" and not _mapped_or_traced(x) for x in tensors)


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
    """Raise `ValueError` if intermediate results up to `bound` do not fit int64."""
    if bound > _INT64_MAX:
        raise ValueError(f"{what} can reach {bound:,}, beyond int64 (2^63 - 1), in which it is computed; use floats")


def narrowed(x: Tensor, dtype: torch.dtype, what: str) -> Tensor:
    """`x` in a smaller integer type. Raises `ValueError` if a value does not fit, where values are readable."""
    limit = torch.iinfo(dtype).max
    if readable(x) and (reached := largest(x)) > limit:
        name = str(dtype).removeprefix("torch.")
        raise ValueError(f"{what} reaches {reached:,}, beyond the limit of {name}, {limit:,}; use smaller numbers")
    return x.to(dtype)


def refuse_nan(x: Tensor, what: str) -> None:
    """Raise `ValueError` if `x` holds NaN, where values are readable."""
    if readable(x) and x.isnan().any():
        raise ValueError(f"{what} holds NaN, which has no sign")
