"""Threshold features of angles and categories: their kernels, cells, questions and errors."""

from typing import Any

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from readings import centres, rows, seeded
from spaces import with_negatives
from torch.testing import assert_close

import torchvsa
from torchvsa import VSA
from torchvsa.encoders import ThresholdFeatures

ASKING = 15 / 16
"""The share of dimensions that ask anything."""


def similarities(vsa: VSA, kind: Any, count: int) -> torch.Tensor:
    """The cosines between all `count` cells of one sensor."""
    codes = ThresholdFeatures(vsa, 1, 24, kinds=[kind], seed=0)(centres(torch.arange(count)[:, None], count))
    return vsa.similarity(codes[:, None], codes)


@with_negatives
def test_an_angle_has_a_kernel_that_falls_linearly_round_the_circle(vsa: VSA) -> None:
    apart = (torch.arange(24)[:, None] - torch.arange(24)).abs()
    turns = torch.minimum(apart, 24 - apart) / 24
    # 1 - 4 turns, but for the dimensions that ask nothing. Where elements differ in size (HRR) the share that is
    # negated weighs more or less.
    assert_close(similarities(vsa, "angle", 24), 1 - ASKING * 4 * turns, atol=0.1, rtol=0)


@with_negatives
@pytest.mark.parametrize(
    ("count", "kernel"), [(2, -1), (3, -1 / 3), (4, -1 / 3), (5, -1 / 5), (6, -1 / 5), (20, -1 / 19)]
)
def test_categories_are_as_far_apart_as_they_can_be(vsa: VSA, count: int, kernel: float, chance: float) -> None:
    wanted = torch.full((count, count), 1 - ASKING * (1 - kernel)).fill_diagonal_(1)
    # Gaussian elements (HRR) have three times the variance of chance: the fourth moment counts.
    assert_close(similarities(vsa, count, count), wanted, atol=3**0.5 * chance, rtol=0)


@pytest.mark.parametrize("subset", [1, 3])
def test_an_element_is_negated_where_all_answers_are_yes(subset: int) -> None:
    kinds: list[Any] = ["real", "angle", 3, 7, "angle", 2]
    encode = ThresholdFeatures(torchvsa.MAP(500), 6, 20, subset, seed=0, kinds=kinds)
    sizes = [20 if isinstance(kind, str) else kind for kind in kinds]
    cells = torch.stack(
        [torch.randint(-1, size, (40,), generator=seeded(place)) for place, size in enumerate(sizes)], 1
    )

    def yes(cell: int, place: int, d: int) -> bool:
        kind, mark = kinds[int(encode.sensor[place, d])], int(encode.threshold[place, d])
        if kind == "real":
            inside = cell > mark
        elif kind == "angle":
            inside = mark < cell <= mark + 10
        else:
            inside = bool(encode.members[place, d, cell])
        return inside == bool(encode.above[place, d])

    for row, code in zip(cells.tolist(), encode.encode(cells), strict=True):
        for d in range(500):
            asked = [(row[int(s)], place) for place, s in enumerate(encode.sensor[:, d])]
            answers = [yes(cell, place, d) for cell, place in asked if cell >= 0]
            assert code[d] == encode.start_codes[d] * (-1 if answers and all(answers) else 1)


def test_half_circles_begin_everywhere_and_halves_of_categories_are_balanced() -> None:
    encode = ThresholdFeatures(torchvsa.MAP(4000), 3, 360, 1, seed=0, kinds=["angle", 5, 6])
    circles = (encode.sensor[0] == 0) & (encode.threshold[0] < 359)
    marks = encode.threshold[0][circles].sort().values
    assert marks.diff().max() <= 2
    assert 0 <= marks.min() <= marks.max() < 180
    for sensor, sizes in ((1, {3}), (2, {3})):
        chosen = encode.members[0][encode.sensor[0] == sensor].sum(-1)
        assert set(chosen.tolist()) - {0} == sizes  # 0: the dimensions that ask nothing


def test_one_dimension_in_sixteen_is_constant_for_every_kind() -> None:
    encode = ThresholdFeatures(torchvsa.MAP(4000), 3, 36, 1, seed=0, kinds=["angle", 4, 3])
    x = torch.rand(2000, 3, generator=seeded(1))
    assert (encode(x) == encode.start_codes).all(0).float().mean() == pytest.approx(1 / 16, abs=0.012)


def test_real_kinds_change_no_bit() -> None:
    vsa = torchvsa.MAP(300)
    plain = ThresholdFeatures(vsa, 3, 9, 2, seed=0)
    said = ThresholdFeatures(vsa, 3, 9, 2, seed=0, kinds=["real", "real", "real"])
    assert said.config() == plain.config()
    assert "kinds" not in plain.config()
    assert said.state_dict().keys() == plain.state_dict().keys()
    x = rows(50, 3)
    assert torch.equal(said(x), plain(x))


@settings(max_examples=100, deadline=None, derandomize=True)
@given(
    count=st.integers(2, 2**20), share=st.floats(0, 1, exclude_max=True), dtype=st.sampled_from(["float32", "float64"])
)
def test_the_cell_of_a_category_is_its_number(count: int, share: float, dtype: str) -> None:
    number = int(share * count)
    encode = ThresholdFeatures(torchvsa.MAP(2), 2, 8, kinds=["real", count])
    x = torch.tensor([[0.5, (number + 0.5) / count]], dtype=getattr(torch, dtype))
    assert encode.cells(x).tolist() == [[4, number]]


def test_both_ends_of_a_circle_are_one_cell() -> None:
    encode = ThresholdFeatures(torchvsa.MAP(100), 2, 8, seed=0, kinds=["angle", "real"])
    x = torch.tensor([[0.0, 0.0], [1.0, 1.0], [0.999, 0.999], [torch.nan, 0.5]])
    assert encode.cells(x).tolist() == [[0, 0], [0, 7], [7, 7], [-1, 4]]


def test_edges_are_for_real_sensors_alone() -> None:
    none, edges = torch.tensor([]), torch.tensor([0.9])
    encode = ThresholdFeatures(torchvsa.MAP(50), 3, 8, edges=[edges, none, none], seed=0, kinds=["real", "angle", 2])
    assert encode.cells(torch.tensor([[0.5, 0.5, 0.5], [0.9, 1.0, 0.1]])).tolist() == [[0, 4, 1], [1, 0, 0]]
    with pytest.raises(ValueError, match="sensor 1 is an angle or a category, which has no edges"):
        ThresholdFeatures(torchvsa.MAP(50), 3, 8, edges=[edges, edges, none], kinds=["real", "angle", 2])


@pytest.mark.parametrize(
    ("kinds", "words"),
    [
        (["real"], "kinds must be given for each of 2 sensors, in a list; got"),
        ("ab", "kinds must be given for each of 2 sensors"),
        (3, "kinds must be given for each of 2 sensors"),
        (["real", "round"], "the kind of sensor 1 is 'real', 'angle', or a number of categories .* got 'round'"),
        ([1, "real"], "the kind of sensor 0 is .* from 2 to 2.20; got 1"),
        ([2**20 + 1, "real"], "the kind of sensor 0 is .* got 1048577"),
        ([2.0, "real"], "the kind of sensor 0 is .* got 2.0"),
        ([True, "real"], "the kind of sensor 0 is .* got True"),
        (["real", "angle"], "sensor 1 is an angle, whose half circles need an even number of bins; got 9"),
    ],
)
def test_kinds_that_make_no_sense(kinds: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        ThresholdFeatures(torchvsa.MAP(50), 2, 9, kinds=kinds)


def test_more_categories_than_memory_holds_are_refused_before_any_is_taken() -> None:
    plan = ThresholdFeatures(torchvsa.MAP(1_000_000), 1, kinds=[2**20])
    with pytest.raises(ValueError, match=r"with up to 1,048,576 categories needs .* take fewer sensors, categories"):
        plan.draw(seeded())
