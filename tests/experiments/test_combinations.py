"""A pairwise cover of rule x architecture x protection x record drives in the main job, or is refused before that."""

import itertools
from pathlib import Path

import pytest
from combinations import FACTORS, Combination, drive, every, pairwise

COVER = list(pairwise(every()))


def test_the_cover_has_all_pairs() -> None:
    for (a, one), (b, other) in itertools.combinations(enumerate(zip(*every(), strict=True)), 2):
        assert {(c[a], c[b]) for c in COVER} == set(itertools.product(set(one), set(other))), (FACTORS[a], FACTORS[b])
    assert len(COVER) < len(every()) / 5


@pytest.mark.parametrize("combination", COVER, ids="-".join)
@pytest.mark.filterwarnings("ignore::behaviours.ConvergenceWarning")
def test_it_drives_or_is_refused_before(combination: Combination, tmp_path: Path) -> None:
    refused = drive(combination, tmp_path / "run")
    assert bool(refused) == (not (tmp_path / "run").exists())
    if combination[0] == "least_squares":
        assert bool(refused) == (combination[1] in ("hrr", "fhrr"))
