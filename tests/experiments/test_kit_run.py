"""A run: what is measured once is kept, going on gives the same bits, and a figure that fails costs nothing else."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from counting import Counting, study
from kits import composed
from rich.console import Console

from experiments.kit import Outcome
from experiments.kit.run import draw, load, run


def ran(folder: Path, *overrides: str) -> Outcome:
    with (folder.parent / "said").open("a") as said:
        return run(study, composed(study, "workers=1", *overrides), folder, Console(file=said, width=200))


def measured(log: Path) -> list[str]:
    return [line.split()[0] for line in log.read_text().splitlines()]


def test_what_it_writes(tmp_path: Path) -> None:
    outcome = ran(tmp_path / "run")
    folder = tmp_path / "run"
    content = json.loads((folder / "results.json").read_text())
    assert content["table"] == [{"name": name, "mean": 1.5, "missing": None} for name in "ab"]
    assert content["metrics"] == {"a.mean": 1.5, "a.missing": None, "b.mean": 1.5, "b.missing": None, "most": 2}
    assert content["config"]["names"] == ["a", "b"]
    assert set(content["provenance"]) == {
        "commit", "date", "host", "platform", "cpus", "threads", "command", "versions",
    }  # fmt: skip
    assert (folder / "prepared.txt").read_text() == "yes"
    records = pd.read_parquet(folder / "records.parquet")
    pd.testing.assert_frame_equal(records, outcome.records)
    assert records.to_dict("list") == {
        "name": ["a", "a", "b", "b"], "repeat": [0, 1, 0, 1], "count": [1, 2, 1, 2], "half": [0, 0.5, 0, 0.5],
    }  # fmt: skip
    page = (folder / "report.html").read_text()
    for words in ("It counts to 2.", "How far does a study count?", "By counting.", "over the repeats", "All settings"):
        assert words in page
    assert (folder / "figures" / "counts.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "figures" / "counts.csv").read_text().startswith("name,repeat,count,half\n")


def test_the_same_settings_are_not_measured_again_and_fresh_begins_anew(tmp_path: Path) -> None:
    log = tmp_path / "log"
    first = ran(tmp_path / "run", f"log={log}")
    again = ran(tmp_path / "run", f"log={log}")
    assert measured(log) == ["a0", "a1", "b0", "b1"]
    assert again.provenance == first.provenance
    assert again.metrics == first.metrics
    pd.testing.assert_frame_equal(again.records, first.records)
    assert "fresh=true begins anew" in (tmp_path / "said").read_text()
    ran(tmp_path / "run", f"log={log}", "fresh=true")
    assert measured(log) == ["a0", "a1", "b0", "b1"] * 2


def test_other_settings_are_measured_anew_in_the_same_folder(tmp_path: Path) -> None:
    log = tmp_path / "log"
    ran(tmp_path / "run", f"log={log}")
    ran(tmp_path / "run", f"log={log}", "share=0.3")
    assert measured(log) == ["a0", "a1", "b0", "b1"] * 2


def test_a_run_goes_on_after_a_failure_and_a_torn_line(tmp_path: Path) -> None:
    log, folder = tmp_path / "log", tmp_path / "run"

    def failing() -> Any:
        return replace(composed(study, "workers=1", f"log={log}"), fail_at=1)

    with pytest.raises(RuntimeError, match="cannot be measured"):
        run(study, failing(), folder, Console(quiet=True))
    assert not (folder / "results.json").exists()
    with (folder / "cells.jsonl").open("a") as file:
        file.write('{"key": "torn')
    with pytest.raises(RuntimeError, match="cannot be measured"):
        run(study, failing(), folder, Console(quiet=True))
    assert measured(log) == ["a0", "a1", "a1"]


@pytest.mark.parametrize("left", [0, 1, 3])
def test_going_on_gives_the_same_bits(tmp_path: Path, left: int) -> None:
    whole = ran(tmp_path / "whole", "share=0.3")
    folder = tmp_path / "part"
    folder.mkdir()
    lines = (tmp_path / "whole" / "cells.jsonl").read_text().splitlines(keepends=True)
    (folder / "cells.jsonl").write_text("".join(lines[:left]) + lines[left][:30])
    log = tmp_path / "log"
    log.touch()
    gone_on = ran(folder, "share=0.3")
    assert gone_on.metrics == whole.metrics
    pd.testing.assert_frame_equal(gone_on.records, whole.records)


def test_workers_do_not_matter(tmp_path: Path) -> None:
    log = tmp_path / "log"
    settings = composed(study, "workers=2", f"log={log}", "repeats=5")
    both = run(study, settings, tmp_path / "two", Console(quiet=True))
    pd.testing.assert_frame_equal(both.records, ran(tmp_path / "one", "repeats=5").records)
    assert sorted(measured(log)) == [f"{name}{repeat}" for name in "ab" for repeat in range(5)]


def test_a_figure_that_fails_costs_nothing_else_and_the_page_can_be_drawn_again(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    ran(folder, "drawable=false")
    assert "figure counts could not be drawn: RuntimeError: no ink" in (tmp_path / "said").read_text()
    assert json.loads((folder / "results.json").read_text())["metrics"]["most"] == 2
    assert "could not be drawn" in (folder / "report.html").read_text()
    found, outcome = load(folder)
    assert found is study
    assert isinstance(outcome.settings, Counting)
    outcome.settings.drawable = True
    assert not draw(found, outcome, Console(quiet=True)).failures
    assert "could not be drawn" not in (folder / "report.html").read_text()
