"""ErrorDriven keeps its promise: every pair with the margin asked for, and an honest report where it cannot."""

from collections import Counter
from collections.abc import Iterator
from typing import Literal, cast

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from plain import wide
from robots import correct, random_pairs, same_bits, space

import behaviours.learning.error_driven as module
from behaviours import Behaviour, Demonstrations, ErrorDriven
from behaviours.learning import ConvergenceWarning


def leads(behaviour: Behaviour, pairs: Demonstrations) -> np.ndarray:
    """By how much each pair's result beats the best other one and silence, in scores that the pair gives itself."""
    made = behaviour.space
    items = made.items(behaviour.results)
    levels = made.schema.command_levels(pairs.commands).tolist()
    found = []
    for condition, level in zip(made.encode(made.cells(pairs.sensors)), levels, strict=True):
        noisy = wide(made.vsa.unbind(behaviour.program, condition))
        scores = [float(np.vdot(wide(item), noisy).real) / np.linalg.norm(wide(item)) for item in items]
        own = behaviour.results.tolist().index(level)
        itself = np.linalg.norm(wide(made.vsa.bind(condition, items[own]))) ** 2 / np.linalg.norm(wide(items[own]))
        found.append((scores.pop(own) - max([0.0, *scores])) / itself)
    return np.array(found)


@pytest.mark.parametrize("vsa", ["MAP-C", "MAP-B", "BSC", "FHRR"])
@pytest.mark.parametrize("margin", [0.0, 0.5, 1.0])
def test_every_pair_has_its_margin(vsa: str, margin: float) -> None:
    shown = random_pairs(60)
    behaviour = ErrorDriven(margin).fit(space(512, vsa), shown)
    assert behaviour.report.wrong == 0
    lead = leads(behaviour, shown)
    # Float scores are sums of float32 products.
    assert lead.min() >= margin - 1e-4
    assert lead.min() > 0
    assert correct(behaviour, shown).mean() == 1


@pytest.mark.parametrize("epochs", [1, 2, 3, 5])
def test_the_report_counts_what_is_still_wrong(epochs: int) -> None:
    shown = random_pairs(60)
    with pytest.warns(ConvergenceWarning, match=rf"pairs wrong.* after {epochs} epoch"):
        behaviour = ErrorDriven(0.5, epochs=epochs).fit(space(256), shown)
    lead = leads(behaviour, shown)
    assert behaviour.report.epochs == epochs
    assert behaviour.report.wrong == np.sum((lead < 0.5 - 1e-9) | (lead <= 0)) > 0


def test_a_last_pass_that_sets_all_right_leaves_nothing_wrong() -> None:
    shown = Demonstrations([[1.0, 1, 1]], [[1.0, 1]])
    report = ErrorDriven(epochs=1).fit(space(256), shown).report
    assert (report.epochs, report.updates, report.wrong) == (1, 1, 0)


def perceptron_steps(space_, shown: Demonstrations, margin: float) -> Iterator[tuple[np.ndarray, bool]]:
    """The rule as its docstring says it, one pair after the other, in Python's own numbers: the program after each."""
    levels = space_.schema.command_levels(shown.commands).tolist()
    results = [list(level) for level in dict.fromkeys(map(tuple, levels))]
    items = space_.items(torch.tensor(results)).numpy().astype(np.int64)
    conditions = space_.encode(space_.cells(shown.sensors)).numpy().astype(np.int64)
    program = np.zeros(space_.vsa.dim, np.int64)
    lengths = np.sqrt((items**2).sum(1))
    while True:
        for condition, level in zip(conditions, levels, strict=True):
            own = results.index(level)
            scores = items @ (condition * program) / lengths
            others = np.where(np.arange(len(items)) == own, -np.inf, scores)
            rival = int(others.argmax())
            itself = ((condition * items[own]) ** 2).sum() / lengths[own]
            lead = scores[own] - max(others[rival], 0)
            short = lead < margin * itself or lead <= 0
            if short:
                program = program + condition * items[own]
                if others[rival] > 0:
                    program = program - condition * items[rival]
            yield program, short


def perceptron(space_, shown: Demonstrations, margin: float, epochs: int) -> np.ndarray:
    """The program in the end."""
    steps, sweep = perceptron_steps(space_, shown, margin), []
    for _ in range(epochs):
        sweep = [next(steps) for _ in range(len(shown))]
        if not any(short for _, short in sweep):
            break
    return sweep[-1][0]


@pytest.mark.filterwarnings("ignore::behaviours.learning.ConvergenceWarning")
@pytest.mark.parametrize("count", [1, 7, 70])
def test_it_is_the_sequential_perceptron_whatever_the_block(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    shown, made = random_pairs(count), space(256)
    # .49 keeps the comparison off the exact ties that round differently in other orders of operations.
    expected = perceptron(made, shown, 0.49, 4)
    for block in (1, 3, 64):
        monkeypatch.setattr(module, "BLOCK", block)
        behaviour = ErrorDriven(0.49, epochs=4).fit(made, shown)
        np.testing.assert_array_equal(behaviour.program.numpy(), expected)


def test_the_report_does_not_depend_on_the_block(monkeypatch: pytest.MonkeyPatch) -> None:
    shown, made = random_pairs(70), space(256)
    fits = []
    for block in (1, 3, 64):
        monkeypatch.setattr(module, "BLOCK", block)
        fits.append(ErrorDriven().fit(made, shown))
    assert all(fit.report == fits[0].report and same_bits(fit.program, fits[0].program) for fit in fits)


def settle(shown: list[int], how: str) -> int:
    if how == "first":
        return shown[0]
    if how == "latest":
        return shown[-1]
    return Counter(shown).most_common(1)[0][0]  # among equals the one met first


@pytest.mark.parametrize("how", ["first", "majority", "latest"])
@settings(max_examples=40, deadline=None, derandomize=True)
@given(rows=st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=1, max_size=14))
def test_contradictions(how: str, rows: list[tuple[int, int]]) -> None:
    commands = [[-1.0, -1], [-1, 1], [1, 0], [0, 1]]
    shown = Demonstrations([[c + 0.5] * 3 for c, _ in rows], [commands[r] for _, r in rows])
    rule = ErrorDriven(contradictions=cast(Literal["first", "majority", "latest"], how))
    behaviour = rule.fit(space(1000), shown)
    wanted = {c: settle([r for other, r in rows if other == c], how) for c, _ in rows}
    assert behaviour.report.wrong == 0
    for condition, result in wanted.items():
        assert behaviour([[condition + 0.5] * 3]).commands.tolist() == [commands[result]]
    assert behaviour.report.contradicting == sum(wanted[c] != r for c, r in rows)
    assert behaviour.report.new == len(wanted)
    assert behaviour.report.truly_known == len(rows) - len(wanted)


@pytest.mark.filterwarnings("ignore::behaviours.learning.ConvergenceWarning")
def test_known_is_the_sum_of_the_distinct_conditions() -> None:
    shown = random_pairs(300)
    twice = Demonstrations.join([shown, shown])
    made = space(128)
    expected = made.encode(made.cells(shown.sensors)).numpy().astype(int).sum(0)
    np.testing.assert_array_equal(ErrorDriven(epochs=1).fit(made, twice).known.numpy(), expected)


def test_settings_that_make_no_sense() -> None:
    with pytest.raises(ValueError, match="'first', 'majority' or 'latest'; got 'loudest'"):
        ErrorDriven(contradictions=cast(Literal["first"], "loudest"))


def averaged(space_, shown: Demonstrations, margin: float, epochs: int) -> np.ndarray:
    """The plain definition: the program after every visit, kept and averaged."""
    steps, programs = perceptron_steps(space_, shown, margin), []
    for _ in range(epochs):
        sweep = [next(steps) for _ in range(len(shown))]
        programs += [program for program, _ in sweep]
        if not any(corrected for _, corrected in sweep):
            break
    return (np.sum(programs, axis=0) / len(programs)).astype(np.float32)


@pytest.mark.filterwarnings("ignore::behaviours.learning.ConvergenceWarning")
@pytest.mark.parametrize(("count", "epochs"), [(1, 3), (7, 1), (7, 50), (70, 2), (70, 4)])
def test_the_average_is_that_of_all_visits(count: int, epochs: int, monkeypatch: pytest.MonkeyPatch) -> None:
    shown, made = random_pairs(count), space(256)
    expected = averaged(made, shown, 0.49, epochs)
    for block in (1, 64):
        monkeypatch.setattr(module, "BLOCK", block)
        behaviour = ErrorDriven(0.49, epochs, average=True).fit(made, shown)
        assert behaviour.program.dtype == torch.float32
        np.testing.assert_array_equal(behaviour.program.numpy(), expected)


@pytest.mark.parametrize("vsa", ["MAP-C", "BSC", "FHRR", "HRR"])
def test_the_report_of_an_average_is_about_the_average(vsa: str) -> None:
    shown = random_pairs(60)
    last, mean = (ErrorDriven(0.5, average=average).fit(space(512, vsa), shown) for average in (False, True))
    assert (last.report.epochs, last.report.updates) == (mean.report.epochs, mean.report.updates)
    lead = leads(mean, shown)
    # Scores of float programs: none of these leads lies within rounding of the margin.
    assert np.abs(lead - 0.5).min() > 1e-5
    assert mean.report.wrong == np.sum((lead < 0.5) | (lead <= 0))
    assert last.report.wrong == 0
