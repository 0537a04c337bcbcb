"""The interface of policies that combine behaviours."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import cast

import torch
from jaxtyping import Shaped
from torch import Tensor, nn

from behaviours.bank import BehaviourBank
from behaviours.behaviour import Behaviour
from behaviours.controller import Controller
from behaviours.recall import Recall
from torchvsa.blocks import by_blocks


class Policy(Controller):
    """Several behaviours of one bank as one: readings `[B, n]` in, a `Recall` with `speaker` out.

    `names` says which behaviours take part; `Recall.speaker` counts within it. A new policy implements
    `ask` and is listed in `behaviours.composition.POLICIES`.
    """

    def __init__(self, bank: BehaviourBank, names: list[str]) -> None:
        super().__init__()
        if not names:
            raise ValueError("a policy needs at least one behaviour to combine; the list of names is empty")
        self.space = bank.space
        self.names = names
        # The behaviours as they are now: what the bank learns later does not change the policy.
        self._parts = nn.ModuleList([bank[name] for name in names])

    @property
    def parts(self) -> list[Behaviour]:
        """The behaviours that take part, in the order of `names`."""
        return cast(list[Behaviour], list(self._parts))

    def _answer(self, cells: Shaped[Tensor, "batch w"]) -> Recall:
        # Some rows at a time: the conditions of all need not be held.
        return by_blocks(lambda rows: self.ask(self.space.encode(rows)), cells, row_bytes=self.space.vsa.row_bytes)

    @abstractmethod
    def ask(self, conditions: Shaped[Tensor, "batch d"]) -> Recall:
        """Answer conditions that are encoded and protected already."""

    def per_behaviour(self, given: Mapping[str, float] | None, otherwise: list[float], what: str) -> Tensor:
        """One float64 number per behaviour from a mapping of names, which may name only those that take part."""
        given = given or {}
        if unknown := set(given) - set(self.names):
            raise ValueError(f"{what} names {', '.join(sorted(unknown))}; the behaviours are {', '.join(self.names)}")
        numbers = [float(given.get(name, default)) for name, default in zip(self.names, otherwise, strict=True)]
        return torch.tensor(numbers, dtype=torch.float64)
