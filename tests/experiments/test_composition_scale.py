"""How many behaviours fit into one vector, and a sequence of two lamps; on few draws."""

from collections.abc import Callable

import pytest
import torch

import sim
from behaviours import Demonstrations, ErrorDriven, OneShot, Rule
from experiments.composition import scale, sequence

Learn = Callable[[scale.Shown], torch.Tensor]


@pytest.mark.parametrize(("rule", "learn"), [(OneShot(), scale.one_shot), (ErrorDriven(margin=5), scale.trained)])
def test_programs_learned_together_are_those_of_the_rules(rule: Rule, learn: Learn) -> None:
    cells, results = scale.behaviours(4, seed=3)
    programs = learn(scale.Shown.of(500, 2, cells, results))
    for number, program in enumerate(programs):
        shown = Demonstrations(cells[number] + 0.5, results[number][:, None])
        assert torch.equal(rule.fit(scale.space(500, 2), shown).program.to(torch.float32), program)


def test_no_condition_is_in_two_of_128_behaviours() -> None:
    cells, results = scale.behaviours(256, seed=0)
    assert cells.shape == (256, 20, 3)
    assert results.shape == (256, 20)
    for half in cells.split(128):
        assert len(half.flatten(0, 1).unique(dim=0)) == 2560


def test_recall_is_what_is_predicted() -> None:
    rows = scale.capacity(500, codebooks=[0, 1], sizes=(1, 4, 16, 64))
    assert [row["behaviours"] for row in rows] == [1, 4, 16, 64]
    assert {row["queries"] for row in rows} == {2 * 64 * 20}
    assert rows[0]["trained.predicted"] == rows[0]["trained.bundled"] == 1
    assert rows[-1]["one_shot.bundled"] < 0.4
    assert max(scale.misses(rows).values()) < 0.06
    head, _, first, *rest = scale.table(rows).splitlines()
    assert head.startswith("| dim | behaviours | queries | one_shot.bundled |")
    assert first.startswith(f"| 500 | 1 | 2560 | {rows[0]['one_shot.bundled']:.3f} |")
    assert len(rest) == 3


def test_votes_are_counted() -> None:
    cells = torch.tensor([[[0, 0, 0], [1, 1, 1]], [[0, 0, 0], [2, 2, 2]], [[0, 0, 0], [1, 1, 1]]])
    # The first condition: two of three votes for 5. The second: a tie of 1 and 7. The third: no rival.
    assert scale.votes(cells, torch.tensor([[5, 1], [4, 3], [5, 7]])) == pytest.approx((2 + 1 + 1) / 6)


def test_contradictions_are_decided_by_votes() -> None:
    (row,) = scale.contradictions(2000, codebooks=[0, 1], sizes=(3,), queries=2400)
    assert row["queries"] == 2400
    assert row["one_shot.bundled"] == pytest.approx(row["votes"], abs=0.04)
    assert row["trained.bundled"] == pytest.approx(row["votes"], abs=0.04)
    assert row["one_shot.gated"] > 0.98


@pytest.mark.slow
def test_a_robot_goes_to_the_lamp_that_was_never_demonstrated() -> None:
    room = sequence.room()
    rows = sequence.compare(room, codebooks=[0, 1], starts=6)
    assert {name: row["success_rate"] for name, row in rows.items()} == {
        "teacher": 1.0,
        "one vector": 1.0,
        "one vector, where the teacher succeeds": 1.0,
    }
    assert "| one vector | 1.000 [0.610, 1.000] | 6 |" in sequence.table(rows)
    assert sequence.agreement(room, 0, sequence.runs(room, 5), tested=10) > 0.95
    assert sim.Task.of(room) == sequence.TASK
