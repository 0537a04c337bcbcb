"""The batched code gives the bits of the paper's loops."""

import math
from dataclasses import dataclass

import numpy as np
import oracle
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from robots import protected, random_pairs, same_bits, space
from torch.testing import assert_close

import torchvsa
from behaviours import Actuator, Demonstrations, ErrorDriven, OneShot, Rule, Schema, Sensor, Space
from behaviours.ordered import in_order_of_appearance
from torchvsa.encoders import Level, Lookup, Product, Sum

PROTECTIONS = (
    {"name": "self_shift", "width": "mean"},
    {"name": "self_shift", "width": "sum"},
    {"name": "fixed_shift", "shift": 3},
    {"name": "none"},
)


@dataclass
class Case:
    space: Space
    rule: OneShot
    sensors: list[list[float]]
    commands: list[list[float]]
    queries: list[list[float]]


@st.composite
def cases(draw: st.DrawFn) -> Case:
    """Demonstrations of a few rows that repeat, contradict each other and miss readings."""
    dim = draw(st.sampled_from([64, 65, 129, 512, 4000]))
    sensors, actuators = draw(st.integers(1, 4)), draw(st.integers(1, 3))
    schema = Schema(
        [Sensor(f"s{i}", -i, 2.0 + i) for i in range(sensors)],
        [Actuator(f"a{i}", -1 - i, 1, levels=2 + i) for i in range(actuators)],
    )
    bins, values = draw(st.integers(1, 6)), draw(st.sampled_from([Lookup, Level]))
    record = draw(st.sampled_from([Sum, Sum, Product]))
    vsa = torchvsa.MAP(dim, dtype=draw(st.sampled_from([torch.int8, torch.float32])))
    protection = protected(vsa, draw(st.sampled_from(PROTECTIONS)))
    made = Space(schema, record(values(vsa, bins), sensors), protection=protection, seed=draw(st.integers(0, 5)))

    reading = [st.one_of(st.floats(s.low, s.high), st.just(math.nan)) for s in schema.sensors]
    condition = st.tuples(*reading).map(list)
    seen = condition.filter(lambda row: not all(map(math.isnan, row)))
    command = st.tuples(*(st.floats(a.low, a.high) for a in schema.actuators)).map(list)
    conditions = draw(st.lists(seen, min_size=1, max_size=6))
    results = draw(st.lists(command, min_size=1, max_size=4))
    rows = draw(st.lists(st.tuples(st.sampled_from(conditions), st.sampled_from(results)), min_size=1, max_size=16))
    rule = OneShot(
        draw(st.sampled_from(["exact", "similarity"])),
        threshold=draw(st.sampled_from([None, -0.5, 0.0, 0.1, 0.4, 0.7, 1.0])),
        clip_each_step=draw(st.booleans()),
    )
    queries = conditions + draw(st.lists(condition, max_size=3))
    return Case(made, rule, [s for s, _ in rows], [a for _, a in rows], queries)


def learned(case: Case) -> tuple[oracle.Encoder, oracle.Learned]:
    encoder, rule = oracle.Encoder.of(case.space), case.rule
    threshold = rule.sigmas / encoder.dim**0.5 if rule.threshold is None else rule.threshold
    return encoder, oracle.learn(encoder, case.sensors, case.commands, rule.novelty, threshold, rule.clip_each_step)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(cases())
def test_learning_is_algorithm_1(case: Case) -> None:
    behaviour = case.rule.fit(case.space, Demonstrations(case.sensors, case.commands))
    _, expected = learned(case)
    np.testing.assert_array_equal(behaviour.program.numpy(), expected.prog_hv)
    np.testing.assert_array_equal(behaviour.known.numpy(), expected.known_cond_hv)
    np.testing.assert_array_equal(case.space.items(behaviour.results).numpy(), expected.results)
    for i, values in enumerate(expected.values):
        levels = in_order_of_appearance(behaviour.results[:, i])
        np.testing.assert_array_equal(case.space.result_encoder.codes[levels].numpy(), values)
    report = behaviour.report
    for count in ("new", "truly_known", "falsely_known", "re_added", "contradicting"):
        assert getattr(report, count) == getattr(expected, count), count
    assert report.samples == len(case.sensors)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(cases())
def test_recall_is_algorithm_2(case: Case) -> None:
    recall = case.rule.fit(case.space, Demonstrations(case.sensors, case.commands))(case.queries)
    encoder, memory = learned(case)
    answers = [oracle.query(encoder, memory, reading) for reading in case.queries]
    np.testing.assert_array_equal(recall.commands.numpy(), [a.commands for a in answers])
    for part in ("similarity", "margin", "familiarity"):
        wanted = torch.tensor([getattr(a, part) for a in answers], dtype=torch.float32)
        assert_close(getattr(recall, part), wanted, atol=1e-6, rtol=1e-6)


@pytest.mark.parametrize("clip", [False, True])
def test_a_long_demonstration_that_forgets(clip: bool) -> None:
    """Enough samples for every kind of decision: known conditions are forgotten and stored again."""
    made = space(256)
    shown = random_pairs(40)
    rows, results = np.random.default_rng(0).integers(0, 40, (2, 160))
    shown = Demonstrations(shown.sensors[rows], shown.commands[results])
    case = Case(made, OneShot("similarity", clip_each_step=clip), shown.sensors.tolist(), shown.commands.tolist(), [])
    _, expected = learned(case)
    assert expected.falsely_known
    assert expected.re_added
    assert expected.contradicting
    behaviour = case.rule.fit(made, shown)
    np.testing.assert_array_equal(behaviour.program.numpy(), expected.prog_hv)
    report = behaviour.report.to_dict()
    assert {k: report[k] for k in ("new", "falsely_known", "re_added", "contradicting", "truly_known")} == {
        k: getattr(expected, k) for k in ("new", "falsely_known", "re_added", "contradicting", "truly_known")
    }


@pytest.mark.parametrize("dtype", ["int8", "float32"])
@pytest.mark.parametrize(
    "rule", [OneShot(), OneShot("similarity", clip_each_step=True), ErrorDriven(epochs=3)], ids=str
)
@pytest.mark.filterwarnings("ignore::behaviours.learning.ConvergenceWarning")
def test_threads_and_chunks_change_no_bit(rule: Rule, dtype: str) -> None:
    shown = random_pairs(30)
    asked = torch.from_numpy(np.random.default_rng(1).uniform(0, 20, (21, 3)))
    asked[::9, 1] = torch.nan

    def bits(threads: int, chunk: int) -> list[torch.Tensor]:
        torch.set_num_threads(threads)
        behaviour = rule.fit(space(500, dtype=dtype), shown)
        recalls = [behaviour(rows) for rows in asked.split(chunk)]
        fields = ("commands", "similarity", "margin", "familiarity")
        return [behaviour.program, behaviour.known] + [torch.cat([getattr(r, f) for r in recalls]) for f in fields]

    first = bits(1, 4096)
    for threads, chunk in ((1, 1), (1, 7), (2, 7), (2, 4096)):
        assert all(map(same_bits, bits(threads, chunk), first)), (threads, chunk)


def test_line_10_as_printed_cannot_be_decoded() -> None:
    """Line 10 stores actuator ⊗ value, but Algorithm 2 looks up what is unbound from the actuator already."""
    for seed in range(5):
        encoder = oracle.Encoder.of(space(4000, seed=seed))
        commands = [0.0, 1.0]
        for i, actuator in enumerate(encoder.actuator):
            value = encoder.encode_actuator(i, commands[i])
            noisy = oracle.bind(actuator, encoder.result(commands))
            # 4 standard deviations of chance; a bundle of two keeps 1/√2 of each.
            assert abs(oracle.cosine(noisy, oracle.bind(actuator, value))) < 4 / 4000**0.5
            assert oracle.cosine(noisy, value) == pytest.approx(0.5**0.5, abs=0.03)


def test_results_of_samples_that_were_not_stored_are_unknown() -> None:
    made = space(512)
    shown = Demonstrations([[1.0, 1, 1], [1.0, 1, 1], [2.0, 2, 2]], [[-1.0, -1], [1, 1], [0, 1]])
    behaviour = OneShot().fit(made, shown)
    assert behaviour.results.tolist() == [[0, 0], [1, 2]]
    assert behaviour(shown.sensors).commands.tolist() == [[-1.0, -1], [-1, -1], [0, 1]]


def test_a_reading_that_equals_an_edge_up_to_rounding_is_above_it() -> None:
    """0 is the second of the edges -1, 0, 1, 2, 3; the float just below it is not told apart from it."""
    schema = Schema([Sensor("s", -1, 3)], [Actuator("a", -1, 1, levels=2)])
    made = Space(schema, Sum(Lookup(torchvsa.MAP(64), bins=4), 1), seed=0)
    below = [[-4e-15], [-(2.0**-52)], [0.0]]
    assert made.cells(below).flatten().tolist() == [0, 1, 1]
    encoder = oracle.Encoder.of(made)
    for reading in below:
        np.testing.assert_array_equal(encoder.condition(reading), made.encode(made.cells([reading]))[0].numpy())
