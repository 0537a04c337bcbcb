"""The drives that a finished run of the corral kept, as files for the Rerun viewer."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from experiments.corral.study import study
from experiments.kit.run import load
from experiments.tasks import corral
from experiments.tasks.rrd import write_rrd


def write_starts(folder: Path, starts: Sequence[str] = ()) -> list[Path]:
    """Write `rrd/start_<number>.rrd` in the folder of a run, with all controllers that drove from this held-out start.

    Args:
        folder: of a finished run of `torchvsa corral`.
        starts: numbers of starts; by default all that the run kept, the first 12.

    Raises:
        OSError: without `results.json`.
        ValueError: if another study ran there, a start was not kept, or rerun-sdk is not installed.
    """
    ran, outcome = load(folder)
    if ran is not study:
        raise ValueError(f"{folder} holds the results of {ran.name}; expected those of {study.name}")
    paths = {name: folder / "trajectories" / f"{name}.parquet" for name in outcome.settings.controllers}
    kept = {name: pd.read_parquet(path) for name, path in paths.items() if path.is_file()}
    known = {str(start): start for start in sorted({start for frame in kept.values() for start in frame.episode})}
    for start in starts:
        if start not in known:
            raise ValueError(f"{folder} kept no start {start}; choose from {', '.join(known) or 'none'}")
    arena = corral.arena(outcome.settings.arena)
    written = []
    for start in starts or known:
        drives = {name: frame.loc[frame.episode == known[start]] for name, frame in kept.items()}
        drives = {name: steps for name, steps in drives.items() if len(steps)}
        (folder / "rrd").mkdir(exist_ok=True)
        written.append(write_rrd(folder / "rrd" / f"start_{start}.rrd", drives, arena))
    return written
