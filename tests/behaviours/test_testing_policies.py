"""`check_policy` passes on a sound policy, and names the law that a broken one breaks."""

import copy
from collections.abc import Sequence
from typing import Any

import pytest
import torch
from robots import space

from behaviours import BehaviourBank, Demonstrations, OneShot, Policy, Priority
from behaviours.recall import Recall
from behaviours.testing import check_policy


class Steady(Priority):
    """The sound one: goes on with the first that ever spoke."""

    def start(self, episodes: Any) -> Any:
        return super().start(episodes), torch.full((len(episodes),), -1)

    def step(self, readings: Any, state: Any) -> tuple[Recall, Any]:
        past, speaker = state
        cells, past = self.space.step(readings, past)
        blind = (cells < 0).all(-1)
        recall = super().answer(cells)
        assert recall.speaker is not None
        speaker = torch.where((speaker < 0) & ~blind, recall.speaker, speaker)
        answers = [part.answer(cells) for part in self.parts]
        rows = torch.arange(len(cells))
        commands, similarity, margin, familiarity = (
            torch.stack([getattr(answer, name) for answer in answers])[speaker.clamp(min=0), rows]
            for name in ("commands", "similarity", "margin", "familiarity")
        )
        return Recall(commands, similarity, margin, familiarity, speaker).mask_unobserved(blind), (past, speaker)


class Hiding(Priority):
    """Keeps what it remembers to itself."""

    count = 0

    def step(self, readings: Any, state: Any) -> tuple[Recall, Any]:
        self.count += 1
        recall, state = super().step(readings, state)
        return recall._replace(similarity=recall.similarity / self.count), state


class Writing(Steady):
    """Writes into the state that it was given."""

    def step(self, readings: Any, state: Any) -> tuple[Recall, Any]:
        recall, (past, speaker) = super().step(readings, state)
        state[1].copy_(speaker)
        return recall, (past, state[1])


class Sociable(Steady):
    """All robots of a batch follow the first."""

    def step(self, readings: Any, state: Any) -> tuple[Recall, Any]:
        recall, (past, speaker) = super().step(readings, state)
        return recall, (past, speaker[:1].expand(len(speaker)).clone())


class Placed(Steady):
    """Treats robots by their place in the batch."""

    def step(self, readings: Any, state: Any) -> tuple[Recall, Any]:
        recall, state = super().step(readings, state)
        places = 1 + torch.arange(len(recall.similarity))
        return recall._replace(similarity=recall.similarity / places), state


class Growing(Steady):
    """Lets the state grow."""

    def step(self, readings: Any, state: Any) -> tuple[Recall, Any]:
        recall, (past, speaker) = super().step(readings, state[:2])
        return recall, (past, speaker, speaker)


class Talking(Priority):
    """Speaks where nothing was observed."""

    def step(self, readings: Any, state: Any) -> tuple[Recall, Any]:
        recall, state = super().step(readings, state)
        return recall._replace(commands=recall.commands.nan_to_num(0.0)), state


class Unnamed(Priority):
    """Counts speakers from 1."""

    def query(self, conditions: Sequence[torch.Tensor]) -> Recall:
        recall = super().query(conditions)
        assert recall.speaker is not None
        return recall._replace(speaker=recall.speaker + 1)


class Live(Priority):
    """Asks whatever its bank holds by now."""

    def __init__(self, bank: BehaviourBank) -> None:
        super().__init__(bank)
        self.bank = bank

    def query(self, conditions: Sequence[torch.Tensor]) -> Recall:
        return Priority(self.bank).query(conditions)


class Loose(Priority):
    """Holds programs that no state_dict carries."""

    def __init__(self, bank: BehaviourBank) -> None:
        super().__init__(bank)
        self.others = [copy.deepcopy(Priority(bank))]

    def query(self, conditions: Sequence[torch.Tensor]) -> Recall:
        return self.others[0].query(conditions)


class Dark(Priority):
    """Answers otherwise where gradients are off."""

    def query(self, conditions: Sequence[torch.Tensor]) -> Recall:
        recall = super().query(conditions)
        return recall if torch.is_grad_enabled() else recall._replace(similarity=recall.similarity * 0)


class Endless(Priority):
    """Gives commands beyond the range."""

    def query(self, conditions: Sequence[torch.Tensor]) -> Recall:
        recall = super().query(conditions)
        return recall._replace(commands=recall.commands * 10)


def nobody(bank: BehaviourBank) -> Any:
    return torch.nn.Identity()


def unasking(bank: BehaviourBank) -> Policy:
    """A policy of nothing."""
    if bank.names:
        return Priority(bank)
    made = BehaviourBank(bank.space)
    made.learn("x", Demonstrations([[1.0, 1, 1]], [[0.0, 0]]), OneShot())
    return Priority(made)


@pytest.mark.parametrize(
    ("make", "law"),
    [
        (Hiding, "the same state gives the same answer"),
        (Writing, "a step changes neither readings nor state"),
        (Sociable, "robots do not influence each other"),
        (Placed, "robots do not influence each other"),
        (Growing, "the state has one row per robot and keeps its form"),
        (Talking, "without observations there is no answer"),
        (Unnamed, "the speaker is one of its names"),
        (Live, "a policy is a snapshot"),
        (Loose, "a state dict determines the answers"),
        (Dark, "whether gradients are on does not matter"),
        (Endless, "answers have one row per robot within range"),
        (nobody, "it is a policy of its bank"),
        (unasking, "an empty bank raises value error"),
    ],
)
def test_a_broken_policy_is_told_its_law(make: Any, law: str) -> None:
    with pytest.raises(AssertionError, match=rf"{make.__name__} breaks the law: ({law})"):
        check_policy(make)


def test_a_sound_policy_with_a_memory_passes() -> None:
    check_policy(Steady)
    check_policy(Steady, space(1000, "HRR", protection={"name": "self_shift", "width": "sum"}))
