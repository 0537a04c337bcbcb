"""A sweep whose jobs submitit starts on this machine: one dies, the command dies, and the same command goes on."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from commands import only, output_of
from counting import study
from test_kit_command import command, running

pytest.importorskip("submitit", reason="needs the extra cluster")

from experiments.kit.command import run_study
from experiments.kit.submitit_jobs import Executor

CELLS = 8


def wait_for(reached: Callable[[], bool], seconds: float = 120) -> None:
    deadline = time.monotonic() + seconds
    while not reached():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.1)


def importable(monkeypatch: pytest.MonkeyPatch) -> None:
    """Jobs find the study that counts; the command is as a user types it."""
    monkeypatch.setenv("PYTHONPATH", f"{Path(__file__).parents[2]}{os.pathsep}{Path(__file__).parent}")
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")
    monkeypatch.setattr(sys, "argv", ["torchvsa"])


def measured(folder: Path) -> dict[int, int]:
    """How many cells the job of each seed below a folder has measured."""
    found: dict[int, int] = {}
    for path in folder.rglob("cells.jsonl"):
        found[json.loads(path.with_name("run.json").read_text())["config"]["seed"]] = len(path.read_text().splitlines())
    return found


@pytest.mark.slow
def test_a_sweep_goes_on_after_the_command_and_a_job_were_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "log"
    log.touch()
    arguments = [
        "--multirun", "hydra/launcher=submitit_local", "seed=0,1", "names=[a]", f"repeats={CELLS}", "seconds=0.4",
        "workers=1", f"log={log}", "drawable=false",
    ]  # fmt: skip

    def pids() -> set[int]:
        return {int(line.split()[1]) for line in log.read_text().splitlines()}

    # The command is killed; its jobs end with it.
    first = command(tmp_path, *arguments)
    wait_for(lambda: bool(measured(tmp_path)))
    first.kill()
    first.communicate()
    jobs = pids()
    wait_for(lambda: not any(map(running, jobs)), 10)
    assert sum(measured(tmp_path).values()) < 2 * CELLS

    # One job is ended, by a signal that submitit lets it ignore. The other one finishes, and the command says so.
    monkeypatch.chdir(tmp_path)
    importable(monkeypatch)

    def under_way() -> set[int]:
        """Jobs at a second cell: what they had measured before is written."""
        lines = [int(line.split()[1]) for line in log.read_text().splitlines()]
        return {job for job in lines if job not in jobs and lines.count(job) > 1}

    def end_one() -> None:
        wait_for(lambda: bool(under_way()))
        os.kill(min(under_way()), signal.SIGTERM)

    with ThreadPoolExecutor() as threads:
        ending = threads.submit(end_one)
        with pytest.raises(SystemExit) as exit_:
            run_study(study, arguments)
        ending.result()
    assert exit_.value.code == 1
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("counting: ")]
    assert "1 of 2 jobs ended without a result" in line
    assert "the same command goes on from here" in line
    assert len(list(tmp_path.rglob("results.json"))) == 1
    unfinished = sum(CELLS - count for count in measured(tmp_path).values())
    assert 0 < unfinished < CELLS
    (why,) = [path for path in tmp_path.rglob("*_log.err") if "ended by SIGTERM" in path.read_text()]
    assert str(why.parent) in line

    # The same command measures what is missing, and nothing else.
    log.write_text("")
    run_study(study, arguments)
    assert len(log.read_text().splitlines()) == unfinished
    assert measured(tmp_path) == {0: CELLS, 1: CELLS}

    printed = output_of(tmp_path, "collect", "outputs/counting/sweep")
    assert "not begun" not in printed
    assert "unfinished" not in printed
    assert only(tmp_path, "rows.parquet").is_file()


@pytest.mark.slow
def test_jobs_end_with_a_command_that_a_signal_ends(tmp_path: Path) -> None:
    code = (
        "import sys, time\n"
        "from experiments.kit.signals import ended_by_signals\n"
        "from experiments.kit.submitit_jobs import Executor\n"
        "def job(path):\n"
        "    import os, pathlib, time\n"
        "    pathlib.Path(path).write_text(str(os.getpid()))\n"
        "    time.sleep(600)\n"
        "with ended_by_signals():\n"
        "    Executor(sys.argv[1] + '/%j', 'local').map_array(job, [sys.argv[1] + '/pid'])\n"
    )
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(Path(__file__).parents[2])}
    sweep = subprocess.Popen([sys.executable, "-c", code, tmp_path], env=environment, stderr=subprocess.PIPE, text=True)
    wait_for(lambda: (tmp_path / "pid").exists() and bool((tmp_path / "pid").read_text()))
    sweep.terminate()
    _, said = sweep.communicate(timeout=30)
    assert sweep.returncode == 143
    assert said.splitlines()[0] == "ended by SIGTERM; the same command goes on from here"
    assert not running(int((tmp_path / "pid").read_text()))


def test_a_job_that_cannot_begin_is_told_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ChildProcessError) as error:
        Executor(str(tmp_path / "%j"), "local").map_array(_Unreadable(), [1])
    assert "failed: ValueError: invalid literal for int() with base 10: 'not here'; its log is" in str(error.value)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(OSError, match="there is no sbatch or srun"):
        Executor(str(tmp_path / "%j"), "slurm")


class _Unreadable:
    def __call__(self, argument: int) -> None: ...

    def __reduce__(self) -> tuple[object, ...]:
        return int, ("not here",)
