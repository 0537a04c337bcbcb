"""Each work in a process of its own: how fast memory is had depends on what a process did before."""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any

MEMORY: dict[str, dict[str, str]] = {
    "returned": {},
    "kept": {"MALLOC_TRIM_THRESHOLD_": str(2**34), "MALLOC_MMAP_THRESHOLD_": str(2**34)},
}
"""What the C library does with the memory of large tensors that are freed: by default it returns it to the system, and
has it back page by page; told so by its environment, it keeps all of it."""


def isolated(work: Callable[..., Any], *arguments: Any, memory: str = "returned") -> Any:
    """`work(*arguments)` in a new process, which ends with it."""
    with _environment(MEMORY[memory]), ProcessPoolExecutor(1, get_context("spawn")) as process:
        return process.submit(work, *arguments).result()


@contextmanager
def _environment(variables: dict[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
