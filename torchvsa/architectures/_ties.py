"""Who decides when the voters of a majority are split evenly."""

import torch
from jaxtyping import Shaped
from torch import Tensor


def first_two(
    xs: Shaped[Tensor, "..."], dim: int, weights: Shaped[Tensor, "..."] | None
) -> tuple[Shaped[Tensor, "..."], Shaped[Tensor, "..."]] | None:
    """The first two voters along `dim` that have a say (a weight other than 0), or None for fewer than two.

    They make the voter that breaks ties, so that it depends on the vectors themselves: with one fixed tie
    vector, unrelated bundles of an even number of voters would resemble each other (cosine .25).
    """
    xs = xs.movedim(dim, -2)
    if xs.shape[-2] < 2:
        return None
    if weights is None:
        return xs[..., 0, :], xs[..., 1, :]
    # Distinct keys need no stable sort, which interchange formats lack.
    keys = (weights == 0) * xs.shape[-2] + torch.arange(xs.shape[-2], device=xs.device)
    order = (
        keys.expand(xs.shape[:-1]).topk(2, -1, largest=False).indices[..., None].expand(*xs.shape[:-2], 2, xs.shape[-1])
    )
    pair = xs.gather(-2, order)
    return pair[..., 0, :], pair[..., 1, :]
