"""A GPU, under the names that `pretended` has. It belongs in a process of its own, since it notes every warning."""

import warnings
from copy import deepcopy
from typing import Any

import torch
from torch import Tensor, nn
from torch.utils._python_dispatch import TorchDispatchMode

NAME = "cuda"
TOLERANCE, TRAINED = 1e-4, 1e-2
"""How far floats may be from those of the CPU: sums that nearly cancel are scaled up again, and their rounding with
them. Adam divides a gradient by its own size, so that one of 0 but for rounding still moves a program that is
trained."""
aten = torch.ops.aten
waited: list[str] = []
"""Operations that had to wait until values on the device were known, in order."""


class Watched(TorchDispatchMode):
    """While it is on, PyTorch says when it waits for the GPU. Copying a tensor of the CPU to it does not count."""

    def __enter__(self) -> Any:
        warnings.simplefilter("always")
        warnings.showwarning = _note
        torch.cuda.set_sync_debug_mode("warn")
        return super().__enter__()

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        sources = {aten._to_copy.default: 0, aten.copy_.default: 1}
        copied = args[sources[func]] if func in sources else None
        free = isinstance(copied, Tensor) and not copied.is_cuda
        torch.cuda.set_sync_debug_mode("default" if free else "warn")
        try:
            return func(*args, **(kwargs or {}))
        finally:
            torch.cuda.set_sync_debug_mode("warn")


def on() -> Watched:
    """What makes its waiting known."""
    return Watched()


def _note(message: Any, category: Any, filename: str, lineno: int, *_: Any) -> None:
    if "synchronizing CUDA operation" in str(message):
        waited.append(f"{filename}:{lineno}")


def moved(x: Tensor | nn.Module) -> Any:
    """A copy of a tensor or a module on the device."""
    return deepcopy(x).to(NAME)


def brought_back(x: Any) -> Any:
    """The tensors of an answer, on the CPU; raises if one of them is there already."""
    if isinstance(x, tuple):
        return tuple(brought_back(part) for part in x if part is not None)
    if not x.is_cuda:
        raise AssertionError("an answer came back on the CPU")
    return x.cpu()
