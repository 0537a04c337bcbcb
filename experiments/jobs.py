"""Independent jobs of a study, on all workers, with one progress bar."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor, as_completed
from typing import Any, TypeVar

from rich.progress import Progress

T = TypeVar("T")


def run_jobs(
    executor: Executor, progress: Progress, what: str, function: Callable[..., T], arguments: Sequence[tuple[Any, ...]]
) -> list[T]:
    """`function(*a)` for each of the `arguments`, in their order.

    Jobs start in the order given, so the longest should come first. The first error ends the run, and what has not
    started is dropped.
    """
    task = progress.add_task(what, total=len(arguments))
    futures = [executor.submit(function, *given) for given in arguments]
    try:
        for future in as_completed(futures):
            future.result()
            progress.advance(task)
    except BaseException:
        for future in futures:
            future.cancel()
        raise
    return [future.result() for future in futures]
