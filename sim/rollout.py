"""Drive a controller from seeded starts: many robots per process, one call per control step for all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from contextlib import nullcontext
from dataclasses import dataclass, fields
from multiprocessing import get_context
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.arena import Arena
from sim.arenas import find_arena
from sim.checks import whole_number
from sim.columns import EpisodeColumns, StepColumns
from sim.controller import Controller, ControllerLike, advance, append, as_controller, begin
from sim.engine import check_commands, control_steps
from sim.engines import find_engine
from sim.result import Rollout, Steps
from sim.robot import ACTUATORS
from sim.state import rows_of
from sim.task import Task, find_task
from sim.tracker import DWELL_SECONDS, Tracker


@dataclass(frozen=True)
class _Job:
    """The arguments of a worker that drives episodes."""

    controller: Controller
    arena: Arena
    task: Task
    engine: str
    body: str
    seed: int
    steps: int
    dwell_steps: int
    robots: int
    record: bool


def rollout(
    policy: ControllerLike,
    arena: str | Arena = "default",
    body: str | None = None,
    episodes: Iterable[int] = range(200),
    seed: int = 0,
    seconds: float = 60.0,
    dwell: float = DWELL_SECONDS,
    robots: int | None = None,
    executor: Executor | None = None,
    workers: int = 1,
    record: bool = True,
    progress: Callable[[int], object] | None = None,
    engine: str = "vector",
    task: Task | None = None,
) -> Rollout:
    """Drive `policy` through `episodes` and report what happened.

    An episode ends at success (`dwell` seconds at the lamp without a break) or after `seconds`. Control runs at 20 Hz.
    Commands outside [-1, 1] are clipped. The same arguments give the same bits at any `robots`, `workers` and
    `executor`, provided that the policy treats each row independently.

    Args:
        policy: a function or `nn.Module` from readings `[B, n]` to commands `[B, 2]` (an array, a tensor, or an object
            with `.commands`), or a `Controller`, which may have a memory.
        arena: a name in `sim.ARENAS`, or an `Arena`.
        body: the robot's body: `planar`, or, in `bullet`, `wheeled`.
        episodes: distinct numbers, 0 or more; each selects one start and one sequence of wheel noise.
        seed: common to all episodes, 0 or more.
        seconds: longest duration of an episode.
        dwell: seconds at the lamp that count as success.
        robots: robots per process at once; by default 4,096 in `vector`, and 64 in `bullet`, where each has 29 MB.
        executor: where to run; it can be reused over calls, and the caller shuts it down.
        workers: number of processes, each of which gets contiguous chunks of episodes. Without an executor, more than
            one worker starts a pool for this call.
        record: whether to record every control step.
        progress: called with the number of newly finished episodes.
        engine: `vector` steps all robots together; `bullet` is a physics engine, the truth, and much slower.
        task: what the robot senses, and which lamps it goes to; by default all lamps of the arena, see `Task.of`.

    Raises:
        ValueError: an unknown arena, engine or body, no episodes, repeated or negative ones, or a number out of range.
            Commands that are not finite or have the wrong shape; the message names episode and step.
    """
    numbers, chosen, where = _check_episodes(episodes), find_engine(engine), find_arena(arena)
    job = _Job(
        as_controller(policy),
        where,
        find_task(task, where),
        engine,
        chosen.find_body(body),
        whole_number("seed", seed),
        control_steps(seconds),
        control_steps(dwell),
        chosen.robots if robots is None else whole_number("robots", robots, 1),
        record,
    )
    workers = whole_number("workers", workers, 1)
    if executor is None and workers == 1:
        parts = [_drive(job, numbers, progress)]
    else:
        parts = _spread(job, numbers, executor, workers, progress)
    merged = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    trajectory = Steps(**{field.name: merged.pop(f"row_{field.name}") for field in fields(Steps)})
    lengths = merged["steps"] if record else np.zeros(len(numbers), dtype=np.int64)
    return Rollout(
        arena=job.arena,
        task=job.task,
        engine=engine,
        body=job.body,
        seed=job.seed,
        seconds=seconds,
        dwell_seconds=dwell,
        trajectory=trajectory,
        offsets=np.concatenate([[0], np.cumsum(lengths)]),
        **merged,
    )


def _check_episodes(episodes: Iterable[int]) -> NDArray[np.int64]:
    try:
        listed = list(episodes)
    except TypeError:
        listed = []
    if not listed:
        raise ValueError(f"episodes {episodes!r}; expected at least one whole number")
    numbers = np.array([whole_number("episode", number) for number in listed], dtype=np.int64)
    values, counts = np.unique(numbers, return_counts=True)
    if counts.max() > 1:
        raise ValueError(f"episode {values[counts > 1][0]} is given {counts.max()} times; expected once")
    return numbers


def _spread(
    job: _Job,
    numbers: NDArray[np.int64],
    executor: Executor | None,
    workers: int,
    progress: Callable[[int], object] | None,
) -> list[dict[str, NDArray[Any]]]:
    # A few chunks per worker keep the workers evenly busy and the progress moving. Chunks of fewer episodes than
    # `robots` waste time.
    chunks = max(min(workers, len(numbers)), min(4 * workers, len(numbers) // job.robots))
    # Not forked: a child must not inherit the parent's threads and physics clients.
    started = ProcessPoolExecutor(workers, mp_context=get_context("spawn")) if executor is None else None
    with started if started is not None else nullcontext(executor) as pool:
        assert pool is not None
        futures = [pool.submit(_drive, job, chunk) for chunk in np.array_split(numbers, chunks)]
        try:
            for future in as_completed(futures):
                finished = len(future.result()["episode"])
                if progress is not None:
                    progress(finished)
        except BaseException:
            for future in futures:
                future.cancel()
            raise
        return [future.result() for future in futures]


def _drive(
    job: _Job, numbers: NDArray[np.int64], progress: Callable[[int], object] | None = None
) -> dict[str, NDArray[Any]]:
    """Drive the episodes in this process. Returns columns per episode, and per control step under `row_...`."""
    size = min(job.robots, len(numbers))
    tracker = Tracker(size, job.dwell_steps, len(job.task.goals))
    episodes, rows = EpisodeColumns(numbers), StepColumns(job.task)
    with find_engine(job.engine)(size, job.arena, job.task, job.body, job.seed) as engine:
        slots = np.arange(size)
        row = np.arange(size)  # the index in `numbers` of each slot's episode
        following = size
        episodes.start[row] = engine.reset(slots, numbers[row])
        memory = begin(job.controller, numbers[row])
        while slots.size:
            state = engine.observe(slots)
            tracker.observe(slots, state)
            done = tracker.success[slots] | (tracker.clock[slots] >= job.steps)
            going, finished = slots[~done], slots[done]
            if finished.size:
                episodes.finish(row[finished], tracker, finished)
                memory = rows_of(memory, np.flatnonzero(~done))
            if going.size:
                sensors, driven = state.sensors[~done], numbers[row[going]]
                step = tracker.clock[going]
                where = f"episode {driven[0]}, step {step[0]}"
                answer, memory = advance(job.controller, sensors, memory, where)
                commands = _check(answer, driven, step)
                reached = tracker.first[going] >= 0
                episodes.count(row[going], state.contact[~done], tracker.at_goal[going] & reached, reached)
                if job.record:
                    rows.add(row[going], state, ~done, commands, tracker, going)
                engine.drive(going, commands)
            slots = going
            if refilled := min(finished.size, len(numbers) - following):
                free, new = finished[:refilled], np.arange(following, following + refilled)
                following += refilled
                tracker.reset(free)
                row[free] = new
                episodes.start[new] = engine.reset(free, numbers[new])
                slots = np.concatenate([going, free])
                order = np.argsort(slots)
                slots = slots[order]
                memory = rows_of(append(job.controller, memory, numbers[new]), order)
            if progress is not None and finished.size:
                progress(int(finished.size))
    columns = episodes.columns()
    return columns | {f"row_{name}": column for name, column in rows.columns(columns["steps"]).items()}


def _check(answer: object, episodes: NDArray[np.int64], steps: NDArray[np.int64]) -> NDArray[np.float64]:
    where = f"episode {episodes[0]}, step {steps[0]}"
    try:
        commands = check_commands(answer, len(episodes))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{where}: {error}") from error
    bad = ~np.isfinite(commands).all(axis=1)
    if bad.any():
        row = int(np.argmax(bad))
        names = ", ".join(actuator.name for actuator in ACTUATORS)
        raise ValueError(
            f"episode {episodes[row]}, step {steps[row]}: the policy commanded {commands[row].tolist()} ({names}); "
            "expected finite numbers"
        )
    return commands
