"""Which summands decide the ties of a majority."""

import torch
from jaxtyping import Shaped
from torch import Tensor


def tie_voters(
    xs: Shaped[Tensor, "..."], dim: int, weights: Shaped[Tensor, "..."] | None
) -> tuple[Shaped[Tensor, "..."], Shaped[Tensor, "..."]] | None:
    """The first two summands along `dim` with a weight other than 0; None if there are fewer than two summands.

    The vector that decides ties is computed from them. With a fixed one, unrelated bundles of an even number of
    hypervectors would resemble each other (cosine .25).
    """
    xs = xs.movedim(dim, -2)
    if xs.shape[-2] < 2:
        return None
    if weights is None:
        return xs[..., 0, :], xs[..., 1, :]
    # Distinct sort keys need no stable sort, which ONNX lacks.
    keys = (weights == 0) * xs.shape[-2] + torch.arange(xs.shape[-2], device=xs.device)
    order = (
        keys.expand(xs.shape[:-1]).topk(2, -1, largest=False).indices[..., None].expand(*xs.shape[:-2], 2, xs.shape[-1])
    )
    pair = xs.gather(-2, order)
    return pair[..., 0, :], pair[..., 1, :]
