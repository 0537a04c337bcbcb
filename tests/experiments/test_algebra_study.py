"""The measurements of the algebra, on few runs."""

from pathlib import Path
from typing import Any

import pytest
from kits import composed
from rich.console import Console

from experiments.composition.algebra import cells, measure, study
from experiments.kit.run import check_all, run

SMALL = (
    "codebooks={removal:1,mirror:1,distance:1,recognition:1,interpolation:1}", "demonstrations=6", "tested=20",
    "workers=1",
)  # fmt: skip


def settings(*overrides: str) -> Any:
    return composed(study, *SMALL, *overrides)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::behaviours.ConvergenceWarning")
def test_what_is_measured_is_what_theory_says(tmp_path: Path) -> None:
    small = settings(
        "behaviours=[escape,flee,cruise]", "steps=[1,50]", "sequences=300", "recognition_demonstrations=4",
        "variants=8", "readings_shown=100", "compared=500", "rules=[one_shot]", "shown=[same]", "readings=[uniform]",
    )  # fmt: skip
    outcome = run(study, small, tmp_path, Console(quiet=True))
    rows: dict[str, list[dict[str, Any]]] = {}
    for row in outcome.table:
        rows.setdefault(row["operation"], []).append(row)
    assert rows["removal"] == [{"operation": "removal", "codebooks": 1, "exact": 1}]
    p, mirror, both = rows["mirror"]
    assert p["right"] == mirror["left"] == 0
    assert p["left"] == mirror["right"]
    assert both["right"] > 0.9
    (near,) = rows["distance"]
    assert near["pairs"] == 28
    assert near["spearman"] > 0.7
    few, many = rows["recognition"]
    for row in (few, many):
        assert row["sequences"] == 300
        assert row["recognised"] > row["ceiling"] - 0.1
    assert few["ceiling"] < many["ceiling"] <= 1
    (switch,) = rows["interpolation"]
    assert switch["error"] < 0.01
    assert outcome.metrics["recognition.50.recognised"] == many["recognised"]
    assert outcome.metrics["distance.uniform.one_shot.same.spearman"] == near["spearman"]
    assert len(study.shown(outcome)) == 5
    assert few["recognised_low"] == few["recognised"] == few["recognised_high"]
    assert "removal is exact with 1 of 1 codebooks" in study.headline(outcome).lower()
    assert (tmp_path / "figures" / "algebra.png").is_file()


@pytest.mark.slow
def test_variants_may_learn_from_readings_of_their_own_from_runs() -> None:
    small = settings("operations=[distance]", "variants=3", "readings_shown=50", "rules=[one_shot]")
    assert len(cells(small)) == 4
    cell = {"operation": "distance", "readings": "driven", "rule": "one_shot", "shown": "own", "codebook": 0}
    rows = measure(small, cell)
    assert [row["pair"] for row in rows] == ["0-1", "0-2", "1-2"]
    assert all(0 < row["distance"] < 2 and 0 < row["disagreement"] < 1 for row in rows)


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("operations=[addition]", "operations: there is no 'addition'; choose from removal, mirror"),
        ("sequences=3", "sequences=3: expected at least one for each of 8 behaviours"),
        ("dim=333", "dim=333: expected an even number"),
    ],
)
def test_what_cannot_work_is_refused(override: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        check_all(study, composed(study, override))
