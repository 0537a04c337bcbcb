"""The laws of learning rules."""

import copy
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from itertools import pairwise
from typing import Any

import torch

from behaviours.bank import BehaviourBank
from behaviours.behaviour import Behaviour
from behaviours.controller import Controller
from behaviours.demonstrations import Demonstrations
from behaviours.learning import ConvergenceWarning, OneShot, Rule, require_rule
from behaviours.space import Space
from behaviours.testing._controllers import CONTROLLER_LAWS
from behaviours.testing._material import (
    default_space,
    first_step,
    no_global_random_numbers,
    pairs,
    readings,
    recalls_all,
    tensors,
    unchanged,
)
from behaviours.testing._trial import Trial, count_samples, rows, same_program
from torchvsa._numerics import is_integer
from torchvsa.testing._laws import check, refuses, require, same


def check_rule(rule: Rule, space: Space | None = None) -> None:
    """Check the laws of learning rules.

    Among the laws: a few unrelated pairs are recalled (smooth commands up to half a level), in any order of the
    demonstrations; the counts of the report add up; equal demonstrations give the same bits, with and without
    gradients; demonstrations, space and rule are not changed; progress rises to 1; `partial_fit` continues as
    documented or raises `ValueError`; the learned behaviour obeys the laws of `check_policy` that are not about
    speakers.

    Args:
        rule: The rule, with its options.
        space: The space over which it learns; by default an integer one of 3 sensors. If the rule does not support its
            architecture, `fit` must raise `ValueError`.

    Raises:
        AssertionError: Naming the broken law.
    """
    require_rule(rule)
    case = Trial(rule, default_space() if space is None else space)
    supported = rule.supports(case.space.vsa)
    with warnings.catch_warnings(action="ignore", category=ConvergenceWarning):
        if not supported:
            check(case, (_unsupported_architectures_raise_value_error,))
            return
        check(case, _LAWS)
        behaviour = case.fit()
        check(case, [_for_behaviour(behaviour, law) for law in CONTROLLER_LAWS])


def _for_behaviour(behaviour: Behaviour, law: Callable[[Controller], None]) -> Callable[[Trial], None]:
    @wraps(law)
    def checked(_: Trial) -> None:
        law(behaviour)

    return checked


def _unsupported_architectures_raise_value_error(case: Trial) -> None:
    refuses(ValueError, case.fit)


def _a_behaviour_over_the_given_space_is_learned(case: Trial) -> None:
    behaviour = case.fit()
    require(isinstance(behaviour, Behaviour), f"fit returned {type(behaviour).__name__}")
    require(behaviour.space is case.space, "its space is not the given one")
    behaviour.check()
    require(not behaviour.program.requires_grad, "its program requires gradients")
    require(
        case.rule.integer_programs or not is_integer(behaviour.program),
        "integer_programs=False, yet the program has integers",
    )
    bank = BehaviourBank(case.space)
    bank.learn("learned", case.shown(), case.rule)
    same_program(bank["learned"], behaviour)


def _unrelated_pairs_are_recalled(case: Trial) -> None:
    shown = case.shown()
    behaviour = case.fit(shown)
    require(recalls_all(behaviour, shown), "some of the recalled commands differ from those shown")
    familiarity = first_step(behaviour, shown.sensors).familiarity
    require((familiarity > 0).all(), f"familiarities of learned conditions: {familiarity.tolist()}")


def _any_order_of_rows_is_learned(case: Trial) -> None:
    shown = case.shown()
    for order in (list(range(len(shown)))[::-1], torch.randperm(len(shown), generator=torch.Generator()).tolist()):
        require(recalls_all(case.fit(rows(shown, order)), shown), f"pairs shown in the order {order} are not recalled")


def _a_single_result_is_certain(case: Trial) -> None:
    shown = rows(case.shown(), [0])
    behaviour = case.fit(shown)
    recall = first_step(behaviour, shown.sensors)
    require(recalls_all(behaviour, shown), "the only pair is not recalled")
    require(recall.margin.isposinf().all(), f"the margin of the only result is {recall.margin.tolist()}")
    require(recall.familiarity[0] > 1 - 1e-4, f"the familiarity of the only condition is {recall.familiarity.tolist()}")


def _results_are_distinct_and_were_shown(case: Trial) -> None:
    shown = case.shown()
    results = case.fit(rows(shown, [*range(len(shown)), *range(len(shown))])).results.tolist()
    levels = case.space.schema.command_levels(shown.commands).tolist()
    require(all(result in levels for result in results), "a stored result was not shown")
    require(len(set(map(tuple, results))) == len(results), "a result is stored twice")
    first = [levels.index(result) for result in results]
    require(first == sorted(first), "results are not in order of first appearance")


def _the_report_adds_up(case: Trial) -> None:
    once = case.shown()
    shown = rows(once, [*range(len(once)), 0])
    report = case.fit(shown).report
    require(report.rule == case.rule.name, f"the report is of {report.rule!r}")
    require(report.samples == len(shown), f"{report.samples} samples of {len(shown)}")
    require(count_samples(report) == report.samples, f"the counts do not add up: {report}")
    require(0 < report.new <= len(once), f"{report.new} new conditions of {len(once)}")
    require(report.presumed_known == 0, f"known from earlier demonstrations, of which there are none: {report}")
    require(report.contradicting == 0, f"no samples contradict each other: {report}")
    require(report.wrong <= report.samples, f"more pairs are wrong than there are samples: {report}")


def _contradictions_are_resolved_to_a_shown_result(case: Trial) -> None:
    shown = case.shown()
    other = int((shown.commands != shown.commands[0]).any(1).nonzero()[0]) if len(shown) > 1 else 0
    if other == 0:
        return
    again = Demonstrations(
        shown.sensors[[0, 0]], shown.commands[[other, other]], torch.arange(len(shown), len(shown) + 2)
    )
    behaviour = case.fit(Demonstrations.join([shown, again]))
    commands = first_step(behaviour, shown.sensors).commands.cpu()
    # A smooth behaviour answers with the mean.
    resolved = behaviour.smooth or any(torch.equal(commands[0], shown.commands[row]) for row in (0, other))
    require(resolved, f"the condition shown with two results recalls neither, but {commands[0].tolist()}")
    rest = shown.where(torch.arange(len(shown)) > 0)
    require(recalls_all(behaviour, rest), "conditions without contradictions are recalled wrongly")
    report = behaviour.report
    require(report.contradicting in (1, 2), f"contradicting should be 1 or 2: {report}")
    require(count_samples(report) == report.samples == len(shown) + 2, f"the counts do not add up: {report}")


def _partly_observed_readings_are_learned(case: Trial) -> None:
    sensors = readings(case.space, 6, seed=7, unobserved=0.5)
    shown = Demonstrations(sensors, pairs(case.space, 1).commands.expand(6, -1), torch.arange(6))
    require(recalls_all(case.fit(shown), shown), "the only result is not recalled")


def _fitting_again_gives_the_same_bits(case: Trial) -> None:
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
    single, double = fitted
    if is_integer(single.program):
        same_program(single, double)
    queries = case.shown().sensors
    require(
        torch.equal(first_step(single, queries).commands, first_step(double, queries).commands),
        "with 2 threads other commands are recalled",
    )


def _whether_gradients_are_on_does_not_matter(case: Trial) -> None:
    plain = case.fit()
    for mode in (torch.no_grad, torch.inference_mode, torch.enable_grad):
        with mode():
            inside = case.fit()
        same_program(inside, plain)


def _demonstrations_space_and_rule_are_not_changed(case: Trial) -> None:
    shown, space, rule = case.shown(), tensors(case.space), repr(case.rule)
    given = shown.sensors.clone(), shown.commands.clone(), shown.episodes.clone()
    behaviour = case.fit(shown)
    for after, before in zip((shown.sensors, shown.commands, shown.episodes), given, strict=True):
        same(after, before)
    unchanged(case.space, space, "the space")
    require(repr(case.rule) == rule, f"the rule {rule} became {case.rule!r}")
    learned = tensors(behaviour)
    for tensor in (shown.sensors, shown.commands, shown.episodes):
        tensor.zero_()
    unchanged(behaviour, learned, "the behaviour, when the demonstrations were modified,")


def _progress_rises_to_one(case: Trial) -> None:
    first = case.fit()
    for learn in (
        lambda progress: case.rule.fit(case.space, case.shown(), progress),
        lambda progress: case.rule.partial_fit(first, case.shown(), progress),
    ):
        fractions: list[float] = []
        try:
            learn(fractions.append)
        except ValueError:
            continue  # a rule that cannot continue; other laws check `fit`
        require(all(a <= b for a, b in pairwise(fractions)), f"progress falls: {fractions}")
        require(
            bool(fractions) and fractions[0] >= 0 and fractions[-1] == 1,
            f"progress does not go from 0 to 1: {fractions}",
        )


def _partial_fit_continues_or_raises_value_error(case: Trial) -> None:
    shown = case.shown()
    half = len(shown) // 2
    first, then = (rows(shown, range(half)), rows(shown, range(half, len(shown)))) if half else (shown, shown)
    for before in (case.fit(first), OneShot().fit(case.space, first)):
        held, report = tensors(before), before.report
        after = case.try_partial_fit(before, then)
        unchanged(before, held, "the behaviour before")
        require(before.report == report, "the report of the behaviour before was changed")
        if after is None:
            continue
        require(
            case.rule.supports_partial_fit, "supports_partial_fit=False, yet partial_fit continues from a behaviour"
        )
        require(after.space is before.space, "its space is another one")
        after.check()
        require(
            after.report.wrong > 0 or recalls_all(after, then),
            "later pairs are not recalled, and the report does not count them as wrong",
        )
        stored = len(before.results)
        same(after.results[:stored], before.results)
        require(len(after.results.unique(dim=0)) == len(after.results), "a result is stored twice")
        require(after.report.rule == case.rule.name, f"the report is of {after.report.rule!r}")
        require(after.report.samples == len(first) + len(then), f"the counts do not add up: {after.report}")
        require(count_samples(after.report) == after.report.samples, f"the counts do not add up: {after.report}")


def _invalid_demonstrations_raise_value_error(case: Trial) -> None:
    good, schema = case.shown(), case.space.schema

    def refused(sensors: torch.Tensor, commands: torch.Tensor, **names: Any) -> None:
        shown = Demonstrations(sensors, commands, torch.arange(len(sensors)), **names)
        refuses(ValueError, lambda: case.fit(shown))

    unobserved = torch.full_like(good.sensors[:1], torch.nan)
    refused(torch.cat([good.sensors, unobserved]), torch.cat([good.commands, good.commands[:1]]))
    refused(torch.cat([good.sensors, good.sensors], 1), good.commands)
    refused(good.sensors, torch.cat([good.commands, good.commands], 1))
    refused(good.sensors, good.commands, sensor_names=[f"not {sensor.name}" for sensor in schema.sensors])
    for column, sensor in enumerate(schema.sensors):
        if sensor.out_of_range == "error":
            outside = good.sensors.clone()
            outside[-1, column] = 2 * sensor.high - sensor.low
            refused(outside, good.commands)
    for column, actuator in enumerate(schema.actuators):
        outside = good.commands.clone()
        outside[-1, column] = 2 * actuator.high - actuator.low
        refused(good.sensors, outside)


_LAWS: tuple[Callable[[Trial], None], ...] = (
    _a_behaviour_over_the_given_space_is_learned,
    _unrelated_pairs_are_recalled,
    _any_order_of_rows_is_learned,
    _a_single_result_is_certain,
    _results_are_distinct_and_were_shown,
    _the_report_adds_up,
    _contradictions_are_resolved_to_a_shown_result,
    _partly_observed_readings_are_learned,
    _fitting_again_gives_the_same_bits,
    _the_number_of_threads_does_not_matter,
    _whether_gradients_are_on_does_not_matter,
    _demonstrations_space_and_rule_are_not_changed,
    _progress_rises_to_one,
    _partial_fit_continues_or_raises_value_error,
    _invalid_demonstrations_raise_value_error,
)
