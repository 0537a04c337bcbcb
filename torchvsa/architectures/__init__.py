"""The architectures, by name."""

from collections.abc import Callable
from functools import partial

import torch

from torchvsa.architectures.base import VSA
from torchvsa.architectures.bsc import BSC
from torchvsa.architectures.bsdc import BSDC
from torchvsa.architectures.bsdc_seg import BSDCSEG
from torchvsa.architectures.fhrr import FHRR
from torchvsa.architectures.hrr import HRR
from torchvsa.architectures.map import MAP
from torchvsa.architectures.mbat import MBAT
from torchvsa.architectures.mcr import MCR
from torchvsa.architectures.vtb import VTB
from torchvsa.registry import Registry

ARCHITECTURES: Registry[Callable[..., VSA]] = Registry(
    "architecture",
    {
        "MAP-C": partial(MAP, variant="C"),
        "MAP-B": partial(MAP, variant="B"),
        "MAP-I": partial(MAP, variant="I"),
        "HRR": HRR,
        "FHRR": FHRR,
        "BSC": BSC,
        "BSDC-S": BSDC,
        "BSDC-SEG": BSDCSEG,
        "MBAT": MBAT,
        "MCR": MCR,
        "VTB": VTB,
    },
)


def architecture(name: str, dim: int, dtype: str | torch.dtype | None = None, **options: str) -> VSA:
    """Make an architecture by its name in `ARCHITECTURES`. Its own default applies without a `dtype`."""
    make = ARCHITECTURES.find(name)
    if isinstance(dtype, str):
        found = getattr(torch, dtype, None)
        if not isinstance(found, torch.dtype):
            raise ValueError(f"there is no element type {dtype!r}; write e.g. 'float32' or 'int8'")
        dtype = found
    for option, fixed in (make.keywords if isinstance(make, partial) else {}).items():
        if options.get(option, fixed) != fixed:
            raise ValueError(f"{name} has the {option} {fixed!r}; got {option}={options[option]!r}")
    return make(dim=dim, **({} if dtype is None else {"dtype": dtype}), **options)


def architecture_near(name: str, dim: int, dtype: str | torch.dtype | None = None, **options: str) -> VSA:
    """Make an architecture with the number of dimensions nearest to `dim` that it allows; of two the smaller one."""
    ARCHITECTURES.find(name)
    problem = None
    for apart in range(dim):
        for near in (dim - apart, dim + apart):
            try:
                return architecture(name, near, dtype, **options)
            except ValueError as error:
                problem = problem or error
    raise ValueError(f"{name} can be made with no number of dimensions from 1 to {2 * dim - 1}: {problem}")


__all__ = [
    "ARCHITECTURES",
    "BSC",
    "BSDC",
    "BSDCSEG",
    "FHRR",
    "HRR",
    "MAP",
    "MBAT",
    "MCR",
    "VSA",
    "VTB",
    "architecture",
    "architecture_near",
]
