"""A pairwise cover of rule x architecture x protection x record drives in the main job, or is refused before that."""

import itertools
from pathlib import Path

import pytest
import torch
from combinations import FACTORS, Combination, drive, every, pairwise

from experiments.kit.options import option_name
from torchvsa import ARCHITECTURES, VSA, architecture_near

COVER = list(pairwise(every()))


def test_the_cover_has_all_pairs() -> None:
    for (a, one), (b, other) in itertools.combinations(enumerate(zip(*every(), strict=True)), 2):
        assert {(c[a], c[b]) for c in COVER} == set(itertools.product(set(one), set(other))), (FACTORS[a], FACTORS[b])
    assert len(COVER) < len(every()) / 5


def unsupported(rule: str, vsa: VSA, record: str) -> bool:
    """Whether the algebra of the architecture cannot do what the rule or the record asks of it."""
    real = vsa.elementwise and not vsa.dtype.is_complex
    return (
        (rule in ("least_squares", "evident") and not real)
        or (record == "subset_product" and not vsa.elementwise)
        or (record in ("threshold_features", "oblique_features") and not vsa.negatable)
        or (record == "random_fourier" and not (real and vsa.dtype != torch.bool))
    )


@pytest.mark.parametrize("combination", COVER, ids="-".join)
@pytest.mark.filterwarnings("ignore::behaviours.ConvergenceWarning")
def test_it_drives_or_is_refused_before(combination: Combination, tmp_path: Path) -> None:
    refused = drive(combination, tmp_path / "run")
    assert bool(refused) == (not (tmp_path / "run").exists())
    rule, option, _, record = combination
    vsa = architecture_near(next(name for name in ARCHITECTURES if option_name(name) == option), 64)
    assert bool(refused) == unsupported(rule, vsa, record), refused
