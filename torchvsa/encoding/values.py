"""Codes for the values of one sensor or actuator: an index 0 .. levels-1 becomes a hypervector."""

from collections.abc import Callable

import torch
from jaxtyping import Shaped
from torch import Tensor

from torchvsa._memory_limit import require_memory
from torchvsa.architectures import VSA

_FEWER = "take fewer levels or dimensions"


def lookup(vsa: VSA, levels: int, generator: torch.Generator | None = None) -> Shaped[Tensor, "levels d"]:
    """A lookup table of independent random hypervectors: similarity 1 within a level, else about 0.

    Source: Neubert et al. 2016, section II.
    """
    return vsa.random(levels, generator=generator)


def level(
    vsa: VSA, levels: int, generator: torch.Generator | None = None, span: int | None = None
) -> Shaped[Tensor, "levels d"]:
    """Level codes: similarity falls linearly with the distance, 1 - |i - j| / span, and is about 0 from `span` on.

    Every `span` levels stands an independent random hypervector; between two of them, elements change
    over one by one, always in the same random order (with an order for each stretch, codes `span` apart would
    still share up to a quarter of their elements). By default the span is the whole range, which makes the two
    ends independent. `span=1` is the lookup table.

    Source: Rachkovskij et al. 2005; Kleyko et al. 2018 for the linear kernel.
    """
    span = max(levels - 1, 1) if span is None else span
    if span < 1:
        raise ValueError(f"span counts the levels over which similarity falls to 0, at least 1; got {span}")
    segments = -(-(levels - 1) // span) if levels > 1 else 0
    # Codes are made one by one, then stacked.
    require_memory(
        (2 * levels + segments + 1) * vsa.row_bytes + 9 * vsa.dim,
        f"level codes of {levels} levels and d = {vsa.dim}",
        _FEWER,
    )
    anchors = vsa.random(segments + 1, generator=generator)
    order = torch.randperm(vsa.dim, generator=generator)
    codes = []
    for index in range(levels):
        segment, step = divmod(index, span)
        if step == 0:
            codes.append(anchors[segment])
        else:
            # Integer comparison: exactly d · step / span, rounded up, elements have changed over.
            changed = order * span < vsa.dim * step
            codes.append(torch.where(changed.to(anchors.device), anchors[segment + 1], anchors[segment]))
    return torch.stack(codes)


def balanced(vsa: VSA, levels: int, generator: torch.Generator | None = None) -> Shaped[Tensor, "levels d"]:
    """Codes as far apart as they can be: in each dimension half of them, a random half, is negated.

    An even number of codes has the cosine -1 / (levels - 1) between any two, an odd one -1 / levels. Two are each
    other's negative; of two random codes half of the elements agree, and cannot tell them apart.

    Source: a simplex of code words, as in error-correcting output codes (Dietterich and Bakiri 1995).
    """
    # Random numbers are sorted, along a dimension that is copied for it, in float32 and int64.
    require_memory(
        levels * (28 * vsa.dim + 2 * vsa.row_bytes), f"balanced codes of {levels} levels and d = {vsa.dim}", _FEWER
    )
    start = vsa.random(generator=generator)
    ranks = torch.rand(levels, vsa.dim, generator=generator).argsort(0)
    negated = (2 * ranks < levels).to(start.device)
    return torch.where(negated, ~start if start.dtype == torch.bool else -start, start)


VALUES: dict[str, Callable[..., Tensor]] = {"lookup": lookup, "level": level, "balanced": balanced}
