"""Each work in a process of its own: how fast memory is had depends on what a process did before."""

import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any
from unittest.mock import patch

MEMORY: dict[str, dict[str, str]] = {
    "returned": {},
    "kept": {"MALLOC_TRIM_THRESHOLD_": str(2**34), "MALLOC_MMAP_THRESHOLD_": str(2**34)},
}
"""What the C library does with the memory of large tensors that are freed: by default it returns it to the system, and
has it back page by page; told so by its environment, it keeps all of it."""


def isolated(work: Callable[..., Any], *arguments: Any, memory: str = "returned") -> Any:
    """`work(*arguments)` in a new process, which ends with it."""
    with patch.dict(os.environ, MEMORY[memory]), ProcessPoolExecutor(1, get_context("spawn")) as process:
        return process.submit(work, *arguments).result()
