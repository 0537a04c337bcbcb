"""The laws of policies."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps

import torch

from behaviours.bank import BehaviourBank
from behaviours.composition.base import Policy
from behaviours.controller import Controller
from behaviours.demonstrations import Demonstrations
from behaviours.learning import OneShot
from behaviours.space import Space
from behaviours.testing._controllers import CONTROLLER_LAWS, same_answer
from behaviours.testing._material import a_space, pairs, readings, recalled, tensors, unchanged, walk
from torchvsa.testing._laws import check, refuses, require


def check_policy(make: Callable[[BehaviourBank], Policy], space: Space | None = None) -> None:
    """Check the laws of policies. Raises `AssertionError` naming the law that is broken.

    Args:
        make: A class of policies, or a function that makes one of a bank: `lambda bank: Mine(bank, option=3)`. It is
            called several times, with banks of behaviours named `"low"` and `"high"`.
        space: The codebooks of these behaviours; by default exact ones for 3 sensors.

    Among the laws: a policy is a snapshot of the bank; equal states and readings give equal answers; a step modifies
    neither; each robot of a batch is answered as it would be alone, whoever joins or leaves; where nothing was
    observed nobody speaks.
    """
    case = _Case(make, a_space() if space is None else space)
    check(case, (_it_is_a_policy_of_its_bank, *map(_of_the_policy, CONTROLLER_LAWS), *_LAWS))


@dataclass(frozen=True)
class _Case:
    make: Callable[[BehaviourBank], Policy]
    space: Space

    def __repr__(self) -> str:
        return getattr(self.make, "__qualname__", repr(self.make))

    def bank(self, turn: int = 0) -> BehaviourBank:
        """Two behaviours of 6 conditions each (or as many as are unrelated), whose results are turned on by `turn`."""
        shown = pairs(self.space, 12)
        half = (len(shown) + 1) // 2
        low = torch.arange(len(shown)) < half
        bank = BehaviourBank(self.space)
        for name, rows in (("low", low), ("high", ~low if half < len(shown) else low)):
            part = shown.where(rows)
            bank.learn(name, Demonstrations(part.sensors, part.commands.roll(turn, 0), part.episodes), OneShot())
        return bank

    def policy(self, turn: int = 0) -> Policy:
        return self.make(self.bank(turn))


def _of_the_policy(law: Callable[[Controller], None]) -> Callable[[_Case], None]:
    @wraps(law)
    def checked(case: _Case) -> None:
        law(case.policy())

    return checked


def _it_is_a_policy_of_its_bank(case: _Case) -> None:
    bank = case.bank()
    policy = case.make(bank)
    require(isinstance(policy, Policy), f"{type(policy).__name__} is no subclass of Policy")
    require(policy.space is bank.space, "its space is not that of its bank")
    require(set() < set(policy.names) <= set(bank.names), f"it combines {policy.names} of {bank.names}")


def _the_speaker_is_one_of_its_names(case: _Case) -> None:
    policy = case.policy()
    state = policy.start(range(5))
    for rows in walk(case.space, 8, 5):
        recall, state = policy.step(rows, state)
        speaker = recall.speaker
        require(speaker is not None and speaker.shape == (5,), "there is no speaker for each robot")
        assert speaker is not None
        require(speaker.dtype == torch.int64, f"speakers are {speaker.dtype}")
        silent = recall.commands.isnan().all(1)
        require((speaker[silent] == -1).all(), "somebody speaks where no commands are given")
        spoken = speaker[~silent]
        require(((spoken >= 0) & (spoken < len(policy.names))).all(), f"speakers {spoken.tolist()} of {policy.names}")


def _an_empty_bank_has_nothing_to_combine(case: _Case) -> None:
    refuses(ValueError, lambda: case.make(BehaviourBank(case.space)))


def _a_policy_is_a_snapshot(case: _Case) -> None:
    bank, rows = case.bank(), torch.cat([pairs(case.space, 12).sensors, readings(case.space, 20, 8)])
    policy = case.make(bank)
    before, names = recalled(policy, rows), list(policy.names)
    bank.learn("low", pairs(case.space, 5, seed=9), OneShot())
    bank.learn("new", pairs(case.space, 3, seed=10), OneShot())
    same_answer(recalled(policy, rows), before)
    require(policy.names == names, f"its names {names} became {policy.names}")


def _its_bank_stays_as_it_is(case: _Case) -> None:
    bank = case.bank()
    before, names = tensors(bank), bank.names
    policy = case.make(bank)
    state = policy.start(range(4))
    for rows in walk(case.space, 4, 4):
        _, state = policy.step(rows, state)
    unchanged(bank, before, "the bank")
    require(bank.names == names, f"the bank's names {names} became {bank.names}")


def _a_state_dict_carries_what_it_answers_by(case: _Case) -> None:
    policy, other = case.policy(), case.policy(turn=1)
    rows = torch.cat([pairs(case.space, 12).sensors, readings(case.space, 20, 8)])
    other.load_state_dict(policy.state_dict())
    same_answer(recalled(other, rows), recalled(policy, rows))


_LAWS: tuple[Callable[[_Case], None], ...] = (
    _the_speaker_is_one_of_its_names,
    _an_empty_bank_has_nothing_to_combine,
    _a_policy_is_a_snapshot,
    _its_bank_stays_as_it_is,
    _a_state_dict_carries_what_it_answers_by,
)
