"""Resonator networks: factor a bound hypervector into one item of each codebook."""

import math
from collections.abc import Sequence
from functools import reduce
from typing import TYPE_CHECKING, NamedTuple

import torch
from jaxtyping import Bool, Float, Int64, Shaped
from torch import Tensor, nn

from torchvsa._blocks import by_blocks
from torchvsa._checks import positive_integer, readable
from torchvsa._memory_limit import require_memory
from torchvsa._numerics import cosines
from torchvsa.errors import ShapeError
from torchvsa.memory._exact import Phases, Signs
from torchvsa.memory._noise import row_seeds

if TYPE_CHECKING:
    from torchvsa.architectures.base import VSA

_BLOCK_BYTES = 2**25
"""Memory for the states of one block of rows; blocks of 1 MiB took twice as long, larger ones gained nothing."""


class Factors(NamedTuple):
    """The answer of a `Resonator`, one entry per bound hypervector."""

    indices: Int64[Tensor, "*batch f"]
    """The item of each codebook."""
    similarity: Float[Tensor, "*batch"]
    """The cosine of the bound hypervector with the product of these items: 1 for exact factors."""
    converged: Bool[Tensor, "*batch"]
    """Whether the row came to rest, or its items were accepted; False for a cycle, and at the limit of steps."""
    steps: Int64[Tensor, "*batch"]
    """The number of steps that the row took."""


class Resonator(nn.Module):
    """Find the items, one from each codebook, whose product is a given hypervector.

        resonator = Resonator(vsa, [colours, shapes, places])      # [K1, d], [K2, d], [K3, d]
        resonator(vsa.bind(vsa.bind(colours[3], shapes[0]), places[7])).indices      # tensor([3, 0, 7])

    Each factor has a state, at first the normalised sum of its codebook. In each step, factor after factor is unbound
    from the states of the others, compared with its items, and replaced by the normalised sum of the items weighted by
    these similarities: all products are searched at once, without a list of them. A row ends when its states repeat.

    The search succeeds almost always up to a number of products that grows about with d², and rarely above: the study
    `resonator` measures it. A sum of products, whose cosine with each is below 1, is searched for one of them.

    With `noise`, similarities are disturbed in each step, so that cycles end; with `threshold`, only large ones count.
    Together, `noise=0.5, threshold=1.5`, they find factors in several times larger sets of products. Noise is drawn
    per row, from a seed that `generator` gives to each row in order.

    Works for architectures whose binding is element-wise with elements of -1 / +1, bits, or complex numbers of
    magnitude 1 (MAP, BSC, FHRR). All sums are of whole numbers (magnitudes other than these are rounded to 2^15 steps),
    so that a row has the same bits in any batch.

    Args:
        vsa: The architecture.
        codebooks: Two or more codebooks `[K, d]`, each with its own K.
        steps: The largest number of steps per row.
        noise: The standard deviation of the noise, in that of the similarity of unrelated hypervectors.
        threshold: The smallest similarity that counts, in the same unit; if none of a factor reaches it, all count.
        accept: The cosine of a row without the other factors with an item, for all factors, at which the row ends.

    Raises:
        ValueError: For an architecture that does not suit, codebooks of other values, and options out of range.

    Source: Frady, Kent, Olshausen and Sommer 2020, "Resonator networks, 1", and Kent et al. 2020, "Resonator networks,
    2", equations for outer product weights; noise and threshold: Langenegger et al. 2023, "In-memory factorization of
    holographic perceptual representations".
    """

    def __init__(
        self,
        vsa: "VSA",
        codebooks: Sequence[Shaped[Tensor, "_ d"]],
        steps: int = 1000,
        noise: float = 0.0,
        threshold: float | None = None,
        accept: float = 0.6,
    ) -> None:
        super().__init__()
        if not self.supports(vsa):
            raise ValueError(
                f"a resonator needs element-wise binding of -1 / +1, bits or phases, as in MAP, BSC and FHRR; got {vsa}"
            )
        if len(codebooks) < 2:
            raise ValueError(f"a resonator needs at least two codebooks; got {len(codebooks)}")
        for number, book in enumerate(codebooks):
            if book.dim() != 2 or len(book) == 0:
                raise ShapeError(f"codebook {number} must be [K, d] with K at least 1; got shape {tuple(book.shape)}")
            vsa.check_codes(book, f"codebook {number}")
        self.vsa = vsa
        self.steps = positive_integer("steps", steps)
        for name, value in (("noise", noise), ("threshold", threshold), ("accept", accept)):
            if value is not None and not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{name} is a number of 0 or more; got {value!r}")
        self.noise, self.threshold, self.accept = float(noise), threshold, float(accept)
        self.factors = len(codebooks)
        for number, book in enumerate(codebooks):
            self.register_buffer(f"codebook_{number}", book)

    @staticmethod
    def supports(vsa: "VSA") -> bool:
        """Whether the architecture suits; see the class."""
        return vsa.elementwise and vsa.commutative and (vsa.self_inverse or vsa.dtype.is_complex)

    @property
    def codebooks(self) -> list[Tensor]:
        """The codebooks, in order."""
        return [getattr(self, f"codebook_{number}") for number in range(self.factors)]

    @torch.no_grad()
    def forward(self, bound: Shaped[Tensor, "*batch d"], generator: torch.Generator | None = None) -> Factors:
        """Factor each hypervector `[..., d]`; also raw sums and trained programs, with elements of any size.

        Raises:
            ShapeError: `bound` does not end in d elements.
            ValueError: An element is not finite, or there is noise and no `generator`.
        """
        self.vsa.check(bound, "bound")
        if self.noise and generator is None:
            raise ValueError("a resonator with noise needs a generator, which decides it")
        rows = bound.reshape(-1, bound.shape[-1])
        if readable(rows) and not rows.isfinite().all():
            wrong = (~rows.isfinite()).any(-1).nonzero()[0].item()
            raise ValueError(f"bound must be finite; row {wrong} holds NaN or infinity")
        row_bytes = 8 * (2 if rows.is_complex() else 1) * self.vsa.dim * (2 * self.factors + 4)
        items = sum(map(len, self.codebooks))
        require_memory(
            items * self.vsa.dim * (16 if rows.is_complex() else 8) + row_bytes,
            f"a resonator of {items:,} items at d = {self.vsa.dim:,}",
            "take smaller codebooks or fewer dimensions",
        )
        if generator is None:
            seeds = torch.zeros(len(rows), dtype=torch.int64, device=rows.device)
        else:
            seeds = row_seeds(len(rows), generator).to(rows.device)
        found = by_blocks(self._factor, rows, seeds, row_bytes=row_bytes, block_bytes=_BLOCK_BYTES)
        batch = bound.shape[:-1]
        return Factors(found.indices.reshape(*batch, self.factors), *(each.reshape(batch) for each in found[1:]))

    def _factor(self, rows: Shaped[Tensor, "batch d"], seeds: Int64[Tensor, "batch"]) -> Factors:
        kind = Phases if self.vsa.dtype.is_complex else Signs
        exact = kind(rows, max(map(len, self.codebooks)), self.noise)
        books = [exact.codes(book) for book in self.codebooks]
        states = [exact.state(book.sum(0)).expand(len(rows), -1) for book in books]
        bound, chance = exact.bound, exact.chance
        live = torch.arange(len(rows), device=rows.device)
        indices = torch.zeros(len(rows), self.factors, dtype=torch.int64, device=rows.device)
        converged, taken = torch.zeros_like(live, dtype=torch.bool), torch.zeros_like(live)
        before: list[Tensor] = []
        marked: list[Tensor] = []
        for step in range(1, self.steps + 1):
            if not len(live):
                break
            seen: list[Tensor] = []
            for place, book in enumerate(books):
                others = [state for other, state in enumerate(states) if other != place]
                seen.append(exact.similarities(reduce(exact.unbind, others, bound), book))
                active = seen[-1]
                if self.noise:
                    active = exact.noisy(active, self.noise * chance, seeds, step * self.factors + place)
                if self.threshold is not None:
                    strong = exact.strength(active) >= self.threshold * chance[:, None]
                    active = torch.where(strong | ~strong.any(-1, keepdim=True), active, 0)
                states[place] = exact.state(active @ book)
            tops = [similarities.abs().max(-1) for similarities in seen]
            least = torch.stack([top.values.to(torch.float64) for top in tops]).amin(0)
            rest = (least >= self.accept * self.vsa.dim**0.5 * chance) & (least > 0)
            ended = rest
            if not self.noise:
                # States follow from similarities, which are fewer numbers to compare. Those of steps 1, 2, 4, 8, ...
                # are marked, so that a cycle is found within three times its length (Brent 1980).
                rest = rest | _equal(seen, before)
                ended = rest | _equal(seen, marked)
            if step == self.steps:
                ended = torch.ones_like(ended)
            before, marked = seen, seen if step & (step - 1) == 0 else marked
            if ended.any():
                at = live[ended]
                indices[at] = torch.stack([top.indices for top in tops], -1)[ended]
                converged[at], taken[at] = rest[ended], step
                live, bound, chance, seeds = (x[~ended] for x in (live, bound, chance, seeds))
                states, before, marked = ([x[~ended] for x in xs] for xs in (states, before, marked))
        items = [book[index] for book, index in zip(self.codebooks, indices.unbind(-1), strict=True)]
        similarity = cosines(rows, reduce(self.vsa.bind, items)).to(torch.float32)
        return Factors(indices, similarity, converged, taken)


def _equal(these: list[Tensor], those: list[Tensor]) -> Bool[Tensor, "batch"]:
    """Whether all similarities of a row are the same; False where there are none to compare with."""
    if not those:
        return torch.zeros(len(these[0]), dtype=torch.bool, device=these[0].device)
    return torch.stack([(one == other).all(-1) for one, other in zip(these, those, strict=True)]).all(0)
