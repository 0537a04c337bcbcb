"""Which works there are, and how one of them is measured."""

import argparse
from typing import Any

from benchmarks import (
    cleanup,
    digits,
    encoding,
    fit_times,
    growth,
    imports,
    learning,
    protection,
    random_vectors,
    recall,
    rollouts,
    sparse,
)
from benchmarks.harness import time_case
from benchmarks.report import WIDTH
from experiments.kit.console import wide_console

WORKS = {
    "encoding": encoding,
    "cleanup": cleanup,
    "protection": protection,
    "random": random_vectors,
    "learning": learning,
    "recall": recall,
    "sparse": sparse,
    "digits": digits,
    "rollouts": rollouts,
    "imports": imports,
}
KEPT = ("encoding", "protection", "random", "recall", "digits")
"""Works whose steps make tensors so large that it matters what becomes of their memory."""
ON_THE_CPU = ("rollouts", "imports")
"""Works that no other device has a part in."""
GROWTH = "growth"
FIT_TIMES = "fit_times"
"""Runs only if it is named."""


def measure(name: str, options: argparse.Namespace) -> list[dict[str, Any]]:
    """The rows of one work, with the options of the command."""
    if name == GROWTH:
        return list(growth.rows(options.device, max(options.threads), min(options.repeats, 3), options.small))
    if name == FIT_TIMES:
        return list(fit_times.rows(max(options.threads), small=options.small))
    rows, console = [], wide_console(WIDTH)
    for case in WORKS[name].cases(options.device, options.small):
        for threads in options.threads:
            console.print(f"{case.work}, {case.shape}, {threads} threads", style="dim")
            rows += time_case(case, threads, options.repeats, options.device)
    return rows
