"""A process with a device beside the CPU, for tests; see `pretended`."""

from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any

import pytest
import torch
from torch.utils import backend_registration


@contextmanager
def another_device() -> Iterator[Callable[..., Any]]:
    """`run(check, *arguments)`, in a process of its own, with the pretended device."""
    if not hasattr(backend_registration, "_setup_privateuseone_for_python_backend"):
        pytest.skip(f"PyTorch {torch.__version__} lets no device be made in Python")
    with ProcessPoolExecutor(1, get_context("spawn")) as process:
        yield lambda check, *arguments: process.submit(_pretend, check, *arguments).result()


def _pretend(check: Callable[..., Any], *arguments: Any) -> Any:
    import pretended

    torch.set_num_threads(1)
    with pretended.Pretended():
        return check(*arguments)
