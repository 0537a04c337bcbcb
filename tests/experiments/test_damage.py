"""What is damaged is exactly what was asked for, in programs, codebooks, queries, networks and trees."""

from functools import cache
from typing import cast

import numpy as np
import pytest
import torch
from kits import composed

import sim
from behaviours import Demonstrations
from experiments.models.damage import DAMAGES, PARTS, Array, Damage, Learner
from experiments.robustness.baselines import Baseline, network
from experiments.robustness.programs import Program
from experiments.robustness.study import LEARNERS, Robustness, study

SMALL = ("vsa.dim=500", "encoder.bins=8", "encoder.span=2", "one_shot.encoder.bins=8", "mlp_epochs=15", "hidden=8")
READINGS = np.random.default_rng(5).uniform([0, 0, 0], [sensor.high for sensor in sim.SENSORS], (300, 3))
READINGS[:150, 0] = sim.SENSORS[0].high  # dark to the left, to the right, to both
READINGS[80:220, 1] = sim.SENSORS[1].high


def settings(*overrides: str) -> Robustness:
    return cast(Robustness, composed(study, *SMALL, *overrides))


@cache
def learner(name: str) -> Learner:
    return LEARNERS[name](settings(), Demonstrations(READINGS, sim.Teacher()(READINGS)))


def damage(kind: str, share: float, *seed: int) -> Damage:
    return Damage(kind, share, 3.0, seed or (0, 0))


CASES = [(name, part) for name in ("default", "one_shot", "hand_written") for part in PARTS]
CASES += [("mlp", "parameters"), ("decision_tree", "parameters")]


@pytest.mark.parametrize("kind", DAMAGES)
@pytest.mark.parametrize("share", [0.0, 0.1, 0.333, 1.0])
def test_exactly_the_share_is_damaged_and_the_rest_stays(kind: str, share: float) -> None:
    arrays = [Array(np.arange(1.0, 42.0)), Array(np.full((30, 3), 0.25), mirror=1.0)]
    damaged = damage(kind, share)(arrays)
    changed = [(new != array.values).reshape(len(new), -1) for new, array in zip(damaged, arrays, strict=True)]
    assert sum(int(rows.any(1).sum()) for rows in changed) == int(share * 71 + 0.5)
    # An element of several numbers is damaged as a whole.
    assert np.array_equal(changed[1].any(1), changed[1].all(1))
    assert np.array_equal(arrays[0].values, np.arange(1.0, 42.0))
    if kind == "flip":
        assert np.array_equal(np.abs(damaged[0]), arrays[0].values)
        assert set(np.unique(damaged[1])) <= {0.25, 0.75}
    if kind == "zero":
        assert all((new[rows.any(1)] == 0).all() for new, rows in zip(damaged, changed, strict=True))


def test_noise_is_relative_to_the_array_that_it_falls_on() -> None:
    small, large = damage("noise", 1.0)([Array(np.full(20_000, 0.1)), Array(np.full(20_000, -10.0))])
    assert np.std(small - 0.1) == pytest.approx(0.3, rel=0.03)
    assert np.std(large + 10) == pytest.approx(30, rel=0.03)
    assert abs(np.mean(large + 10)) < 1


def test_the_same_seed_damages_the_same_and_a_larger_share_damages_more_of_it() -> None:
    array = [Array(np.ones(1000))]
    for kind in DAMAGES:
        assert np.array_equal(damage(kind, 0.3, 7, 1)(array), damage(kind, 0.3, 7, 1)(array))
        assert not np.array_equal(damage(kind, 0.3, 7, 1)(array), damage(kind, 0.3, 7, 2)(array))
        assert not np.array_equal(damage(kind, 0.3, 7, 1)(array), damage(kind, 0.3, 7, 1)(array, key=(1,)))
    (some,), (more,) = damage("zero", 0.2)(array), damage("zero", 0.4)(array)
    assert (more[some == 0] == 0).all()
    (flipped,) = damage("flip", 0.2)(array)
    assert np.array_equal(flipped < 0, some == 0)


@pytest.mark.parametrize(("name", "part"), CASES)
def test_no_damage_changes_nothing(name: str, part: str) -> None:
    one = learner(name)
    for kind in DAMAGES:
        commands = one.damaged(part, damage(kind, 0.0))(READINGS)
        if isinstance(one, Program):
            expected = one.behaviour(READINGS).commands.numpy()
        else:
            assert isinstance(one, Baseline)
            labels = one.model.predict_proba((READINGS - one.shift) / one.scale).argmax(-1)
            expected = one.commands[labels]
        assert np.array_equal(commands, expected)


@pytest.mark.parametrize(("name", "part"), CASES)
@pytest.mark.parametrize("kind", DAMAGES)
def test_an_answer_does_not_depend_on_what_is_asked_together(name: str, part: str, kind: str) -> None:
    one, what = learner(name), damage(kind, 0.4)
    together = one.damaged(part, what)(READINGS)
    policy = one.damaged(part, what)
    alone = np.concatenate([policy(row[None]) for row in READINGS[:150]])
    assert np.array_equal(alone, together[:150])


@pytest.mark.parametrize("part", PARTS)
def test_heavy_damage_is_felt(part: str) -> None:
    one = learner("default")
    right = sim.Teacher()(READINGS)
    shares = [(one.damaged(part, damage("flip", s))(READINGS) == right).all(1).mean() for s in (0.0, 0.5)]
    assert shares[1] < shares[0] - 0.15


@pytest.mark.parametrize("part", ["program", "query"])
def test_flipping_all_of_the_program_or_the_query_turns_the_order_of_the_results_around(part: str) -> None:
    one = learner("default")
    assert isinstance(one, Program)
    bins = one.space.cells(READINGS)
    scores = torch.stack(
        [one.space.encode(bins).double() @ (one.behaviour.program * item).double() for item in one.items], -1
    )
    worst = one.damaged(part, damage("flip", 1.0)).results(bins)
    tied = (scores == scores.amin(-1, keepdim=True)).sum(-1) > 1
    assert not tied.all()
    assert np.array_equal(worst[~tied], scores.argmin(-1).numpy()[~tied])


def test_the_codebooks_of_others_stay_whole_and_missing_readings_keep_their_entry() -> None:
    one = learner("default")
    assert isinstance(one, Program)
    before = one.space.encoder.table.clone(), one.items.clone()
    damaged = one.damaged("codebooks", damage("noise", 0.25))
    assert torch.equal(one.space.encoder.table, before[0])
    assert torch.equal(one.items, before[1])
    table = damaged.space.encoder.table
    assert torch.equal(table[:, -1], before[0][:, -1].float())
    hit = int((table != before[0]).sum()) + int((damaged.items != one.items).sum())
    assert hit == one.elements("codebooks") // 4 == (3 * 8 * 500 + len(one.items) * 500) // 4


def test_each_condition_is_damaged_in_its_own_way() -> None:
    one = learner("default")
    assert isinstance(one, Program)
    bins = one.space.cells(READINGS)
    query = one.damaged("query", damage("flip", 0.45))
    # Asked in another order and company, each condition gets the same answer.
    assert np.array_equal(query.results(bins).tolist(), query.results(bins.flip(0))[::-1].tolist())
    assert (query.results(bins) != one.damaged("query", damage("flip", 0.45, 1, 1)).results(bins)).any()


def test_the_elements_of_a_network_are_all_its_weights_and_biases() -> None:
    one = learner("mlp")
    assert isinstance(one, Baseline)
    assert one.elements("parameters") == 3 * 8 + 8 + 8 * 3 + 3
    changed = one.damaged("parameters", damage("zero", 0.5))
    layers, whole = ([*each.model.coefs_, *each.model.intercepts_] for each in (changed, one))
    assert sum(int((layer == 0).sum()) for layer in layers) - sum(int((layer == 0).sum()) for layer in whole) == 30
    # The largest output wins, however large all of them are.
    hidden = np.maximum((READINGS - one.shift) / one.scale @ (1e6 * whole[0]) + whole[2], 0)
    outputs = hidden @ whole[1] + whole[3]
    large = learner("mlp").damaged("parameters", damage("flip", 0.0))
    assert isinstance(large, Baseline)
    large.model.coefs_[0] *= 1e6
    assert np.array_equal(large(READINGS), one.commands[outputs.argmax(-1)])


def test_the_elements_of_a_tree_are_its_thresholds_and_its_leaves() -> None:
    one = learner("decision_tree")
    assert isinstance(one, Baseline)
    whole = one.model.tree_
    assert one.elements("parameters") == whole.node_count
    changed = one.damaged("parameters", damage("flip", 1.0))
    assert isinstance(changed, Baseline)
    flipped, children = changed.model.tree_, whole.children_left
    inner, leaves = children >= 0, children < 0
    assert flipped.threshold[inner] == pytest.approx(1 - np.array(whole.threshold)[inner])
    # Every leaf decides otherwise, and the tree that was learned stays whole.
    decisions = [np.array(tree.value[leaves, 0]).argmax(-1) for tree in (flipped, whole)]
    assert (decisions[0] != decisions[1]).all()
    assert (np.array(whole.value[:, 0]) >= 0).all()


def test_an_mlp_needs_two_commands() -> None:
    shown = Demonstrations([[0.1, 0.2, 1.0], [0.3, 0.2, 1.0]], [[1.0, 1.0], [1.0, 1.0]])
    with pytest.raises(ValueError, match="mlp needs demonstrations with two commands or more"):
        network(shown, seed=0, hidden=4, epochs=2)
