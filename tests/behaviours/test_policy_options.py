"""Options of policies that cannot work are refused when they are given."""

import math
from typing import Any, cast

import pytest
from robots import random_pairs, space

from behaviours import BehaviourBank, Bundle, OneShot, Priority


def three() -> BehaviourBank:
    bank = BehaviourBank(space(64))
    for seed, name in enumerate(("seek", "avoid", "cruise")):
        bank.learn(name, random_pairs(8, seed), OneShot())
    return bank


@pytest.mark.parametrize("policy", [Bundle, Priority])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, "2", True, None, [1]])
def test_numbers_of_policies_are_finite_numbers(policy: type[Bundle | Priority], value: Any) -> None:
    bank = three()
    what = "weights" if policy is Bundle else "thresholds"
    with pytest.raises(ValueError, match=f"{what} of 'seek' is a finite number; got"):
        policy(bank, **cast(Any, {what: {"seek": value}}))
    with pytest.raises(TypeError, match=f"{what} map names of behaviours to numbers"):
        policy(bank, **cast(Any, {what: [1, 2, 3]}))


@pytest.mark.parametrize("weight", [2**53, 1e300, 1e-320])
def test_weights_that_no_sum_can_hold_are_refused(weight: float) -> None:
    bank = three()
    with pytest.raises(ValueError, match=r"the elements of the sum reach .* between 2\^-53 and 2\^53"):
        Bundle(bank, {"seek": weight, "avoid": 0, "cruise": 0})


def test_an_order_is_a_list_of_different_names() -> None:
    bank = three()
    with pytest.raises(TypeError, match=r"write \['seek'\] for 'seek'"):
        Priority(bank, "seek")
    with pytest.raises(ValueError, match="'seek' is named 2 times"):
        Priority(bank, ["seek", "avoid", "seek"])
