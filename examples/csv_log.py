"""From a CSV log to one hypervector that answers: read, learn, ask about a run that was not shown.

    python examples/csv_log.py log.csv --actuators v omega --by run

Without a file, six runs of the corral's teacher are written to `corral.csv` first. The last run is held out. The shell
does the same, compares with other models and writes a page: `torchvsa learn corral.csv --actuators left_wheel
right_wheel --by run`. Needs `torchvsa[data]`.

For `corral.csv`, 1,700 rows, the whole takes 6 s on one thread and 350 MB, most of it PyTorch and pyarrow; the program
is 4,000 numbers, and an answer takes 0.07 ms.
"""

import argparse
import csv
import os
import statistics
import time
from pathlib import Path

import numpy as np
import torch

import sim
from behaviours import BehaviourBank, Demonstrations, LeastSquares, Schema, Space
from behaviours.data import read


def write_corral(path: Path) -> None:
    """Six runs of the teacher: a run, readings and commands in each row, units in the first line."""
    shown = sim.rollout(sim.Teacher(), episodes=range(6), record=True, engine="vector")
    titles = [f"{one.name} [{one.unit}]" if one.unit else one.name for one in (*sim.SENSORS, *sim.ACTUATORS)]
    columns = np.concatenate([shown.trajectory.sensors, shown.trajectory.commands], 1).tolist()
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["run", *titles])
        rows.writerows([run, *row] for run, row in zip(shown.step_episode.tolist(), columns, strict=True))


def main() -> None:
    """Read, learn from all runs but one, and ask about that one."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("log", nargs="?", type=Path, help="a CSV file; by default one is written to corral.csv")
    options.add_argument("--actuators", nargs="+", default=[one.name for one in sim.ACTUATORS])
    options.add_argument("--by", default="run", help="the column that names the run of each row")
    given = options.parse_args()
    torch.set_num_threads(1)
    path = given.log or Path("corral.csv")
    if given.log is None:
        write_corral(path)
    log = read(path)
    schema = Schema.from_data(log, given.actuators, by=given.by, show=print)
    shown = Demonstrations.from_data(log, schema, by=given.by)
    held_out = shown.episodes == shown.episodes.unique()[-1]
    bank = BehaviourBank(Space(schema))
    bank.learn("drive", shown.where(~held_out), LeastSquares(smooth=True))
    bank.save("drive.safetensors")
    tick, test = bank["drive"].freeze(), shown.where(held_out)
    errors = (tick(test.sensors).commands - test.commands).abs().mean(0)
    means = (test.commands - shown.where(~held_out).commands.mean(0)).abs().mean(0)
    for actuator, error, mean in zip(schema.actuators, errors.tolist(), means.tolist(), strict=True):
        print(f"{actuator.name}: mean error {error:.3f}; of the mean command {mean:.3f}")
    times = []
    for row in test.sensors[:200]:
        began = time.perf_counter()
        tick(row[None])
        times.append(time.perf_counter() - began)
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    memory = pages * os.sysconf("SC_PAGE_SIZE") / 2**20
    print(f"an answer takes {1e6 * statistics.median(times):.0f} µs; {memory:.0f} MB; drive.safetensors is written")


if __name__ == "__main__":
    main()
