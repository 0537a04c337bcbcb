"""Learning in pieces: what follows from a behaviour and another piece of demonstration."""

from itertools import pairwise
from typing import Any

import numpy as np
import oracle
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from robots import correct, random_pairs, same_bits, space

from behaviours import (
    RULES,
    Behaviour,
    BehaviourBank,
    Demonstrations,
    ErrorDriven,
    Gradient,
    LearningReport,
    LeastSquares,
    OneShot,
    Rule,
)

PIECEWISE: list[Rule] = [
    OneShot("similarity"),
    OneShot("similarity", clip_each_step=True),
    ErrorDriven(),
    ErrorDriven(average=True),
    Gradient(epochs=20),
    Gradient(epochs=20, sparse=True),
]
in_pieces = pytest.mark.parametrize("rule", PIECEWISE, ids=str)


def random_rows(count: int, kinds: int, seed: int) -> Demonstrations:
    """Rows that repeat and contradict each other."""
    pairs = random_pairs(kinds, seed)
    rows, results = np.random.default_rng(seed).integers(0, kinds, (2, count))
    return Demonstrations(pairs.sensors[rows], pairs.commands[results])


def cut(shown: Demonstrations, ends: list[int]) -> list[Demonstrations]:
    rows = torch.arange(len(shown))
    marks = [0, *sorted(ends), len(shown)]
    return [shown.where((rows >= a) & (rows < b)) for a, b in pairwise(marks) if a < b]


def learn(rule: Rule, made: Any, pieces: list[Demonstrations]) -> Behaviour:
    behaviour = rule.fit(made, pieces[0])
    for piece in pieces[1:]:
        behaviour = rule.partial_fit(behaviour, piece)
    return behaviour


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 50),
    kinds=st.integers(1, 30),
    ends=st.lists(st.integers(1, 59), max_size=4),
    dim=st.sampled_from([64, 256]),
    clip=st.booleans(),
    threshold=st.sampled_from([None, -0.5, 0.0, 0.1, 0.4]),
)
def test_superposing_in_pieces_is_algorithm_1(
    seed: int, kinds: int, ends: list[int], dim: int, clip: bool, threshold: float | None
) -> None:
    shown, made = random_rows(60, kinds, seed), space(dim)
    rule = OneShot("similarity", threshold=threshold, clip_each_step=clip)
    whole, pieces = rule.fit(made, shown), learn(rule, made, cut(shown, ends))
    assert same_bits(pieces.program, whole.program)
    assert same_bits(pieces.known, whole.known)
    assert pieces.results.tolist() == whole.results.tolist()
    encoder = oracle.Encoder.of(made)
    limit = 4 / dim**0.5 if threshold is None else threshold
    expected = oracle.learn(encoder, shown.sensors.tolist(), shown.commands.tolist(), "similarity", limit, clip)
    np.testing.assert_array_equal(pieces.program.numpy(), expected.prog_hv)
    np.testing.assert_array_equal(pieces.known.numpy(), expected.known_cond_hv)
    np.testing.assert_array_equal(made.items(pieces.results).numpy(), expected.results)
    report, once = pieces.report, whole.report
    # What is stored, and what is not, is the same; whether it was known before is only known within a piece.
    assert report.samples == once.samples
    assert report.pairs == once.pairs
    assert report.truly_known + report.falsely_known + report.presumed_known == once.truly_known + once.falsely_known
    assert once.presumed_known == 0


@pytest.mark.parametrize("vsa", ["BSC", "MAP-B", "MAP-I"])
@pytest.mark.parametrize("clip", [False, True])
def test_other_integer_codes_in_pieces(vsa: str, clip: bool) -> None:
    shown, made = random_rows(60, 20, 1), space(256, vsa)
    rule = OneShot("similarity", clip_each_step=clip)
    whole, pieces = rule.fit(made, shown), learn(rule, made, cut(shown, [13, 40]))
    assert same_bits(pieces.program, whole.program)
    assert same_bits(pieces.known, whole.known)


@pytest.mark.filterwarnings("ignore::behaviours.learning.ConvergenceWarning")
@in_pieces
def test_a_piece_leaves_the_behaviour_before_it_as_it_is(rule: Rule) -> None:
    first, then = cut(random_pairs(20), [10])
    before = rule.fit(space(256), first)
    state = {key: value.clone() for key, value in before.state_dict().items()}
    report = before.report
    after = rule.partial_fit(before, then)
    assert all(same_bits(value, state[key]) for key, value in before.state_dict().items())
    assert before.report is report
    assert after.space is before.space
    assert not torch.equal(after.program, before.program)


@in_pieces
def test_new_results_stand_behind_the_old_ones(rule: Rule) -> None:
    first = Demonstrations([[1.0, 1, 1], [2.0, 2, 2]], [[0.0, 0], [1, 1]])
    then = Demonstrations([[3.0, 3, 3], [4.0, 4, 4], [5.0, 5, 5]], [[-1.0, -1], [1, 1], [-1, 1]])
    made = space(1024, protection={"name": "self_shift", "width": "sum"})
    behaviour = rule.partial_fit(rule.fit(made, first), then)
    assert made.schema.command_values(behaviour.results).tolist() == [[0, 0], [1, 1], [-1, -1], [-1, 1]]
    assert correct(behaviour, Demonstrations.join([first, then])).mean() == 1


@in_pieces
def test_reports_and_known_conditions_add_up(rule: Rule) -> None:
    pieces = cut(random_rows(60, 200, 3), [20, 35])
    made = space(4000, protection={"name": "self_shift", "width": "sum"})
    behaviour = learn(rule, made, pieces)
    alone = [rule.fit(made, piece).report for piece in pieces]
    report = behaviour.report
    assert (report.rule, report.samples) == (rule.name, 60)
    if not isinstance(rule, OneShot):
        assert report.new == sum(r.new for r in alone)
        assert report.contradicting == sum(r.contradicting for r in alone)
        sums = [made.encode(made.cells(piece.sensors)).unique(dim=0).int().sum(0) for piece in pieces]
        assert behaviour.known.tolist() == sum(sums, torch.zeros(4000, dtype=torch.int32)).tolist()
        assert report.updates > 0
        assert report.epochs >= 3
    counted = report.new + report.re_added + report.truly_known + report.falsely_known + report.presumed_known
    assert counted == report.samples


def test_a_report_of_two_pieces() -> None:
    a = LearningReport("one_shot", 5, 4, 1, epochs=2, updates=7, wrong=3)
    b = LearningReport("gradient", 3, 1, 2, contradicting=1, epochs=9, updates=1, wrong=2)
    both = LearningReport("gradient", 8, 5, 3, contradicting=1, epochs=11, updates=8, wrong=2)
    assert a.merged(b) == both


@pytest.mark.filterwarnings("ignore::behaviours.learning.ConvergenceWarning")
@pytest.mark.parametrize("rule", [ErrorDriven(), Gradient(learning_rate=0.1)], ids=["error_driven", "gradient"])
@pytest.mark.parametrize("vsa", ["MAP-C", "FHRR", "BSC"])
def test_training_goes_on_from_the_program_at_hand(rule: Rule, vsa: str) -> None:
    shown = random_pairs(120)
    made = space(1024, vsa, protection={"name": "self_shift", "width": "sum"})
    pieces = cut(shown, [40, 80])
    behaviour = OneShot().fit(made, pieces[0])
    for _ in range(3):
        for piece in pieces:
            behaviour = rule.partial_fit(behaviour, piece)
    # Pieces shown in turn end where all of them are recalled, although each call sees one alone.
    assert correct(behaviour, shown).mean() == 1


def test_what_is_in_order_is_left_alone() -> None:
    shown = random_pairs(60)
    behaviour = ErrorDriven().fit(space(512), shown)
    again = ErrorDriven().partial_fit(behaviour, shown)
    assert same_bits(again.program, behaviour.program)
    assert (again.report.updates, again.report.epochs) == (behaviour.report.updates, behaviour.report.epochs + 1)


@pytest.mark.parametrize("sparse", [False, True])
def test_a_descent_starts_where_the_program_is(sparse: bool) -> None:
    shown = random_pairs(30)
    behaviour = Gradient().fit(space(512), shown)
    slowly = Gradient(learning_rate=1e-9, epochs=1, sparse=sparse).partial_fit(behaviour, shown)
    torch.testing.assert_close(slowly.program, behaviour.program, atol=1e-5, rtol=1e-5)


def test_a_clipped_behaviour_goes_on_clipped_or_raw() -> None:
    first, then = cut(random_pairs(12), [6])
    made = space(512)
    raw = OneShot().fit(made, first)
    with pytest.raises(
        ValueError, match=r"programs of torch.int8.*torch.int32, so continue from behaviour.clipped\(\)"
    ):
        OneShot("similarity", clip_each_step=True).partial_fit(raw, then)
    clipped = OneShot("similarity", clip_each_step=True).partial_fit(raw.clipped(), then)
    assert clipped.program.dtype == torch.int8
    wide = OneShot("similarity", threshold=2.0).partial_fit(raw.clipped(), then)
    assert same_bits(wide.program, raw.program.clamp(-1, 1) + OneShot().fit(made, then).program)


def test_rules_that_cannot_say_why() -> None:
    shown = random_pairs(5)
    behaviour = OneShot().fit(space(64), shown)
    for rule, words in (
        (LeastSquares(), "covariance of all earlier pairs"),
        (OneShot(), "needs all earlier conditions.*novelty='similarity'"),
        (Gradient(output="int8"), "output='int8' rounds.*output='float'"),
    ):
        with pytest.raises(ValueError, match=words):
            rule.partial_fit(behaviour, shown)


@pytest.mark.parametrize("name", RULES)
def test_a_rule_goes_on_or_says_that_it_cannot(name: str) -> None:
    ready = [rule for rule in PIECEWISE if rule.name == name]
    assert RULES[name].supports_partial_fit == bool(ready)


class Whole(OneShot):
    """A rule that says nothing of pieces."""

    name = "whole"
    partial_fit = Rule.partial_fit


def test_rules_need_not_go_on() -> None:
    shown = random_pairs(5)
    with pytest.raises(ValueError, match="'whole' cannot continue from a behaviour"):
        Whole().partial_fit(OneShot().fit(space(64), shown), shown)


def test_a_bank_begins_and_goes_on() -> None:
    shown = random_rows(40, 15, 0)
    first, then = cut(shown, [25])
    bank = BehaviourBank(space(256))
    rule = OneShot("similarity")
    assert bank.partial_fit("seek", first, rule).samples == 25
    assert bank.partial_fit("seek", then, rule).samples == 40
    assert bank.names == ["seek"]
    assert same_bits(bank["seek"].program, rule.fit(bank.space, shown).program)
    before = bank["seek"]
    with pytest.raises(ValueError, match="covariance of all earlier pairs"):
        bank.partial_fit("seek", then, LeastSquares())
    assert bank["seek"] is before
