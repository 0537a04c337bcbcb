"""Driving robots for a study: on all workers, with progress shown."""

from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any

import torch
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

import sim
from experiments import presets


class Driver:
    """Drives policies in the run's arena, on all workers, with a progress bar for each drive."""

    def __init__(self, config: Mapping[str, Any], executor: Executor, progress: Progress) -> None:
        self.config, self.executor, self.progress = config, executor, progress
        self.arena = presets.arena(config["arena"])

    def drive(
        self, what: str, policy: sim.ControllerLike, episodes: range, body: str | None = None, record: bool = False
    ) -> sim.Rollout:
        """Drive `policy` from the starts of `episodes`."""
        task = self.progress.add_task(what, total=len(episodes))
        return sim.rollout(
            policy,
            arena=self.arena,
            body=body or self.config["body"]["name"],
            episodes=episodes,
            seed=self.config["seed"],
            seconds=self.config["seconds"],
            robots=self.config["robots"],
            executor=self.executor,
            workers=self.config["workers"],
            record=record,
            progress=lambda count: self.progress.advance(task, count),
        )


def drive_here(
    config: Mapping[str, Any],
    policy: sim.ControllerLike,
    episodes: Iterable[int],
    arena: str | sim.Arena = "default",
    record: bool = False,
) -> sim.Rollout:
    """Drive in this process, with the settings of the run: for jobs that are spread over the workers themselves."""
    return sim.rollout(
        policy,
        arena=arena,
        body=config["body"]["name"],
        episodes=episodes,
        seed=config["seed"],
        seconds=config["seconds"],
        robots=config["robots"],
        record=record,
    )


def pooled_success(episodes: int, successes: int) -> dict[str, Any]:
    """Success over all episodes, with Wilson's 95 % interval, as columns of a row; None for no episode."""
    if not episodes:
        return dict.fromkeys(("episodes", "success_rate", "success_low", "success_high"))
    low, high = sim.wilson(successes, episodes)
    return {"episodes": episodes, "success_rate": successes / episodes, "success_low": low, "success_high": high}


@contextmanager
def workers(count: int) -> Iterator[Executor]:
    """A pool of processes that drive robots, ready to be reused."""
    # Spawned, so that a worker inherits no threads and no physics clients; one thread each, as there are several.
    with ProcessPoolExecutor(count, get_context("spawn"), torch.set_num_threads, (1,)) as pool:
        yield pool


def progress_bars(console: Console) -> Progress:
    """Progress bars with counts and times, to be used as a context."""
    columns = (TextColumn("{task.description:>28}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, console=console)
