"""How time grows with the size of the work: the exponent of a power fitted over two decades and more."""

import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import torch

from behaviours import Actuator, Demonstrations, ErrorDriven, OneShot, Schema, Sensor, Space
from benchmarks.harness import wait
from torchvsa import MAP, CleanUp, SelfShift
from torchvsa.encoders import Level, Lookup, Sum

Work = Callable[[], object]


def encode(batch: int = 512, sensors: int = 3, dim: int = 4000, device: str = "cpu") -> Work:
    """Records of `sensors` values."""
    generator = torch.Generator().manual_seed(0)
    record = Sum(Level(MAP(dim, dtype=torch.int8), 64), sensors).draw(generator).to(device)
    rows = torch.randint(64, (batch, sensors), generator=generator).to(device)
    return lambda: record.encode(rows)


def protect(batch: int = 512, dim: int = 4000, device: str = "cpu") -> Work:
    """Shifts by widths of their own."""
    vsa = MAP(dim, dtype=torch.int8)
    rows = vsa.random(batch, generator=torch.Generator().manual_seed(0)).to(device)
    shift = SelfShift(vsa, seed=0).to(device)
    return lambda: shift(rows)


def clean_up(batch: int = 512, items: int = 256, dim: int = 4000, device: str = "cpu") -> Work:
    """The most similar of `items`."""
    vsa, generator = MAP(dim, dtype=torch.int8), torch.Generator().manual_seed(0)
    memory = CleanUp(vsa.random(items, generator=generator).to(device))
    rows = vsa.random(batch, generator=generator).to(device)
    return lambda: memory(rows)


def _robot(sensors: int, dim: int, device: str) -> Space:
    schema = Schema(
        [Sensor(f"s{i}", 0, 20) for i in range(sensors)], [Actuator(f"a{i}", -1, 1, levels=3) for i in range(2)]
    )
    vsa = MAP(dim, dtype=torch.int8)
    return Space(schema, Sum(Lookup(vsa, 20), sensors), protection=SelfShift(vsa, "sum")).to(device)


def _pairs(count: int, sensors: int) -> Demonstrations:
    generator = torch.Generator().manual_seed(0)
    readings = torch.randint(20, (count, sensors), generator=generator) + 0.5
    return Demonstrations(readings, torch.randint(3, (count, 2), generator=generator) - 1.0)


def learn_one_shot(samples: int = 4000, dim: int = 4000, device: str = "cpu") -> Work:
    """Algorithm 1, with exact novelty, on random samples of 3 sensors x 20 values."""
    space, shown = _robot(3, dim, device), _pairs(samples, 3)
    return lambda: OneShot().fit(space, shown)


def learn_error_driven(pairs: int = 100, dim: int = 4000, device: str = "cpu") -> Work:
    """The error-driven rule on random pairs."""
    space, shown = _robot(3, dim, device), _pairs(pairs, 3)
    return lambda: ErrorDriven(margin=0.0).fit(space, shown)


def recall(batch: int = 512, dim: int = 4000, device: str = "cpu") -> Work:
    """Algorithm 2."""
    space = _robot(3, dim, device)
    behaviour, asked = OneShot().fit(space, _pairs(80, 3)), _pairs(batch, 3).sensors
    return lambda: behaviour(asked)


SWEEPS: list[tuple[str, str, Callable[..., Work], Sequence[int]]] = [
    ("record encoding", "batch", encode, (32, 128, 512, 2048, 8192)),
    ("record encoding", "sensors", encode, (2, 8, 32, 128, 256)),
    ("record encoding", "dim", encode, (250, 1000, 4000, 16_000, 32_000)),
    ("protect", "batch", protect, (32, 128, 512, 2048, 8192)),
    ("protect", "dim", protect, (250, 1000, 4000, 16_000, 32_000)),
    ("clean-up", "batch", clean_up, (32, 128, 512, 2048, 8192)),
    ("clean-up", "items", clean_up, (16, 64, 256, 1024, 4096)),
    ("clean-up", "dim", clean_up, (250, 1000, 4000, 16_000, 32_000)),
    ("Algorithm 1", "samples", learn_one_shot, (400, 2000, 10_000, 50_000, 200_000)),
    ("error-driven", "pairs", learn_error_driven, (8, 25, 80, 250, 800)),
    ("Algorithm 2", "batch", recall, (32, 128, 512, 2048, 8192)),
    ("Algorithm 2", "dim", recall, (250, 1000, 4000, 16_000, 32_000)),
]


def rows(device: str, threads: int, repeats: int = 3, small: bool = False) -> Iterator[dict[str, Any]]:
    """One row for each sweep: sizes, medians of seconds, and the exponent of the fitted power."""
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        for work, variable, make, sizes in SWEEPS:
            sizes = sizes[:2] if small else sizes
            seconds = [_median(make(**{variable: size, "device": device}), repeats, device) for size in sizes]
            exponent = float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])
            top = float(np.diff(np.log(seconds))[-1] / np.diff(np.log(sizes))[-1])
            yield {
                "work": f"growth of {work}",
                "shape": f"{variable}={sizes[0]}..{sizes[-1]}",
                "threads": threads,
                "ours_s": seconds[-1],
                "sizes": list(sizes),
                "seconds": seconds,
                "exponent": exponent,
                "exponent_at_the_top": top,
                "device": device,
            }
    finally:
        torch.set_num_threads(before)


def _median(work: Work, repeats: int, device: str) -> float:
    times = []
    with torch.no_grad():
        for run in range(repeats + 1):
            wait(device)
            began = time.perf_counter()
            work()
            wait(device)
            if run:
                times.append(time.perf_counter() - began)
    return statistics.median(times)
