"""A study as a command: one line for what the user can mend, sweeps, and no process left behind."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from commands import only, results
from counting import study

from experiments.kit.command import errors_in_one_line, run_study
from experiments.kit.pool import measured, processes
from experiments.kit.signals import ended_by_signals
from experiments.main import main

COUNTING = Path(__file__).with_name("counting.py")


def command(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(Path(__file__).parents[2])}
    # A shell's background jobs, and so the tests in one, inherit that Ctrl-C is ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return subprocess.Popen(
            [sys.executable, COUNTING, *arguments], cwd=folder, env=environment, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True, start_new_session=True,
        )  # fmt: skip
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.fixture
def refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """`refused(*arguments)`: the one line with which the command refuses them."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")  # which the command changes
    monkeypatch.setattr(sys, "argv", ["torchvsa"])

    def line(*arguments: str) -> str:
        with pytest.raises(SystemExit) as exit_:
            run_study(study, arguments)
        assert exit_.value.code == 1
        (found,) = capsys.readouterr().err.splitlines()
        assert not list(tmp_path.rglob("results.json"))
        return found

    return line


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("repeats=abc", "repeats=abc: expected a whole number"),
        ("repeats=1e3", "repeats=1000.0: expected a whole number"),
        ("repeats=", "repeats=: expected a whole number"),
        ("share=x", "share=x: expected a number"),
        ("drawable=maybe", "drawable=maybe: expected true or false"),
        ("names=a", "names: expected a list, e.g. names=[a,b]"),
        ("repeats=1,2", "a list needs brackets, repeats=[1,2]; a job for each needs --multirun"),
        ("repaets=1", "there is no setting 'repaets'; did you mean repeats?"),
        ("zzz=1", "there is no setting 'zzz'; choose from seed, workers, fresh, rule"),
        ("rule=nonsense", "there is no rule 'nonsense'; choose from error_driven, evident, gradient, "),
        ("vsa=hrr", "there is no setting 'vsa'; --help lists those of this study"),
        ("+vsa=hrr", "there is no setting 'vsa'"),
        ("rule.epoch=3", "there is no setting 'rule.epoch'; did you mean rule.epochs?"),
        ("experiment=nonsense", "there is no experiment 'nonsense'; choose from printed, quick"),
        ("+experiment=quick", "experiment"),
        ("hydra/launcher=nonsense", "there is no hydra/launcher 'nonsense'; choose from basic, joblib"),
        ("hydra.run.dir=/dev/null/results", "/dev/null/results"),
        ("+hydra.callbacks.x._target_=os.system", "could run code"),
        ("hydra.launcher._target_=os.system", "could run code"),
        ("+hydra.job_logging.handlers.x.class=os.system", "of Python's logging, settings change nothing but levels"),
        ("hydra.searchpath=[pkg://os]", "could run code"),
        ("--config-name=other", "a study has its own config"),
        ("--config-dir=mine", "mine/experiment/evil.yaml: _target_ could run code"),
        ("--config-dir=lines", "lines/cluster.yaml: setup could run code"),
    ],
)
def test_one_line_names_what_is_wrong(refused: Callable[..., str], tmp_path: Path, arguments: str, words: str) -> None:
    (tmp_path / "mine" / "experiment").mkdir(parents=True)
    (tmp_path / "mine" / "experiment" / "evil.yaml").write_text("hydra: {launcher: {_target_: os.system}}\n")
    (tmp_path / "lines").mkdir()
    (tmp_path / "lines" / "cluster.yaml").write_text("hydra: {launcher: {setup: [rm -r x]}}\n")
    line = refused(*arguments.split())
    assert line.startswith("counting: ")
    assert words in line


def test_presets_of_the_users_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["torchvsa"])
    (tmp_path / "mine" / "experiment").mkdir(parents=True)
    (tmp_path / "mine" / "experiment" / "tiny.yaml").write_text("# @package _global_\nnames: [c]\nrepeats: 1\n")
    run_study(study, ["--config-dir", "mine", "experiment=tiny", "workers=1"])
    assert results(tmp_path)["config"]["names"] == ["c"]


def test_help_lists_settings_options_and_presets(capsys: pytest.CaptureFixture[str]) -> None:
    run_study(study, ["--help"])
    printed = capsys.readouterr().out
    for words in ("what is counted", "a, b, c", "a number from 1 to 100", "error_driven", "margin", "experiment=quick"):
        assert words in printed


def test_the_main_command_lists_studies_and_names_what_is_not_there(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")
    main([])
    printed = capsys.readouterr().out
    assert "capacity" in printed
    assert "draw FOLDER" in printed
    for arguments, words in (
        (["nonsense"], "no study 'nonsense'"),
        (["draw"], "required: folder"),
        (["draw", "x"], "x"),
    ):
        with pytest.raises(SystemExit) as exit_:
            main(arguments)
        assert exit_.value.code == 1
        (line,) = capsys.readouterr().err.splitlines()
        assert words in line


_kept: list[bytearray] = []


def growing(material: None, cell: int) -> int:
    """Keep more memory than joblib lets a process grow by, long enough for it to look."""
    _kept.append(bytearray(b"x") * 400_000_000)
    time.sleep(1.1)
    return os.getpid()


@pytest.mark.slow
def test_a_process_that_grows_is_replaced_without_a_warning(tmp_path: Path) -> None:
    code = (
        "import sys, warnings; sys.path.insert(0, sys.argv[1]); warnings.simplefilter('always')\n"
        "from test_kit_command import growing, measured\n"
        "found = dict(measured(growing, None, range(8), 2))\n"
        "print(sorted(found), len(set(found.values())))"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    run = [sys.executable, "-c", code, str(Path(__file__).parent)]
    done = subprocess.run(run, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True, timeout=120)
    cells, count = done.stdout.rsplit(" ", 1)
    assert cells == str(list(range(8)))
    assert int(count) > 2
    assert "worker" not in done.stderr


@pytest.mark.slow
def test_a_sweep_of_four_jobs_two_at_a_time_and_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = tmp_path / "log"
    arguments = (
        "--multirun", "hydra/launcher=joblib", "hydra.launcher.n_jobs=2", "seed=0,1,2,3", "repeats=1",
        f"log={log}", "workers=2", "seconds=0.5",
    )  # fmt: skip
    sweep = command(tmp_path, *arguments)
    _, said = sweep.communicate(timeout=300)
    assert sweep.returncode == 0, said
    found = [json.loads(path.read_text()) for path in tmp_path.rglob("results.json")]
    assert sorted(content["seed"] for content in found) == [0, 1, 2, 3]
    lines = log.read_text().split()
    assert len(lines[::2]) == 8
    assert len(set(lines[1::2])) == 2  # processes
    # What is there already does not depend on the launcher, and one process starts sooner.
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["torchvsa"])
    run_study(study, [argument for argument in arguments if "launcher" not in argument])
    assert log.read_text().split() == lines


def test_a_worker_that_dies_is_told_in_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")
    with pytest.raises(SystemExit) as exit_, errors_in_one_line("counting"):
        list(measured(lambda material, cell: os._exit(3), None, [0, 1], workers=2))
    assert exit_.value.code == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("counting: a worker process died (EXIT(3)")


@pytest.mark.slow
def test_no_job_of_a_sweep_outlives_a_command_that_is_killed(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.touch()
    sweep = command(
        tmp_path, "--multirun", "hydra/launcher=joblib", "hydra.launcher.n_jobs=3", "seed=0,1", "repeats=100",
        "seconds=0.3", f"log={log}",
    )  # fmt: skip
    deadline = time.monotonic() + 120
    while not log.read_text():
        assert time.monotonic() < deadline, "no cell was measured"
        time.sleep(0.1)
    sweep.kill()
    workers = {int(line.split()[1]) for line in log.read_text().splitlines()}
    sweep.communicate(timeout=20)  # which all its processes hold open until they end, the idle third one, too
    assert not any(map(running, workers))


def running(pid: int) -> bool:
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_signal_ends_a_command_as_an_exception_does(
    number: signal.Signals, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    before, cleaned = signal.getsignal(number), []

    def job() -> None:
        with ended_by_signals():
            try:
                os.kill(os.getpid(), number)
                time.sleep(10)
            finally:
                cleaned.append(True)

    with pytest.raises(SystemExit) as exit_:
        job()
    assert exit_.value.code == code
    assert cleaned
    assert f"{number.name}; the same command goes on from here" in capsys.readouterr().err
    assert signal.getsignal(number) == before


def blocked(material: None, cell: int) -> bool:
    return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def test_workers_never_hear_of_an_interrupt_which_they_would_print() -> None:
    assert dict(measured(blocked, None, [0, 1], 2)) == {0: True, 1: True}
    with processes(2) as executor:
        assert executor is not None
        assert executor.submit(blocked, None, 0).result()
    assert not blocked(None, 0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "code", "words"),
    [
        (signal.SIGTERM, 143, "SIGTERM; the same command goes on from here"),
        (signal.SIGKILL, -9, ""),
        (signal.SIGINT, 130, "counting: stopped; the same command goes on from here"),
    ],
)
def test_no_worker_outlives_the_command_and_the_same_command_goes_on(
    tmp_path: Path, number: signal.Signals, code: int, words: str
) -> None:
    log = tmp_path / "log"
    arguments = (f"log={log}", "repeats=30", "seconds=0.3", "names=[a]")
    run = command(tmp_path, *arguments)
    deadline = time.monotonic() + 120
    pids: list[int] = []
    while len(pids) < 5 or len(set(pids)) < 2:
        assert time.monotonic() < deadline, "two workers did not measure"
        time.sleep(0.1)
        pids = [int(line.split()[1]) for line in log.read_text().splitlines()] if log.exists() else []
    workers = set(pids)
    if number == signal.SIGINT:  # as a terminal sends it: to the whole group
        os.killpg(run.pid, number)
    else:
        os.kill(run.pid, number)
    _, said = run.communicate(timeout=60)
    assert run.returncode == code
    assert words in said
    deadline = time.monotonic() + 20
    while any(map(running, workers)):
        assert time.monotonic() < deadline, "a worker is left"
        time.sleep(0.1)
    done = len(only(tmp_path, "cells.jsonl").read_text().splitlines())
    assert 0 < done < 30
    if number != signal.SIGKILL:  # the hardest of them is enough
        return
    log.unlink()
    again = command(tmp_path, *arguments, "workers=1")
    printed, said = again.communicate(timeout=120)
    assert again.returncode == 0, said
    assert f"{done} of 30 cells" in printed
    assert len(log.read_text().splitlines()) == 30 - done
