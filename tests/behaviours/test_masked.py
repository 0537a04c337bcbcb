"""Behaviours that use some of the sensors."""

from pathlib import Path

import numpy as np
import pytest
import torch
from robots import random_pairs, same_bits, space

from behaviours import (
    BehaviourBank,
    Bundle,
    Demonstrations,
    ErrorDriven,
    MotorSchema,
    OneShot,
    Priority,
    WinnerTakesAll,
    recognise,
    switching_weights,
)


def bank(dim: int = 1000) -> BehaviourBank:
    """`lights` uses left and right; `front` uses the third sensor."""
    made = BehaviourBank(space(dim, protection="none", combine="product"))
    made.learn(
        "lights", Demonstrations([[1.0, 2, 3], [4, 5, 6]], [[1.0, 0], [0, 1]]), OneShot(), sensors=["right", "left"]
    )
    made.learn("front", Demonstrations([[9.0, 9, 12]], [[-1.0, -1]]), OneShot(), sensors=["front"])
    return made


def test_unused_sensors_do_not_matter() -> None:
    lights = bank()["lights"]
    assert lights.space.sensors == ("left", "right")
    for front in (0.0, 19.0, np.nan):
        recall = lights([[1.0, 2, front], [4, 5, front]])
        assert recall.commands.tolist() == [[1.0, 0.0], [0.0, 1.0]]
        assert recall.familiarity.min() > 0.5
    blind = lights([[np.nan, np.nan, 3.0]])
    assert blind.commands.isnan().all()
    assert "2 sensors (left, right)" in repr(lights)


def test_all_forms_of_a_behaviour_use_the_same_sensors(tmp_path: Path) -> None:
    made = bank()
    readings = torch.rand(50, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) * 19
    loaded = BehaviourBank.load(made.save(tmp_path / "bank.safetensors"))
    for name in made:
        recall, frozen = made[name](readings), made[name].freeze()
        for other in (loaded[name](readings), frozen(readings), made(readings)[name]):
            assert all(same_bits(a, b) for a, b in zip(recall[:4], other[:4], strict=True))
        for row in readings[:5]:
            tick = frozen([row.tolist()])
            assert all(same_bits(a, b) for a, b in zip(made[name]([row.tolist()])[:4], tick[:4], strict=True))
        assert loaded[name].space.sensors == made[name].space.sensors
        assert loaded[name].threshold == made[name].threshold
        assert loaded[name].least_similarity == made[name].least_similarity is not None


@pytest.mark.parametrize("policy", [Priority, WinnerTakesAll, MotorSchema])
def test_policies_ask_each_behaviour_about_its_own_sensors(policy: type) -> None:
    made = policy(bank())
    recall = made([[1.0, 2, 5], [4, 5, 7], [8, 8, 12]])
    assert recall.commands.tolist() == [[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]]
    assert recall.speaker.tolist() == [0, 0, 1]
    # A behaviour none of whose sensors was observed has nothing to say.
    assert made([[np.nan, np.nan, 12.0]]).speaker.tolist() == [1]
    assert made([[np.nan, np.nan, np.nan]]).speaker.tolist() == [-1]


def test_behaviours_over_different_sensors_do_not_add_up() -> None:
    made = bank()
    with pytest.raises(ValueError, match="use different sensors do not add up"):
        _ = made["lights"] + made["front"]
    with pytest.raises(ValueError, match="use different sensors"):
        Bundle(made)
    assert (made["lights"] + made["lights"]).space.sensors == ("left", "right")


def test_silence_is_kept_at_the_sensors_that_are_used() -> None:
    made = BehaviourBank(space(1000, protection="none", combine="product"))
    own, other = random_pairs(5), random_pairs(5, seed=3)
    made.learn("own", own, ErrorDriven(margin=2), silent=other, sensors=["left"])
    assert made["own"].space.sensors == ("left",)


def test_unknown_sensors_are_named() -> None:
    made = bank(64)
    for wrong in (["lft"], [], "left"):
        with pytest.raises(ValueError, match="out of left, right, front"):
            made.learn("x", random_pairs(3), OneShot(), sensors=wrong)


def test_a_threshold_is_what_nearly_all_of_its_own_conditions_reach() -> None:
    made, shown = BehaviourBank(space(1000)), random_pairs(60)
    made.learn("x", shown, OneShot())
    recall, before = made["x"](shown.sensors), made["x"]
    made.partial_fit("x", random_pairs(5, seed=8), OneShot(novelty="similarity"))
    for reached, field in ((recall.familiarity, "threshold"), (recall.similarity, "least_similarity")):
        least = getattr(before, field)
        assert 0.97 <= (reached >= least - 1e-6).double().mean() < 1
        assert getattr(made["x"], field) <= least


def test_what_a_robot_runs_is_recognised_by_the_sensors_of_each_behaviour() -> None:
    made = bank()
    readings = [[1.0, 2, 7], [4, 5, 3], [0, 0, 12], [8, 8, 12]]
    commands = [[1.0, 0], [0, 1], [-1, -1], [-1, -1]]
    assert recognise(made, readings, commands, [0, 0, 1, 1]).best == ["lights", "front"]
    with pytest.raises(ValueError, match="use different sensors do not add up"):
        switching_weights(made["lights"], made["front"], readings)
