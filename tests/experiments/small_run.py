"""A tiny run of the main job, made in this process: everything that its page is drawn from."""

import fcntl
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import cast

import torch
from kits import composed
from rich.console import Console
from rich.progress import Progress

import sim
from behaviours import Behaviour, Demonstrations, Policy
from experiments.corral import study
from experiments.corral.controllers import CONTROLLERS, Controller, Material
from experiments.corral.measure import prepare
from experiments.corral.settings import Corral
from experiments.kit import Outcome
from experiments.kit.run import run
from experiments.tasks import corral

STARTS = range(8)
SETTINGS = (
    "vsa.dim=600",
    "encoder.bins=8",
    "encoder.span=2",
    "rule.epochs=20",
    "seconds=10",
    "demonstrations=6",
    "paper_bins=[2]",
    "validation_starts=2",
    f"starts={len(STARTS)}",
    f"wheeled_starts={len(STARTS)}",
    f"other_starts={len(STARTS)}",
    "robots=8",
    "workers=1",
)


@contextmanager
def one_thread() -> Iterator[None]:
    """Tests that run side by side would otherwise fight for the cores; no result depends on it."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def settings(*overrides: str) -> Corral:
    return cast(Corral, composed(study, *SETTINGS, *overrides))


@one_thread()
def small_run(folder: Path, *overrides: str) -> Outcome:
    """Run the job with these settings, and draw its page."""
    return run(study, settings(*overrides), folder, Console(quiet=True))


@cache
def full_run() -> Outcome:
    """All controllers. The first process of a test run that needs them runs the job, the others load what it found."""
    of_tests = os.environ.get("PYTEST_XDIST_TESTRUNUID", str(os.getpid()))
    folder = Path(tempfile.gettempdir(), f"torchvsa-tests-{of_tests}")
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return small_run(folder)


@cache
@one_thread()
def material() -> Material:
    """What the cells of this run share."""
    with Progress(disable=True) as progress:
        return prepare(settings(), Path(tempfile.mkdtemp()), progress)


@cache
@one_thread()
def controller(name: str) -> Controller:
    return CONTROLLERS[name](material())


def program(name: str) -> Behaviour | Policy:
    found = controller(name).program
    assert found is not None
    return found


@cache
@one_thread()
def rollout(name: str) -> sim.Rollout:
    return corral.drive(settings(), controller(name).policy, STARTS, record=True)


def held_out() -> Demonstrations:
    return corral.moving(material().examined)
