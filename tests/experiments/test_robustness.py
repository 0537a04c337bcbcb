"""The damage study: what it refuses, measures and reports."""

import io
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyarrow.parquet as pq
import pytest
from commands import only, results, shared_output_of
from kits import composed
from rich.console import Console

from experiments.kit.run import check_all, load, run
from experiments.main import main
from experiments.robustness.results import survival
from experiments.robustness.study import Robustness, cells, study

SMALL = ("vsa.dim=500", "encoder.bins=8", "encoder.span=2", "one_shot.encoder.bins=8", "mlp_epochs=15", "hidden=8")


def settings(*overrides: str) -> Robustness:
    return cast(Robustness, composed(study, *SMALL, *overrides))


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("learners=[nobody]", "learners: there is no 'nobody'; choose from default, "),
        ("parts=[]", "parts is empty; choose from program, "),
        ("damages=[flip,flip]", "damages names 'flip' 2 times"),
        ("damages=[melt]", "damages: there is no 'melt'; choose from flip, zero, noise"),
        ("shares=[0.1,0.2]", "shares begin with 0"),
        ("shares=[0,1.5]", r"shares=\[0,1.5\]: expected a number from 0 to 1"),
        ("drive_shares=[0.15]", r"drive_shares are some of the shares .*0.15"),
        ("draws=0", "draws=0: expected 1 or more"),
        ("kept=0", "kept=0: expected more than 0 and at most 1"),
        # Programs without signs, a rule that does not fit, and codes without a table.
        ("vsa=bsc", "BSC has none; try vsa=map_c"),
        ("vsa=bsdc_s", "BSDC-S has none; try vsa=map_c"),
        ("one_shot.rule.name=guess", "no learning rule 'guess'"),
        ("record=threshold_features", "threshold_features has none .* try encoder=level record=product"),
    ],
)
def test_wrong_settings_are_named(override: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        check_all(study, settings("learners=[default,one_shot]", override))


def test_a_rule_that_cannot_train_the_architecture_is_refused() -> None:
    with pytest.raises(ValueError, match="the rule least_squares cannot train programs of HRR"):
        check_all(study, settings("vsa=hrr", "rule=least_squares"))


def test_an_undamaged_learner_is_measured_once_and_robots_drive_first() -> None:
    found = cells(settings("learners=[default,mlp]", "shares=[0,0.1,0.3]", "drive_shares=[0,0.3]"))
    assert [cell["learner"] for cell in found if not cell["share"]] == ["teacher", "default", "mlp"]
    driven = [cell["share"] in (0, 0.3) for cell in found]
    assert driven == sorted(driven, reverse=True)
    assert len(found) == 3 + (3 + 1) * 3 * 2


def test_the_draws_share_the_starts(finished: tuple[Path, str]) -> None:
    records = pq.read_table(only(finished[0], "records.parquet")).to_pylist()
    damaged = [record for record in records if record["share"] == 0.5]
    assert {(record["draw"], record["episodes"]) for record in damaged} == {(0, 2), (1, 2)}


def test_what_is_survived_follows_from_the_numbers() -> None:
    values = {0.0: 0.9, 0.1: 0.88, 0.2: 0.5, 0.3: 0.89}
    table: list[dict[str, Any]] = [
        {
            "learner": "default",
            "part": "program",
            "damage": "flip",
            "share": share,
            "agreement": value,
            "success_rate": None,
        }
        for share, value in values.items()
    ]
    (row,) = survival(table, kept=0.95)
    # What comes back after it fell was not survived.
    assert (row["agreement"], row["success_rate"]) == (0.1, None)
    assert survival(table, kept=0.5)[0]["agreement"] == 0.3
    assert survival(table, kept=0.99)[0]["agreement"] == 0.0


TINY = (
    *SMALL,
    "demonstrations=4",
    "starts=4",
    "seconds=12",
    "shares=[0,0.5]",
    "drive_shares=[0,0.5]",
    "draws=2",
    "damages=[flip]",
    "parts=[program]",
    "learners=[default,decision_tree]",
    "workers=1",
    "bullet_learners=[]",
)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("robustness")
    return folder, shared_output_of(folder, "robustness", *TINY)


def test_the_command_writes_table_records_and_page(finished: tuple[Path, str]) -> None:
    folder, printed = finished
    content = results(folder)
    assert content["table"][0]["learner"] == "teacher"
    assert content["metrics"]["teacher.success_rate"] == content["table"][0]["success_rate"]
    rows = {(row["learner"], row["part"], row["share"]): row for row in content["table"][1:]}
    assert list(rows) == [
        (name, part, share)
        for name, part in (("default", "program"), ("decision_tree", "parameters"))
        for share in (0.0, 0.5)
    ]
    records = pq.read_table(only(folder, "records.parquet")).to_pylist()
    for (name, part, share), row in rows.items():
        own = [r for r in records if (r["learner"], r["part"], r["share"]) == (name, part, share)]
        assert len(own) == (2 if share else 1)
        assert row["agreement"] == pytest.approx(np.mean([r["agreement"] for r in own]))
        assert row["agreement_min"] == min(r["agreement"] for r in own)
        assert row["episodes"] == sum(r["episodes"] for r in own) == 4
        assert row["success_rate"] * 4 == sum(r["successes"] for r in own)
        assert all(r["damaged"] == int(share * r["elements"] + 0.5) for r in own)
        assert content["metrics"][f"{name}.{part}.flip.{share:g}.agreement"] == row["agreement"]
        assert content["metrics"][f"{name}.{part}.elements"] == own[0]["elements"]
    assert rows["decision_tree", "parameters", 0.0]["agreement"] > 0.9
    assert rows["default", "program", 0.5]["agreement"] < rows["default", "program", 0.0]["agreement"]
    assert "results.json" in printed
    page = only(folder, "report.html").read_text()
    assert page.count("data:image/png;base64,") == 1
    assert [path.name for path in folder.rglob("*.png")] == ["robustness.png"]
    assert "Shares that are survived" in page
    assert "how much there is to damage" in page
    assert "Sign flipped, the largest share that leaves 95% of the agreement: <code>default</code> program 0%" in page


def test_the_same_seed_gives_the_same_results_in_other_batches(finished: tuple[Path, str], tmp_path: Path) -> None:
    config = settings(*TINY, "robots=3")
    again = run(study, config, tmp_path, Console(file=io.StringIO()))
    before = results(finished[0])
    assert again.table == before["table"]
    assert again.metrics == before["metrics"]
    # The page can be drawn from the files alone.
    assert load(tmp_path)[1].table == again.table


def test_a_wrong_setting_is_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")  # which the command changes
    with pytest.raises(SystemExit) as exit_:
        main(["robustness", "damages=[melt]"])
    assert exit_.value.code == 1
    assert capsys.readouterr().err == "robustness: damages: there is no 'melt'; choose from flip, zero, noise\n"
    assert not list(tmp_path.rglob("results.json"))
