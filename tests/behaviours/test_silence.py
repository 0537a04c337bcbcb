"""Behaviours learned apart: silent where others know, louder by evidence, and silent where nobody is sure."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from plain import wide
from robots import random_pairs, space

from behaviours import (
    BehaviourBank,
    Bundle,
    Demonstrations,
    ErrorDriven,
    Gradient,
    LeastSquares,
    OneShot,
    Priority,
    Rule,
    Sequencing,
    Silence,
)

BOTH = [ErrorDriven(margin=2, evidence=1), LeastSquares(ridge=1e-6, evidence=0.5)]


def scores(bank: BehaviourBank, name: str, shown: Demonstrations) -> np.ndarray:
    """The score of each result, in units of the score that a stored pair gives itself, in plain NumPy."""
    behaviour = bank[name]
    items = wide(bank.space.items(behaviour.results)).real
    conditions = wide(bank.space.encode(bank.space.cells(shown.sensors))).real
    unit = (items**2).sum(1)
    return (conditions * wide(behaviour.program).real) @ items.T / unit


@pytest.mark.parametrize("rule", BOTH, ids=lambda rule: rule.name)
def test_a_rule_is_silent_where_only_others_know(rule: Rule) -> None:
    bank, shown = BehaviourBank(space(1024, protection="none")), random_pairs(30)
    own, other = shown.where([row < 15 for row in range(30)]), shown.where([row >= 15 for row in range(30)])
    assert rule.supports_silence
    bank.learn("own", own, rule, silent=other)
    loudest = np.abs(scores(bank, "own", other)).max()
    assert loudest <= 0.25 * scores(bank, "own", own).max(1).min()
    bank.learn("alone", own, rule)
    assert np.abs(scores(bank, "alone", other)).max() > 2 * loudest
    # What it was shown itself does not become silent by being shown to others, too.
    bank.learn("shared", own, rule, silent=shown)
    assert torch.equal(bank["shared"].program, bank["own"].program)


def test_priority_by_similarity_lets_each_speak_where_it_is_not_silent() -> None:
    bank, shown = BehaviourBank(space(2048, protection="none")), random_pairs(45)
    parts = {name: shown.where([number % 3 == of for number in range(45)]) for of, name in enumerate("abc")}
    bank.learn_apart(parts, BOTH[0])
    policy, recalls = Priority(bank, ["c", "a", "b"], by="similarity"), bank(shown.sensors)
    for name, least in zip(policy.names, policy.thresholds, strict=True):
        assert least == pytest.approx(
            0.5 * np.quantile(bank[name](parts[name].sensors).similarity, 0.02, method="lower")
        )
    speaker = policy(shown.sensors).speaker
    assert speaker is not None
    for row, number in enumerate(speaker.tolist()):
        above = [float(recalls[n].similarity[row]) - t for n, t in zip("cab", policy.thresholds, strict=True)]
        assert number == next((i for i, lead in enumerate(above) if lead >= 0), int(np.argmax(above)))
        assert policy.names[number] == "abc"[row % 3]
    with pytest.raises(ValueError, match="expected one of 'familiarity', 'similarity'"):
        Priority(bank, by="margin")  # pyright: ignore[reportArgumentType] # what a file could hold


@pytest.mark.parametrize("rule", BOTH, ids=lambda rule: rule.name)
def test_what_was_shown_often_is_louder(rule: Rule) -> None:
    bank, shown = BehaviourBank(space(2048, protection="none")), random_pairs(2)
    often = Demonstrations.join([shown.where([True, False])] * 50 + [shown.where([False, True])])
    bank.learn("seen", often, rule)
    first, second = scores(bank, "seen", shown).max(1)
    if isinstance(rule, ErrorDriven):
        assert first >= 2 + np.log(51)
        assert 2 + np.log(2) <= second <= 4 + np.log(2)
    else:
        assert first / second == pytest.approx((1 + 0.5 * np.log(51)) / (1 + 0.5 * np.log(2)), rel=1e-3)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(seed=st.integers(0, 99), times=st.integers(3, 30), more=st.sampled_from(["go", "stop"]))
def test_the_one_with_more_evidence_wins_a_tie(seed: int, times: int, more: str) -> None:
    bank = BehaviourBank(space(1024, protection="none", seed=seed))
    count = {"go": 1, "stop": 1, more: 10 * times}
    results = {"go": [1.0, 1.0], "stop": [0.0, 0.0]}
    shown = {name: Demonstrations([[3.0, 3, 3]] * count[name], [results[name]] * count[name]) for name in count}
    bank.learn_apart(shown, ErrorDriven(margin=2, evidence=1))
    assert Bundle(bank)([[3.0, 3, 3]]).commands.tolist() == [results[more]]


def test_a_louder_margin_takes_precedence() -> None:
    shown = {"go": Demonstrations([[3.0, 3, 3]], [[1.0, 1]]), "stop": Demonstrations([[3.0, 3, 3]], [[0.0, 0]])}
    for loud, commands in (("go", [1.0, 1.0]), ("stop", [0.0, 0.0])):
        bank, rule = BehaviourBank(space(1024, protection="none")), ErrorDriven(margin=2)
        bank.learn_apart(shown, {**dict.fromkeys(shown, rule), loud: replace(rule, margin=6)})
        assert Bundle(bank)([[3.0, 3, 3]]).commands.tolist() == [commands]


@pytest.mark.parametrize("combine", ["sum", "product"])
def test_a_sum_of_behaviours_learned_apart_recalls_what_each_was_shown(combine: str) -> None:
    shown = random_pairs(60)
    apart = {str(part): shown.where([row % 3 == part for row in range(60)]) for part in range(3)}
    bank = BehaviourBank(space(2000, protection="none", combine=combine))
    bank.learn_apart(apart)
    assert (Bundle(bank)(shown.sensors).commands == shown.commands).all()
    assert torch.equal((bank["0"] + bank["1"] + bank["2"]).program, Bundle(bank).program)


def test_a_rule_that_cannot_keep_silence_says_so() -> None:
    bank, shown = BehaviourBank(space(64)), random_pairs(4)
    for rule in (OneShot(), Gradient(epochs=1)):
        assert not rule.supports_silence
        with pytest.raises(ValueError, match=f"{rule.name}' cannot keep silence; take ErrorDriven or LeastSquares"):
            bank.learn("x", shown, rule, silent=shown)
    with pytest.raises(ValueError, match="there is no rule for 'b'"):
        bank.learn_apart({"a": shown, "b": shown}, {"a": ErrorDriven()})


def test_silence_is_an_answer() -> None:
    bank, shown = BehaviourBank(space(1024)), random_pairs(8)
    bank.learn("known", shown, OneShot())
    known, unknown = shown.sensors, random_pairs(8, seed=7).sensors
    assert bank["known"].threshold is not None
    quiet = Silence(bank["known"], familiarity=bank["known"].threshold - 1e-6)
    assert quiet(known).speaker.tolist() == [0] * 8
    recall = quiet(unknown)
    assert recall.speaker.tolist() == [-1] * 8
    assert recall.commands.isnan().all()
    still = Silence(Bundle(bank), familiarity=bank["known"].threshold - 1e-6, fallback=[0, 0])
    assert still(unknown).commands.tolist() == [[0.0, 0.0]] * 8
    assert still(known).commands.tolist() == shown.commands.tolist()
    assert Silence(bank["known"], similarity=0.99)(known).speaker.tolist() == [-1] * 8
    with pytest.raises(ValueError, match="left_motor"):
        Silence(bank["known"], fallback=[9, 0])
    with pytest.raises(ValueError, match="Sequencing has a memory"):
        Silence(Sequencing(bank))
