"""Read items out of programs: unbind a condition, then compare the result with the items."""

from typing import TYPE_CHECKING

import torch
from jaxtyping import Float64, Shaped
from torch import Tensor, nn

from torchvsa._blocks import by_blocks
from torchvsa._numerics import as_bipolar, in_units, inner_products, is_integer, norms
from torchvsa.errors import ShapeError
from torchvsa.memory import Match, best

if TYPE_CHECKING:
    from torchvsa.architectures.base import VSA


class Readout(nn.Module):
    """Scores of items for conditions: `<unbind(program, condition), item> / |item|`.

        readout = vsa.readout(programs, items)
        readout(conditions)              # scores, [B, K] or [B, b, K]
        readout.match(conditions)        # the best item of each: index, similarity, margin

    `programs` is one hypervector `[d]` or a stack `[b, d]`, which may be raw accumulators; `items` are `[K, d]`. If
    `bind` is bilinear, programs are folded into the items, `<unbind(p, c), item> = <fold(p, item), c>`, so that a batch
    of conditions takes one matrix product (see `VSA.fold`). Otherwise conditions are unbound and compared in turn.

    Products of integers are exact, so their scores depend neither on the batch nor on threads. Scores are float64 and
    differentiable with respect to programs and conditions.

    Later changes of `programs` and `items` do not affect a readout. `of` makes one for other programs and the same
    items.

    Source: Neubert et al. 2016, Algorithm 2, lines 2 and 3. Raises `ShapeError` for other shapes.
    """

    programs: Tensor
    items: Tensor
    lengths: Tensor
    units: Tensor | None
    folded: Tensor | None

    def __init__(
        self,
        vsa: "VSA",
        programs: Shaped[Tensor, "*b d"],
        items: Shaped[Tensor, "K d"],
        lengths: Float64[Tensor, "K"] | None = None,
    ) -> None:
        super().__init__()
        vsa.check(programs, "programs")
        vsa.check(items, "items")
        if programs.dim() > 2 or items.dim() != 2 or len(items) == 0:
            raise ShapeError(
                f"a readout takes programs [d] or [b, d] and items [K, d], K at least 1; got shapes "
                f"{tuple(programs.shape)} and {tuple(items.shape)}"
            )
        # Powers of two bring floats into range without rounding. Scores are scaled back; cosines need not be.
        programs, units = in_units(programs)
        if lengths is None:
            items, _ = in_units(items)
            lengths = norms(items)
            lengths = torch.where(lengths == 0, 1.0, lengths)  # products with zero vectors are 0 already
        self.vsa = vsa
        folded = vsa.fold(_wide(programs, items, vsa.elementwise)[..., None, :], items) if vsa.bilinear else None
        buffers = {"programs": programs, "units": units, "items": items, "lengths": lengths, "folded": folded}
        for name, tensor in buffers.items():
            self.register_buffer(name, tensor, persistent=False)

    def of(self, programs: Shaped[Tensor, "*b d"]) -> "Readout":
        """A readout of other programs with the same items; reuses the lengths of the items."""
        return Readout(self.vsa, programs, self.items, self.lengths)

    def forward(self, conditions: Shaped[Tensor, "batch d"]) -> Float64[Tensor, "batch *b K"]:
        """The score of each item for each condition."""
        scores = self._products(conditions).to(torch.float64) / self.lengths
        return scores if self.units is None else scores * self.units.to(torch.float64)

    def match(self, conditions: Shaped[Tensor, "batch d"]) -> Match:
        """The best item for each condition, `[B]` or `[B, b]`, with its cosine and margin (see `CleanUp`)."""
        if self.vsa.bilinear and is_integer(conditions):
            # Products and lengths both take float64; convert once.
            conditions = as_bipolar(conditions).to(torch.float64)
        products = self._products(conditions)
        return best(products.to(torch.float64) / self.lengths, self.noise(conditions))

    def _products(self, conditions: Shaped[Tensor, "batch d"]) -> Shaped[Tensor, "batch *b K"]:
        self.vsa.check(conditions, "conditions")
        folded = self.folded
        if folded is not None and folded.dim() == 2:
            return inner_products(conditions, folded)
        if folded is not None:
            return inner_products(conditions, folded.flatten(0, -2)).unflatten(-1, folded.shape[:-1])
        row_bytes = self.programs.numel() * max(self.programs.element_size(), 4)
        return by_blocks(lambda rows: inner_products(self._unbound(rows), self.items), conditions, row_bytes=row_bytes)

    def noise(self, conditions: Shaped[Tensor, "batch d"]) -> Float64[Tensor, "batch *b"]:
        """The length of each noisy result, `|unbind(program, condition)|`."""
        if self.programs.dim() == 1:
            return self.vsa.unbound_norm(self.programs, conditions)
        return torch.stack([self.vsa.unbound_norm(program, conditions) for program in self.programs], -1)

    def _unbound(self, conditions: Shaped[Tensor, "batch d"]) -> Shaped[Tensor, "batch *b d"]:
        return self.vsa.unbind(self.programs, conditions if self.programs.dim() == 1 else conditions[:, None])


def _wide(programs: Tensor, items: Tensor, elementwise: bool) -> Tensor:
    """Programs in a type that holds their products with the items.

    They can exceed int32 if both are int32 sums, or if an element of a product is a sum of several products.
    """
    sums = is_integer(programs) and is_integer(items) and programs.element_size() == 4
    return programs.to(torch.int64) if sums and (items.element_size() == 4 or not elementwise) else programs
