"""The measurements of the algebra, on few runs."""

import pytest

from behaviours import OneShot
from experiments.composition import algebra


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::behaviours.ConvergenceWarning")
def test_what_is_measured_is_what_theory_says() -> None:
    (row,) = algebra.mirrored([0], demonstrations=6, tested=20)
    assert row["p.right"] == row["mirror.left"] == 0
    assert row["p.left"] == row["mirror.right"]
    assert row["sum.right"] > 0.9
    found = algebra.interpolation(0, demonstrations=4, tested=10)
    assert found["measured"] == pytest.approx(found["predicted"], abs=0.01)
    assert algebra.removal(0, demonstrations=6)


@pytest.mark.slow
def test_distance_and_recognition_have_their_ceilings() -> None:
    near = algebra.distance(0, "uniform", OneShot(), count=8, shown=100, tested=500)
    assert near["pairs"] == 28
    assert near["spearman"] > 0.7
    assert algebra.distance(0, "driven", OneShot(), own=True, count=3, shown=50)["readings"] == 4000
    names = ("escape", "flee", "cruise")
    rules = {name: algebra.EIGHT[name] for name in names}
    few, many = algebra.recognition(0, (1, 50), sequences=300, demonstrations=4, rules=rules)
    for row in (few, many):
        assert row["sequences"] == 300
        assert row["recognised"] > row["ceiling"] - 0.1
    assert few["ceiling"] < many["ceiling"] <= 1
