"""Behaviours add up: exactly, and what is taken away again leaves no trace."""

import copy
import math
import warnings
from pathlib import Path
from typing import Any

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from robots import KINDS, random_pairs, same_bits, space
from torch.testing import assert_close

from behaviours import (
    Behaviour,
    BehaviourBank,
    Bundle,
    ConvergenceWarning,
    Demonstrations,
    ErrorDriven,
    LearningReport,
    OneShot,
)
from torchvsa._numerics import as_bipolar

NAMES = ["seek", "avoid", "flee"]
SHOWN = random_pairs(36)
READINGS = [*SHOWN.sensors[::3].tolist(), [math.nan, 3.3, 19.0]]


def learned(vsa: str = "MAP-C", dim: int = 500, results: int = 3) -> BehaviourBank:
    """Three behaviours over one space, each with results that the others lack."""
    bank = BehaviourBank(space(dim, vsa))
    for i, name in enumerate(NAMES):
        sensors = SHOWN.sensors[12 * i : 12 * i + 12]
        commands = torch.tensor([[i - 1.0, (row % results) - 1.0] for row in range(12)])
        bank.learn(name, Demonstrations(sensors, commands), ErrorDriven())
    return bank


def same(a: Behaviour, b: Behaviour) -> bool:
    tensors = zip((a.program, a.known, a.results), (b.program, b.known, b.results), strict=True)
    return all(x.dtype == y.dtype and torch.equal(x, y) for x, y in tensors) and a.report == b.report


@pytest.mark.parametrize("vsa", KINDS)
def test_programs_and_known_conditions_are_weighted_sums(vsa: str) -> None:
    bank = learned(vsa, 400)
    both = bank["seek"] + 2 * bank["avoid"] - bank["flee"] / 4
    for name in ("program", "known"):
        seek, avoid, flee = (as_bipolar(getattr(bank[part], name)) for part in NAMES)
        wanted = seek + 2 * avoid - 0.25 * flee
        assert_close(getattr(both, name), wanted.to(getattr(both, name).dtype))
    conditions = bank.space.encode(bank.space.cells(READINGS[:4]))
    items, seek = both.memory.items, bank["seek"]
    assert_close(both.scores(READINGS[:4]), bank.space.vsa.readout(both.program, items)(conditions))
    assert not torch.equal(both.program, seek.program)


@given(weights=st.lists(st.integers(-9, 9), min_size=3, max_size=3).filter(any))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_adding_is_voting(weights: list[int]) -> None:
    bank = learned()
    made = Behaviour.sum([bank[name] for name in NAMES], weights)
    assert made.program.dtype == torch.int32
    conditions = bank.space.encode(bank.space.cells(READINGS[:6]))
    votes = sum(w * made.readout().of(bank[name].program)(conditions) for w, name in zip(weights, NAMES, strict=True))
    assert_close(made.readout()(conditions), votes, rtol=1e-12, atol=1e-9)
    assert sum(term.weight != 0 for term in made.terms) == sum(w != 0 for w in weights)


@pytest.mark.parametrize("vsa", ["MAP-C", "MAP-I", "MAP-B", "BSC"])
def test_what_is_taken_away_again_leaves_no_trace(vsa: str) -> None:
    bank = learned(vsa)
    seek, avoid, flee = (bank[name] for name in NAMES)
    everything = seek + avoid + flee
    assert same(everything - avoid, seek + flee)
    assert same(everything - (avoid + seek), 1 * flee)
    assert same(3 * avoid + seek - 3 * avoid, 1 * seek)
    assert same(everything - avoid + avoid, seek + flee + avoid)
    assert torch.equal((everything - avoid - flee).program, seek.program)
    opposite = -everything
    assert same(-opposite, everything)
    assert same(sum([seek, avoid, flee]), everything)  # type: ignore[arg-type] (`sum` begins with 0)


@given(
    parts=st.tuples(
        *[st.tuples(st.integers(1, 12), st.integers(0, 9), st.sampled_from(["one_shot", "error_driven"]))] * 3
    ),
    vsa=st.sampled_from(["MAP-C", "MAP-I", "MAP-B", "BSC"]),
    weight=st.integers(-5, 5).filter(bool),
)
@settings(max_examples=40, deadline=None, derandomize=True)
def test_removal_is_exact(parts: Any, vsa: str, weight: int) -> None:
    made = space(200, vsa, protection="none")
    rules = {"one_shot": OneShot(), "error_driven": ErrorDriven(epochs=3)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        a, b, c = (rules[rule].fit(made, random_pairs(count, seed)) for count, seed, rule in parts)
    fingerprints = {part.terms[0].fingerprint for part in (a, b, c)}
    if len(fingerprints) == 3:
        assert same((a + weight * b + c) - weight * b, a + c)
        assert same(a + weight * b - a, weight * b)


def test_results_are_counted() -> None:
    bank = learned()
    seek, avoid, flee = (bank[name] for name in NAMES)
    assert len((seek + avoid).results) == 6
    assert torch.equal((seek + avoid - avoid).results, seek.results)
    twice = seek + 2 * avoid - avoid
    assert len(twice.results) == 6
    assert torch.equal((twice - avoid).results, seek.results)
    # A result that two have stays until the last of them is gone.
    other = OneShot().fit(bank.space, Demonstrations(SHOWN.sensors[30:32], [[-1.0, -1.0], [-1.0, 0.0]]))
    shared = seek + other
    assert torch.equal(shared.results, seek.results)
    assert torch.equal((shared - seek).results, other.results)
    assert len((shared + flee - other).results) == 6


def test_a_report_says_what_a_sum_is_made_of() -> None:
    bank = learned()
    made = bank["seek"] + 2 * bank["avoid"] - bank["flee"]
    assert made.report.terms == ("seek", "2 * avoid", "-flee")
    assert made.report.rule == "sum"
    assert made.report.samples == 36
    assert made.report.pairs == 36
    assert (made - made.terms[0].weight * bank["seek"]).report.terms == ("2 * avoid", "-flee")
    text = repr(made)
    for part in (
        "d=500",
        "3 sensors (left, right, front)",
        "2 actuators",
        "sum of seek, 2 * avoid, -flee",
        "9 results",
    ):
        assert part in text
    assert "error_driven, 12 pairs" in repr(bank["seek"])
    assert repr(bank).count("Behaviour(") == 3
    unnamed = OneShot().fit(bank.space, random_pairs(4))
    assert (unnamed + bank["seek"]).report.terms == ("one_shot", "seek")


@pytest.mark.parametrize("vsa", KINDS)
def test_a_sum_is_a_behaviour_like_any_other(vsa: str, tmp_path: Path) -> None:
    bank = learned(vsa, 400)
    made = bank["seek"] + 2 * bank["avoid"]
    recall = made(READINGS)
    assert recall.commands.shape == (13, 2)
    frozen = made.freeze()(READINGS)
    assert torch.equal(frozen.commands, recall.commands)
    assert same(copy.deepcopy(made), made)
    bank.add("both", made)
    again = BehaviourBank.load(bank.save(tmp_path / "bank"))
    assert same(again["both"], made)
    assert all(same_bits(a, b) for a, b in zip(again["both"](READINGS)[:4], recall[:4], strict=True))
    # What a sum is made of is in the file too: its terms can be taken away from it.
    assert torch.equal((again["both"] - 2 * again["avoid"]).results, bank["seek"].results)
    assert (again["both"] - 2 * again["avoid"]).report.terms == ("seek",)
    assert again.save(tmp_path / "again").read_bytes() == (tmp_path / "bank").read_bytes()


def test_the_negative_answers_what_scores_least() -> None:
    seek = learned()["seek"]
    scores = seek.scores(READINGS[:4])
    assert_close((-seek).scores(READINGS[:4]), -scores)
    commands = seek.memory.commands[scores.argmin(-1)]
    assert torch.equal((-seek)(READINGS[:4]).commands, commands)
    assert_close((-seek)(READINGS).familiarity, -seek(READINGS).familiarity)


def test_a_bundle_is_the_sum() -> None:
    bank = learned()
    made = bank["seek"] + 3 * bank["flee"]
    assert same(Bundle(bank, {"flee": 3, "avoid": 0}).behaviour, made)


def test_wrong_sums_are_refused() -> None:
    bank = learned()
    seek = bank["seek"]
    for wrong in (math.nan, math.inf, 1e300):
        with pytest.raises(ValueError, match=r"finite number|give weights nearer to 1"):
            _ = wrong * seek
    with pytest.raises(ValueError, match="finite number"):
        _ = True * seek
    for nothing in (lambda: seek - seek, lambda: 0 * seek, lambda: seek + bank["avoid"] - (bank["avoid"] + seek)):
        with pytest.raises(ValueError, match=r"cancel each other|at least one"):
            nothing()
    with pytest.raises(ValueError, match="different spaces"):
        _ = seek + OneShot().fit(space(500, seed=1), random_pairs(4))
    wrong: Any
    for wrong in (1, "avoid", None, seek.program):
        with pytest.raises(TypeError):
            _ = seek + wrong
    with pytest.raises(TypeError):
        _ = seek * bank["avoid"]  # type: ignore[operator] (refused)


def test_forged_terms_are_refused(tmp_path: Path) -> None:
    from behaviours.storage import load_tensors, save_tensors

    bank = learned(dim=64)
    bank.add("both", bank["seek"] + bank["avoid"])
    tensors, about = load_tensors(bank.save(tmp_path / "bank"), "bank")

    def term(**changes: Any) -> dict[str, Any]:
        forged = copy.deepcopy(about)
        forged["behaviours"][3]["terms"][0] |= changes
        return forged

    forged = [term(weight=w) for w in (0, True, "1", None, 1e400)]
    forged += [term(results=r) for r in ([], [0], [0, 1, 99], [0, 1, -1], [True, 1, 2], None, "012")]
    forged += [term(name=None), term(fingerprint=""), term(fingerprint=1), term(report={}), term(other=1)]
    doubled = copy.deepcopy(about)
    doubled["behaviours"][3]["terms"] *= 2
    empty = copy.deepcopy(about)
    empty["behaviours"][3]["terms"] = []
    for number, wrong in enumerate([*forged, doubled, empty]):
        path = save_tensors(tmp_path / f"forged{number}", "bank", tensors, wrong)
        with pytest.raises(ValueError, match="behaviour 'both'"):
            BehaviourBank.load(path)


def test_a_report_of_terms_is_a_tuple_of_texts() -> None:
    with pytest.raises(ValueError, match="terms of a report"):
        LearningReport("sum", 1, 1, terms="seek")  # type: ignore[arg-type] (refused)
    with pytest.raises(ValueError, match="terms of a report"):
        LearningReport("sum", 1, 1, terms=(1,))  # type: ignore[arg-type] (refused)
