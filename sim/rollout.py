"""A policy driven from seeded starts: many robots a process, the policy asked once a tick for all of them."""

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
    """What a worker needs to drive a run of episodes."""

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

    An episode ends at success (at the lamp throughout `dwell` seconds) or after `seconds`. Control runs at 20 Hz.
    Commands outside [-1, 1] are clipped. The same arguments give the same bits, whatever `robots`, `workers` and
    `executor` (as long as the policy's rows do not depend on each other).

    Args:
        policy: a function or `nn.Module` from readings `[B, 3]` to commands `[B, 2]` (an array, a tensor, or an object
            with `.commands`), or a `Controller`, which has a memory.
        arena: a name in `sim.ARENAS`, or an `Arena`.
        body: a name in `sim.BODIES`.
        episodes: distinct numbers, 0 or more; each stands for one start and one sequence of wheel noise.
        seed: of all episodes together, 0 or more.
        seconds: longest duration of an episode.
        dwell: time at the lamp that makes a success.
        robots: robots per process, about 29 MB each.
        executor: where to run, to be reused over calls; the caller shuts it down.
        workers: contiguous chunks of episodes are spread over this many processes; without an executor, more than
            one starts a pool for this call.
        record: keep every control step.
        progress: called with the number of newly finished episodes.

    Raises:
        ValueError: an unknown arena or body, no episodes, repeated or negative ones, a number out of range; or
            commands that are not finite or have the wrong shape, naming episode and step.
    """
    numbers = _check_episodes(episodes)
    robots, workers = whole_number("robots", robots, 1), whole_number("workers", workers, 1)
    seed = whole_number("seed", seed)
    find_body(body)
    driver, where = as_controller(policy), find_arena(arena)
    task = _Task(driver, where, body, seed, control_steps(seconds), control_steps(dwell), robots, record)
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
        given = list(episodes)
    except TypeError:
        given = []
    if not given:
        raise ValueError(f"episodes {episodes!r}; expected at least one whole number")
    numbers = np.array([whole_number("episode", number) for number in given], dtype=np.int64)
    values, counts = np.unique(numbers, return_counts=True)
    if counts.max() > 1:
        raise ValueError(f"episode {values[counts > 1][0]} is asked for {counts.max()} times; expected once")
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
    own = ProcessPoolExecutor(workers, mp_context=get_context("spawn")) if executor is None else None
    with own if own is not None else nullcontext(executor) as pool:
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
    """Drive the episodes in this process; columns per episode, and per control step under `row_...`."""
    size = min(task.robots, len(numbers))
    tracker = Tracker(size, task.dwell_steps)
    episodes = EpisodeColumns(numbers)
    rows = StepColumns(task.record)
    with VectorSim(size, task.arena, task.body, task.seed) as simulator:
        place = np.arange(size)  # the position in `numbers` of each slot's episode
        for slot in range(size):
            start = simulator.reset(slot, int(numbers[slot]))
            episodes.start[slot] = start.x, start.y, start.heading
        waiting = size
        slots = np.arange(size)
        memory = begin(task.controller, numbers[:size])
        while slots.size:
            state = simulator.observe(slots.tolist())
            tracker.observe(slots, state)
            done = tracker.success[slots] | (tracker.clock[slots] >= task.steps)
            for slot in slots[done].tolist():
                episodes.finish(int(place[slot]), tracker, slot)
            going = slots[~done]
            if going.size < slots.size:
                memory = rows_of(memory, np.flatnonzero(~done))
            if going.size:
                sensors, step = state.sensors[~done], tracker.clock[going]
                driven = numbers[place[going]]
                where = f"episode {driven[0]}, step {step[0]}"
                answer, memory = advance(task.controller, sensors, memory, where)
                commands = _check(answer, driven, step)
                reached = tracker.first[going] >= 0
                contact, at_lamp = state.contact[~done], state.at_lamp[~done]
                episodes.count(place[going], contact, at_lamp, reached)
                rows.add(place[going], step, state, ~done, commands, reached)
                simulator.drive(going.tolist(), commands)
            finished = slots[done]
            refilled = finished[: len(numbers) - waiting]
            for slot in refilled.tolist():
                tracker.reset(slot)
                start = simulator.reset(slot, int(numbers[waiting]))
                episodes.start[waiting] = start.x, start.y, start.heading
                place[slot] = waiting
                waiting += 1
            slots = np.concatenate([going, refilled])
            if refilled.size:
                order = np.argsort(slots)
                slots = slots[order]
                memory = rows_of(append(task.controller, memory, numbers[place[refilled]]), order)
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
