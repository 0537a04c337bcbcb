"""Rule x architecture x protection x record through the main job: each combination drives, or is refused before that.

python tests/experiments/combinations.py    # the full product, with progress
"""

import itertools
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import pandas as pd
from kits import composed
from rich.progress import Progress, track

from experiments.corral import study
from experiments.kit.options import options, register_groups
from experiments.kit.run import check_all

FACTORS = ("rule", "vsa", "protection", "record")
TINY = (
    "controllers=[default]", "demonstrations=1", "starts=1", "seconds=1.5", "animate=false", "workers=1", "robots=2",
    "vsa.dim=64", "encoder.bins=6", "encoder.span=null",
)  # fmt: skip

Combination = tuple[str, ...]


def every() -> list[Combination]:
    """The full product of all options."""
    register_groups()
    return list(itertools.product(*(options(factor) for factor in FACTORS)))


def pairwise(combinations: Sequence[Combination]) -> Iterator[Combination]:
    """Combinations such that any two options of different factors meet in one of them, chosen greedily."""

    def pairs(combination: Combination) -> set[tuple[object, ...]]:
        return set(itertools.combinations(enumerate(combination), 2))

    missing = set[tuple[object, ...]]().union(*map(pairs, combinations))
    while missing:
        best = max(combinations, key=lambda combination: len(pairs(combination) & missing))
        missing -= pairs(best)
        yield best


def drive(combination: Combination, folder: Path) -> str:
    """Run the main job, tiny. Returns why it was refused, "" if it was not.

    Whatever is not refused by the checks must work.
    """
    chosen = [f"{factor}={option}" for factor, option in zip(FACTORS, combination, strict=True)]
    epochs = ["rule.epochs=3"] if combination[0] in ("error_driven", "gradient") else []
    settings = composed(study, *chosen, *epochs, *TINY)
    try:
        check_all(study, settings)
    except ValueError as error:
        return str(error)
    folder.mkdir()
    with Progress(disable=True) as progress:
        material = study.prepare(settings, folder, progress)
    (cell,) = study.cells(settings)
    found = study.measure(material, cell)
    assert isinstance(found, list)
    records = pd.DataFrame([cell | row for row in found])
    (row,) = study.summarise(settings, records)
    assert row["controller"] == "default"
    assert row["episodes"] == 1
    assert 0 <= row["train_agreement"] <= 1
    return ""


def main() -> None:
    """Drive the full product; the exit status is 1 if any combination failed."""
    failed, refused = [], 0
    for combination in track(every(), "combinations"):
        with tempfile.TemporaryDirectory() as folder:
            try:
                refused += bool(drive(combination, Path(folder, "run")))
            except Exception as error:  # all of them are listed at the end
                failed.append(f"{combination}: {type(error).__name__}: {error}")
    print(f"{len(every())} combinations: {refused} refused, {len(failed)} failed", *failed, sep="\n")
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
