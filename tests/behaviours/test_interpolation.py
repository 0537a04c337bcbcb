"""The weight at which a sum of two behaviours changes over."""

import math

import pytest
import torch
from if_else import Rules, learned, readings, space
from robots import random_pairs
from robots import space as other_space

from behaviours import BehaviourBank, Demonstrations, ErrorDriven, OneShot, switching_weight, switching_weights

# Between them, so that no weight of integer scores is met exactly.
WEIGHTS = [(4 * step + 1) / 101 for step in range(25)]


@pytest.mark.parametrize("vsa", ["MAP-C", "BSC", "FHRR", "HRR"])
def test_weights_are_where_the_sum_changes(vsa: str) -> None:
    bank = BehaviourBank(other_space(300, vsa, values="level", combine="product", protection="none"))
    bank.learn("a", random_pairs(15), ErrorDriven())
    bank.learn("b", random_pairs(15, seed=1), ErrorDriven())
    x = torch.cat([random_pairs(15).sensors, random_pairs(30, seed=2).sensors])
    a, b = bank["a"], bank["b"]
    weights = switching_weights(a, b, x)
    assert ((weights >= 0) & (weights <= 1) | weights.isinf()).all()
    assert (weights.isfinite() & (weights > 0)).sum() > 10
    for w in WEIGHTS:
        made = (1 - w) * a + w * b
        recall = made(x)
        holds = (recall.commands == a(x).commands).all(1)
        # Rounding of the sum decides where two results tie.
        clear = (recall.margin > 1e-6) & (weights > 0)
        assert clear.double().mean() > 0.8
        assert torch.equal(holds[clear], (w < weights)[clear]), w


@pytest.mark.parametrize("seed", range(2))
def test_half_of_the_readings_change_at_the_weight(seed: int) -> None:
    bank = learned({"seek": Rules(), "flee": Rules(turn=-1)}, seed=seed)
    x = readings(1000, seed=1)
    a, b = bank["seek"], bank["flee"]
    w = switching_weight(a, b, x)
    assert 0.2 < w < 0.8
    disagree = (a(x).commands != b(x).commands).any(1)
    for weight, least, most in ((w - 0.01, 0.5, 1), (w + 0.01, 0, 0.5)):
        holds = (((1 - weight) * a + weight * b)(x).commands == a(x).commands).all(1)[disagree].double().mean()
        assert least <= holds <= most


def test_what_never_changes() -> None:
    bank = learned({"seek": Rules(), "flee": Rules(turn=-1)}, shown=50, dim=1000)
    x = readings(20)
    seek, flee = bank["seek"], bank["flee"]
    assert switching_weights(seek, seek, x).isinf().all()
    assert math.isnan(switching_weight(seek, seek, x))
    x[3] = math.nan
    weights = switching_weights(seek, flee, x)
    assert weights.isnan().tolist() == [row == 3 for row in range(20)]
    assert not math.isnan(switching_weight(seek, flee, x))
    agree = (seek(x).commands == flee(x).commands).all(1)
    assert (weights[~agree & ~weights.isnan()] < 1).all()


def test_results_of_the_other_behaviour_can_win_at_once() -> None:
    made = space(dim=64)
    a = OneShot().fit(made, Demonstrations([[0.1, 0.1, 0.1]], [[-1, -1]]))
    b = OneShot().fit(made, Demonstrations([[0.1, 0.1, 0.1]], [[1, 1]]))
    # Far from everything that was shown, chance decides, and for some readings against the only result of `a`.
    weights = switching_weights(a, b, readings(200))
    assert (weights > 0).any()
    at_once = weights == 0
    assert at_once.any()
    assert ((0.9999 * a + 0.0001 * b)(readings(200)).commands[at_once] == 1).all()


def test_different_spaces_do_not_add_up() -> None:
    x = readings(5)
    one, two = (OneShot().fit(space(dim=64, seed=seed), Demonstrations(x, Rules()(x))) for seed in (0, 1))
    with pytest.raises(ValueError, match="different spaces"):
        switching_weights(one, two, x)
