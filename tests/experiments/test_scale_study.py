"""How many behaviours fit into one vector; on few draws."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from kits import composed
from rich.console import Console

from behaviours import Demonstrations, ErrorDriven, OneShot, Rule
from experiments.composition.scale import measure, study
from experiments.kit.run import check_all, run
from experiments.tasks import random_behaviours as task

Learn = Callable[[task.EncodedPairs], torch.Tensor]


def settings(*overrides: str) -> Any:
    return composed(study, *overrides)


@pytest.mark.parametrize(("rule", "learn"), [(OneShot(), task.one_shot), (ErrorDriven(margin=5), task.trained)])
def test_programs_learned_together_are_those_of_the_rules(rule: Rule, learn: Learn) -> None:
    cells, results = task.behaviours(4, seed=3)
    programs = learn(task.EncodedPairs.of(500, 2, cells, results))
    for number, program in enumerate(programs):
        shown = Demonstrations(cells[number] + 0.5, results[number][:, None])
        assert torch.equal(rule.fit(task.space(500, 2), shown).program.to(torch.float32), program)


def test_no_condition_is_in_two_of_128_behaviours() -> None:
    cells, results = task.behaviours(256, seed=0)
    assert cells.shape == (256, 20, 3)
    assert results.shape == (256, 20)
    for half in cells.split(128):
        assert len(half.flatten(0, 1).unique(dim=0)) == 2560


def test_votes_are_counted() -> None:
    cells = torch.tensor([[[0, 0, 0], [1, 1, 1]], [[0, 0, 0], [2, 2, 2]], [[0, 0, 0], [1, 1, 1]]])
    # The first condition: two of three votes for 5. The second: a tie of 1 and 7. The third: no rival.
    assert task.votes(cells, torch.tensor([[5, 1], [4, 3], [5, 7]])) == pytest.approx((2 + 1 + 1) / 6)


def test_recall_is_what_is_predicted_and_contradictions_are_decided_by_votes(tmp_path: Path) -> None:
    small = settings(
        "dims=[500]", "sizes=[1,4,16,64]", "codebooks=2", "contradicting=[3]", "contradicting_dim=2000",
        "contradicting_codebooks=2", "contradicting_queries=2400", "workers=1",
    )  # fmt: skip
    outcome = run(study, small, tmp_path, Console(quiet=True))
    *rows, votes = outcome.table
    assert [row["behaviours"] for row in rows] == [1, 4, 16, 64]
    assert {row["queries"] for row in rows} == {2 * 64 * 20}
    assert rows[0]["trained_predicted"] == rows[0]["trained_bundled"] == 1
    assert rows[-1]["one_shot_bundled"] < 0.4
    assert outcome.metrics["one_shot.largest_difference"] == pytest.approx(0, abs=0.06)
    assert outcome.metrics["trained.largest_difference"] == pytest.approx(0, abs=0.06)
    assert outcome.metrics["distinct.500.16.one_shot_gated"] == rows[2]["one_shot_gated"]
    assert votes["queries"] == 2400
    assert votes["one_shot_bundled"] == pytest.approx(votes["votes"], abs=0.04)
    assert votes["trained_bundled"] == pytest.approx(votes["votes"], abs=0.04)
    assert votes["one_shot_gated"] > 0.98
    one, other = study.shown(outcome)
    assert "| 500 | 1 | 2,560 |" in one.markdown()
    assert "count of votes" in other.markdown()
    for name in ("scale", "contradictions"):
        assert (tmp_path / "figures" / f"{name}.png").is_file()
    assert "largest difference" in study.headline(outcome)


def test_another_seed_draws_other_behaviours() -> None:
    cell = {"kind": "distinct", "dim": 300, "codebook": 0}
    one, other = (measure(settings(f"seed={seed}", "sizes=[1,32]"), cell)[1] for seed in (0, 1))
    assert one["one_shot_bundled"] != other["one_shot_bundled"]


def test_sizes_that_do_not_divide_the_largest_are_refused() -> None:
    with pytest.raises(ValueError, match="sizes=3 does not divide the largest size, 4"):
        check_all(study, settings("sizes=[3,4]"))
