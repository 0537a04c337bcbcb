"""What every learning rule promises, on every architecture: a rule joins by being listed in RULES."""

import math

import numpy as np
import plain
import pytest
import torch
from robots import SCHEMA, correct, random_pairs, same_bits, space
from torch.testing import assert_close

import torchvsa
from behaviours import RULES, Demonstrations
from behaviours.learning.samples import Samples
from torchvsa import ARCHITECTURES

rules = pytest.mark.parametrize("rule", RULES)
on_architectures = pytest.mark.parametrize(
    ("rule", "vsa"),
    [(r, name) for r in RULES for name in ARCHITECTURES if RULES[r].supports(torchvsa.architecture(name, 8))],
)


@on_architectures
def test_ten_pairs_are_recalled(rule: str, vsa: str) -> None:
    # With the paper's width one pair of ten may share a shift; the sum spreads them.
    shown = random_pairs(10)
    behaviour = RULES[rule]().fit(space(2000, vsa, protection={"name": "self_shift", "width": "sum"}), shown)
    assert correct(behaviour, shown).mean() == 1
    assert (behaviour(shown.sensors).familiarity > 0.5 / 10**0.5).all()


@pytest.mark.filterwarnings("ignore::behaviours.learning.ConvergenceWarning")
@rules
def test_progress_rises_to_one(rule: str) -> None:
    shares: list[float] = []
    RULES[rule]().fit(space(64), random_pairs(40), shares.append)
    assert shares == sorted(shares)
    assert min(shares) > 0
    assert shares[-1] == 1.0


@on_architectures
@pytest.mark.parametrize("protection", torchvsa.PROTECTIONS)
def test_folded_recall_is_recall_step_by_step(rule: str, vsa: str, protection: str) -> None:
    shown = random_pairs(10, seed=3)
    behaviour = RULES[rule]().fit(space(512, vsa, protection=protection), shown)
    queries = [*shown.sensors.tolist(), [0.0, 20.0, 7.7], [math.nan, 3.3, math.nan], [1.5, math.nan, 19.0]]
    recall = behaviour(queries)
    exact = behaviour.space.vsa.integer
    for row, reading in enumerate(queries):
        expected = plain.query(behaviour, reading)
        # Floats: where two results are as good as equal, either may win.
        if exact or expected.margin > 1e-5:
            assert recall.commands[row].tolist() == expected.commands
        for field in ("similarity", "margin", "familiarity"):
            assert_close(getattr(recall, field)[row].item(), getattr(expected, field), atol=1e-5, rtol=1e-5)


@on_architectures
def test_rows_answer_as_they_would_alone(rule: str, vsa: str) -> None:
    shown = random_pairs(8)
    behaviour = RULES[rule]().fit(space(256, vsa), shown)
    together = behaviour(shown.sensors)
    for row, reading in enumerate(shown.sensors):
        alone = behaviour(reading[None])
        assert_close(alone.commands[0], together.commands[row])
        assert_close(alone.similarity[0], together.similarity[row], atol=1e-6, rtol=1e-5)


@on_architectures
def test_the_same_bits_twice(rule: str, vsa: str) -> None:
    shown = random_pairs(10)
    one, two = (RULES[rule]().fit(space(256, vsa, seed=4), shown) for _ in range(2))
    assert same_bits(
        torch.view_as_real(one.program) if one.program.is_complex() else one.program,
        torch.view_as_real(two.program) if two.program.is_complex() else two.program,
    )


@on_architectures
def test_nothing_observed_nothing_said(rule: str, vsa: str) -> None:
    shown = random_pairs(5)
    recall = RULES[rule]().fit(space(256, vsa), shown)([[math.nan] * 3, shown.sensors[0].tolist()])
    assert recall.commands.isnan().all(1).tolist() == [True, False]
    for part in (recall.similarity, recall.margin, recall.familiarity):
        assert part[0] == 0
        assert part[1] != 0


@rules
def test_no_rows_no_answers(rule: str) -> None:
    recall = RULES[rule]().fit(space(256), random_pairs(5))(torch.empty(0, 3))
    assert recall.commands.shape == (0, 2)
    assert all(part.shape == (0,) for part in (recall.similarity, recall.margin, recall.familiarity))


@rules
def test_a_program_that_knows_one_result_is_certain(rule: str) -> None:
    shown = Demonstrations([[1.0, 2.0, 3.0]], [[1.0, -1.0]])
    recall = RULES[rule]().fit(space(1000, protection="none"), shown)(shown.sensors)
    assert recall.commands.tolist() == [[1.0, -1.0]]
    assert recall.margin.tolist() == [math.inf]
    assert recall.familiarity.item() == pytest.approx(1.0)


@pytest.mark.parametrize("rule", [rule for rule in RULES if RULES[rule].counts])
@pytest.mark.parametrize(
    "vsa", [name for name in ARCHITECTURES if torchvsa.architecture(name, 8).integer or "MAP" in name]
)
def test_integer_codes_make_integer_programs(rule: str, vsa: str) -> None:
    behaviour = RULES[rule]().fit(space(256, vsa), random_pairs(30))
    assert behaviour.program.dtype == behaviour.known.dtype == torch.int32


@rules
def test_float_and_integer_codes_learn_the_same_program(rule: str) -> None:
    shown = random_pairs(25)
    exact, floats = (RULES[rule]().fit(space(512, dtype=dtype), shown) for dtype in ("int8", "float32"))
    np.testing.assert_array_equal(exact.program.numpy(), floats.program.numpy())
    assert exact.results.tolist() == floats.results.tolist()


@rules
def test_a_row_without_any_observed_sensor_is_refused(rule: str) -> None:
    shown = Demonstrations([[1.0, 2, 3], [math.nan] * 3], [[0.0, 0], [1, 1]])
    with pytest.raises(ValueError, match="row 1 of the demonstration has no observed sensor"):
        RULES[rule]().fit(space(64), shown)


@rules
def test_values_out_of_range_are_refused(rule: str) -> None:
    with pytest.raises(ValueError, match=r"sensor 'front' reads 21 in row 1; its range is \[0, 20\]"):
        RULES[rule]().fit(space(64), Demonstrations([[0.0, 0, 0], [0, 0, 21]], [[0.0, 0], [0, 0]]))
    with pytest.raises(ValueError, match=r"actuator 'right_motor' is told -1.5 in row 0; its range is \[-1, 1\]"):
        RULES[rule]().fit(space(64), Demonstrations([[0.0, 0, 0]], [[0.0, -1.5]]))
    with pytest.raises(ValueError, match=r"left, right, front.*got shape \(1, 2\)"):
        RULES[rule]().fit(space(64), Demonstrations([[0.0, 0]], [[0.0, 0]]))


def test_samples_list_conditions_and_results_as_they_appear() -> None:
    shown = Demonstrations([[5.5, 1, 1], [2.5, 1, 1], [5.9, 1, 1]], [[1.0, 1], [-1, 0], [-1, 0]])
    samples = Samples.of(space(128), shown)
    assert samples.condition.tolist() == [0, 1, 0]
    assert samples.result.tolist() == [0, 1, 1]
    assert SCHEMA.command_values(samples.results).tolist() == [[1, 1], [-1, 0]]
