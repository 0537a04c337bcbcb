"""Random bits for bipolar and binary hypervectors."""

import torch
from jaxtyping import UInt8
from torch import Tensor


def random_bits(
    *shape: int, generator: torch.Generator | None, device: torch.device | str | None
) -> UInt8[Tensor, "*shape"]:
    """Independent bits 0 / 1 of equal probability.

    Unpacks random bytes, which takes an eighth of the draws. Each row of the last dimension starts at a byte, so that
    drawing n rows at once or one by one gives the same bits.
    """
    source = generator.device if generator is not None else device
    *rows, count = shape
    words = torch.randint(256, (*rows, -(-count // 8)), dtype=torch.uint8, generator=generator, device=source)
    bits = (words[..., None] >> torch.arange(8, dtype=torch.uint8, device=source)) & 1
    return bits.flatten(-2)[..., :count].to(device if device is not None else source)
