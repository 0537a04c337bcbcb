"""Work spread over processes: joblib's, which end with the process that started them."""

from __future__ import annotations

import hashlib
import os
import pickle
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from functools import lru_cache, partial
from typing import Any

import cloudpickle
import joblib
import numpy as np
import torch
from hydra_plugins.hydra_joblib_launcher import _core
from joblib.executor import get_memmapping_executor
from joblib.parallel import get_active_backend
from numpy.typing import NDArray

from experiments.kit.signals import end_without, without_interrupts

Measure = Callable[[Any, Any], Any]


def measured(measure: Measure, material: object, cells: Sequence[Any], workers: int) -> Iterator[tuple[int, Any]]:
    """`measure(material, cell)` for each cell, with its place in `cells`, as they are done.

    `workers` processes do the work, or those of `joblib.parallel_config`, if one is active: of a Dask cluster, all.
    With one worker, and inside a process of another pool (a sweep's), this process does all of it. Each works with one
    thread. Raises `ValueError` if a worker of Dask's has several threads.
    """
    if workers == 1 or _nested():
        yield from _here(measure, material, cells)
        return
    content = cloudpickle.dumps((measure, material))
    # joblib maps a large array into its workers' memory once, instead of sending it with each cell.
    packed = np.frombuffer(content, dtype=np.uint8)
    digest = hashlib.sha256(content).hexdigest()
    backend: Any = get_active_backend()[0]
    if _name(backend) == "DaskDistributedBackend":
        yield from _on_dask(backend.client, packed, digest, cells)
        return
    tasks = (joblib.delayed(_there)(packed, digest, place, cell) for place, cell in enumerate(cells))
    # Workers of another backend may have other parents.
    watched = {"initializer": _begin, "initargs": (os.getpid(),)} if _name(backend) == "LokyBackend" else {}
    pool: Any = joblib.Parallel(n_jobs=workers, return_as="generator_unordered", **watched)
    with _workers_may_be_replaced():
        with without_interrupts():  # in which the processes start
            found = pool(tasks)
        yield from found


def _on_dask(client: Any, packed: NDArray[np.uint8], digest: str, cells: Sequence[Any]) -> Iterator[tuple[int, Any]]:
    """The same on a Dask cluster, without joblib's queue: that one waits for ever for a cell that kills its worker."""
    from dask.distributed import KilledWorker, as_completed

    if max(client.nthreads().values(), default=1) > 1:
        raise ValueError("a cell needs a process of its own: start Dask's workers with one thread each, --nthreads 1")
    # What a task returns is made again if the worker that has it dies; what is scattered is lost.
    shared = client.submit(_same, packed, pure=False)
    tasks = [client.submit(_there, shared, digest, place, cell, pure=False) for place, cell in enumerate(cells)]
    waiting = {task.key: (task, cell) for task, cell in zip(tasks, cells, strict=True)}
    done = as_completed(tasks)
    del tasks
    try:
        for task in done:
            found = task.result()
            # A result that is kept on a worker would be measured again if that worker dies.
            del waiting[task.key]
            task.release()
            yield found
    except KilledWorker as error:
        cell = waiting[error.task][1]
        raise ChildProcessError(
            f"cell {cell} killed each worker that began it; the workers' logs may say why"
        ) from error
    finally:
        client.cancel([task for task, _ in waiting.values()])


def _same(packed: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return packed


def _name(backend: object) -> str:
    return type(backend).__name__


_here_and_now = threading.local()


def _nested() -> bool:
    """Whether this is a process of another pool of joblib's, or a worker of Dask's that measures."""
    working = getattr(_here_and_now, "working", False)
    return working or bool(getattr(get_active_backend()[0], "nesting_level", 0))


def _here(measure: Measure, material: object, cells: Sequence[Any]) -> Iterator[tuple[int, Any]]:
    threads = torch.get_num_threads()
    for place, cell in enumerate(cells):
        torch.set_num_threads(1)
        try:
            found = measure(material, cell)
        finally:
            torch.set_num_threads(threads)
        yield place, found


def _there(packed: NDArray[np.uint8], digest: str, place: int, cell: Any) -> tuple[int, Any]:
    torch.set_num_threads(1)
    measure, material = _unpacked(_Packed(packed, digest))
    _here_and_now.working = True
    try:
        return place, measure(material, cell)
    finally:
        _here_and_now.working = False


class _Packed:
    """Bytes that are compared by their digest."""

    def __init__(self, content: NDArray[np.uint8], digest: str) -> None:
        self.content, self.digest = content, digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Packed) and other.digest == self.digest


@lru_cache(maxsize=1)
def _unpacked(packed: _Packed) -> tuple[Measure, Any]:
    """What this process's last cells worked with, unpacked once."""
    return pickle.loads(packed.content.tobytes())


@contextmanager
def processes(workers: int) -> Iterator[Executor | None]:
    """A pool of `workers` processes of one thread each, for `sim.rollout`; None where this process works alone."""
    if workers == 1 or _nested():
        yield None
        return
    with without_interrupts():
        # Those of an earlier call are used again. Joblib keeps one pool; one of another class would break its next
        # call.
        executor = get_memmapping_executor(workers, timeout=60, initializer=_begin, initargs=(os.getpid(),))
        executor.submit(int)  # which starts them
    with _workers_may_be_replaced():
        yield executor


@contextmanager
def _workers_may_be_replaced() -> Iterator[None]:
    """Within it joblib does not warn when it replaces a process that has grown by 300 MB, which is no fault."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
        yield


def _begin(parent: int) -> None:
    """What a worker does first: use one thread, and watch its parent, which cannot end it if it is killed itself."""
    torch.set_num_threads(1)
    end_without(parent)


@contextmanager
def jobs_end_with_this_process() -> Iterator[None]:
    """Within this context, so do the processes of Hydra's launcher for joblib, also those that have begun no job."""
    before = _core.Parallel
    _core.Parallel = partial(before, initializer=end_without, initargs=(os.getpid(),))
    try:
        yield
    finally:
        _core.Parallel = before
