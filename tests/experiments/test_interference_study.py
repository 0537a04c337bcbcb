"""The study of interference, small."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kits import composed
from rich.console import Console

import sim
from behaviours import Bundle
from experiments.composition import sums
from experiments.composition.interference import study
from experiments.composition.measure import agreement
from experiments.composition.rows import Shown
from experiments.kit.run import check_all, run
from experiments.tasks import corral

SMALL = ("vsa.dim=1000", "demonstrations=4", "heldout=3", "codebooks=2", "seconds=20", "workers=1")


@pytest.fixture(scope="module")
def given() -> sums.Material:
    """Demonstrated and held-out moments of few runs."""
    train, heldout = (
        corral.moving(sim.rollout(sim.Teacher(), episodes=range(first, first + count), seconds=20))
        for first, count in ((corral.FIRST_DEMONSTRATION, 4), (0, 3))
    )
    settings = composed(study, *SMALL)
    return sums.material(settings, Shown(sums.combining(settings), train), heldout)


def test_all_parts_are_measured(tmp_path: Path) -> None:
    settings = composed(
        study, *SMALL, "rows=[one_shot,error_driven_1]", "rule.margin=1.0", "joint=[0,20]", "draws=1", "codebooks=1"
    )
    outcome = run(study, settings, tmp_path, Console(quiet=True))
    rules = {(row["learner"], row["how"]): row for row in outcome.table if row["part"] == "rules"}
    assert list(rules) == [
        ("one_shot", "sum"), ("one_shot", "joint"),
        ("error_driven_1", "sum"), ("error_driven_1", "joint"), ("error_driven_1", "silent_sum"),
    ]  # fmt: skip
    repairs = {(row["repair"], row["source"], row["joint"]): row for row in outcome.table if row["part"] == "repair"}
    assert len(repairs) == 2 * 2 * 2
    plain = rules["error_driven_1", "sum"]
    for (_, _, joint), row in repairs.items():
        if joint == 0:
            assert row["agreement"] == plain["agreement"]
            assert row["corrections"] == 0
    more = repairs["margin_0", "anywhere", 20]
    assert more["corrections"] > 0
    assert more["alone"] < 1
    reasons = [row for row in outcome.table if row["part"] == "reason"]
    assert sum(row["moments"] for row in reasons) == pytest.approx(1)
    assert sum(row["moments"] * row["right"] for row in reasons) == pytest.approx(plain["agreement"])
    assert [row["predicted"] for row in reasons] == pytest.approx([row["right"] for row in reasons])
    wrong = 1 - plain["agreement"]
    assert {row["knowers"]: row["wrong_share"] * wrong for row in reasons} == pytest.approx(
        {who: plain[f"wrong_{who}"] for who in (row["knowers"] for row in reasons)}
    )
    assert outcome.metrics["reason.answers_predicted"] == 1
    assert outcome.metrics["reason.largest_error"] == pytest.approx(0, abs=1e-9)
    overruled = [row["wrong_share"] for row in outcome.table if row["part"] == "overruled"]
    assert sum(overruled) == pytest.approx(1)
    assert len(study.shown(outcome)) == 4
    for name in ("reason", "repair", "rules"):
        assert (tmp_path / "figures" / f"{name}.png").is_file()
    assert "joint samples bring the plain sum" in study.headline(outcome)


def test_agreement_is_that_of_the_study_of_composition(given: sums.Material) -> None:
    asked = sums.Questions(given, 1)
    bank = given.shown.bank(1)
    shares = asked.shares(asked.right(sums.added(bank)))
    wanted = agreement(Bundle(bank), given.moments)
    assert {key: shares[key] for key in wanted if key != "ceiling"} == {
        key: value for key, value in wanted.items() if key != "ceiling"
    }


def test_conditions_are_known_by_those_who_were_shown_them(given: sums.Material) -> None:
    cells = given.shown.space(0).cells
    for place, (name, samples) in enumerate(given.shown.apart.items()):
        known = {tuple(row) for row in cells(samples.sensors).tolist()}
        asked = [tuple(row) in known for row in cells(given.moments.shown.sensors).tolist()]
        assert given.knows[:, place].tolist() == asked, name
    assert set(given.knowers) <= set(sums.KNOWERS)
    own = given.knows[np.arange(len(given.owner)), given.owner]
    assert own[given.knowers == sums.RIGHT].all()
    assert not own[given.knowers == sums.OTHER].any()


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["rows=[nobody]"], "rows: there is no 'nobody'; choose from one_shot, error_driven_0"),
        (["rows=[]"], "rows is empty; name at least one"),
        (["vsa=hrr"], "the rule least_squares cannot train programs of HRR"),
        (["repairs.margin_0.name=least_squares"], "there is no setting 'repairs.margin_0.margin'"),
        (["+repairs.once={name:one_shot}"], "repairs.once: novelty='exact' needs all earlier conditions"),
        (["sources=[nowhere]"], "sources: there is no 'nowhere'"),
    ],
)
def test_what_cannot_work_is_refused(overrides: list[str], words: str) -> Any:
    with pytest.raises(ValueError, match=words):
        check_all(study, composed(study, *overrides))
