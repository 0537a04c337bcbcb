"""Learning says what happens: progress while it lasts, a warning where it fails, and an end where nothing is gained."""

import math
import warnings
from typing import Any

import numpy as np
import pytest
import torch
from robots import correct, random_pairs, same_bits, space

import torchvsa
from behaviours import (
    RULES,
    Behaviour,
    BehaviourBank,
    BehaviourClassifier,
    Demonstrations,
    ErrorDriven,
    Gradient,
    LeastSquares,
    OneShot,
)
from behaviours.learning import ConvergenceWarning, no_convergence_warnings
from behaviours.learning.ridge import solve

TRAINED = [ErrorDriven(epochs=20), Gradient(epochs=30, batch_size=16), LeastSquares()]
trained = pytest.mark.parametrize("rule", TRAINED, ids=[rule.name for rule in TRAINED])


def contradicting(count: int, seed: int = 0) -> Demonstrations:
    """Pairs, half of which are shown a second time with other commands."""
    shown = random_pairs(count, seed)
    others = shown.where(torch.arange(count) < count // 2)
    return Demonstrations.join([shown, Demonstrations(others.sensors, -others.commands.roll(1, 0))])


@trained
def test_pairs_left_wrong_are_told(rule: Any) -> None:
    shown = random_pairs(200)
    with pytest.warns(ConvergenceWarning) as caught:
        behaviour = rule.fit(space(64), shown)
    (warning,) = caught
    wrong = int((correct(behaviour, shown) == 0).sum())
    assert wrong > 0
    assert str(warning.message).startswith(f"{type(rule).__name__} left {wrong} of 200 pairs wrong")
    assert "take more dimensions (dim)" in str(warning.message)
    assert "contradict" not in str(warning.message)
    assert warning.filename == __file__


@trained
def test_contradictions_are_told(rule: Any) -> None:
    shown = contradicting(200)
    with pytest.warns(
        ConvergenceWarning, match=r"(\d+) of 300 rows \(\d+%\) contradict.* more bins or fewer levels"
    ) as caught:
        behaviour = rule.fit(space(64), shown)
    assert f"{behaviour.report.contradicting} of 300 rows" in str(caught[0].message)


@trained
def test_contradictions_alone_are_no_failure(rule: Any) -> None:
    # Two of three say the same. (Between two that differ in both wheels a linear program may choose a mixture.)
    shown = Demonstrations.join([contradicting(20), random_pairs(20)])
    report = rule.fit(space(4000, protection={"name": "self_shift", "width": "sum"}), shown).report
    assert report.contradicting >= 8


def test_the_warning_points_at_the_callers_line_from_any_depth() -> None:
    shown = random_pairs(200)
    bank = BehaviourBank(space(64))
    calls = [
        lambda: LeastSquares().fit(bank.space, shown),
        lambda: bank.learn("go", shown, LeastSquares()),
        lambda: bank.partial_fit("go", shown, ErrorDriven(epochs=1)),
        lambda: bank.partial_fit("new", shown, ErrorDriven(epochs=1)),
    ]
    for call in calls:
        with pytest.warns(ConvergenceWarning) as caught:
            call()
        assert (caught[0].filename, caught[0].lineno) == (__file__, call.__code__.co_firstlineno)


def test_those_who_report_it_themselves_ignore_it() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with no_convergence_warnings():
            LeastSquares().fit(space(64), random_pairs(200))


def test_conditions_held_back_are_not_counted() -> None:
    generator = torch.Generator().manual_seed(0)
    shown = Demonstrations(torch.rand(60, 3, generator=generator) * 20, torch.rand(60, 2, generator=generator) * 2 - 1)
    made = space(4000, protection={"name": "self_shift", "width": "sum"})
    with pytest.warns(ConvergenceWarning, match=r"left \d of 42 pairs wrong after 21 epochs"):
        report = Gradient(validation_fraction=0.3, patience=20, epochs=40, batch_size=8).fit(made, shown).report
    assert report.wrong > 10


PIECEWISE = [OneShot("similarity"), ErrorDriven(epochs=2), Gradient(epochs=3)]


@pytest.mark.filterwarnings("ignore::behaviours.learning.ConvergenceWarning")
@pytest.mark.parametrize("rule", PIECEWISE, ids=[rule.name for rule in PIECEWISE])
def test_pieces_tell_their_progress(rule: Any) -> None:
    bank = BehaviourBank(space(64))
    for seed in (0, 1):
        shares: list[float] = []
        bank.partial_fit("go", random_pairs(600, seed), rule, shares.append)
        assert len(shares) >= 3
        assert shares == sorted(shares)
        assert (min(shares) > 0, shares[-1]) == (True, 1.0)


@pytest.mark.filterwarnings("ignore::behaviours.learning.ConvergenceWarning")
@pytest.mark.parametrize(
    "rule", [*TRAINED[1:], ErrorDriven(epochs=1), Gradient(epochs=1, batch_size=4), OneShot()], ids=str
)
def test_long_work_tells_several_shares(rule: Any) -> None:
    shares: list[float] = []
    rule.fit(space(64), random_pairs(1200), shares.append)
    assert len(shares) >= 4
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_training_ends_where_it_would_not_get_there() -> None:
    shown, made = random_pairs(40), space(16)
    with pytest.warns(ConvergenceWarning, match=r"after 2\d epochs; take more dimensions \(dim\)$"):
        early = ErrorDriven(epochs=100, patience=10).fit(made, shown)
    # The program is one of those at the end of its last 10 epochs, each of which a run of that many epochs ends with.
    with no_convergence_warnings():
        ends: list[Behaviour] = [
            ErrorDriven(epochs=epochs, patience=200).fit(made, shown)
            for epochs in range(early.report.epochs - 9, early.report.epochs + 1)
        ]
    shares = [correct(end, shown).mean() for end in ends]
    assert correct(early, shown).mean() == max(shares)
    assert any(same_bits(early.program, end.program) for end in ends)
    assert early.report.updates == ends[-1].report.updates


@pytest.mark.parametrize("vsa", ["BSC", "HRR"])  # integers and floats
def test_patience_leaves_runs_that_converge_alone(vsa: str) -> None:
    shown = random_pairs(60)
    made = space(200, vsa, protection={"name": "self_shift", "width": "sum"})
    patient, usual = (ErrorDriven(patience=patience).fit(made, shown) for patience in (200, 30))
    assert same_bits(patient.program, usual.program)
    assert patient.report == usual.report


def grad_off() -> Any:
    return pytest.mark.parametrize("off", [torch.no_grad, torch.inference_mode])


@grad_off()
@pytest.mark.parametrize("name", RULES)
def test_gradients_may_be_off_around_learning(name: str, off: Any) -> None:
    shown, rule = random_pairs(40), RULES[name]()
    protection = {"name": "self_shift", "width": "sum"}
    plain = rule.fit(space(1000, protection=protection), shown)
    with off():
        inside = rule.fit(space(1000, protection=protection), shown)
    assert same_bits(inside.program, plain.program)
    assert inside.report == plain.report


@grad_off()
@pytest.mark.parametrize("rule", [Gradient(epochs=20), Gradient(epochs=20, sparse=True), Gradient("hinge", epochs=20)])
@pytest.mark.parametrize("vsa", ["MAP-C", "HRR", "FHRR"])
def test_gradients_may_be_off_around_pieces(rule: Gradient, vsa: str, off: Any) -> None:
    made = space(1000, vsa, protection={"name": "self_shift", "width": "sum"})
    first, then = random_pairs(20), random_pairs(20, 1)
    plain = rule.partial_fit(rule.fit(made, first), then)
    with off():
        inside = rule.partial_fit(rule.fit(made, first), then)
        recall = inside(then.sensors)
    real = [torch.view_as_real(p) if p.is_complex() else p for p in (inside.program, plain.program)]
    assert same_bits(*real)
    assert not inside.program.is_inference()
    assert torch.equal(recall.commands, plain(then.sensors).commands)


def test_a_learning_rate_that_is_too_high_is_told() -> None:
    with pytest.raises(ValueError, match=r"learning_rate=1e\+25 made the program infinite; take a lower one"):
        Gradient("squared", learning_rate=1e25, epochs=3).fit(space(64), random_pairs(20))


def test_a_ridge_that_is_too_small_is_told() -> None:
    vsa = torchvsa.MAP(64, dtype=torch.int8)
    conditions, items = (vsa.random(count, generator=torch.Generator().manual_seed(count)) for count in (3, 1))
    # Each condition twice: without a ridge the system has no single solution.
    with pytest.raises(ValueError, match="ridge=1e-300 is too small"):
        solve(vsa, conditions.repeat(2, 1), items, torch.ones(6, 1, dtype=torch.float64), 1e-300)
    with pytest.raises(ValueError, match="ridge is a finite number above 0; got nan"):
        solve(vsa, conditions, items, torch.ones(3, 1, dtype=torch.float64), math.nan)


def test_a_classifier_of_noisy_labels_says_nothing() -> None:
    rng = np.random.default_rng(0)
    readings, labels = rng.normal(size=(80, 2)), rng.integers(0, 2, 80)
    classifier = BehaviourClassifier(dim=64, bins=4, epochs=5, random_state=0).fit(readings, labels)
    assert classifier.score(readings, labels) < 1
    classifier.partial_fit(readings, labels)
