"""Learning from very many samples in bounded memory: `python -m benchmarks.memory`."""

import argparse
import resource
import time

import torch
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from behaviours import Actuator, Demonstrations, OneShot, Schema, Sensor, Space
from torchvsa import MAP
from torchvsa.encoders import Lookup, Sum


def main() -> None:
    """Learn, and print the time and the largest memory of the process."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--sensors", type=int, default=24)
    parser.add_argument("--dim", type=int, default=4000)
    options = parser.parse_args()
    generator = torch.Generator().manual_seed(0)
    schema = Schema([Sensor(f"s{i}", 0, 1) for i in range(options.sensors)], [Actuator("motor", -1, 1, levels=3)])
    space = Space(schema, Sum(Lookup(MAP(options.dim, dtype=torch.int8), 32), options.sensors))
    readings = torch.rand(options.samples, options.sensors, generator=generator)
    shown = Demonstrations(readings, torch.sign(readings[:, :1] - readings[:, 1:2]))
    columns = (TextColumn("learning"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    began = time.perf_counter()
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task("learning", total=1.0)
        behaviour = OneShot().fit(space, shown, lambda share: progress.update(task, completed=share))
    seconds = time.perf_counter() - began
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"{behaviour.report.new} conditions of {options.samples} samples in {seconds:.1f} s, peak {peak:.2f} GiB")


if __name__ == "__main__":
    main()
