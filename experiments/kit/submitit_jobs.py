"""Sweeps whose jobs submitit starts, on this machine or on Slurm: waited for to the last, and told in one line.

submitit raises what the first dead job left and forgets the others, asks Slurm's accounting, which not every cluster
has, and leaves the jobs of this machine behind when the command ends.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import submitit

from experiments.kit.signals import end_without, ended_by_signals, without_interrupts

Job = submitit.Job[Any]

QUEUE_S = 10.0
"""How often Slurm's queue is read. A job that is in it at neither of two readings, and left no result, is dead."""
USUAL = {"", "None", "Resources", "Priority", "JobArrayTaskLimit"}
"""Why jobs wait that will run without anybody doing something."""


@contextmanager
def waited_for() -> Iterator[None]:
    """Within this context, Hydra's launchers for submitit use `Executor`."""
    before = submitit.AutoExecutor
    submitit.AutoExecutor = Executor
    try:
        yield
    finally:
        submitit.AutoExecutor = before


class Executor(submitit.AutoExecutor):
    """Submits jobs, and returns them when all have ended.

    Raises `ChildProcessError`, naming job and log, if one ended without a result.
    """

    def __init__(self, folder: str, cluster: str, **parameters: Any) -> None:
        self._local = cluster == "local"
        try:
            super().__init__(folder, cluster=cluster, **parameters)
        except RuntimeError as error:
            raise OSError("hydra/launcher=submitit_slurm needs Slurm's commands: there is no sbatch or srun") from error

    def map_array(self, fn: Callable[..., Any], *iterable: Iterable[Any]) -> list[Job]:
        """Submit a job for each combination of arguments, and wait for all of them."""
        if self._local:
            with without_interrupts():
                jobs = super().map_array(_OfThisCommand(fn), *iterable)
        else:
            jobs = super().map_array(fn, *iterable)
        try:
            _wait_here(jobs) if self._local else _wait_for_queue(jobs)
        except BaseException:
            if self._local:
                _end(jobs)
            else:
                array = jobs[0].job_id.split("_")[0]
                print(f"jobs {array} stay in Slurm's queue; scancel {array} ends them", file=sys.stderr)
            raise
        _refuse_dead(jobs)
        return jobs


class _OfThisCommand:
    """A job on this machine: it ends with the command that started it, and when it is asked to."""

    def __init__(self, job: Any) -> None:
        self.job, self.command = job, os.getpid()

    def __call__(self, *arguments: Any) -> Any:
        end_without(self.command)
        with ended_by_signals():  # submitit lets a job ignore SIGTERM
            return self.job(*arguments)

    def checkpoint(self, *arguments: Any) -> submitit.helpers.DelayedSubmission:
        """What submitit starts again after a time limit."""
        return submitit.helpers.DelayedSubmission(self, *arguments)


def _wait_here(jobs: Sequence[Job]) -> None:
    while not all(job.done() for job in jobs):
        time.sleep(0.2)


def _wait_for_queue(jobs: Sequence[Job]) -> None:
    waiting, absent, told, read = list(jobs), set[str](), set[str](), time.monotonic()
    while waiting := [job for job in waiting if not _has_result(job)]:
        if time.monotonic() - read > QUEUE_S:
            queue, read = _queue(), time.monotonic()
            if queue is not None:
                names = {job.job_id for job in waiting}
                gone = names - queue.keys()
                waiting = [job for job in waiting if job.job_id not in gone & absent]
                absent = gone
                told |= _told({name: queue[name] for name in names - gone}, told)
        time.sleep(0.5)


def _told(reasons: Mapping[str, str], before: set[str]) -> set[str]:
    """Say for which reasons jobs wait, other than that others come first and but for those told `before`."""
    new = set(reasons.values()) - USUAL - before
    for reason in sorted(new):
        names = ", ".join(sorted(name for name, why in reasons.items() if why == reason))
        print(f"{names} in Slurm's queue: {reason}; scancel ends jobs that cannot start", file=sys.stderr)
    return new


def _queue() -> dict[str, str] | None:
    """The jobs in Slurm's queue, `array_task`, and why they do not run; None if Slurm does not answer."""
    command = ["squeue", "--me", "--noheader", "--array", "--format=%i %r"]
    try:
        found = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return {
        name: reason.strip() for name, _, reason in (line.strip().partition(" ") for line in found.stdout.splitlines())
    }


def _has_result(job: Job) -> bool:
    with suppress(OSError):  # a network's file system then looks again
        os.listdir(job.paths.folder)
    return job.paths.result_pickle.exists()


def _end(jobs: Sequence[Job]) -> None:
    """Ask the jobs of this machine to end, and give them a moment."""
    for job in jobs:
        if not job.done():
            os.kill(int(job.job_id), signal.SIGTERM)
    deadline = time.monotonic() + 5
    while time.monotonic() < deadline and not all(job.done() for job in jobs):
        time.sleep(0.1)


def _refuse_dead(jobs: Sequence[Job]) -> None:
    dead = [job for job in jobs if not _has_result(job)]
    if dead:
        names = ", ".join(job.job_id for job in dead)
        raise ChildProcessError(
            f"{len(dead)} of {len(jobs)} jobs ended without a result ({names}; the first one's log is "
            f"{dead[0].paths.stderr}); the same command goes on from here"
        )
    for job in jobs:
        if error := job.exception():
            trace = re.search(r"-{10,}\n(.*?)\n-{10,}", str(error), re.DOTALL)
            why = (trace[1] if trace else str(error)).strip().splitlines()[-1]
            raise ChildProcessError(f"job {job.job_id} failed: {why}; its log is {job.paths.stderr}")
