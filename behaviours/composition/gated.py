"""Combine behaviours in one vector, each behind a context of its own."""

from collections.abc import Sequence

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor

from behaviours.algebra import weighted_sum
from behaviours.bank import BehaviourBank
from behaviours.composition.base import Policy
from behaviours.composition.choosing import seed_of
from behaviours.recall import Recall, familiarity
from torchvsa._numerics import norms


class Gated(Policy):
    """All programs in one vector, Σ bind(pᵢ, contextᵢ), which is asked with the context of one behaviour.

    Behaviours that contradict each other do not disturb each other more than unrelated ones do, but the vector needs
    the dimensions for all pairs together (`torchvsa.capacity.recall_probability`). Who is asked is decided as in
    `WinnerTakesAll`. All behaviours can recall the results of all.

    Args:
        bank: The behaviours to combine.
        seed: Seed of the contexts.

    Source: contexts as roles, Plate 1995; programs with a context, Levy et al. 2013.
    """

    program: Tensor
    contexts: Tensor
    tag: Tensor

    def __init__(self, bank: BehaviourBank, seed: int = 0) -> None:
        super().__init__(bank, bank.names)
        vsa, device = self.space.vsa, self.space.device
        generator = torch.Generator().manual_seed(seed_of(seed, 0))
        self.register_buffer("contexts", vsa.random(len(self.names), generator=generator, device=device))
        self.register_buffer("program", self._joined())
        self.memory = self.joint_memory()

    def _joined(self) -> Shaped[Tensor, "d"]:
        vsa = self.space.vsa
        bound = [
            vsa.bind(part.program.detach(), context) for part, context in zip(self.parts, self.contexts, strict=True)
        ]
        return weighted_sum(vsa, [1] * len(bound), bound)

    def longest(self) -> Tensor:
        """The length of the longest program, to which a program that decides whom to ask is scaled."""
        return torch.stack([norms(part.program.detach()) for part in self.parts]).max()

    def draw_tag(self, seed: int) -> None:
        """Draw the `tag` behind which a program that decides whom to ask is kept."""
        generator = torch.Generator().manual_seed(seed_of(seed, 1))
        self.register_buffer("tag", self.space.vsa.random(generator=generator, device=self.space.device))

    def add_tagged(self, program: Shaped[Tensor, "d"]) -> None:
        """Add a program behind the tag to the vector."""
        vsa = self.space.vsa
        self.program = weighted_sum(vsa, [1, 1], [self.program, vsa.bind(program, self.tag)])

    def query(self, conditions: Sequence[Shaped[Tensor, "batch d"]]) -> Recall:
        """See `Policy.query`."""
        answers = [self._answer_of(number, condition) for number, condition in enumerate(conditions)]
        return self.spoken(answers, self.chosen(conditions, answers))

    def chosen(
        self, conditions: Sequence[Shaped[Tensor, "batch d"]], answers: Sequence[Recall]
    ) -> Int64[Tensor, "batch"]:
        """The behaviour whose context is used."""
        return self.known(answers).argmax(-1)

    def _answer_of(self, number: int, condition: Shaped[Tensor, "batch d"]) -> Recall:
        vsa = self.space.vsa
        program = vsa.unbind(self.program, self.contexts[number])
        match = vsa.readout(program, self.memory.current_items()).match(condition)
        familiar = familiarity(condition, self.parts[number].known)
        return Recall(self.memory.commands[match.index], match.similarity, match.margin, familiar)
