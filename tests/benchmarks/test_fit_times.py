"""The benchmark of fits: ours and AdaptHD learn the same folds in turns, and the table has seconds and accuracy."""

import sys
from pathlib import Path

import pytest
import torch

from behaviours import BehaviourClassifier
from benchmarks import fit_times
from benchmarks.__main__ import main
from benchmarks.report import fill
from experiments.models.classifiers import CLASSIFIERS


@pytest.fixture(autouse=True)
def few_epochs(monkeypatch: pytest.MonkeyPatch) -> None:
    quick = lambda dim, epochs, seed: BehaviourClassifier(dim, epochs=1, random_state=seed)  # noqa: E731
    monkeypatch.setitem(CLASSIFIERS, "one_hypervector", quick)


def test_models_alternate_fold_by_fold() -> None:
    threads = torch.get_num_threads()
    found = fit_times.fits(sensors=2, dim=50, folds=2, epochs=1, threads=1)
    assert [(row["model"], row["fold"]) for row in found] == [
        (model, fold) for fold in (0, 1) for model in ("one_hypervector", "torchhd_adapthd")
    ]
    assert all(row["fit_s"] > 0 and 0.3 < row["accuracy"] < 1 and row["rows"] in (1092, 1091) for row in found)
    assert torch.get_num_threads() == threads


def test_the_row_sums_seconds_and_averages_accuracies(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    fits = [
        {"model": model, "fit_s": seconds, "accuracy": share}
        for model, seconds, share in (
            ("one_hypervector", 1.0, 0.8), ("torchhd_adapthd", 5.0, 0.6),
            ("one_hypervector", 2.0, 1.0), ("torchhd_adapthd", 7.0, 0.7),
        )
    ]  # fmt: skip
    monkeypatch.setattr(fit_times, "fits", lambda *_: fits)
    (row,) = fit_times.rows(threads=2)
    assert (row["ours_s"], row["peer_s"], row["ratio"]) == (3, 12, 4)
    assert (row["ours_accuracy"], row["peer_accuracy"]) == pytest.approx((0.9, 0.65))
    page = tmp_path / "benchmarks.md"
    page.write_text((Path(__file__).parents[2] / "docs" / "benchmarks.md").read_text())
    fill(page, [{**row, "machine": "some CPU", "memory": "returned"}])
    line = "| fit wall following | 24 sensors, 5 folds, d=4000 | 2 | 3.00 s | 0.900 | torchhd AdaptHD, epochs: 120 |"
    assert f"{line} 12.00 s | 0.650 | 4.0 |" in page.read_text()


def test_the_command_runs_it_by_name(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("benchmarks.__main__.isolated", lambda work, *given, memory: work(*given))
    monkeypatch.setattr(sys, "argv", ["benchmarks", "--only", "fit_times", "--small", "--threads", "1"])
    main()
    printed = capsys.readouterr().out
    assert "2 sensors, 2 folds, d=50" in printed
    assert "their accuracy" in printed
