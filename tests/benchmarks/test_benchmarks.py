"""The benchmarks at tiny sizes: everything runs, ours and peers answer the same, and rows say what was measured."""

import json
import math
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import torch

from benchmarks import corral
from benchmarks.__main__ import main
from benchmarks.harness import INPUTS, Case, Floor, time_case
from benchmarks.isolated import MEMORY, isolated
from benchmarks.report import fill

ROOT = Path(__file__).parents[2]
COLUMNS = {
    "work", "shape", "threads", "ours_s", "peer", "peer_s", "ratio", "floor", "floor_s", "of_floor", "device",
    "machine", "memory",
}  # fmt: skip


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Works that are measured one after the other here, since a process for each takes seconds to begin."""
    monkeypatch.setattr("benchmarks.__main__.isolated", lambda work, *arguments, memory: work(*arguments))
    monkeypatch.setattr("benchmarks.floors._SIDE", {"cpu": 64})
    yield
    torch.compiler.reset()
    corral.samples.cache_clear()


@pytest.mark.slow
@pytest.mark.usefixtures("in_this_process")
@pytest.mark.filterwarnings("ignore:`torch.jit:DeprecationWarning")  # of PyTorch's own parts
def test_the_command_measures_every_work(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    # Each case compares its answers with the peers' before it is timed.
    options = ["--small", "--repeats", "1", "--threads", "1"]
    files = ["--out", str(tmp_path / "rows.json"), "--docs", str(tmp_path)]
    page = (ROOT / "docs" / "benchmarks.md").read_text()
    (tmp_path / "benchmarks.md").write_text(page)
    monkeypatch.setattr(sys, "argv", ["benchmarks", *options, *files])
    main()
    printed = capsys.readouterr().out
    rows: list[dict[str, Any]] = json.loads((tmp_path / "rows.json").read_text())
    compared = [row for row in rows if "exponent" not in row]
    works = {row["work"].split(",")[0] for row in compared}
    assert works == {
        "record encoding", "clean-up", "protect", "random hypervectors", "Algorithm 1", "Algorithm 2", "robot step",
        "import beyond torch", "sparse codes", "digits",
    }  # fmt: skip
    for row in compared:
        assert set(row) >= COLUMNS
        assert row["ratio"] == row["peer_s"] / row["ours_s"]
        assert row["floor"] is None or row["of_floor"] == row["ours_s"] / row["floor_s"]
        assert row["work"] in printed or "…" in printed
    kept = {row["work"].split(",")[0] for row in compared if row["memory"] == "kept"}
    assert kept == {"record encoding", "protect", "random hypervectors", "Algorithm 2", "digits"}
    for row in rows:
        if "exponent" in row:
            slope = math.log(row["seconds"][1] / row["seconds"][0]) / math.log(row["sizes"][1] / row["sizes"][0])
            assert row["exponent"] == pytest.approx(slope)
    assert (tmp_path / "benchmarks.png").read_bytes().startswith(b"\x89PNG")
    filled = (tmp_path / "benchmarks.md").read_text()
    for row in rows:
        assert f"| {row['work']} | {row['shape']} |" in filled
    # What stands around the tables is as it was.
    assert filled.startswith(page.split("<!-- table: begin -->")[0])
    assert filled.endswith(page.split("<!-- growth: end -->")[1])


def test_a_gpu_that_is_not_there_is_said_at_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    monkeypatch.setattr(sys, "argv", ["benchmarks", "--device", "cuda"])
    with pytest.raises(SystemExit):
        main()
    assert "finds no CUDA device here" in capsys.readouterr().err


def test_a_page_that_is_not_there_is_said_at_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(sys, "argv", ["benchmarks", "--docs", str(tmp_path)])
    with pytest.raises(SystemExit):
        main()
    assert f"{tmp_path} has no benchmarks.md" in capsys.readouterr().err


@pytest.mark.usefixtures("in_this_process")
def test_a_part_is_printed_and_leaves_the_files_of_the_whole(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "benchmarks.md").write_text("as it was")
    (tmp_path / "benchmarks").mkdir()
    monkeypatch.setattr("benchmarks.__main__.FOLDER", tmp_path / "benchmarks")
    monkeypatch.setattr(sys, "argv", ["benchmarks", "--only", "random", "--small", "--repeats", "1", "--threads", "1"])
    main()
    assert "torchhd.random" in capsys.readouterr().out
    files = [path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file()]
    assert files == [Path("docs", "benchmarks.md")]
    assert (tmp_path / "docs" / "benchmarks.md").read_text() == "as it was"


def test_a_gpu_has_tables_of_its_own(tmp_path: Path) -> None:
    page = tmp_path / "benchmarks.md"
    page.write_text((ROOT / "docs" / "benchmarks.md").read_text())
    row = {
        "work": "w", "shape": "s", "threads": 1, "ours_s": 2e-3, "peer": "p", "peer_s": 8e-3, "ratio": 4.0,
        "floor": "fill", "floor_s": 1e-3, "of_floor": 2.0, "device": "cuda",
        "machine": "some GPU", "memory": "returned",
    }  # fmt: skip
    grown = {**row, "work": "g", "exponent": 1.0, "exponent_at_the_top": 1.5}
    before = page.read_text()
    fill(page, [row, grown])
    filled = page.read_text()
    assert "some GPU:" in filled
    assert "| w | s | 1 | 2.00 ms | p | 8.00 ms | 4.0 | fill | 2.0 |" in filled
    assert "| g | s | 2.00 ms | 1.00 | 1.50 |" in filled
    assert filled.startswith(before.split("<!-- table, cuda: begin -->")[0])


def test_a_work_has_a_process_and_its_memory_of_its_own() -> None:
    (variable, *_) = MEMORY["kept"]
    assert variable not in os.environ
    assert isolated(os.getenv, variable, memory="kept") == MEMORY["kept"][variable]
    assert isolated(os.getenv, variable) is None
    assert isolated(os.getpid) != os.getpid()
    assert variable not in os.environ
    with pytest.raises(ZeroDivisionError):
        isolated(divmod, 1, 0, memory="kept")
    assert variable not in os.environ


def test_calls_alternate_and_inputs_rotate() -> None:
    order: list[tuple[str, int]] = []
    case = Case(
        "w",
        "s",
        lambda index: order.append(("ours", index)),
        {"a": lambda index: order.append(("a", index)), "b": lambda index: order.append(("b", index))},
        check=lambda: order.append(("check", 0)),
        floor=Floor("f", lambda index: order.append(("floor", index)), share=2.0),
    )
    rows = time_case(case, threads=1, repeats=INPUTS, device="cpu")
    names = [name for name, _ in order]
    assert names[0] == "check"
    # Once to warm up; then each is called untimed and timed, in turns.
    turns = ["ours", "a", "b", "floor"]
    assert names[1:5] == turns
    assert names[5:] == [name for _ in range(INPUTS) for turn in turns for name in (turn, turn)]
    assert {index for name, index in order if name == "ours"} == set(range(INPUTS))
    assert [row["peer"] for row in rows] == ["a", "b"]


def test_an_answer_that_differs_stops_the_benchmark() -> None:
    def differs() -> None:
        assert torch.equal(torch.zeros(1), torch.ones(1))

    called: list[int] = []
    case = Case("w", "s", called.append, {}, check=differs)
    before = torch.get_num_threads()
    with pytest.raises(AssertionError):
        time_case(case, threads=1, repeats=1, device="cpu")
    assert not called
    assert torch.get_num_threads() == before
