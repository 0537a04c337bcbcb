"""Bundle and Priority give what their definitions say, computed by hand."""

import math
from functools import cache

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from plain import wide
from robots import KINDS, correct, random_pairs, same_bits, space
from torch.testing import assert_close

from behaviours import Behaviour, BehaviourBank, Bundle, Demonstrations, ErrorDriven, OneShot, Policy, Priority, Recall
from torchvsa._numerics import inner_products

NAMES = ["seek", "avoid", "cruise"]


def three(dim: int = 1000, vsa: str = "MAP-C", each: int = 8) -> tuple[BehaviourBank, dict[str, Demonstrations]]:
    """Three behaviours of distinct conditions, and what they were shown."""
    bank, pairs = BehaviourBank(space(dim, vsa, protection={"name": "self_shift", "width": "sum"})), {}
    shown = random_pairs(3 * each)
    for i, name in enumerate(NAMES):
        pairs[name] = shown.where([each * i <= row < each * (i + 1) for row in range(len(shown))])
        bank.learn(name, pairs[name], OneShot())
    return bank, pairs


taught = cache(three)
"""The same for all examples of a test, which leave it as it is."""


def everything(pairs: dict[str, Demonstrations]) -> torch.Tensor:
    """All conditions, and some that nobody was shown."""
    return torch.cat([*(p.sensors for p in pairs.values()), random_pairs(20, seed=9).sensors])


def same_answer(a: Recall, b: Recall) -> bool:
    return all(same_bits(getattr(a, f), getattr(b, f)) for f in ("commands", "similarity", "margin", "familiarity"))


@settings(max_examples=60, deadline=None, derandomize=True)
@given(weights=st.lists(st.integers(-9, 9), min_size=3, max_size=3).filter(any), seed=st.integers(0, 99))
def test_bundling_is_voting(weights: list[int], seed: int) -> None:
    """<c ⊗ Σ wᵢpᵢ, A> = Σ wᵢ <c ⊗ pᵢ, A>, exactly."""
    bank, _ = taught(128)
    policy = Bundle(bank, dict(zip(NAMES, weights, strict=True)))
    rng = np.random.default_rng(seed)
    condition, answer = (2 * rng.integers(0, 2, (2, 128)) - 1).astype(np.int64)
    votes = [(condition * bank[name].program.numpy().astype(np.int64)) @ answer for name in NAMES]
    together = (condition * policy.program.numpy().astype(np.int64)) @ answer
    assert together == sum(w * v for w, v in zip(weights, votes, strict=True))
    assert policy.program.dtype == torch.int32


@settings(max_examples=30, deadline=None, derandomize=True)
@given(weights=st.lists(st.floats(-3, 3), min_size=3, max_size=3).filter(lambda w: max(map(abs, w)) > 1e-9))
@pytest.mark.parametrize("vsa", KINDS)
def test_bundling_is_voting_for_any_weights(vsa: str, weights: list[float]) -> None:
    bank, _ = taught(128, vsa, each=3)
    policy = Bundle(bank, dict(zip(NAMES, weights, strict=True)))
    wanted = sum(w * wide(bank[name].program) for w, name in zip(weights, NAMES, strict=True))
    np.testing.assert_allclose(wide(policy.program), wanted, atol=1e-5)


def test_clipping_breaks_the_vote() -> None:
    bank, pairs = three(128)
    policy = Bundle(bank)
    conditions = bank.space.encode(bank.space.cells(everything(pairs)))
    items = bank.space.items(policy.behaviour.results)

    def votes(program: torch.Tensor) -> torch.Tensor:
        return inner_products(bank.space.vsa.unbind(program, conditions), items).to(torch.int64)

    shares = sum(votes(bank[name].program) for name in NAMES)
    assert torch.equal(votes(policy.program), torch.as_tensor(shares))
    clipped = sum(votes(bank[name].clipped().program) for name in NAMES)
    assert not torch.equal(votes(policy.behaviour.clipped().program), torch.as_tensor(clipped))


@pytest.mark.parametrize("vsa", KINDS)
def test_clipped_programs_are_bundled_as_the_votes_they_are(vsa: str) -> None:
    """Clipped programs are small types (int8, bits) whose sums are not."""
    bank, pairs = three(128, vsa, each=3)
    clipped = BehaviourBank(bank.space)
    for name in bank:
        clipped.add(name, bank[name].clipped())
    policy = Bundle(clipped, {"seek": 100, "avoid": 90})
    wanted = sum(w * wide(clipped[name].program) for w, name in zip([100, 90, 1], NAMES, strict=True))
    np.testing.assert_allclose(wide(policy.program), wanted, rtol=1e-5, atol=1e-4)
    wanted = sum(w * wide(clipped[name].known) for w, name in zip([100, 90, 1], NAMES, strict=True))
    np.testing.assert_allclose(wide(policy.behaviour.known), wanted, rtol=1e-5, atol=1e-4)
    assert policy(pairs["seek"].sensors).commands.isfinite().all()


def test_raw_and_clipped_programs_mix() -> None:
    bank, _ = three(128)
    mixed = BehaviourBank(bank.space)
    mixed.add("clipped", bank["seek"].clipped())
    mixed.add("raw", bank["avoid"])
    wanted = wide(bank["seek"].clipped().program) + wide(bank["avoid"].program)
    np.testing.assert_array_equal(wide(Bundle(mixed).program), wanted)


@pytest.mark.parametrize("vsa", KINDS)
def test_a_bundle_recalls_all_of_its_parts_as_one_behaviour(vsa: str) -> None:
    bank, pairs = three(4000, vsa)
    policy = Bundle(bank)
    for name in NAMES:
        recall = policy(pairs[name].sensors)
        assert recall.commands.tolist() == pairs[name].commands.tolist()
    whole = policy.behaviour
    assert isinstance(whole, Behaviour)
    readings = everything(pairs)
    assert same_answer(whole(readings), policy(readings))
    assert whole.program.shape == bank["seek"].program.shape


@pytest.mark.parametrize("policy", [Bundle, Priority])
def test_one_behaviour_alone_is_that_behaviour(policy: type[Bundle | Priority]) -> None:
    bank = BehaviourBank(space(500))
    shown = random_pairs(9)
    bank.learn("only", shown, OneShot())
    recall = policy(bank)(shown.sensors)
    assert same_answer(recall, bank["only"](shown.sensors))
    assert recall.speaker is not None
    assert recall.speaker.tolist() == [0] * 9


@settings(max_examples=40, deadline=None, derandomize=True)
@given(weights=st.lists(st.integers(-2, 3), min_size=3, max_size=3).filter(any))
def test_the_speaker_contributes_most_to_the_winner(weights: list[int]) -> None:
    bank, pairs = taught(64, each=4)
    policy = Bundle(bank, dict(zip(NAMES, weights, strict=True)))
    readings = everything(pairs)
    recall = policy(readings)
    items = wide(bank.space.items(policy.behaviour.results)).real
    programs = [w * wide(bank[name].program).real for w, name in zip(weights, NAMES, strict=True)]
    assert recall.speaker is not None
    for row, condition in enumerate(wide(bank.space.encode(bank.space.cells(readings))).real):
        scores = items @ (condition * sum(programs)) / np.linalg.norm(items, axis=1)
        winner = items[int(scores.argmax())]
        # Behaviours of weight 0 are left out.
        shares = [winner @ (condition * p) if w else -np.inf for w, p in zip(weights, programs, strict=True)]
        assert recall.speaker[row].item() == int(np.argmax(shares))


def by_hand(policy: Priority, row: int, recalls: list[Recall]) -> int:
    above = [float(recall.familiarity[row] - limit) for recall, limit in zip(recalls, policy.thresholds, strict=True)]
    return next((speaker for speaker, lead in enumerate(above) if lead >= 0), int(np.argmax(above)))


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    order=st.permutations(NAMES),
    take=st.integers(1, 3),
    thresholds=st.dictionaries(st.sampled_from(NAMES), st.sampled_from([-1.0, 0.0, 0.1, 0.3, 1.0])),
)
def test_priority_by_hand(order: list[str], take: int, thresholds: dict[str, float]) -> None:
    bank, pairs = taught(256, each=4)
    order = order[:take]
    thresholds = {name: value for name, value in thresholds.items() if name in order}
    policy = Priority(bank, order, thresholds)
    readings = everything(pairs)
    recall, recalls = policy(readings), [bank[name](readings) for name in order]
    assert recall.speaker is not None
    for row in range(len(readings)):
        speaker = by_hand(policy, row, recalls)
        assert recall.speaker[row] == speaker
        for field in ("commands", "similarity", "margin", "familiarity"):
            assert_close(getattr(recall, field)[row], getattr(recalls[speaker], field)[row])


def test_priority_lets_each_speak_where_it_knows() -> None:
    bank, pairs = three(4000)
    for name in NAMES:
        recall = Priority(bank)(pairs[name].sensors)
        assert recall.speaker is not None
        assert recall.speaker.tolist() == [NAMES.index(name)] * 8
        assert correct(bank[name], pairs[name]).mean() == 1
    # With so few conditions the least familiar one gives the threshold.
    least = [float(bank[name](pairs[name].sensors).familiarity.min()) for name in NAMES]
    assert Priority(bank).thresholds == pytest.approx(least, abs=2e-6)
    bank.add("both", bank["seek"] + bank["avoid"])
    assert Priority(bank).thresholds[3] == pytest.approx(0.5 / math.sqrt(16))


def test_where_two_know_the_first_in_order_speaks() -> None:
    bank = BehaviourBank(space(1000))
    bank.learn("go", Demonstrations([[1.0, 1, 1]], [[1.0, 1]]), OneShot())
    bank.learn("stop", Demonstrations([[1.0, 1, 1]], [[0.0, 0]]), ErrorDriven())
    for order in (["go", "stop"], ["stop", "go"]):
        recall = Priority(bank, order)([[1.0, 1, 1]])
        assert recall.commands.tolist() == ([[1.0, 1.0]] if order[0] == "go" else [[0.0, 0.0]])


def test_weights_decide_between_contradicting_behaviours() -> None:
    bank = BehaviourBank(space(1000))
    bank.learn("go", Demonstrations([[1.0, 1, 1]], [[1.0, 1]]), OneShot())
    bank.learn("stop", Demonstrations([[1.0, 1, 1]], [[0.0, 0]]), OneShot())
    for weight, speaker in ((0.5, 0), (2.0, 1)):
        recall = Bundle(bank, {"stop": weight})([[1.0, 1, 1]])
        assert recall.speaker is not None
        assert recall.speaker.tolist() == [speaker]
        assert recall.commands.tolist() == [[[1.0, 1.0], [0.0, 0.0]][speaker]]


def test_the_bank_replaces_names_and_refuses_strangers() -> None:
    bank = BehaviourBank(space(128))
    bank.learn("a", random_pairs(3), OneShot())
    report = bank.learn("a", random_pairs(5), OneShot())
    assert (bank.names, len(bank), report.new, "a" in bank, "b" in bank) == (["a"], 1, 5, True, False)
    with pytest.raises(KeyError, match="no behaviour 'b' in this bank; it holds a"):
        bank["b"]
    with pytest.raises(ValueError, match="learned over another space"):
        bank.add("b", OneShot().fit(space(128, seed=1), random_pairs(3)))


def test_names_that_policies_do_not_know() -> None:
    bank, _ = three(64)
    with pytest.raises(ValueError, match="weights names flee; the behaviours are seek, avoid, cruise"):
        Bundle(bank, {"flee": 1.0})
    with pytest.raises(KeyError, match="no behaviour 'flee'"):
        Priority(bank, ["seek", "flee"])
    with pytest.raises(ValueError, match="thresholds names avoid; the behaviours are seek"):
        Priority(bank, ["seek"], {"avoid": 0.1})
    with pytest.raises(ValueError, match="the list of names is empty"):
        Priority(bank, [])


def test_policies_are_policies() -> None:
    assert issubclass(Bundle, Policy)
    assert issubclass(Priority, Policy)


@pytest.mark.parametrize("vsa", KINDS)
def test_a_behaviour_of_weight_0_is_left_out(vsa: str) -> None:
    bank, pairs = three(500, vsa)
    readings = everything(pairs)
    policy = Bundle(bank, {"seek": 0, "avoid": 1, "cruise": 0.0})
    recall = policy(readings)
    assert same_answer(recall, bank["avoid"](readings))
    assert policy.names == NAMES
    assert recall.speaker is not None
    assert recall.speaker.unique().tolist() == [1]
    assert policy.behaviour.results.tolist() == bank["avoid"].results.tolist()
    assert torch.equal(policy.behaviour.known, bank["avoid"].known)
    assert policy.behaviour.report.samples == 8
    with pytest.raises(ValueError, match="at least one weight must differ from 0; got 0 for each of seek, avoid"):
        Bundle(bank, dict.fromkeys(NAMES, 0))


@pytest.mark.parametrize("weight", [2**27, 2**28, 3_000_000_000, 2**31, 2**32, 2**40, 1e12, 2**40 + 0.5])
@pytest.mark.parametrize("vsa", KINDS)
def test_large_weights_answer_as_the_behaviour_itself(vsa: str, weight: float) -> None:
    bank, pairs = three(500, vsa)
    readings = everything(pairs)
    alone = bank["avoid"](readings)
    recall = Bundle(bank, {"avoid": weight, "seek": 0, "cruise": 0})(readings)
    sure = alone.margin > 1e-5  # sums of floats may decide a tie otherwise
    assert torch.equal(recall.commands[sure], alone.commands[sure])
    assert_close(recall.similarity, alone.similarity, atol=1e-5, rtol=1e-5)
    assert_close(recall.margin, alone.margin, atol=1e-5, rtol=1e-5)
    if bank["avoid"].program.dtype == torch.int32 and weight == round(weight):
        policy = Bundle(bank, {"avoid": weight, "seek": -3, "cruise": 0})
        programs = zip(bank["avoid"].program.tolist(), bank["seek"].program.tolist(), strict=True)
        assert [int(element) for element in policy.program] == [int(weight) * a - 3 * s for a, s in programs]


@pytest.mark.parametrize("policy", [Bundle, Priority])
def test_a_policy_is_a_snapshot(policy: type[Bundle | Priority]) -> None:
    bank, pairs = three(500)
    readings = everything(pairs)
    made = policy(bank)
    before = made(readings)
    bank.learn("seek", random_pairs(30, seed=5), OneShot())
    bank.learn("new", random_pairs(3, seed=6), OneShot())
    assert same_answer(made(readings), before)
    assert made.names == NAMES
