"""A program that recalls whom to ask, in the same vector as the behaviours."""

from typing import Any

import pytest
import torch
from robots import random_pairs, space

from behaviours import BehaviourBank, Demonstrations, ErrorDriven, Gated, Hierarchy, OneShot, WinnerTakesAll, choosing
from torchvsa import MAP

SHOWN = random_pairs(24)
PARTS = {"few": SHOWN.where([row < 4 for row in range(24)]), "many": SHOWN.where([row >= 4 for row in range(24)])}


def bank(dim: int = 4000, **options: Any) -> BehaviourBank:
    made = BehaviourBank(space(dim, protection={"name": "self_shift", "width": "sum"}, **options))
    for name, shown in PARTS.items():
        made.learn(name, shown, OneShot())
    return made


def speakers(policy: Gated | WinnerTakesAll, readings: torch.Tensor) -> list[int]:
    speaker = policy(readings).speaker
    assert speaker is not None
    return speaker.tolist()


def test_known_conditions_are_answered_by_who_knows_them_whatever_the_number_of_pairs() -> None:
    made = Hierarchy(bank())
    assert speakers(made, SHOWN.sensors) == [0] * 4 + [1] * 20
    assert torch.equal(made(SHOWN.sensors).commands, SHOWN.commands)


def test_without_a_chooser_it_decides_as_winner_takes_all_does() -> None:
    behaviours = bank(16_000)
    unknown = random_pairs(200, seed=5).sensors
    with_one_known = torch.where(torch.arange(3) == 1, unknown, SHOWN.sensors.repeat(9, 1)[:200])
    for readings in (SHOWN.sensors, with_one_known):
        winner = WinnerTakesAll(behaviours)
        familiar = [behaviours[name](readings).familiarity * len(PARTS[name]) ** 0.5 for name in PARTS]
        clear = (familiar[0] - familiar[1]).abs() > 0.3
        assert clear.any()
        assert speakers(Hierarchy(behaviours), readings[clear]) == speakers(winner, readings[clear])


def test_all_is_in_one_vector_of_integers_in_which_the_choice_is_as_loud_as_the_longest_program() -> None:
    behaviours = bank()
    made = Hierarchy(behaviours)
    assert made.program.shape == (4000,)
    assert made.program.dtype == torch.int32
    squares = [float(behaviours[name].program.double().square().sum()) for name in PARTS]
    assert float(made.program.double().square().sum()) == pytest.approx(sum(squares) + max(squares), rel=0.05)


def test_a_chooser_decides_as_it_was_shown() -> None:
    behaviours = bank()
    exchanged = choosing(behaviours, {"few": PARTS["many"], "many": PARTS["few"]}, ErrorDriven(margin=5))
    assert exchanged(SHOWN.sensors).commands[:, 0].tolist() == [1] * 4 + [0] * 20
    assert speakers(Hierarchy(behaviours, exchanged), SHOWN.sensors) == [1] * 4 + [0] * 20


def test_only_names_that_a_chooser_was_shown_are_chosen() -> None:
    behaviours = bank()
    always = choosing(behaviours, {"many": PARTS["few"]})
    assert set(speakers(Hierarchy(behaviours, always), random_pairs(100, seed=3).sensors)) == {1}


def test_where_both_know_a_condition_the_chooser_decides() -> None:
    behaviours = bank()
    behaviours.learn("many", Demonstrations(SHOWN.sensors, SHOWN.commands.roll(1, 0)), OneShot())
    made = Hierarchy(behaviours, choosing(behaviours, PARTS))
    assert speakers(made, SHOWN.sensors) == [0] * 4 + [1] * 20
    assert torch.equal(made(PARTS["few"].sensors).commands, PARTS["few"].commands)


def test_runs_of_different_behaviours_stay_apart() -> None:
    behaviours = bank()
    parts = {name: Demonstrations(shown.sensors, shown.commands, [7] * len(shown)) for name, shown in PARTS.items()}
    assert torch.equal(choosing(behaviours, parts).program, choosing(behaviours, PARTS).program)


def test_the_seed_draws_contexts_tag_and_names_unrelated_to_the_codebooks() -> None:
    behaviours = bank()
    first, again, other = Hierarchy(behaviours), Hierarchy(behaviours), Hierarchy(behaviours, seed=1)
    assert torch.equal(first.program, again.program)
    assert not torch.equal(first.contexts, other.contexts)
    assert not torch.equal(first.tag, other.tag)
    drawn = torch.cat([first.contexts, first.tag[None], first.name_items])
    codebooks = behaviours.space.encoder.state_dict()
    codes = torch.cat([codebooks["roles"], codebooks["values.0.codes"], drawn])
    alike = behaviours.space.vsa.similarity(drawn[:, None], codes).abs()
    alike[:, -len(drawn) :].fill_diagonal_(0)
    assert alike.max() < 6 / 4000**0.5


def test_behaviours_of_different_sensors_are_refused() -> None:
    behaviours = bank()
    behaviours.learn("many", PARTS["many"], OneShot(), sensors=["left", "front"])
    for make in (Hierarchy, lambda bank: choosing(bank, PARTS)):
        with pytest.raises(ValueError, match=r"'few' uses left, right, front, and 'many' left, front"):
            make(behaviours)


def test_a_chooser_of_other_behaviours_is_refused() -> None:
    behaviours = bank()
    with pytest.raises(ValueError, match=r"commands left_motor, right_motor, and not one of the 2 behaviours"):
        Hierarchy(behaviours, behaviours["few"])
    with pytest.raises(ValueError, match="learned over other conditions"):
        Hierarchy(behaviours, choosing(bank(seed=1), PARTS))
    with pytest.raises(TypeError, match="chooser is a behaviour"):
        Hierarchy(behaviours, "few")  # pyright: ignore[reportArgumentType] (refused)


def test_choosing_needs_demonstrations_of_behaviours_of_the_bank() -> None:
    with pytest.raises(ValueError, match="no behaviour 'much' to choose; the bank holds few, many"):
        choosing(bank(), {"much": SHOWN})
    with pytest.raises(ValueError, match="no demonstrations to learn from"):
        choosing(bank(), {})


class Opaque(MAP):
    """MAP that does not tell that its bind is linear in both arguments."""

    bilinear = False


def test_an_architecture_whose_bind_is_not_linear_needs_a_chooser() -> None:
    vsa = Opaque(2000, dtype=torch.int8)
    behaviours = bank(vsa=vsa)
    assert not Hierarchy.supports(vsa)
    assert Gated.supports(vsa)
    with pytest.raises(ValueError, match="not linear in both arguments"):
        Hierarchy(behaviours)
    assert speakers(Hierarchy(behaviours, choosing(behaviours, PARTS)), SHOWN.sensors) == [0] * 4 + [1] * 20
