"""A sweep on a Slurm that the test starts: a job is cancelled, a node drained, and the same command goes on."""

import re
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime, timedelta
from pathlib import Path

import pytest
from commands import output_of
from counting import study
from slurm import ENDED, NODES, missing, running_slurm, slurm, states
from test_submitit_local import importable, measured, wait_for

from experiments.kit.command import run_study

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())

JOBS, CELLS = 12, 12


@pytest.mark.slow
def test_a_sweep_goes_on_after_a_job_was_cancelled_and_a_node_drained(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    log, folder = tmp_path / "log", tmp_path / "outputs" / "counting" / "sweep"
    arguments = [
        "--multirun", "hydra/launcher=submitit_slurm", f"seed=range({JOBS})", "names=[a]", f"repeats={CELLS}",
        "seconds=0.75", "workers=1", "log=log", "drawable=false",
    ]  # fmt: skip
    importable(monkeypatch)
    monkeypatch.chdir(tmp_path)
    with running_slurm(tmp_path / "slurm") as environment, ThreadPoolExecutor() as threads:
        monkeypatch.setenv("SLURM_CONF", environment["SLURM_CONF"])

        def disturb() -> tuple[int, str]:
            try:
                wait_for(lambda: bool(measured(folder)))
            except AssertionError:
                slurm(environment, "scancel", "--user", "root")  # or the command would wait for ever
                raise
            seed = min(measured(folder))
            (array,) = {one.split("_")[0] for one in slurm(environment, "squeue", "--noheader", "--format=%F").split()}
            slurm(environment, "scancel", f"{array}_{seed}")
            slurm(environment, "scontrol", "update", f"nodename={NODES[1]}", "state=drain", "reason=test")
            assert states(environment)[1] in ("draining", "drained")
            return seed, (datetime.now() + timedelta(seconds=1)).isoformat()

        disturbing = threads.submit(disturb)
        with pytest.raises(SystemExit) as exit_:
            run_study(study, arguments)
        cancelled, drained = disturbing.result()
        wait_for(lambda: states(environment) == ["idle", "drained"], 60)

        # All other jobs have finished. None began on the drained node.
        assert exit_.value.code == 1
        (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("counting: ")]
        assert re.search(rf"1 of {JOBS} jobs ended without a result \(\d+_{cancelled};", line)
        found = measured(folder)
        assert 0 < found.pop(cancelled) < CELLS
        assert found == dict.fromkeys(set(range(JOBS)) - {cancelled}, CELLS)
        ended = (tmp_path / "slurm" / ENDED).read_text().splitlines()
        assert len(ended) == JOBS
        assert sum("JobState=CANCELLED" in one for one in ended) == 1
        later = [one for one in ended if re.findall(r"StartTime=(\S+)", one) > [drained]]
        assert later
        assert all(f"NodeList={NODES[0]} " in one for one in later)
        printed = output_of(tmp_path, "collect", str(folder))
        (missed,) = [one for one in printed.splitlines() if "unfinished" in one]
        assert f"seed={cancelled}" in missed

        # The node comes back, and the same command measures what is missing.
        slurm(environment, "scontrol", "update", f"nodename={NODES[1]}", "state=resume")
        lacked = CELLS - measured(folder)[cancelled]
        log.write_text("")
        run_study(study, arguments)
        assert len(log.read_text().splitlines()) == lacked
        assert measured(folder) == dict.fromkeys(range(JOBS), CELLS)
        assert "unfinished" not in output_of(tmp_path, "collect", str(folder))


@pytest.mark.slow
def test_what_slurm_refuses_or_holds_is_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("experiments.kit.submitit_jobs.QUEUE_S", 1.0)
    importable(monkeypatch)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["torchvsa"])
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")
    arguments = ["--multirun", "hydra/launcher=submitit_slurm", "seed=0,1", "names=[a]", "repeats=1", "workers=1"]
    with running_slurm(tmp_path / "slurm") as environment, ThreadPoolExecutor() as threads:
        monkeypatch.setenv("SLURM_CONF", environment["SLURM_CONF"])
        with pytest.raises(SystemExit) as exit_:
            run_study(study, [*arguments, "hydra.launcher.partition=none"])
        assert exit_.value.code == 1
        (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("counting: ")]
        assert "invalid partition specified: none" in line

        def release() -> None:
            try:
                wait_for(lambda: "JobHeldUser" in slurm(environment, "squeue", "--noheader", "--format=%r"))
            except AssertionError:
                slurm(environment, "scancel", "--user", "root")  # or the command would wait for ever
                raise
            time.sleep(4)  # in which the command reads the queue more than once
            (array,) = set(slurm(environment, "squeue", "--noheader", "--format=%F").split())
            slurm(environment, "scontrol", "release", array)

        releasing = threads.submit(release)
        run_study(study, [*arguments, "+hydra.launcher.additional_parameters.hold=true"])
        releasing.result()
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "JobHeldUser" in line]
    assert re.match(r"\d+_0, \d+_1 in Slurm's queue: JobHeldUser; ", line)
    assert measured(tmp_path / "outputs" / "counting" / "sweep") == {0: 1, 1: 1}
