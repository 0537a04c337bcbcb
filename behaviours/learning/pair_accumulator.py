"""progHV and knownCondHV of Algorithm 1, while pairs are added to them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Int64, Shaped
from numpy.typing import NDArray
from torch import Tensor

from behaviours.learning.samples import Samples
from behaviours.ordered import distinct_rows
from behaviours.progress import Progress, no_progress
from behaviours.space import Space
from torchvsa._numerics import as_bipolar, inner_products, is_integer, norms, real_parts

_DISTINCT, _BLOCK = 512, 8192
"""Most distinct conditions that are held, and compared with each other, at once; and most samples of them."""


@dataclass(frozen=True)
class _Block:
    """Samples in a row: their distinct `conditions` `[k, d]`, and for each of them its condition and result."""

    conditions: Shaped[Tensor, "k d"]
    condition: Int64[Tensor, "N"]
    result: Int64[Tensor, "N"]

    def __len__(self) -> int:
        return len(self.condition)


class PairAccumulator:
    """`state` `[2, d]`, the program above the known conditions, and `rows`, the samples that are in them.

    They stay raw accumulators, or with `clip` are normalised after each addition.
    """

    def __init__(self, space: Space, samples: Samples, clip: bool, progress: Progress = no_progress) -> None:
        self.vsa, self.samples, self.clip = space.vsa, samples, clip
        self.items = space.items(samples.results)
        nothing = torch.zeros(2, self.vsa.dim, dtype=self.vsa.accumulator, device=self.items.device)
        self.state = torch.zeros_like(self.vsa.normalize(nothing)) if clip else nothing
        self.progress = progress
        self.rows: list[int] = []
        self.empty = True

    def resume(self, program: Shaped[Tensor, "d"], known: Shaped[Tensor, "d"]) -> None:
        """Start from what was learned before."""
        wide = torch.promote_types(program.dtype, known.dtype)
        state = torch.stack([program.detach().to(wide), known.to(wide)])
        self.state = state if self.clip else as_bipolar(state)
        self.empty = False

    @property
    def program(self) -> Shaped[Tensor, "d"]:
        """The sum of the pairs."""
        return self.state[0].clone()

    @property
    def known(self) -> Shaped[Tensor, "d"]:
        """The sum of their conditions."""
        return self.state[1].clone()

    @property
    def accepted(self) -> Bool[Tensor, "N"]:
        """Which samples are in the sums."""
        accepted = torch.zeros_like(self.samples.condition, dtype=torch.bool)
        accepted[self.rows] = True
        return accepted

    def add(self, rows: Int64[Tensor, "N"]) -> None:
        """Add the pairs of these samples."""
        for block in self._blocks(rows):
            if self.clip:
                for some in torch.arange(len(block)).split(_DISTINCT):
                    for pair in self._pairs(block, some):
                        self._add_clipped(pair)
            else:
                self._add(block, slice(None))
        self.rows += rows.tolist()

    def add_where_dissimilar(self, threshold: float) -> None:
        """Go through the samples in order and add those that `known` does not resemble.

        An empty memory resembles nothing, even where the threshold is negative.
        """
        add = self._add_dissimilar_clipped if self.clip else self._add_dissimilar
        start = 0
        with torch.inference_mode():  # thousands of small steps, of which none needs to know its history
            for block in self._blocks(torch.arange(len(self.samples.condition))):
                self.rows += [start + row for row in add(block, threshold)]
                start += len(block)

    def _blocks(self, rows: Int64[Tensor, "N"]) -> Iterator[_Block]:
        start = 0
        while start < len(rows):
            some = rows[start : start + _BLOCK]
            distinct, which = distinct_rows(self.samples.condition[some][:, None])
            if len(distinct) > _DISTINCT:
                # They are numbered as they appear: the block ends where one too many does.
                end = int((which == _DISTINCT).to(torch.int8).argmax())
                some, which, distinct = some[:end], which[:end], distinct[:_DISTINCT]
            yield _Block(self.samples.conditions[distinct[:, 0]], which, self.samples.result[some])
            start += len(some)
            self.progress(start / len(rows))

    def _pairs(self, block: _Block, rows: Tensor | slice) -> Shaped[Tensor, "N 2 d"]:
        """What Algorithm 1 adds in lines 6 and 7: for each row its pair, and its condition."""
        conditions = block.conditions[block.condition[rows]]
        return torch.stack([self.vsa.bind(self.items[block.result[rows]], conditions), conditions], 1)

    def _add(self, block: _Block, rows: list[int] | slice) -> None:
        for some in torch.arange(len(block))[rows].split(_DISTINCT):
            self.state = self.state + self.vsa.superpose(self._pairs(block, some), 0)
        self.empty = False

    def _add_clipped(self, pair: Shaped[Tensor, "2 d"]) -> None:
        self.state = self.vsa.bundle(pair[None], 0) if self.empty else self.vsa._bundle_pair(self.state, pair)
        self.empty = False

    def _add_dissimilar(self, block: _Block, threshold: float) -> list[int]:
        """Add the rows that one sample after the other would, found by scalars alone; says which.

        While the sums are raw, what an addition does to the products of all others stands in their Gram matrix.
        """
        gram = _numbers(inner_products(block.conditions, block.conditions))
        products = _numbers(inner_products(block.conditions, self.state[1:]))[:, 0]
        square = _numbers(inner_products(self.state[1:], self.state[1:])).item()
        lengths = np.sqrt(gram.diagonal())
        condition, added, start = block.condition.cpu().numpy(), [], 0
        while start < len(block):
            new = ~_above(threshold, products, square**0.5 * lengths) | (self.empty and not added)
            ahead = new[condition[start:]]
            at = int(ahead.argmax())
            if not ahead[at]:
                break
            added.append(start + at)
            one = condition[start + at]
            square += 2 * products[one] + gram[one, one]
            products = products + gram[one]
            start += at + 1
        if added:
            self._add(block, added)
        return added

    def _add_dissimilar_clipped(self, block: _Block, threshold: float) -> list[int]:
        """The same with the literal clip, under which sums are not linear: the vectors themselves are asked."""
        met, which = distinct_rows(torch.stack([block.condition, block.result], 1))
        pairs = self._pairs(_Block(block.conditions, met[:, 0], met[:, 1]), slice(None)).unbind()
        lengths = norms(block.conditions).tolist()
        wide = torch.promote_types(_floats(block.conditions).dtype, _floats(self.state).dtype)
        conditions = _floats(block.conditions).to(wide).unbind()
        known, length = self._known(wide)
        resembles: dict[int, bool] = {}  # by condition, until the next addition
        added = []
        for row, (condition, pair) in enumerate(zip(block.condition.tolist(), which.tolist(), strict=True)):
            if condition not in resembles:
                product, scale = conditions[condition].dot(known).item(), length * lengths[condition]
                resembles[condition] = not self.empty and (product / scale if scale else 0.0) > threshold
            if not resembles[condition]:
                self._add_clipped(pairs[pair])
                known, length = self._known(wide)
                resembles.clear()
                added.append(row)
        return added

    def _known(self, wide: torch.dtype) -> tuple[Shaped[Tensor, "d"], float]:
        """The known conditions as `_floats` of a type, and their length."""
        known = _floats(self.state[1]).to(wide)
        return known, known.dot(known).item() ** 0.5


def _above(threshold: float, products: NDArray[np.float64], lengths: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the cosines are above the threshold; a zero vector has cosine 0 with everything."""
    if lengths.all():
        return products / lengths > threshold
    return np.divide(products, lengths, out=np.zeros_like(products), where=lengths > 0) > threshold


def _numbers(x: Tensor) -> NDArray[np.float64]:
    return x.to(torch.float64).cpu().numpy()


def _floats(x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch e"]:
    """Real vectors with the same products, in the smallest type that keeps those of integers exact."""
    x = real_parts(as_bipolar(x))
    if is_integer(x):
        # Codes of one byte are -1, 0 or +1: sums of 2^24 products are exact in float32.
        return x.to(torch.float32 if x.dtype == torch.int8 else torch.float64)
    return x
