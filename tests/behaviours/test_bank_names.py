"""Any text names a behaviour, and copies of a behaviour can rejoin its bank."""

import copy
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from robots import random_pairs, same_bits, space
from saved import bank

from behaviours import BehaviourBank, OneShot

NAMES = ["forward", "train", "to", "keys", "pop", "a.b", "a/b", " ", "\n", "\x00", "\ud800", "é\u202e", "x" * 1000]


def test_any_text_names_a_behaviour(tmp_path: Path) -> None:
    names = list(dict.fromkeys([*dir(torch.nn.ModuleDict()), *dir(BehaviourBank), *NAMES]))
    made = BehaviourBank(space(32))
    behaviour = OneShot().fit(made.space, random_pairs(3))
    for name in names:
        made.add(name, behaviour)
    assert made.names == names
    again = BehaviourBank.load(made.save(tmp_path / "bank"))
    assert again.names == names
    assert all(same_bits(again[name].program, behaviour.program) for name in again)


@pytest.mark.parametrize("name", ["", 5, None, ("a",), True])
def test_what_cannot_name_a_behaviour_is_refused_before_it_is_learned(name: Any) -> None:
    class Unasked(OneShot):
        def fit(self, *_: Any, **__: Any) -> Any:
            raise AssertionError("it was learned first")

    with pytest.raises(ValueError, match="name is a text that is not empty"):
        BehaviourBank(space(32)).learn(name, random_pairs(3), Unasked())


@pytest.mark.parametrize(
    "duplicate", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))], ids=["copied", "pickled"]
)
def test_copies_of_a_behaviour_can_join_its_bank_again(duplicate: Callable[[Any], Any]) -> None:
    made = bank()
    twin = duplicate(made["avoid"])
    twin.program.neg_()
    made.add("flee", twin)
    assert made["flee"].space is made.space
    assert same_bits(made["flee"].program, -made["avoid"].program)
    made.add("tuned", duplicate(made["avoid"].trainable()))
    assert isinstance(made["tuned"].program, torch.nn.Parameter)
    for other in (bank(protection="none"), BehaviourBank(space(128, seed=4))):
        with pytest.raises(ValueError, match="learned over another space"):
            other.add("avoid", made["avoid"])
    changed = duplicate(made)
    changed.space.encoder.codes[0].neg_()
    with pytest.raises(ValueError, match="learned over another space"):
        made.add("avoid", changed["avoid"])
