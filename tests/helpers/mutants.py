"""Load damaged and forged files, and say what happens.

`python tests/helpers/mutants.py --count 200000` tries 200,000 of them, and prints the outcomes by kind of damage.
Mutants are numbered: each number gives the same file. Forged files carry a checksum that fits, as if an adversary had
written them.
"""

import argparse
import math
import random
import resource
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from file_damage import DAMAGES, FORGED
from sound_files import originals
from torch import Tensor

from behaviours import BehaviourBank, Demonstrations, Sensor

ROOM = 2**28
"""Bytes that loading a mutant may take; the files are of some kilobytes."""


ASK = torch.tensor([[0.1, 0.9], [0.9, 0.1], [math.nan, 0.4], [0.0, 1.0]], dtype=torch.float64)


def verdict(number: int, folder: Path) -> tuple[str, str]:
    """The kind of damage of one mutant, and what became of it: `refused`, `loaded`, or what went wrong."""
    rng = random.Random(number)
    kind, content = rng.choice(originals())
    damage = rng.choice([*DAMAGES, *FORGED])
    mutant = DAMAGES[damage](rng, content, folder)
    path = folder / "mutant"
    path.write_bytes(mutant)
    try:
        with _little_room():
            loaded: Any = (BehaviourBank if kind == "bank" else Demonstrations).load(path)
    except (ValueError, OSError) as error:
        text = str(error)
        if "allocate" in text:  # the library's own refusals say what would be needed, before it is taken
            return damage, f"took too much memory before it was refused: {text[-80:]}"
        return damage, "refused" if str(path) in text else f"refused without naming the file: {text[:80]}"
    except BaseException as error:  # (what else comes out is the question here)
        return damage, f"{type(error).__name__} when loaded: {str(error)[:80]}"
    try:
        broken = _broken(loaded)
        # Damage that no checksum covers must have left the content as it was.
        if not broken and damage not in FORGED and loaded.save(folder / "again").read_bytes() != content:
            broken = "loaded other content, though its checksum was not forged"
    except Exception as error:
        broken = f"{type(error).__name__} when asked: {str(error)[:80]}"
    return damage, broken or "loaded"


def _broken(loaded: BehaviourBank | Demonstrations) -> str:
    """The promise that something loaded breaks; nothing if it keeps all."""
    if isinstance(loaded, Demonstrations):
        sound = bool(loaded.commands.isfinite().all()) and not loaded.sensors.isinf().any()
        return "" if sound else "demonstrations that the class forbids"
    sensors = len(loaded.space.schema.sensors)
    readings = torch.cat([ASK] * (1 + sensors // 2), 1)[:, :sensors]
    readings = torch.stack(
        [_valid(column, sensor) for column, sensor in zip(readings.T, loaded.space.schema.sensors, strict=True)],
        1,
    )
    for name in loaded:
        recall, _ = loaded[name].step(readings, loaded[name].start(readings))
        for actuator, column in zip(loaded.space.schema.actuators, recall.commands.T, strict=True):
            seen = column[~readings.isnan().all(1)]
            if not ((seen >= actuator.low) & (seen <= actuator.high)).all():
                return "a command outside of its actuator's range"
        for field in ("similarity", "familiarity"):
            values = getattr(recall, field)
            if not (values.abs() <= 1.001).all():
                return f"a {field} that is no cosine"
        if recall.margin.isnan().any():
            return "a margin that is no number"
    return ""


def _valid(column: Tensor, sensor: Sensor) -> Tensor:
    """Numbers in [0, 1] as readings of a sensor."""
    if not sensor.choices:
        return column.clamp(sensor.low, sensor.high)
    choices = torch.tensor(sensor.choices, dtype=torch.float64)
    chosen = choices[(column.nan_to_num() * len(choices)).long().clamp(max=len(choices) - 1)]
    return torch.where(column.isnan(), column, chosen)


@contextmanager
def _little_room() -> Iterator[None]:
    before = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + ROOM, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def verdicts(numbers: range) -> Counter[tuple[str, str]]:
    """What became of these mutants."""
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder:
        return Counter(verdict(number, Path(folder)) for number in numbers)


def main() -> None:
    """Print the counts; exit with status 1 if one of them ought to be 0."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200_000)
    parser.add_argument("--start", type=int, default=0, help="number of the first mutant")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    end = options.start + options.count
    blocks = [range(at, min(at + 1000, end)) for at in range(options.start, end, 1000)]
    total: Counter[tuple[str, str]] = Counter()
    with ProcessPoolExecutor(options.workers) as pool:
        for done, counts in enumerate(pool.map(verdicts, blocks), 1):
            total += counts
            print(f"\r{done * 1000:,} of {options.count:,}", end="", flush=True)
    print()
    for (damage, what), count in sorted(total.items()):
        print(f"{count:>9,}  {damage:12}  {what}")
    wrong = sum(count for (_, what), count in total.items() if what not in ("refused", "loaded"))
    print(f"{sum(total.values()):>9,}  mutants, {wrong:,} of them neither refused nor sound")
    raise SystemExit(wrong > 0)


if __name__ == "__main__":
    main()
