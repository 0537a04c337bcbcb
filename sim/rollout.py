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

from sim.checks import whole_number
from sim.columns import EpisodeColumns, StepColumns
from sim.controller import Controller, ControllerLike, advance, append, as_controller, begin
from sim.corral import Arena, find_arena
from sim.result import Rollout, Steps
from sim.robot import ACTUATORS, find_body
from sim.state import rows_of
from sim.tracker import DWELL_SECONDS, Tracker
from sim.vector_sim import VectorSim, check_commands, control_steps


@dataclass(frozen=True)
class _Task:
    """The arguments of a worker that drives episodes."""

    controller: Controller
    arena: Arena
    body: str
    seed: int
    steps: int
    dwell_steps: int
    robots: int
    record: bool


def rollout(
    policy: ControllerLike,
    arena: str | Arena = "default",
    body: str = "planar",
    episodes: Iterable[int] = range(200),
    seed: int = 0,
    seconds: float = 60.0,
    dwell: float = DWELL_SECONDS,
    robots: int = 64,
    executor: Executor | None = None,
    workers: int = 1,
    record: bool = True,
    progress: Callable[[int], object] | None = None,
) -> Rollout:
    """Drive `policy` through `episodes` and report what happened.

    An episode ends at success (`dwell` seconds at the lamp without a break) or after `seconds`. Control runs at 20 Hz.
    Commands outside [-1, 1] are clipped. The same arguments give the same bits at any `robots`, `workers` and
    `executor`, provided that the policy treats each row independently.

    Args:
        policy: a function or `nn.Module` from readings `[B, 3]` to commands `[B, 2]` (an array, a tensor, or an object
            with `.commands`), or a `Controller`, which may have a memory.
        arena: a name in `sim.ARENAS`, or an `Arena`.
        body: a name in `sim.BODIES`.
        episodes: distinct numbers, 0 or more; each selects one start and one sequence of wheel noise.
        seed: common to all episodes, 0 or more.
        seconds: longest duration of an episode.
        dwell: seconds at the lamp that count as success.
        robots: robots per process, about 29 MB each.
        executor: where to run; it can be reused over calls, and the caller shuts it down.
        workers: number of processes, each of which gets contiguous chunks of episodes. Without an executor, more than
            one worker starts a pool for this call.
        record: whether to record every control step.
        progress: called with the number of newly finished episodes.

    Raises:
        ValueError: an unknown arena or body, no episodes, repeated or negative ones, or a number out of range. Commands
            that are not finite or have the wrong shape; the message names episode and step.
    """
    numbers = _check_episodes(episodes)
    robots, workers = whole_number("robots", robots, 1), whole_number("workers", workers, 1)
    seed = whole_number("seed", seed)
    find_body(body)
    task = _Task(
        as_controller(policy),
        find_arena(arena),
        body,
        seed,
        control_steps(seconds),
        control_steps(dwell),
        robots,
        record,
    )
    if executor is None and workers == 1:
        parts = [_drive(task, numbers, progress)]
    else:
        parts = _spread(task, numbers, executor, workers, progress)
    merged = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    trajectory = Steps(**{field.name: merged.pop(f"row_{field.name}") for field in fields(Steps)})
    lengths = merged["steps"] if record else np.zeros(len(numbers), dtype=np.int64)
    return Rollout(
        arena=task.arena,
        body=body,
        seed=seed,
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
    task: _Task,
    numbers: NDArray[np.int64],
    executor: Executor | None,
    workers: int,
    progress: Callable[[int], object] | None,
) -> list[dict[str, NDArray[Any]]]:
    # A few chunks per worker keep the workers evenly busy and the progress moving. Chunks of fewer episodes than
    # `robots` waste time.
    chunks = max(min(workers, len(numbers)), min(4 * workers, len(numbers) // task.robots))
    # Not forked: a child must not inherit the parent's threads and physics clients.
    started = ProcessPoolExecutor(workers, mp_context=get_context("spawn")) if executor is None else None
    with started if started is not None else nullcontext(executor) as pool:
        assert pool is not None
        futures = [pool.submit(_drive, task, chunk) for chunk in np.array_split(numbers, chunks)]
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
    task: _Task, numbers: NDArray[np.int64], progress: Callable[[int], object] | None = None
) -> dict[str, NDArray[Any]]:
    """Drive the episodes in this process. Returns columns per episode, and per control step under `row_...`."""
    size = min(task.robots, len(numbers))
    tracker = Tracker(size, task.dwell_steps)
    episodes = EpisodeColumns(numbers)
    rows = StepColumns(task.record)
    with VectorSim(size, task.arena, task.body, task.seed) as simulator:
        row = np.arange(size)  # the index in `numbers` of each slot's episode
        for slot in range(size):
            start = simulator.reset(slot, int(numbers[slot]))
            episodes.start[slot] = start.x, start.y, start.heading
        following = size
        slots = np.arange(size)
        memory = begin(task.controller, numbers[:size])
        while slots.size:
            state = simulator.observe(slots.tolist())
            tracker.observe(slots, state)
            done = tracker.success[slots] | (tracker.clock[slots] >= task.steps)
            for slot in slots[done].tolist():
                episodes.finish(int(row[slot]), tracker, slot)
            going = slots[~done]
            if going.size < slots.size:
                memory = rows_of(memory, np.flatnonzero(~done))
            if going.size:
                sensors, step = state.sensors[~done], tracker.clock[going]
                driven = numbers[row[going]]
                where = f"episode {driven[0]}, step {step[0]}"
                answer, memory = advance(task.controller, sensors, memory, where)
                commands = _check(answer, driven, step)
                reached = tracker.first[going] >= 0
                contact, at_lamp = state.contact[~done], state.at_lamp[~done]
                episodes.count(row[going], contact, at_lamp, reached)
                rows.add(row[going], step, state, ~done, commands, reached)
                simulator.drive(going.tolist(), commands)
            finished = slots[done]
            refilled = finished[: len(numbers) - following]
            for slot in refilled.tolist():
                tracker.reset(slot)
                start = simulator.reset(slot, int(numbers[following]))
                episodes.start[following] = start.x, start.y, start.heading
                row[slot] = following
                following += 1
            slots = np.concatenate([going, refilled])
            if refilled.size:
                order = np.argsort(slots)
                slots = slots[order]
                memory = rows_of(append(task.controller, memory, numbers[row[refilled]]), order)
            if progress is not None and finished.size:
                progress(int(finished.size))
    return episodes.columns() | rows.columns()


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
