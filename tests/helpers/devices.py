"""A process with a device beside the CPU, for tests: the pretended one, and a GPU where there is one."""

from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from importlib import import_module
from multiprocessing import get_context
from typing import Any

import pytest
import torch
from torch.utils import backend_registration

DEVICES = {"pretended": "pretended", "cuda": "gpu"}
"""Devices, and the modules of these helpers that have their names."""
_here: list[Any] = []


@contextmanager
def another_device(device: str = "pretended") -> Iterator[Callable[..., Any]]:
    """`run(check, *arguments)`, in a process of its own, with this device."""
    if device == "cuda" and not torch.cuda.is_available():
        pytest.skip("there is no CUDA device")
    if device == "pretended" and not hasattr(backend_registration, "_setup_privateuseone_for_python_backend"):
        pytest.skip(f"PyTorch {torch.__version__} lets no device be made in Python")
    with ProcessPoolExecutor(1, get_context("spawn")) as process:
        yield lambda check, *arguments: process.submit(_run_on, device, check, *arguments).result()


def other() -> Any:
    """The module of the device of this process, with `NAME`, `moved`, `brought_back` and `waited`."""
    return _here[0]


def _run_on(device: str, check: Callable[..., Any], *arguments: Any) -> Any:
    _here[:] = [import_module(DEVICES[device])]
    torch.set_num_threads(1)
    with other().on():
        return check(*arguments)
