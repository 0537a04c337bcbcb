"""Times ours, peers and a floor in turns, so that all of them meet the same machine."""

import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, cast

import torch

_SHORT = 0.5
"""Seconds: what takes longer is not changed by the state of caches."""
Call = Callable[[int], object]
"""Does the work once; the number says which of some prepared inputs to use, so that no result can be remembered."""
INPUTS = 4
"""Prepared inputs that calls rotate through."""


@dataclass(frozen=True)
class Floor:
    """What the machine itself needs: `share` times what `call` takes, named by what bounds it."""

    name: str
    call: Call
    share: float = 1.0


@dataclass(frozen=True)
class Case:
    """One piece of work at one size, ours and the peers'. `check` raises unless they answer the same."""

    work: str
    shape: str
    ours: Call
    peers: Mapping[str, Call]
    check: Callable[[], None]
    floor: Floor | None = None
    calls: int = 1
    """Calls in one timed run: many for what takes microseconds."""
    timed: bool = False
    """Whether calls measure themselves, each in a new process, and return seconds."""
    more: Mapping[str, Any] = field(default_factory=dict)
    """Further columns of the row."""


def compiled(call: Callable[..., Any], small: bool, **options: Any) -> Callable[..., Any]:
    """The call in one graph. A small run only traces it, since a compiler takes seconds for each."""
    backend = "aot_eager" if small else "inductor"
    return cast(
        Callable[..., Any],
        torch.compile(call, fullgraph=True, dynamic=False, backend=backend, options=None if small else options),
    )


def variants(call: Callable[..., Any], small: bool, compiles: bool = True) -> dict[str, Callable[..., Any]]:
    """The call by what is added to its name, and, if it pays, as PyTorch compiles it."""
    return {"": call} | ({", compiled": compiled(call, small)} if compiles else {})


def time_case(case: Case, threads: int, repeats: int, device: str) -> list[dict[str, Any]]:
    """One row for each peer (or one without): medians of `repeats` alternating runs, in seconds a call."""
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        case.check()
        calls: dict[str, Call] = {"ours": case.ours, **{f"peer {name}": call for name, call in case.peers.items()}}
        if case.floor is not None:
            calls["floor"] = case.floor.call
        times = _alternate(calls, case, repeats, device)
    finally:
        torch.set_num_threads(before)
    ours = times["ours"]
    floor = None if case.floor is None else times["floor"] * case.floor.share
    rows = []
    for peer in case.peers or [None]:
        theirs = None if peer is None else times[f"peer {peer}"]
        rows.append(
            {
                "work": case.work,
                "shape": case.shape,
                "threads": threads,
                "ours_s": ours,
                "peer": peer,
                "peer_s": theirs,
                "ratio": None if theirs is None else theirs / ours,
                "floor": None if case.floor is None else case.floor.name,
                "floor_s": floor,
                "of_floor": None if floor is None else ours / floor,
                "device": device,
                **case.more,
            }
        )
    return rows


def _alternate(calls: Mapping[str, Call], case: Case, repeats: int, device: str) -> dict[str, float]:
    times: dict[str, list[float]] = {name: [] for name in calls}
    with torch.no_grad():
        warm = {name: _time(call, case, 0, device) for name, call in calls.items()}
        for run in range(repeats):
            for name, call in calls.items():
                if warm[name] < _SHORT and not case.timed:
                    call(run % INPUTS)  # not timed: caches and allocator are then its own, not those of the one before
                times[name].append(_time(call, case, run, device))
    return {name: statistics.median(values) for name, values in times.items()}


def _time(call: Call, case: Case, run: int, device: str) -> float:
    """Seconds that one call takes, as the mean over `case.calls` of them."""
    answer = None
    wait(device)
    began = time.perf_counter()
    for index in range(case.calls):
        answer = call((run + 1 + index) % INPUTS)
    wait(device)
    return cast(float, answer) if case.timed else (time.perf_counter() - began) / case.calls


def wait(device: str) -> None:
    """Wait until the device has done all that it was given."""
    if device == "cuda":
        torch.cuda.synchronize()
