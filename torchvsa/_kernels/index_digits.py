"""Sums of indices by products of int8, which are exact on every device.

The plain line is `(marks * torch.arange(d)).sum(-1)` in int64, which writes 8 bytes per element. Indices are taken
apart into digits in base 128 instead, which fit int8.
"""

import torch
from jaxtyping import Int8, Int64
from torch import Tensor


def digit_count(dim: int) -> int:
    """The number of digits of the largest index in base 128."""
    count = 1
    while 128**count < dim:
        count += 1
    return count


def index_digits(dim: int, device: torch.device) -> tuple[Int8[Tensor, "digits d"], Int64[Tensor, "digits"]]:
    """The digits of all indices, and what each digit counts."""
    values = 128 ** torch.arange(digit_count(dim), device=device)
    return (torch.arange(dim, device=device) // values[:, None] % 128).to(torch.int8), values
