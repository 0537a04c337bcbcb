"""Modern, continuous Hopfield networks."""

import torch
from jaxtyping import Shaped
from torch import Tensor

from torchvsa._checks import positive_integer
from torchvsa._numerics import in_range, inner_products, safe_divide
from torchvsa.memory.attractor import Attractor


class Hopfield(Attractor):
    """Replace a query by the mean of the items, weighted by the softmax of their similarity: attention.

        state = softmax(beta · state Xᵀ) X

    Items and queries are scaled to length 1 first, so that `beta` multiplies a cosine whatever d is. For a large `beta`
    the state is the most similar item, as in `CleanUp`; for a small one a mixture of items. It is differentiable, and
    works for every architecture with real, complex or integer elements; bits count as -1 / +1.

    Args:
        items: `[K, d]`.
        beta: The inverse temperature; by default √d, the inverse of the standard deviation of a cosine by chance.
        steps: How often the state is replaced; one is enough where items are well apart.

    Raises:
        ValueError: `beta` is not positive, or `steps` is not a positive integer.

    Source: Ramsauer et al. 2020, "Hopfield networks is all you need", equation 3.
    """

    def __init__(self, items: Shaped[Tensor, "k d"], beta: float | None = None, steps: int = 1) -> None:
        super().__init__(items)
        self.beta = float(items.shape[-1] ** 0.5 if beta is None else beta)
        self.steps = positive_integer("steps", steps)
        if not self.beta > 0:
            raise ValueError(f"beta is positive; got {beta!r}")

    def _completed(self, rows: Shaped[Tensor, "batch d"]) -> Shaped[Tensor, "batch d"]:
        items, state = _unit(self.items), _unit(rows)
        wide = torch.promote_types(items.dtype, state.dtype)
        items, state = items.to(wide), state.to(wide)
        for _ in range(self.steps):
            state = torch.softmax(self.beta * inner_products(state, items), -1).to(wide) @ items
        return state


def _unit(x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
    """Vectors of length 1; zero stays zero."""
    rows, lengths, _ = in_range(x)
    rows = rows if rows.is_floating_point() or rows.is_complex() else rows.to(torch.float32)
    return safe_divide(rows, lengths[..., None].to(rows.real.dtype))
