"""The numbers that DESIGN promises, at d = 4,000 with 3 sensors of 20 values and 9 results.

One seed's recall of k pairs has a standard deviation of about .04; bounds are about three standard errors of
the mean over the seeds.
"""

import pytest
import torch
from robots import correct, random_pairs, space

from behaviours import ErrorDriven, OneShot, Rule

SEEDS = range(12)


def recalls(rule: Rule, count: int, width: str = "mean") -> torch.Tensor:
    """For each seed and each pair, in order, whether it is recalled."""
    protection = {"name": "self_shift", "width": width}
    tasks = [(space(4000, protection=protection, seed=seed), random_pairs(count, seed)) for seed in SEEDS]
    return torch.stack([correct(rule.fit(made, shown), shown) for made, shown in tasks])


@pytest.mark.parametrize(
    ("width", "count", "recall", "within"),
    [
        ("mean", 20, 0.987, 0.03),
        ("mean", 50, 0.925, 0.035),
        ("mean", 80, 0.862, 0.035),
        ("sum", 20, 1.0, 0.0),
        ("sum", 50, 1.0, 0.003),
        ("sum", 80, 0.997, 0.006),
    ],
)
def test_one_shot(width: str, count: int, recall: float, within: float) -> None:
    assert recalls(OneShot(), count, width).mean().item() == pytest.approx(recall, abs=within)


def test_the_literal_clip_keeps_only_the_newest() -> None:
    recalled = recalls(OneShot(clip_each_step=True), 50)
    assert recalled.mean().item() == pytest.approx(0.43, abs=0.05)
    # Nothing of the oldest fifth is left: 1 of 9 results is right by chance (deviation of 120 guesses: .029).
    assert recalled[:, :10].mean() < 1 / 9 + 3 * 0.029
    assert recalled[:, 40:].mean() > 0.9


@pytest.mark.parametrize(("clip", "taken"), [(False, 14.0), (True, 4.2)])
def test_the_similarity_rule_takes_distinct_conditions_for_known(clip: bool, taken: float) -> None:
    """4 standard deviations; measured over 20 seeds: 9 to 18 of 50 raw, 1 to 9 clipped (deviation 2.4 each)."""
    rule = OneShot("similarity", clip_each_step=clip)
    reports = [rule.fit(space(4000, seed=seed), random_pairs(50, seed)).report for seed in SEEDS]
    rejected = sum(report.falsely_known for report in reports) / len(reports)
    assert rejected == pytest.approx(taken, abs=2.1)
    assert all(report.new + report.falsely_known == 50 for report in reports)


@pytest.mark.slow
def test_a_trained_program_holds_hundreds() -> None:
    shown = random_pairs(800)
    behaviour = ErrorDriven().fit(space(4000, protection={"name": "self_shift", "width": "sum"}), shown)
    assert behaviour.report.wrong == 0
    assert correct(behaviour, shown).mean() == 1


@pytest.mark.slow
def test_clipping_a_trained_program_loses_most_of_it() -> None:
    """Plain corrections behind the paper's width: the case of DESIGN's .435."""
    shown = random_pairs(800)
    behaviour = ErrorDriven(margin=0.0).fit(space(4000), shown)
    assert correct(behaviour, shown).mean() == 1
    assert correct(behaviour.clipped(), shown).mean().item() == pytest.approx(0.435, abs=0.06)
