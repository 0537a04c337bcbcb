"""A condition shown with several results: every rule settles it by the same names."""

from collections import Counter
from typing import Any

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from robots import same_bits, space

from behaviours import RULES, Behaviour, Demonstrations, ErrorDriven, Gradient, LeastSquares, OneShot, Rule
from behaviours.learning.samples import Samples

COMMANDS = [[-1.0, -1], [-1, 1], [1, 0], [0, 1]]
WAYS = ["first", "majority", "latest"]
Rows = list[tuple[int, int]]


def shown(rows: Rows) -> Demonstrations:
    """Pairs of a condition and one of `COMMANDS`."""
    return Demonstrations([[c + 0.5] * 3 for c, _ in rows], [COMMANDS[r] for _, r in rows])


def settle(rows: Rows, how: str) -> dict[int, int]:
    wanted = {}
    for condition in dict.fromkeys(c for c, _ in rows):
        results = [r for c, r in rows if c == condition]
        # Among equals the one met first.
        wanted[condition] = {"first": results[0], "latest": results[-1]}.get(how, Counter(results).most_common(1)[0][0])
    return wanted


rows_of_pairs = st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=1, max_size=14)


@pytest.mark.parametrize("how", WAYS)
@settings(max_examples=60, deadline=None, derandomize=True)
@given(rows=rows_of_pairs)
def test_targets_of_samples(how: Any, rows: Rows) -> None:
    made = space(64, protection="none")
    samples = Samples.of(made, shown(rows))
    wanted = list(settle(rows, how).values())
    levels = samples.results[samples.targets(how)]
    assert made.schema.command_values(levels).tolist() == [COMMANDS[r] for r in wanted]
    assert torch.equal(samples.resolved(how).result, samples.targets(how)[samples.condition])


@pytest.mark.parametrize("name", RULES)
@pytest.mark.parametrize("how", WAYS)
def test_every_rule_settles_them(name: str, how: Any) -> None:
    rows = [(0, 0), (1, 1), (0, 2), (2, 3), (0, 2), (1, 1), (0, 3), (1, 0), (2, 1)]
    made = space(2000, protection={"name": "self_shift", "width": "sum"})
    rule: Any = RULES[name]
    behaviour: Behaviour = rule(contradictions=how).fit(made, shown(rows))
    wanted = settle(rows, how)
    assert len({wanted[0], settle(rows, "first")[0], settle(rows, "latest")[0]}) >= 2  # the ways differ here
    for condition, result in wanted.items():
        assert behaviour([[condition + 0.5] * 3]).commands.tolist() == [COMMANDS[result]], condition
    report = behaviour.report
    assert report.contradicting == sum(wanted[c] != r for c, r in rows)
    assert (report.samples, report.new, report.truly_known, report.wrong) == (9, 3, 6, 0)


@pytest.mark.parametrize("rule", [LeastSquares(), Gradient(epochs=3)], ids=["least_squares", "gradient"])
def test_by_default_the_solvers_learn_from_all(rule: Rule) -> None:
    """Two of three is not three of three."""
    made, rows = space(500), [(0, 0), (0, 1), (0, 1)]
    twice = rule.fit(made, shown(rows))
    majority = type(rule)(**vars(rule) | {"contradictions": "majority"}).fit(made, shown(rows))
    assert not torch.allclose(twice.program, majority.program, rtol=0.01)
    same = type(rule)(**vars(rule) | {"contradictions": "all"}).fit(made, shown(rows))
    assert same_bits(same.program, twice.program)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(rows=rows_of_pairs)
def test_a_settled_superposition_holds_each_condition_once_with_its_result(rows: Rows) -> None:
    made = space(128)
    for how in ("majority", "latest"):
        behaviour = OneShot(contradictions=how).fit(made, shown(rows))
        wanted = list(settle(rows, how).values())
        items = made.items(made.schema.command_levels([COMMANDS[r] for r in wanted]))
        conditions = made.encode(made.cells([[c + 0.5] * 3 for c in settle(rows, how)]))
        expected = (conditions.int() * items.int()).sum(0)
        assert behaviour.program.tolist() == expected.tolist()
        # Results that no condition has are not stored.
        assert made.schema.command_values(behaviour.results).tolist() == [COMMANDS[r] for r in dict.fromkeys(wanted)]


def test_a_similarity_that_takes_all_for_new_stores_the_settled_result_each_time() -> None:
    rows = [(0, 0), (0, 1), (0, 1)]
    rule = OneShot("similarity", threshold=2.0, contradictions="majority")
    behaviour = rule.fit(space(256), shown(rows))
    assert behaviour([[0.5] * 3]).commands.tolist() == [COMMANDS[1]]
    assert (behaviour.report.new, behaviour.report.re_added, behaviour.report.contradicting) == (1, 2, 1)


@pytest.mark.parametrize("name", RULES)
def test_ways_that_do_not_exist(name: str) -> None:
    rule: Any = RULES[name]
    choices = (
        "'first', 'majority', 'latest' or 'all'"
        if name in ("least_squares", "gradient")
        else ("'first', 'majority' or 'latest'")
    )
    with pytest.raises(ValueError, match=f"contradictions is {choices}; got 'loudest'"):
        rule(contradictions="loudest")
    if "all" not in choices:
        with pytest.raises(ValueError, match="got 'all'"):
            rule(contradictions="all")


def test_the_default_of_each_rule() -> None:
    defaults = {type(r).__name__: r.contradictions for r in (OneShot(), ErrorDriven(), LeastSquares(), Gradient())}
    assert defaults == {"OneShot": "first", "ErrorDriven": "majority", "LeastSquares": "all", "Gradient": "all"}
