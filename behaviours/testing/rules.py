"""The laws of learning rules."""

import copy
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from itertools import pairwise

import torch

from behaviours.bank import BehaviourBank
from behaviours.behaviour import Behaviour
from behaviours.controller import Controller
from behaviours.demonstrations import Demonstrations
from behaviours.learning import ConvergenceWarning, OneShot, Rule, require_rule
from behaviours.space import Space
from behaviours.testing._controllers import CONTROLLER_LAWS
from behaviours.testing._material import (
    a_space,
    correct,
    no_global_random_numbers,
    pairs,
    readings,
    recalled,
    tensors,
    unchanged,
)
from behaviours.testing._trial import Trial, counted, rows, same_program
from torchvsa._numerics import is_integer
from torchvsa.testing._laws import check, refuses, require, same


def check_rule(rule: Rule, space: Space | None = None) -> None:
    """Check the laws of learning rules. Raises `AssertionError` naming the law that is broken.

    Args:
        rule: The rule, with its options.
        space: The codebooks over which it learns; by default exact ones for 3 sensors. If the rule does not support
            their architecture, it must refuse to learn.

    Among the laws: a few unrelated pairs are recalled, in whatever order they are shown; the report adds up; the same
    demonstration gives the same bits, whatever was learned before and whether gradients are on; demonstration, space
    and rule stay as they are; progress rises to 1; `partial_fit` goes on as documented or raises `ValueError`; what is
    learned keeps the laws of `check_policy` that are not about speakers.
    """
    require_rule(rule)
    case = Trial(rule, a_space() if space is None else space)
    supported = rule.supports(case.space.vsa)
    with warnings.catch_warnings(action="ignore", category=ConvergenceWarning):
        if not supported:
            check(case, (_what_it_does_not_support_is_refused,))
            return
        check(case, _LAWS)
        behaviour = case.fit()
        check(case, [_of_what_it_learned(behaviour, law) for law in CONTROLLER_LAWS])


def _of_what_it_learned(behaviour: Behaviour, law: Callable[[Controller], None]) -> Callable[[Trial], None]:
    @wraps(law)
    def checked(_: Trial) -> None:
        law(behaviour)

    return checked


def _what_it_does_not_support_is_refused(case: Trial) -> None:
    refuses(ValueError, case.fit)


def _a_behaviour_over_the_given_space_is_learned(case: Trial) -> None:
    behaviour = case.fit()
    require(isinstance(behaviour, Behaviour), f"fit returned {type(behaviour).__name__}")
    require(behaviour.space is case.space, "it is over another space than the given one")
    behaviour.check()
    require(not behaviour.program.requires_grad, "its program hangs on the graph of its training")
    require(
        case.rule.integer_programs or not is_integer(behaviour.program),
        "integer_programs=False, yet the program holds integers",
    )
    bank = BehaviourBank(case.space)
    bank.learn("learned", case.shown(), case.rule)
    same_program(bank["learned"], behaviour)


def _unrelated_pairs_are_recalled(case: Trial) -> None:
    shown = case.shown()
    behaviour = case.fit(shown)
    require(correct(behaviour, shown), "some of the commands recalled are others than those shown")
    familiar = recalled(behaviour, shown.sensors).familiarity
    require((familiar > 0).all(), f"familiarities of what was shown: {familiar.tolist()}")


def _any_order_of_rows_will_do(case: Trial) -> None:
    shown = case.shown()
    for order in (list(range(len(shown)))[::-1], torch.randperm(len(shown), generator=torch.Generator()).tolist()):
        require(correct(case.fit(rows(shown, order)), shown), f"pairs shown in the order {order} are not recalled")


def _a_result_that_is_alone_is_certain(case: Trial) -> None:
    shown = rows(case.shown(), [0])
    behaviour = case.fit(shown)
    recall = recalled(behaviour, shown.sensors)
    require(correct(behaviour, shown), "the only pair is not recalled")
    require(recall.margin.isposinf().all(), f"the margin of the only result is {recall.margin.tolist()}")
    require(recall.familiarity[0] > 1 - 1e-4, f"the familiarity of the only condition is {recall.familiarity.tolist()}")


def _results_are_distinct_and_were_shown(case: Trial) -> None:
    shown = case.shown()
    results = case.fit(rows(shown, [*range(len(shown)), *range(len(shown))])).results.tolist()
    levels = case.space.schema.command_levels(shown.commands).tolist()
    require(all(result in levels for result in results), "a result is stored that was not shown")
    require(len(set(map(tuple, results))) == len(results), "a result is stored twice")
    first = [levels.index(result) for result in results]
    require(first == sorted(first), "results are not in the order in which they were shown first")


def _the_report_adds_up(case: Trial) -> None:
    once = case.shown()
    shown = rows(once, [*range(len(once)), 0])
    report = case.fit(shown).report
    require(report.rule == case.rule.name, f"the report is of {report.rule!r}")
    require(report.samples == len(shown), f"{report.samples} samples of {len(shown)}")
    require(counted(report) == report.samples, f"what became of the samples does not add up: {report}")
    require(0 < report.new <= len(once), f"{report.new} new conditions of {len(once)}")
    require(report.presumed_known == 0, f"known from before, in a first piece: {report}")
    require(report.contradicting == 0, f"nothing contradicts: {report}")
    require(report.wrong <= report.samples, f"more are wrong than there are: {report}")


def _contradictions_are_settled_by_what_was_shown(case: Trial) -> None:
    shown = case.shown()
    other = int((shown.commands != shown.commands[0]).any(1).nonzero()[0]) if len(shown) > 1 else 0
    if other == 0:
        return
    again = Demonstrations(
        shown.sensors[[0, 0]], shown.commands[[other, other]], torch.arange(len(shown), len(shown) + 2)
    )
    behaviour = case.fit(Demonstrations.join([shown, again]))
    commands = recalled(behaviour, shown.sensors).commands.cpu()
    settled = any(torch.equal(commands[0], shown.commands[row]) for row in (0, other))
    require(settled, f"the condition shown with two results answers neither, but {commands[0].tolist()}")
    require(torch.equal(commands[1:], shown.commands[1:]), "conditions that nothing contradicts are recalled wrongly")
    report = behaviour.report
    require(report.contradicting in (1, 2), f"1 or 2 samples contradict the others: {report}")
    require(counted(report) == report.samples == len(shown) + 2, f"it does not add up: {report}")


def _what_was_observed_in_part_is_learned(case: Trial) -> None:
    sensors = readings(case.space, 6, seed=7, unobserved=0.5)
    shown = Demonstrations(sensors, pairs(case.space, 1).commands.expand(6, -1), torch.arange(6))
    require(correct(case.fit(shown), shown), "the only result is not recalled")


def _the_same_again_gives_the_same_bits(case: Trial) -> None:
    with no_global_random_numbers(1):
        behaviour = case.fit()
    case.fit(case.shown(seed=5))
    with no_global_random_numbers(2):
        same_program(case.fit(), behaviour)
        same_program(replace(case, rule=copy.deepcopy(case.rule)).fit(), behaviour)


def _the_number_of_threads_does_not_matter(case: Trial) -> None:
    threads, fitted = torch.get_num_threads(), []
    try:
        for count in (1, 2):
            torch.set_num_threads(count)
            fitted.append(case.fit())
    finally:
        torch.set_num_threads(threads)
    one, two = fitted
    if is_integer(one.program):
        same_program(one, two)
    asked = case.shown().sensors
    require(torch.equal(recalled(one, asked).commands, recalled(two, asked).commands), "2 threads learn something else")


def _whether_gradients_are_on_does_not_matter(case: Trial) -> None:
    plain = case.fit()
    for mode in (torch.no_grad, torch.inference_mode, torch.enable_grad):
        with mode():
            inside = case.fit()
        same_program(inside, plain)


def _demonstration_space_and_rule_stay_as_they_are(case: Trial) -> None:
    shown, space, rule = case.shown(), tensors(case.space), repr(case.rule)
    given = shown.sensors.clone(), shown.commands.clone(), shown.episodes.clone()
    behaviour = case.fit(shown)
    for now, before in zip((shown.sensors, shown.commands, shown.episodes), given, strict=True):
        same(now, before)
    unchanged(case.space, space, "the space")
    require(repr(case.rule) == rule, f"the rule {rule} became {case.rule!r}")
    learned = tensors(behaviour)
    for tensor in (shown.sensors, shown.commands, shown.episodes):
        tensor.zero_()
    unchanged(behaviour, learned, "what was learned, with the demonstration")


def _progress_rises_to_one(case: Trial) -> None:
    first = case.fit()
    for learn in (
        lambda progress: case.rule.fit(case.space, case.shown(), progress),
        lambda progress: case.rule.partial_fit(first, case.shown(), progress),
    ):
        shares: list[float] = []
        try:
            learn(shares.append)
        except ValueError:
            continue  # a rule that cannot go on; whether `fit` works is asked elsewhere
        require(all(a <= b for a, b in pairwise(shares)), f"progress falls: {shares}")
        require(bool(shares) and shares[0] >= 0 and shares[-1] == 1, f"progress does not go from 0 to 1: {shares}")


def _pieces_go_on_or_are_refused(case: Trial) -> None:
    shown = case.shown()
    half = len(shown) // 2
    first, then = (rows(shown, range(half)), rows(shown, range(half, len(shown)))) if half else (shown, shown)
    for before in (case.fit(first), OneShot().fit(case.space, first)):
        held, report = tensors(before), before.report
        after = case.goes_on(before, then)
        unchanged(before, held, "the behaviour before")
        require(before.report == report, "the report of the behaviour before was changed")
        if after is None:
            continue
        require(case.rule.supports_partial_fit, "supports_partial_fit=False, yet it goes on from a behaviour")
        require(after.space is before.space, "it goes on over another space")
        after.check()
        require(
            after.report.wrong > 0 or correct(after, then), "the later piece is not recalled, and no report says so"
        )
        stored = len(before.results)
        same(after.results[:stored], before.results)
        require(len(after.results.unique(dim=0)) == len(after.results), "a result is stored twice")
        require(after.report.rule == case.rule.name, f"the report is of {after.report.rule!r}")
        require(after.report.samples == len(first) + len(then), f"the samples do not add up: {after.report}")
        require(counted(after.report) == after.report.samples, f"they do not add up: {after.report}")


def _demonstrations_that_are_not_valid_are_refused(case: Trial) -> None:
    good, schema = case.shown(), case.space.schema

    def refused(sensors: torch.Tensor, commands: torch.Tensor, **names: list[str]) -> None:
        shown = Demonstrations(sensors, commands, torch.arange(len(sensors)), **names)  # type: ignore[arg-type]
        refuses(ValueError, lambda: case.fit(shown))

    blind = torch.full_like(good.sensors[:1], torch.nan)
    refused(torch.cat([good.sensors, blind]), torch.cat([good.commands, good.commands[:1]]))
    refused(torch.cat([good.sensors, good.sensors], 1), good.commands)
    refused(good.sensors, torch.cat([good.commands, good.commands], 1))
    refused(good.sensors, good.commands, sensor_names=[f"not {sensor.name}" for sensor in schema.sensors])
    for column, sensor in enumerate(schema.sensors):
        if sensor.out_of_range == "error":
            beyond = good.sensors.clone()
            beyond[-1, column] = 2 * sensor.high - sensor.low
            refused(beyond, good.commands)
    for column, actuator in enumerate(schema.actuators):
        beyond = good.commands.clone()
        beyond[-1, column] = 2 * actuator.high - actuator.low
        refused(good.sensors, beyond)


_LAWS: tuple[Callable[[Trial], None], ...] = (
    _a_behaviour_over_the_given_space_is_learned,
    _unrelated_pairs_are_recalled,
    _any_order_of_rows_will_do,
    _a_result_that_is_alone_is_certain,
    _results_are_distinct_and_were_shown,
    _the_report_adds_up,
    _contradictions_are_settled_by_what_was_shown,
    _what_was_observed_in_part_is_learned,
    _the_same_again_gives_the_same_bits,
    _the_number_of_threads_does_not_matter,
    _whether_gradients_are_on_does_not_matter,
    _demonstration_space_and_rule_stay_as_they_are,
    _progress_rises_to_one,
    _pieces_go_on_or_are_refused,
    _demonstrations_that_are_not_valid_are_refused,
)
