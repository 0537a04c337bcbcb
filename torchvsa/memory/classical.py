"""The classical recurrent associative network."""

from typing import Literal, NamedTuple

import torch
from jaxtyping import Bool, Float, Float64, Int64, Shaped
from torch import Tensor

from torchvsa._checks import positive_integer
from torchvsa.memory.attractor import BipolarAttractor, signs


class Completion(NamedTuple):
    """What a recurrent network makes of queries, one entry per query."""

    state: Float[Tensor, "batch d"]
    """The last state, of -1 / +1."""
    settled: Bool[Tensor, "batch"]
    """Whether it came to rest; False for a cycle of two states, and at the limit of steps."""
    steps: Int64[Tensor, "batch"]
    """The number of steps, each of all d elements, until the state no longer changed."""


class ClassicalHopfield(BipolarAttractor):
    """A network of d neurons whose weights are the sum of the outer products of the items, without the diagonal.

    The weights W = XᵀX - K are never formed: `W s = Xᵀ (X s) - K s` takes 2 K d operations. A neuron whose input is 0
    keeps its state. Zeros in a query are unknown elements, which the first step decides.

    All neurons at once (`order="synchronous"`) can end in a cycle of two states; one by one (`"asynchronous"`) the
    energy never rises, so that the state comes to rest (Hopfield 1982). One by one costs d small steps in sequence.

    The outer product rule holds about .14 d items; more, or items that resemble each other, disturb each other. The
    projection rule, W = Xᵀ (X Xᵀ)⁻¹ X without its diagonal, keeps up to d linearly independent ones as states of rest;
    with many of them, noisy queries no longer lead there (see the study `memories`).

    Args:
        items: `[K, d]` of -1 / +1, or bits.
        rule: `"outer"` or `"projection"`.
        order: `"synchronous"`, or `"asynchronous"` in an order that `seed` decides, anew in each step.
        steps: The largest number of steps.
        seed: Decides the order.

    Raises:
        ValueError: For other items, unknown options, and linearly dependent items with the projection rule.

    Source: Hopfield 1982, "Neural networks and physical systems with emergent collective computational abilities";
    Personnaz, Guyon and Dreyfus 1986 for the projection rule.
    """

    def __init__(
        self,
        items: Shaped[Tensor, "k d"],
        rule: Literal["outer", "projection"] = "outer",
        order: Literal["synchronous", "asynchronous"] = "synchronous",
        steps: int = 50,
        seed: int = 0,
    ) -> None:
        super().__init__(items)
        if rule not in ("outer", "projection") or order not in ("synchronous", "asynchronous"):
            raise ValueError(
                "rule is 'outer' or 'projection', and order 'synchronous' or 'asynchronous'; "
                f"got {rule!r} and {order!r}"
            )
        self.rule, self.order, self.seed = rule, order, seed
        self.steps = positive_integer("steps", steps)
        if rule == "projection":
            self._weights()

    def _weights(self) -> tuple[Float64[Tensor, "k d"], Float64[Tensor, "k d"], Float64[Tensor, "d"]]:
        """X, the matrix Y of `W = Xᵀ Y` before the diagonal is taken away, and the diagonal."""
        x = self._bipolar().to(torch.float64)
        if self.rule == "outer":
            return x, x, torch.full_like(x[0], len(x))
        factor, failed = torch.linalg.cholesky_ex(x @ x.T)
        if failed or factor.diagonal().min() < 1e-6:
            raise ValueError("the projection rule needs linearly independent items; some are sums of others")
        y = torch.cholesky_solve(x, factor)
        return x, y, (x * y).sum(0)

    def energy(self, states: Shaped[Tensor, "batch d"]) -> Float64[Tensor, "batch"]:
        """The energy `-½ sᵀ W s` of states of -1 / +1."""
        x, y, diagonal = self._weights()
        states = states.to(torch.float64)
        return -((states @ x.T) * (states @ y.T)).sum(-1) / 2 + (states**2 @ diagonal) / 2

    def complete(self, queries: Shaped[Tensor, "batch d"]) -> Completion:
        """The state that each query ends in, and whether it came to rest."""
        x, y, diagonal = self._weights()
        state = signs(queries).to(torch.float64)
        settled = torch.zeros(len(state), dtype=torch.bool, device=state.device)
        steps = torch.full((len(state),), self.steps, device=state.device)
        generator = torch.Generator().manual_seed(self.seed)
        for step in range(self.steps):
            before = state
            if self.order == "synchronous":
                state = _decided(state @ y.T @ x - state * diagonal, state)
            else:
                state, overlaps = state.clone(), state @ y.T
                for neuron in torch.randperm(x.shape[1], generator=generator).tolist():
                    old = state[:, neuron]
                    new = _decided(overlaps @ x[:, neuron] - diagonal[neuron] * old, old)
                    overlaps = overlaps + (new - old)[:, None] * y[:, neuron]
                    state[:, neuron] = new
            rest = (state == before).all(-1) & ~settled
            steps[rest] = step
            settled |= rest
            if settled.all():
                break
        return Completion(state.to(torch.float32), settled, steps)

    def _completed(self, rows: Shaped[Tensor, "batch d"]) -> Shaped[Tensor, "batch d"]:
        return self.complete(rows).state


def _decided(total: Float64[Tensor, "*batch"], state: Float64[Tensor, "*batch"]) -> Float64[Tensor, "*batch"]:
    """The signs of the inputs; where an input is 0, the state before.

    With the outer product rule inputs are whole numbers, and exact. With the projection rule they are rounded, so that
    sums in another order do not decide a tie.
    """
    total = (total * 2.0**20).round()
    return torch.where(total == 0, state, total.sign())
