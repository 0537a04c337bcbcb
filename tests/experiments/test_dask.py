"""The cells of a study on a Dask cluster: a worker is killed, and the results are those of one process."""

import os
import signal
import socket
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, cast

import joblib
import pandas as pd
import pytest
from counting import study
from kits import composed
from rich.console import Console
from test_submitit_local import importable, wait_for

pytest.importorskip("distributed", reason="needs the extra cluster")
from dask import config as dask_config
from dask.distributed import Client, LocalCluster

from experiments.kit.command import run_study
from experiments.kit.pool import measured, processes
from experiments.kit.run import run


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch) -> Iterator[LocalCluster]:
    importable(monkeypatch)
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50) as made:
        yield cast(LocalCluster, made)


@pytest.mark.slow
def test_a_study_goes_on_when_a_worker_of_the_cluster_is_killed(
    cluster: LocalCluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = composed(study, "repeats=6", "workers=1", "drawable=false")
    alone = run(study, settings, tmp_path / "alone", Console(quiet=True))
    log = tmp_path / "log"
    log.touch()

    def pids() -> list[int]:
        return [int(line.split()[1]) for line in log.read_text().splitlines()]

    def kill_one() -> None:
        wait_for(lambda: len(pids()) > 2)
        os.kill(pids()[-1], signal.SIGKILL)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DASK_SCHEDULER_ADDRESS", cluster.scheduler_address)
    with ThreadPoolExecutor() as threads:
        killing = threads.submit(kill_one)
        run_study(study, ["repeats=6", "seconds=0.4", "drawable=false", f"log={log}"])
        killing.result()
    assert len(pids()) in (13, 14)  # the cell that was killed, and one whose result was on its way, perhaps
    assert os.getpid() not in pids()
    (records,) = (tmp_path / "outputs").rglob("records.parquet")
    assert pd.read_parquet(records).equals(alone.records)

    # From Python: a cell starts no pool of its own on a worker.
    with Client(cluster), joblib.parallel_config(backend="dask"):
        assert sorted(measured(pool_within, None, [3, 5], workers=2)) == [(0, (3, True)), (1, (5, True))]

    # A cell that kills its workers, which share something large, ends it; no cell is left behind.
    client: Any = Client(cluster)
    with client, joblib.parallel_config(backend="dask"):
        with pytest.raises(ChildProcessError, match="cell 1 killed each worker that began it"):
            list(measured(deadly, bytes(10**6), range(20), workers=2))
        wait_for(lambda: not any(client.processing().values()))


def deadly(material: bytes, cell: int) -> int:
    if cell == 1:
        os._exit(1)
    time.sleep(0.2)
    return len(material)


def pool_within(material: None, cell: int) -> tuple[int, bool]:
    with processes(2) as executor:
        return cell, executor is None


def test_a_cluster_that_cannot_work_is_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    importable(monkeypatch)
    monkeypatch.chdir(tmp_path)
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        monkeypatch.setenv("DASK_SCHEDULER_ADDRESS", f"tcp://127.0.0.1:{nobody.getsockname()[1]}")
        with dask_config.set({"distributed.comm.timeouts.connect": "1s"}), pytest.raises(SystemExit) as exit_:
            run_study(study, ["repeats=1"])
    assert exit_.value.code == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "there is no Dask scheduler at tcp://127.0.0.1:" in line
    with (
        LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=":0") as threaded,
        Client(threaded),
        joblib.parallel_config(backend="dask"),
        pytest.raises(ValueError, match="with one thread each"),
    ):
        list(measured(pool_within, None, [3], workers=2))
