"""A control loop at 50 Hz on one thread: readings in, wheel commands out.

    python examples/control_loop.py bank.safetensors escape --seconds 5

Without a file, an escape from the corral is learned first and saved to `escape.safetensors`. The robot is simulated
here: for your own, put its readings and motors in place of `env`.

It prints the latency of an answer and the memory of the process: 0.3 to 0.5 ms on a shared machine, where the caches
are cold after each sleep (0.06 ms without any sleep), and 250 MB, most of it PyTorch.
"""

import argparse
import os
import statistics
import time
from pathlib import Path

import gymnasium
import numpy as np
import torch

import sim
from behaviours import Actuator, BehaviourBank, Demonstrations, Schema, Sensor, Space


def learned(path: str) -> BehaviourBank:
    """Five runs of the teacher in the corral, as a bank of one behaviour in a file."""
    shown = sim.rollout(sim.Teacher(), episodes=range(5), record=True, engine="vector")
    schema = Schema(
        [Sensor(one.name, one.low, one.high, one.unit, "clip") for one in sim.SENSORS],
        [Actuator(one.name, one.low, one.high, one.unit, levels=3) for one in sim.ACTUATORS],
    )
    bank = BehaviourBank(Space(schema))
    bank.learn("escape", Demonstrations(shown.trajectory.sensors, shown.trajectory.commands, shown.step_episode))
    bank.save(path)
    return bank


def main() -> None:
    """Load, freeze, and drive."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("bank", nargs="?", help="a file that BehaviourBank.save wrote")
    options.add_argument("name", nargs="?", default="escape", help="a behaviour of it")
    options.add_argument("--seconds", type=float, default=5.0)
    options.add_argument("--hertz", type=float, default=50.0)
    given = options.parse_args()
    torch.set_num_threads(1)
    bank = BehaviourBank.load(given.bank) if given.bank else learned("escape.safetensors")
    tick = bank[given.name].freeze()
    env = gymnasium.make("CorralEscape-v0", engine="vector")
    readings, _ = env.reset(seed=0)
    times, late, steps = [], 0, int(given.seconds * given.hertz)
    due = time.perf_counter()
    for _ in range(steps):
        began = time.perf_counter()
        recall = tick(np.asarray(readings)[None])  # one row: commands, similarity, margin, familiarity
        times.append(time.perf_counter() - began)
        readings, _, ended, cut, _ = env.step(recall.commands[0].numpy().astype(np.float32))
        if ended or cut:
            readings, _ = env.reset()
        due += 1 / given.hertz
        late += time.perf_counter() > due
        time.sleep(max(due - time.perf_counter(), 0))
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    memory = pages * os.sysconf("SC_PAGE_SIZE") / 2**20
    print(f"{steps} steps, {late} late; an answer takes {1e6 * statistics.median(times):.0f} µs; {memory:.0f} MB")


if __name__ == "__main__":
    main()
