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
from behaviours.testing._material import default_space, first_step, pairs, readings, tensors, unchanged, walk
from torchvsa.testing._laws import check, refuses, require


def check_policy(make: Callable[[BehaviourBank], Policy], space: Space | None = None) -> None:
    """Check the laws of policies.

    Among the laws: a policy is a snapshot of the bank; equal states and readings give equal answers; a step modifies
    neither of them; the answer to a robot does not depend on the other robots of the batch; where nothing was observed
    there is no speaker.

    Args:
        make: A policy class, or a function that makes a policy from a bank: `lambda bank: MyPolicy(bank, option=3)`. It
            is called several times, with banks of behaviours named `"low"` and `"high"`.
        space: The space of these behaviours; by default an integer one of 3 sensors.

    Raises:
        AssertionError: Naming the broken law.
    """
    case = _Case(make, default_space() if space is None else space)
    check(case, (_it_is_a_policy_of_its_bank, *map(_of_the_policy, CONTROLLER_LAWS), *_LAWS))


@dataclass(frozen=True)
class _Case:
    make: Callable[[BehaviourBank], Policy]
    space: Space

    def __repr__(self) -> str:
        return getattr(self.make, "__qualname__", repr(self.make))

    def bank(self, turn: int = 0) -> BehaviourBank:
        """Two behaviours of up to 6 unrelated conditions each; their results are rotated by `turn`."""
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
    require(isinstance(policy, Policy), f"{type(policy).__name__} is not a subclass of Policy")
    require(policy.space is bank.space, "its space is not that of its bank")
    require(set() < set(policy.names) <= set(bank.names), f"it combines {policy.names} of {bank.names}")


def _the_speaker_is_one_of_its_names(case: _Case) -> None:
    policy = case.policy()
    state = policy.start(range(5))
    for rows in walk(case.space, 8, 5):
        recall, state = policy.step(rows, state)
        speaker = recall.speaker
        require(speaker is not None and speaker.shape == (5,), "there is not one speaker per robot")
        assert speaker is not None
        require(speaker.dtype == torch.int64, f"speakers are {speaker.dtype}")
        unanswered = recall.commands.isnan().all(1)
        require((speaker[unanswered] == -1).all(), "there is a speaker where there are no commands")
        answered = speaker[~unanswered]
        require(
            ((answered >= 0) & (answered < len(policy.names))).all(), f"speakers {answered.tolist()} of {policy.names}"
        )


def _an_empty_bank_raises_value_error(case: _Case) -> None:
    refuses(ValueError, lambda: case.make(BehaviourBank(case.space)))


def _a_policy_is_a_snapshot(case: _Case) -> None:
    bank, rows = case.bank(), torch.cat([pairs(case.space, 12).sensors, readings(case.space, 20, 8)])
    policy = case.make(bank)
    before, names = first_step(policy, rows), list(policy.names)
    bank.learn("low", pairs(case.space, 5, seed=9), OneShot())
    bank.learn("new", pairs(case.space, 3, seed=10), OneShot())
    same_answer(first_step(policy, rows), before)
    require(policy.names == names, f"its names {names} became {policy.names}")


def _the_bank_is_not_changed(case: _Case) -> None:
    bank = case.bank()
    before, names = tensors(bank), bank.names
    policy = case.make(bank)
    state = policy.start(range(4))
    for rows in walk(case.space, 4, 4):
        _, state = policy.step(rows, state)
    unchanged(bank, before, "the bank")
    require(bank.names == names, f"the bank's names {names} became {bank.names}")


def _a_state_dict_determines_the_answers(case: _Case) -> None:
    policy, other = case.policy(), case.policy(turn=1)
    rows = torch.cat([pairs(case.space, 12).sensors, readings(case.space, 20, 8)])
    other.load_state_dict(policy.state_dict())
    same_answer(first_step(other, rows), first_step(policy, rows))


_LAWS: tuple[Callable[[_Case], None], ...] = (
    _the_speaker_is_one_of_its_names,
    _an_empty_bank_raises_value_error,
    _a_policy_is_a_snapshot,
    _the_bank_is_not_changed,
    _a_state_dict_determines_the_answers,
)
