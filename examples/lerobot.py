"""From a LeRobotDataset to one hypervector: read the folder, learn, ask.

    python examples/lerobot.py ~/.cache/huggingface/lerobot/lerobot/aloha_static_coffee

Without a folder, a small data set is written to `reach` first: an arm of two joints that reaches for targets. The last
fifth of the episodes is held out, and the errors of the commands there are printed beside those of the mean command.
Needs `torchvsa[data]`; `lerobot` itself is not needed.

For `reach`, 2,000 rows, the whole takes 5 s on one thread and 440 MB, most of it PyTorch and pyarrow; the program is
4,000 numbers, and an answer takes 0.07 ms. The default rule warns that it has not learned every row by heart.
"""

import argparse
import json
import os
import statistics
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import torch
from pyarrow import parquet

from behaviours import BehaviourBank, Demonstrations, Schema, Space
from behaviours.data import read_lerobot


def write_reach(folder: Path, episodes: int = 20, steps: int = 100) -> None:
    """The smallest LeRobotDataset, version 3: a description, and one file of rows."""
    generator = np.random.default_rng(0)
    rows = []
    for episode in range(episodes):
        joints, target = generator.uniform(-1, 1, 2), generator.uniform(-1, 1, 2)
        for frame in range(steps):
            speeds = np.clip(np.round(4 * (target - joints)) / 2, -1, 1)
            rows.append((joints, target, speeds, episode, frame / 20))
            joints = joints + speeds / 20
            if frame % 25 == 24:
                target = generator.uniform(-1, 1, 2)
    vectors = {"observation.state": 0, "observation.target": 1, "action": 2}
    table = {name: pa.array([row[place].tolist() for row in rows]) for name, place in vectors.items()}
    table |= {"episode_index": pa.array([row[3] for row in rows]), "timestamp": pa.array([row[4] for row in rows])}
    (folder / "data/chunk-000").mkdir(parents=True, exist_ok=True)
    parquet.write_table(pa.table(table), folder / "data/chunk-000/file-000.parquet")
    names = ["shoulder", "elbow"]
    features = {name: {"dtype": "float64", "shape": [2], "names": names} for name in vectors}
    features["episode_index"] = {"dtype": "int64", "shape": [1], "names": None}
    features["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
    info = {"codebase_version": "v3.0", "fps": 20, "total_episodes": episodes, "features": features}
    (folder / "meta").mkdir(exist_ok=True)
    (folder / "meta/info.json").write_text(json.dumps(info))


def main() -> None:
    """Read, learn from four fifths of the episodes, and ask about the others."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("folder", nargs="?", type=Path, help="a LeRobotDataset; by default one is written to reach")
    given = options.parse_args()
    torch.set_num_threads(1)
    folder = given.folder or Path("reach")
    if given.folder is None:
        write_reach(folder)
    log = read_lerobot(folder)
    print(log)
    schema = Schema.from_data(log, show=print)
    shown = Demonstrations.from_data(log, schema)
    episodes = shown.episodes.unique()
    held_out = shown.episodes >= episodes[-max(len(episodes) // 5, 1)]
    bank = BehaviourBank(Space(schema))
    bank.learn("reach", shown.where(~held_out))
    tick, test = bank["reach"].freeze(), shown.where(held_out)
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
    print(f"an answer takes {1e6 * statistics.median(times):.0f} µs; {memory:.0f} MB")


if __name__ == "__main__":
    main()
