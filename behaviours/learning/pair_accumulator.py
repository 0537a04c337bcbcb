"""Add pairs to progHV and knownCondHV, as Algorithm 1 does."""

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
"""Block limits: distinct conditions per Gram matrix, and samples per block."""


@dataclass(frozen=True)
class _Block:
    """Consecutive samples: their distinct `conditions` `[k, d]`, and each sample's condition and result as indices."""

    conditions: Shaped[Tensor, "k d"]
    condition: Int64[Tensor, "N"]
    result: Int64[Tensor, "N"]

    def __len__(self) -> int:
        return len(self.condition)


class PairAccumulator:
    """The sums of the pairs and of their conditions, in `state` `[2, d]`, and the samples added so far, in `rows`.

    The sums are raw accumulators; with `clip` they are normalised after each addition.
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
        """Continue from the sums of an earlier behaviour."""
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
        """Whether each sample was added."""
        accepted = torch.zeros_like(self.samples.condition, dtype=torch.bool)
        accepted[self.rows] = True
        return accepted

    def add(self, rows: Int64[Tensor, "N"]) -> None:
        """Add the pairs of these samples."""
        for block in self._blocks(rows):
            if self.clip:
                for chunk in torch.arange(len(block)).split(_DISTINCT):
                    for pair in self._pairs(block, chunk):
                        self._add_clipped(pair)
            else:
                self._add(block, slice(None))
        self.rows += rows.tolist()

    def add_where_dissimilar(self, threshold: float) -> None:
        """Go through the samples in order, and add those whose cosine with `known` is at most `threshold`.

        The first sample of an empty accumulator is always added, even if the threshold is negative.
        """
        add = self._add_dissimilar_clipped if self.clip else self._add_dissimilar
        start = 0
        with torch.inference_mode():  # thousands of small steps without gradients
            for block in self._blocks(torch.arange(len(self.samples.condition))):
                self.rows += [start + row for row in add(block, threshold)]
                start += len(block)

    def _blocks(self, rows: Int64[Tensor, "N"]) -> Iterator[_Block]:
        start = 0
        while start < len(rows):
            chunk = rows[start : start + _BLOCK]
            distinct, index = distinct_rows(self.samples.condition[chunk][:, None])
            if len(distinct) > _DISTINCT:
                # Indices are in order of appearance: the block ends before the first index that is too large.
                end = int((index == _DISTINCT).to(torch.int8).argmax())
                chunk, index, distinct = chunk[:end], index[:end], distinct[:_DISTINCT]
            yield _Block(self.samples.conditions[distinct[:, 0]], index, self.samples.result[chunk])
            start += len(chunk)
            self.progress(start / len(rows))

    def _pairs(self, block: _Block, rows: Tensor | slice) -> Shaped[Tensor, "N 2 d"]:
        """The pair and the condition of each row, which lines 6 and 7 of Algorithm 1 add."""
        conditions = block.conditions[block.condition[rows]]
        return torch.stack([self.vsa.bind(self.items[block.result[rows]], conditions), conditions], 1)

    def _add(self, block: _Block, rows: list[int] | slice) -> None:
        for chunk in torch.arange(len(block))[rows].split(_DISTINCT):
            self.state = self.state + self.vsa.superpose(self._pairs(block, chunk), 0)
        self.empty = False

    def _add_clipped(self, pair: Shaped[Tensor, "2 d"]) -> None:
        self.state = self.vsa.bundle(pair[None], 0) if self.empty else self.vsa._bundle_pair(self.state, pair)
        self.empty = False

    def _add_dissimilar(self, block: _Block, threshold: float) -> list[int]:
        """Add the dissimilar rows of the block, and return them.

        The sums are raw, so adding condition i adds row i of the Gram matrix to the inner products of all conditions
        with `known`, and `2 <c_i, known> + <c_i, c_i>` to the squared length of `known`. The rows are found from these
        numbers alone.
        """
        gram = _numbers(inner_products(block.conditions, block.conditions))
        products = _numbers(inner_products(block.conditions, self.state[1:]))[:, 0]
        square = _numbers(inner_products(self.state[1:], self.state[1:])).item()
        lengths = np.sqrt(gram.diagonal())
        condition, added, start = block.condition.cpu().numpy(), [], 0
        while start < len(block):
            new = ~_above(threshold, products, square**0.5 * lengths) | (self.empty and not added)
            remaining = new[condition[start:]]
            offset = int(remaining.argmax())
            if not remaining[offset]:
                break
            added.append(start + offset)
            i = condition[start + offset]
            square += 2 * products[i] + gram[i, i]
            products = products + gram[i]
            start += offset + 1
        if added:
            self._add(block, added)
        return added

    def _add_dissimilar_clipped(self, block: _Block, threshold: float) -> list[int]:
        """As `_add_dissimilar`, with clipping: the sums are not linear, so that each step compares the vectors."""
        unique, index = distinct_rows(torch.stack([block.condition, block.result], 1))
        pairs = self._pairs(_Block(block.conditions, unique[:, 0], unique[:, 1]), slice(None)).unbind()
        lengths = norms(block.conditions).tolist()
        dtype = torch.promote_types(_floats(block.conditions).dtype, _floats(self.state).dtype)
        conditions = _floats(block.conditions).to(dtype).unbind()
        known, length = self._known_floats(dtype)
        similar: dict[int, bool] = {}  # by condition, until the next addition
        added = []
        for row, (condition, pair) in enumerate(zip(block.condition.tolist(), index.tolist(), strict=True)):
            if condition not in similar:
                product, scale = conditions[condition].dot(known).item(), length * lengths[condition]
                similar[condition] = not self.empty and (product / scale if scale else 0.0) > threshold
            if not similar[condition]:
                self._add_clipped(pairs[pair])
                known, length = self._known_floats(dtype)
                similar.clear()
                added.append(row)
        return added

    def _known_floats(self, dtype: torch.dtype) -> tuple[Shaped[Tensor, "d"], float]:
        """The sum of the known conditions as `_floats` of this type, and its length."""
        known = _floats(self.state[1]).to(dtype)
        return known, known.dot(known).item() ** 0.5


def _above(threshold: float, products: NDArray[np.float64], lengths: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether each cosine is above the threshold; zero vectors have the cosine 0."""
    if lengths.all():
        return products / lengths > threshold
    return np.divide(products, lengths, out=np.zeros_like(products), where=lengths > 0) > threshold


def _numbers(x: Tensor) -> NDArray[np.float64]:
    return x.to(torch.float64).cpu().numpy()


def _floats(x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch e"]:
    """Real vectors with the same inner products, in the smallest float type in which those of integers are exact."""
    x = real_parts(as_bipolar(x))
    if is_integer(x):
        # int8 codes are -1, 0 or +1: sums of up to 2^24 products are exact in float32.
        return x.to(torch.float32 if x.dtype == torch.int8 else torch.float64)
    return x
