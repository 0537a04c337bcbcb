"""A behaviour tree whose leaves are hypervector behaviours, with the library `py_trees`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import torch
from jaxtyping import Shaped
from py_trees import behaviour
from py_trees.common import Status
from py_trees.composites import Selector
from py_trees.trees import BehaviourTree as Tree
from torch import Tensor

from behaviours import BehaviourBank, Policy, Recall
from behaviours.composition.base import THRESHOLDS


class _Leaf(behaviour.Behaviour):
    """Succeeds if its behaviour knows the condition, or always; remembers that it was reached."""

    def __init__(self, name: str, number: int, always: bool) -> None:
        super().__init__(name)
        self.number, self.always = number, always
        self.known: Sequence[bool] = ()

    def update(self) -> Status:
        return Status.SUCCESS if self.always or self.known[self.number] else Status.FAILURE


class BehaviourTree(Policy):
    """A selector over the behaviours: the first that knows the condition succeeds, and speaks.

    The last one speaks without being asked whether it knows. A condition is known as in `Priority`, by default if it is
    familiar.

    Source: Colledanchise and Ögren 2018, "Behavior trees in robotics and AI"; py_trees 2.6.
    """

    def __init__(self, bank: BehaviourBank, by: Literal["familiarity", "similarity"] = "familiarity") -> None:
        super().__init__(bank, bank.names)
        self._by, self._limits = by, [THRESHOLDS[by](part) for part in self.parts]
        last = len(self.names) - 1
        self._leaves = [_Leaf(name, number, number == last) for number, name in enumerate(self.names)]
        self._tree = Tree(Selector("who", memory=False, children=self._leaves))

    def query(self, conditions: Sequence[Shaped[Tensor, "batch d"]]) -> Recall:
        """See `Policy.query`."""
        answers = self.answers(conditions)
        found = torch.stack([getattr(recall, self._by) for recall in answers], 1)
        patterns, index = (found >= torch.tensor(self._limits)).unique(dim=0, return_inverse=True)
        speakers = torch.tensor([self._tick(pattern) for pattern in patterns.tolist()])
        return self.spoken(answers, speakers[index])

    def _tick(self, known: Sequence[bool]) -> int:
        """Which behaviour the tree lets speak, given who knows the condition."""
        for leaf in self._leaves:
            leaf.known = known
        self._tree.tick()
        return next(leaf.number for leaf in self._leaves if leaf.status is Status.SUCCESS)
