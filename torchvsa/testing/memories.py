"""The laws of memories with the interface of `CleanUp`."""

import copy
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.testing import assert_close

from torchvsa.architectures import VSA
from torchvsa.errors import ShapeError
from torchvsa.memory import CleanUp
from torchvsa.testing._laws import check, draw, refuses, require, same, seeded


@dataclass(frozen=True)
class _Case:
    make: Callable[[Tensor], CleanUp]
    vsa: VSA

    def __repr__(self) -> str:
        return f"{getattr(self.make, '__name__', 'the memory')} of {self.vsa}"

    def items(self) -> Tensor:
        return draw(self.vsa, 7)

    def queries(self) -> Tensor:
        """Each item with a tenth of its elements replaced by those of another hypervector."""
        items = self.items()
        replaced = torch.rand(items.shape, generator=seeded(1)) < 0.1
        return torch.where(replaced, draw(self.vsa, 7, seed=2), items)


def check_memory(make: Callable[[Tensor], CleanUp], vsa: VSA) -> None:
    """Check the laws of memories. Raises `AssertionError` that names the first broken law.

    Args:
        make: The class of the memory, or a function that makes one of items `[K, d]`. If it has `supports`, which says
            that it does not hold hypervectors of `vsa`, the only law is that it refuses them.
        vsa: The architecture; at least a few hundred dimensions.
    """
    supports = getattr(make, "supports", None)
    held = supports is None or supports(vsa)
    check(_Case(make, vsa), _LAWS if held else (_items_that_do_not_suit_are_refused,))


def _items_that_do_not_suit_are_refused(case: _Case) -> None:
    refuses(ValueError, lambda: case.make(case.items()))


def _items_are_a_matrix(case: _Case) -> None:
    items = case.items()
    for wrong in (items[0], items[:0], items[None]):
        refuses(ShapeError, lambda wrong=wrong: case.make(wrong))


def _each_item_is_found_by_itself_and_by_a_noisy_query(case: _Case) -> None:
    memory = case.make(case.items())
    for queries in (case.items(), case.queries()):
        match = memory(queries)
        same(match.index, torch.arange(7))
        require(match.similarity.min() > 0.5, f"similarities: {match.similarity.tolist()}")
        require(match.margin.min() > 0, f"margins: {match.margin.tolist()}")


def _similarity_and_margin_are_cosines(case: _Case) -> None:
    match = case.make(case.items())(draw(case.vsa, 20, seed=3))
    require(match.similarity.abs().max() <= 1 + 1e-6)
    require((match.margin >= 0).all() and (match.margin <= 2 + 1e-6).all())
    require(all(field.dtype == torch.float32 for field in match[1:]), "similarity and margin are not float32")
    require(case.make(case.items()[:1])(case.queries()).margin.isposinf().all(), "a single item has a finite margin")


def _a_batch_is_its_singles(case: _Case) -> None:
    memory, queries = case.make(case.items()), case.queries()
    whole = memory(queries)
    for size in (1, 3):
        parts = [memory(part) for part in queries.split(size)]
        for field, expected in enumerate(whole):
            assert_close(torch.cat([part[field] for part in parts]), expected)
    folded = memory(torch.stack([queries, queries])[:, :6].unflatten(1, (2, 3)))
    same(folded.index[1].flatten(), whole.index[:6])
    require(memory(queries[0]).index.shape == (), "one query has no batch")
    require(memory(queries[:0]).index.shape == (0,), "no query has an answer")


def _the_same_query_has_the_same_answer(case: _Case) -> None:
    memory, queries = case.make(case.items()), case.queries()
    first = memory(queries)
    for again in (memory, copy.deepcopy(memory), case.make(case.items())):
        for one, other in zip(again(queries), first, strict=True):
            same(one, other)


def _queries_of_another_shape_are_refused(case: _Case) -> None:
    memory = case.make(case.items())
    for wrong in (case.queries()[:, 1:], case.queries()[0, 0]):
        refuses(ShapeError, lambda wrong=wrong: memory(wrong))


def _a_query_of_zeros_knows_nothing(case: _Case) -> None:
    match = case.make(case.items())(torch.zeros(2, case.vsa.dim, dtype=case.vsa.accumulator))
    require(not match.index.any() and not match.similarity.any() and not match.margin.any(), f"it answers {match}")


def _a_query_with_nan_is_told_and_disturbs_no_other(case: _Case) -> None:
    memory, queries = case.make(case.items()), case.queries()
    queries = queries.to(queries.dtype if queries.dtype.is_complex else torch.float32)
    if case.queries().dtype == torch.bool:
        queries = 1 - 2 * queries
    queries[1, 3] = torch.nan
    match = memory(queries)
    require(match.similarity.isnan().tolist() == [False, True] + 5 * [False], f"similarities: {match.similarity}")
    same(match.index[2:], torch.arange(2, 7))


_LAWS: tuple[Callable[[_Case], None], ...] = (
    _items_are_a_matrix,
    _each_item_is_found_by_itself_and_by_a_noisy_query,
    _similarity_and_margin_are_cosines,
    _a_batch_is_its_singles,
    _the_same_query_has_the_same_answer,
    _queries_of_another_shape_are_refused,
    _a_query_of_zeros_knows_nothing,
    _a_query_with_nan_is_told_and_disturbs_no_other,
)
