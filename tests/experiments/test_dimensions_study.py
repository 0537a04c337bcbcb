"""Dimensions that architectures need: the search on known curves, the tasks, and a small run of the command."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from commands import only, output_of, results
from kits import composed

import torchvsa
from experiments.capacity import protocol
from experiments.capacity.crossing import crossing, first_at, window
from experiments.capacity.dimensions import GRID, PUBLISHED_GRID, cells, study
from experiments.kit.run import check_all
from torchvsa import dim_needed, recall_probability
from torchvsa.capacity import Kind


@pytest.mark.parametrize("k", [9, 27, 51])
def test_the_crossing_of_a_known_curve_is_found(k: int) -> None:
    start = min(range(len(GRID)), key=lambda place: abs(GRID[place] - 32 * k))
    found = window(lambda place: recall_probability("MAP-I", GRID[place], k, 1000), start, 0.99, 0.92, len(GRID) - 1)
    by_dim = {GRID[place]: share for place, share in found.items()}
    exact = dim_needed("MAP-I", k, 1000)
    assert crossing(by_dim, 10 * k, 0.99) == pytest.approx(exact, rel=0.015)
    first = first_at(by_dim, 0.99)
    assert first == min(dim for dim in GRID if dim >= exact)
    assert min(by_dim.values()) < 0.92
    assert max(by_dim.values()) > 0.995


def test_a_crossing_is_of_all_that_was_measured() -> None:
    """Errors that fall as 1/d: of 10,000 decisions as many errors as expected, so that the fit is exact."""
    assert crossing({100: 0.96, 200: 0.98, 800: 0.995}, 10_000, 0.99) == pytest.approx(400, rel=1e-4)
    assert crossing({100: 1.0, 200: 1.0}, 100, 0.99) is None
    assert crossing({100: 0.99, 200: 0.9}, 100, 0.99) is None
    few = crossing({100: 0.9, 200: 1.0, 300: 1.0}, 50, 0.99)
    assert few is not None
    assert 100 < few < 300
    assert first_at({100: 0.9}, 0.99) is None


def counting(limit: int) -> Callable[[int], float]:
    asked: list[int] = []

    def accuracy(place: int) -> float:
        assert place not in asked, "asked twice"
        asked.append(place)
        return 1.0 if place >= limit else 0.0

    return accuracy


@pytest.mark.parametrize("limit", [0, 1, 7, 19, 100])
@pytest.mark.parametrize("start", [0, 8, 20])
def test_the_window_holds_both_sides_of_the_target(limit: int, start: int) -> None:
    found = window(counting(limit), start, 0.99, 0.9, 20)
    assert sorted(found) == list(range(min(found), max(found) + 1))
    if limit <= 20:
        assert max(found) >= limit
        assert min(found) == max(limit - 1, 0)
    else:
        assert max(found) == 20


@pytest.mark.parametrize("task", protocol.TASKS)
def test_the_tasks_are_what_a_plain_simulation_counts(task: Kind) -> None:
    """Many dimensions find all, few hardly more than chance, and the closed form says what is between."""
    vsa = torchvsa.architecture("MAP-I", 300)
    draws = [torch.Generator().manual_seed(seed) for seed in range(30)]
    share = np.mean([protocol.TASKS[task](vsa, 15, 300, draw) for draw in draws])
    assert share == pytest.approx(recall_probability("MAP-I", 300, 15, 300, kind=task), abs=0.03)
    wide, narrow = torchvsa.architecture("MAP-I", 1500), torchvsa.architecture("MAP-I", 4)
    assert protocol.TASKS[task](wide, 15, 300, draws[0]) == 1
    assert protocol.TASKS[task](narrow, 15, 300, draws[0]) < 0.5


def test_a_vector_comes_back_as_the_keys_allow() -> None:
    """Keys with independent factors r² leave E[r²] / √E[r⁴] of the similarity each: 1/√2 for HRR, √5/3 if uniform."""
    for name, each in (("BSC", 1.0), ("HRR", math.sqrt(0.5)), (protocol.UNIFORM, math.sqrt(5) / 3)):
        draws = [torch.Generator().manual_seed(seed) for seed in range(8)]
        found = np.mean([protocol.returned(protocol.make(name, 1024), 2, draw) for draw in draws], axis=0)
        assert found == pytest.approx([each, each**2], abs=0.03)


def test_an_architecture_joins_by_being_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    class Squares(torchvsa.HRR):
        name = "Squares"

        def allows_dim(self, dim: int) -> bool:
            return math.isqrt(dim) ** 2 == dim

    monkeypatch.setattr(torchvsa.ARCHITECTURES, "_parts", {**dict(torchvsa.ARCHITECTURES), "Squares": Squares})
    names = {cell["architecture"] for cell in cells(composed(study))}
    assert names == {*torchvsa.ARCHITECTURES, protocol.UNIFORM}
    assert "Squares" in names
    assert protocol.nearest_allowed("Squares", 1000).dim == 1024
    assert protocol.nearest_allowed("Squares", 900).dim == 900
    with pytest.raises(ValueError, match="no architecture 'nobody'"):
        protocol.make("nobody", 4)


def test_the_published_grid_is_part_of_the_grid() -> None:
    assert set(GRID) > PUBLISHED_GRID
    assert max(PUBLISHED_GRID) == 1600
    assert sorted(GRID) == GRID


def test_the_command_compares_lines(tmp_path: Path) -> None:
    printed = output_of(
        tmp_path, "dimensions", "architectures=[MAP-I,HRR]", "counts=[4,12]", "items=200", "repeats=10", "keys=2",
        "keys_dim=256", "workers=1",
    )  # fmt: skip
    content = results(tmp_path)
    rows = {(row["task"], row["architecture"]): row for row in content["table"]}
    assert list(rows) == [(task, name) for task in ("bundle", "pairs", "unbinding") for name in ("MAP-I", "HRR")]
    for task in protocol.TASKS:
        row = rows[task, "MAP-I"]
        assert row["slope"] * 15 + row["start"] == pytest.approx(row["at"])
        assert row["ratio"] == pytest.approx(row["at"] / row["published_at"])
        assert 10 < row["slope"] < 60
        assert abs(row["difference"]) < 0.05
        assert content["metrics"][f"{task}.MAP-I.slope"] == row["slope"]
    assert rows["unbinding", "MAP-I"]["after_2"] == pytest.approx(1)
    assert rows["unbinding", "HRR"]["after_1"] == pytest.approx(0.71, abs=0.1)
    assert "first on the grid" in printed
    assert only(tmp_path, "dimensions.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("architectures=[nobody]", "architectures: there is no 'nobody'; choose from MAP-C, "),
        ("counts=[3,2000]", "counts=2000: expected at most items=1000"),
        ("counts=[3]", r"counts=\[3\]: a line needs at least 2 numbers"),
        ("accuracy=0.9", "accuracy=0.9: expected more than 0.92 and less than 1"),
    ],
)
def test_wrong_settings_are_named(override: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        check_all(study, composed(study, override))
