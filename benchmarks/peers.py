"""The peer's own tensors. Its stubs take slices and results for plain tensors, so no type is stated for them."""

from typing import Any

import torch
import torchhd
from torch import Tensor


def hypervectors(x: Tensor) -> Any:
    """Codes as the peer's, in floats."""
    return x.to(torch.float32).as_subclass(torchhd.MAPTensor)


def plain(x: Any) -> Tensor:
    """The peer's tensor as a plain one."""
    return x.as_subclass(Tensor)
