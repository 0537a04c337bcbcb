"""What every learning rule promises, on every architecture: a rule joins by being registered in RULES."""

import math

import numpy as np
import plain
import pytest
import torch
from robots import KINDS, SCHEMA, correct, random_pairs, space
from torch.testing import assert_close

import torchvsa
from behaviours import RULES, Demonstrations, ErrorDriven, Gradient, LeastSquares, OneShot, Rule, Space
from behaviours.learning.samples import Samples
from behaviours.testing import check_rule
from torchvsa import MAP
from torchvsa.encoders import History, RandomFourier

rules = pytest.mark.parametrize("rule", RULES)
on_architectures = pytest.mark.parametrize(
    ("rule", "vsa"),
    [(r, name) for r in RULES for name in KINDS if RULES[r].supports(torchvsa.architecture_near(name, 8))],
)

OPTIONS: list[Rule] = [
    OneShot("similarity"),
    OneShot("similarity", clip_each_step=True),
    OneShot(contradictions="latest"),
    ErrorDriven(average=True),
    ErrorDriven(contradictions="first"),
    LeastSquares(contradictions="majority"),
    LeastSquares(smooth=True),
    Gradient(epochs=15, sparse=True),
    Gradient(epochs=15, output="int8"),
    Gradient("hinge", epochs=15),
]


def quick(name: str) -> Rule:
    """A rule by its name, with options by which it does not take long."""
    return Gradient(epochs=15) if name == "gradient" else RULES.find(name)()


# Each rule in half of the architectures; in all of them it learns and recalls in the tests below.
@pytest.mark.parametrize(
    ("rule", "vsa"),
    [(rule, vsa) for turn, rule in enumerate(RULES) for vsa in KINDS[(turn + turn // 2) % 2 :: 2]],
)
def test_every_rule_keeps_the_laws(rule: str, vsa: str) -> None:
    # A sparse hypervector has √d ones, which are few at d = 500.
    dim = 2000 if vsa == "BSDC-S" else 500
    check_rule(quick(rule), space(dim, vsa, protection={"name": "self_shift", "width": "sum"}))


@pytest.mark.parametrize("rule", OPTIONS, ids=repr)
def test_their_options_keep_the_laws(rule: Rule) -> None:
    check_rule(rule)


@rules
def test_they_keep_the_laws_over_a_memory_of_continuous_readings(rule: str) -> None:
    check_rule(quick(rule), Space(SCHEMA, History(RandomFourier(MAP(1000), 3), [1])))


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


@pytest.mark.parametrize("rule", [rule for rule in RULES if RULES[rule].integer_programs])
@pytest.mark.parametrize(
    "vsa", [name for name in KINDS if torchvsa.architecture_near(name, 8).integer or "MAP" in name]
)
def test_integer_codes_make_integer_programs(rule: str, vsa: str) -> None:
    behaviour = RULES[rule]().fit(space(256 if "MAP" in vsa else 2000, vsa), random_pairs(30))
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
    with pytest.raises(ValueError, match="row 1 of the demonstrations has no observed sensor"):
        RULES[rule]().fit(space(64), shown)


@rules
def test_values_out_of_range_are_refused(rule: str) -> None:
    with pytest.raises(ValueError, match=r"sensor 'front' reads 21 in row 1; its range is \[0, 20\]"):
        RULES[rule]().fit(space(64), Demonstrations([[0.0, 0, 0], [0, 0, 21]], [[0.0, 0], [0, 0]]))
    message = r"actuator 'right_motor' has the command -1.5 in row 0; its range is \[-1, 1\]"
    with pytest.raises(ValueError, match=message):
        RULES[rule]().fit(space(64), Demonstrations([[0.0, 0, 0]], [[0.0, -1.5]]))
    with pytest.raises(ValueError, match=r"left, right, front.*got shape \(1, 2\)"):
        RULES[rule]().fit(space(64), Demonstrations([[0.0, 0]], [[0.0, 0]]))


def test_samples_list_conditions_and_results_as_they_appear() -> None:
    shown = Demonstrations([[5.5, 1, 1], [2.5, 1, 1], [5.9, 1, 1]], [[1.0, 1], [-1, 0], [-1, 0]])
    samples = Samples.of(space(128), shown)
    assert samples.condition.tolist() == [0, 1, 0]
    assert samples.result.tolist() == [0, 1, 1]
    assert SCHEMA.command_values(samples.results).tolist() == [[1, 1], [-1, 0]]
