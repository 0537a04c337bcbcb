"""Work by blocks is the same work on all rows."""

from typing import NamedTuple

import pytest
import torch
from torch import Tensor

from torchvsa._blocks import by_blocks

ROWS = torch.arange(10)


class Pair(NamedTuple):
    twice: Tensor
    nothing: None
    square: Tensor


@pytest.mark.parametrize(
    ("row_bytes", "sizes"), [(1, [10]), (10, [10]), (11, [9, 1]), (30, [3, 3, 3, 1]), (1000, [1] * 10), (0, [10])]
)
def test_rows_are_taken_some_at_a_time(row_bytes: int, sizes: list[int]) -> None:
    seen: list[int] = []

    def work(a: Tensor, b: Tensor) -> Tensor:
        seen.append(len(a))
        return a + b

    answer = by_blocks(work, ROWS, 2 * ROWS, row_bytes=row_bytes, block_bytes=100)
    assert seen == sizes
    assert answer.tolist() == (3 * ROWS).tolist()


@pytest.mark.parametrize("row_bytes", [1, 30])
def test_an_answer_of_several_parts_keeps_its_form(row_bytes: int) -> None:
    answer = by_blocks(lambda a: Pair(2 * a, None, a**2), ROWS, row_bytes=row_bytes, block_bytes=100)
    assert isinstance(answer, Pair)
    assert answer.nothing is None
    assert answer.twice.tolist() == (2 * ROWS).tolist()
    assert answer.square.tolist() == (ROWS**2).tolist()


def test_no_rows_are_work_too() -> None:
    assert by_blocks(lambda a: a + 1, ROWS[:0], row_bytes=30, block_bytes=100).tolist() == []
