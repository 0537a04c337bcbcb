"""Winner takes all, blending, motor schema, vote and gated give what their definitions say, computed in plain NumPy."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from plain import wide
from robots import random_pairs, space

from behaviours import BehaviourBank, Blending, Gated, MotorSchema, OneShot, Vote, WinnerTakesAll

NAMES = ["seek", "avoid", "cruise"]
ASKED = random_pairs(40, seed=9).sensors


def bank(seed: int = 0, dim: int = 400) -> BehaviourBank:
    """Behaviours of 2, 5 and 9 pairs."""
    made, shown, first = BehaviourBank(space(dim, seed=seed)), random_pairs(16), 0
    for name, count in zip(NAMES, (2, 5, 9), strict=True):
        made.learn(name, shown.where([first <= row < first + count for row in range(16)]), OneShot())
        first += count
    return made


def cosine(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    lengths = np.linalg.norm(a, axis=-1)[:, None] * np.linalg.norm(b, axis=-1)
    return a @ b.T / np.where(lengths == 0, 1, lengths)


def known(made: BehaviourBank) -> np.ndarray:
    """Familiarity times the root of the number of pairs, `[B, b]`."""
    conditions = wide(made.space.encode(made.space.cells(ASKED))).real
    return cosine(conditions, np.stack([wide(made[name].known).real for name in NAMES])) * np.sqrt([2, 5, 9])


def commands(made: BehaviourBank) -> np.ndarray:
    return np.stack([made[name](ASKED).commands.numpy() for name in NAMES], 1)


@settings(max_examples=10, deadline=None, derandomize=True)
@given(seed=st.integers(0, 99))
def test_the_one_that_knows_best_wins(seed: int) -> None:
    made = bank(seed)
    recall, winner = WinnerTakesAll(made)(ASKED), known(made).argmax(1)
    assert recall.speaker is not None
    assert recall.speaker.tolist() == winner.tolist()
    assert recall.commands.tolist() == commands(made)[np.arange(40), winner].tolist()


@settings(max_examples=10, deadline=None, derandomize=True)
@given(seed=st.integers(0, 99), beta=st.floats(0, 40))
def test_blending_is_a_softmax_over_commands(seed: int, beta: float) -> None:
    made = bank(seed)
    weights = np.exp(beta * known(made))
    blended = (commands(made) * (weights / weights.sum(1, keepdims=True))[..., None]).sum(1)
    np.testing.assert_allclose(Blending(made, beta)(ASKED).commands.numpy(), blended, atol=1e-5)


def test_a_very_sharp_blend_is_the_winner() -> None:
    made = bank()
    assert torch.equal(Blending(made, 1e6)(ASKED).commands, WinnerTakesAll(made)(ASKED).commands)


@settings(max_examples=10, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 99),
    weights=st.lists(st.floats(0.1, 5), min_size=3, max_size=3),
    weighed=st.booleans(),
)
def test_a_motor_schema_adds_what_is_recalled_before_the_clean_up(
    seed: int, weights: list[float], weighed: bool
) -> None:
    made = bank(seed)
    policy = MotorSchema(made, dict(zip(NAMES, weights, strict=True)), familiarity=weighed)
    conditions = wide(made.space.encode(made.space.cells(ASKED))).real
    familiar = known(made) / np.sqrt([2, 5, 9]) if weighed else np.ones((40, 3))
    noisy = sum(
        weights[i] * familiar[:, i : i + 1] * conditions * wide(made[name].program).real for i, name in enumerate(NAMES)
    )
    items = wide(made.space.items(policy.memory.levels)).real
    scores = noisy @ items.T / np.linalg.norm(items, axis=1)
    order = np.sort(scores, 1)
    clear = order[:, -1] - order[:, -2] > 1e-3
    right = policy.memory.commands.numpy()[scores.argmax(1)]
    assert policy(ASKED).commands.numpy()[clear].tolist() == right[clear].tolist()


def test_the_majority_of_commands_wins() -> None:
    made = bank()
    answers, best = commands(made), known(made)
    for row, found in enumerate(Vote(made)(ASKED).commands.tolist()):
        given = [tuple(answer) for answer in answers[row].tolist()]
        most = max(map(given.count, given))
        among = [i for i in range(3) if given.count(given[i]) == most]
        assert tuple(found) == given[max(among, key=lambda i: best[row, i])]


def test_a_gated_vector_holds_all_programs_behind_their_contexts() -> None:
    made = bank(dim=4000)
    policy = Gated(made, seed=3)
    programs = np.stack([wide(made[name].program).real for name in NAMES])
    contexts = wide(policy.contexts).real
    np.testing.assert_array_equal(wide(policy.program).real, (programs * contexts).sum(0))
    assert policy.program.shape == (4000,)
    shown = random_pairs(16)
    recall = policy(shown.sensors)
    assert recall.commands.tolist() == shown.commands.tolist()
    assert recall.speaker is not None
    assert recall.speaker.tolist() == [0] * 2 + [1] * 5 + [2] * 9
    assert not torch.equal(Gated(made, seed=4).contexts, policy.contexts)


@pytest.mark.parametrize("weights", [{"seek": 0, "avoid": 0, "cruise": 0}])
def test_a_schema_needs_a_weight(weights: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="at least one weight must differ from 0"):
        MotorSchema(bank(), weights)
    with pytest.raises(ValueError, match="beta is a finite number of at least 0"):
        Blending(bank(), beta=-1)
