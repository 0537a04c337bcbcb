"""Contexts chained by transitions."""

from itertools import pairwise

import pytest
import torch
from robots import SCHEMA, random_pairs, space

from behaviours import BehaviourBank, Demonstrations, ErrorDriven, OneShot, Rule, Sequencing, Space
from behaviours.testing import check_policy
from torchvsa import MAP
from torchvsa.encoders import History, RandomFourier

ROWS = random_pairs(20).sensors
GO_ON, NEXT = ROWS[:8], ROWS[8:12]
NAMES = ("a", "b", "c")
COMMANDS = {"a": [-1.0, -1.0], "b": [1.0, -1.0], "c": [1.0, 1.0]}
CYCLE = {(name, name): GO_ON for name in NAMES} | dict.fromkeys([*pairwise(NAMES), ("c", "a")], NEXT)


def bank(dim: int = 4000, names: tuple[str, ...] = NAMES) -> BehaviourBank:
    """Behaviours that know the same conditions, and answer each with another command."""
    made = BehaviourBank(space(dim, protection={"name": "self_shift", "width": "sum"}))
    for name in names:
        made.learn(name, Demonstrations(ROWS[:12], [COMMANDS[name]] * 12), OneShot())
    return made


def driven(policy: Sequencing, steps: list[torch.Tensor]) -> list[str]:
    """The names of the behaviours that speak, step by step."""
    state, spoken = policy.start(range(1)), []
    for row in steps:
        recall, state = policy.step(row[None], state)
        assert recall.speaker is not None
        spoken.append(policy.names[int(recall.speaker)])
        assert recall.commands[0].tolist() == COMMANDS[spoken[-1]]
    return spoken


@pytest.mark.parametrize("rule", [OneShot(), ErrorDriven(margin=5)])
def test_each_transition_hands_over_to_the_next_one(rule: Rule) -> None:
    made = Sequencing(bank(), CYCLE, rule)
    steps = [GO_ON[0], NEXT[0], GO_ON[1], GO_ON[2], NEXT[1], GO_ON[7], NEXT[2], NEXT[3], GO_ON[0]]
    assert driven(made, steps) == ["a", "b", "b", "b", "c", "c", "a", "b", "b"]


def test_the_same_readings_mean_another_transition_in_another_context() -> None:
    transitions = {("a", "a"): GO_ON, ("a", "b"): NEXT, ("b", "b"): NEXT, ("b", "c"): GO_ON}
    assert driven(Sequencing(bank(), transitions), [GO_ON[0], NEXT[0], NEXT[0], GO_ON[0]]) == ["a", "b", "b", "c"]


def test_a_behaviour_without_transitions_keeps_the_floor() -> None:
    made = Sequencing(bank(), {("a", "a"): GO_ON, ("a", "c"): NEXT})
    assert driven(made, [NEXT[0], NEXT[1], GO_ON[0], NEXT[2]]) == ["c"] * 4


def test_robots_have_a_floor_each() -> None:
    made = Sequencing(bank(), CYCLE)
    _, state = made.step(torch.stack([GO_ON[0], NEXT[0]]), made.start(range(2)))
    assert state[1].tolist() == [0, 1]
    recall, state = made.step(torch.stack([NEXT[1], NEXT[1]]), state)
    assert state[1].tolist() == [1, 2]
    assert recall.commands.tolist() == [COMMANDS["b"], COMMANDS["c"]]


def test_all_is_in_one_vector_of_integers() -> None:
    behaviours = bank()
    made = Sequencing(behaviours, CYCLE)
    assert made.program.shape == (4000,)
    assert made.program.dtype == torch.int32
    square = float(behaviours["a"].program.double().square().sum())
    assert float(made.program.double().square().sum()) == pytest.approx(6 * square, rel=0.1)


def test_where_nothing_is_observed_nobody_takes_the_floor() -> None:
    made = Sequencing(bank(), CYCLE)
    _, state = made.step(NEXT[:1], made.start(range(1)))
    recall, after = made.step(torch.full((1, 3), torch.nan), state)
    assert after[1].tolist() == state[1].tolist() == [1]
    assert recall.speaker is not None
    assert recall.speaker.tolist() == [-1]


def test_a_behaviour_that_does_not_observe_its_sensors_keeps_the_floor() -> None:
    behaviours = bank()
    for name in NAMES:
        shown = Demonstrations(ROWS[:12], [COMMANDS[name]] * 12)
        behaviours.learn(name, shown, OneShot(), sensors=["left", "right"] if name == "b" else None)
    made = Sequencing(behaviours, CYCLE)
    assert driven(made, [NEXT[0], GO_ON[0], NEXT[1]]) == ["b", "b", "c"]
    _, state = made.step(NEXT[:1], made.start(range(1)))
    hidden = NEXT[1:2].clone()
    hidden[0, :2] = torch.nan
    assert made.step(hidden, state)[1][1].tolist() == [1]


def test_without_transitions_it_hands_over_where_a_condition_is_not_known() -> None:
    shown = random_pairs(12)
    behaviours = BehaviourBank(space(2000, protection={"name": "self_shift", "width": "sum"}))
    behaviours.learn("low", shown.where([row < 8 for row in range(12)]), OneShot())
    behaviours.learn("high", shown.where([row >= 4 for row in range(12)]), OneShot())
    made = Sequencing(behaviours)
    state, spoken = made.start(range(1)), []
    for row in (0, 5, 9, 5, 0, 5):
        recall, state = made.step(shown.sensors[row : row + 1], state)
        assert recall.speaker is not None
        spoken.append(int(recall.speaker))
    # Conditions 4 to 7 are known to both: who has the floor keeps it.
    assert spoken == [0, 0, 1, 1, 0, 0]


def test_transitions_keep_the_laws() -> None:
    check_policy(_with_transitions, space(1000))


def test_transitions_of_recorded_runs_keep_the_laws_over_a_memory() -> None:
    check_policy(_with_recorded_transitions, Space(SCHEMA, History(RandomFourier(MAP(1000), 3), [1])))


def _with_transitions(behaviours: BehaviourBank) -> Sequencing:
    return Sequencing(behaviours, _transitions(behaviours, GO_ON, NEXT))


def _with_recorded_transitions(behaviours: BehaviourBank) -> Sequencing:
    recorded = [Demonstrations(rows, torch.zeros(len(rows), 2)) for rows in (GO_ON, NEXT)]
    return Sequencing(behaviours, _transitions(behaviours, *recorded))


def _transitions(behaviours: BehaviourBank, go_on: object, hand_over: object) -> dict[tuple[str, str], object]:
    names = list(behaviours)
    if len(names) < 2:
        return {}
    low, high = names
    return {(low, low): go_on, (low, high): hand_over, (high, high): hand_over, (high, low): go_on}


def test_transitions_that_cannot_work_are_refused() -> None:
    behaviours = bank(64)
    with pytest.raises(ValueError, match=r"got \('a', 'd'\), and the bank holds a, b, c"):
        Sequencing(behaviours, {("a", "d"): NEXT})
    with pytest.raises(ValueError, match=r"'a' hands over, but is not told when to go on"):
        Sequencing(behaviours, {("a", "b"): NEXT})
    with pytest.raises(TypeError, match=r"transitions map \(from, to\) to readings"):
        Sequencing(behaviours, [("a", "b")])  # pyright: ignore[reportArgumentType] (refused)
    with pytest.raises(ValueError, match="at least one row"):
        Sequencing(behaviours, {("a", "a"): ROWS[:0]})
    with pytest.raises(ValueError, match="sensor 'left' reads 99"):
        Sequencing(behaviours, {("a", "a"): [[99.0, 0, 0]]})
