"""Combine behaviours in one vector that also holds a program which recalls whom to ask."""

from collections.abc import Sequence

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor

from behaviours.algebra import weighted_sum
from behaviours.bank import BehaviourBank
from behaviours.behaviour import Behaviour
from behaviours.composition.choosing import common_space, naming_space, same_conditions, with_length
from behaviours.composition.gated import Gated
from behaviours.memory import require_levels
from behaviours.recall import Recall
from behaviours.space import Space
from torchvsa import VSA
from torchvsa._numerics import is_integer, norms


class Hierarchy(Gated):
    """A program answers the name of the behaviour to ask, in the same vector: V = Σ bind(pᵢ, contextᵢ) + bind(T, tag).

    T recalls a name, a random hypervector, from a condition. The behaviour of that name is then asked with its context.
    T is scaled to the length of the longest pᵢ, and rounded to integers if all pᵢ are integers.

    Without a `chooser`, T is one-shot, Σ wᵢ bind(nameᵢ, knownᵢ) with wᵢ = √kᵢ / |knownᵢ|: the score of a name is the
    familiarity of its behaviour times √k, by which `WinnerTakesAll` decides, plus noise.

        chooser = choosing(bank, {"seek": seeking, "avoid": avoiding}, ErrorDriven(margin=5))
        policy = Hierarchy(bank, chooser)

    Args:
        bank: The behaviours to combine.
        chooser: A behaviour that recalls names, see `choosing`; T is its program.
        seed: Seed of contexts, tag and, without a chooser, names.

    Raises:
        ValueError: For behaviours that use different sensors, for a chooser that is none of this bank, and, without a
            chooser, for an architecture whose `bind` is not linear in both arguments.

    Source: arbitration as a behaviour of its own, after Brooks 1986; programs with a context, Levy et al. 2013.
    """

    named: Tensor
    name_items: Tensor

    def __init__(self, bank: BehaviourBank, chooser: Behaviour | None = None, seed: int = 0) -> None:
        super().__init__(bank, seed)
        vsa, device, parts = self.space.vsa, self.space.device, self.parts
        space = common_space(parts)
        if chooser is None:
            if not self.supports(vsa):
                raise ValueError(
                    f"the bind of {vsa} is not linear in both arguments, so that sums of known conditions cannot be "
                    "bound to names; give a chooser (see choosing)"
                )
            named = torch.arange(len(self.names), device=device)
            items = naming_space(space, len(self.names), seed).items(named[:, None])
            choice = _one_shot(vsa, parts, items)
        else:
            _check_chooser(chooser, space, self.names)
            choice = chooser.program.detach().to(device)
            named, items = chooser.results[:, 0].to(device), chooser.memory.current_items().to(device)
        self.register_buffer("named", named)
        self.register_buffer("name_items", items)
        self.draw_tag(seed)
        self.add_tagged(with_length(choice, self.longest(), exact=is_integer(self.program)))

    @classmethod
    def supports(cls, vsa: VSA) -> bool:
        """Whether the names can be learned from known conditions: `bind` is linear in both arguments."""
        return vsa.bilinear

    def chosen(
        self, conditions: Sequence[Shaped[Tensor, "batch d"]], answers: Sequence[Recall]
    ) -> Int64[Tensor, "batch"]:
        """The behaviour whose name is recalled. All behaviours have the same condition."""
        program = self.space.vsa.unbind(self.program, self.tag)
        return self.named[self.space.vsa.readout(program, self.name_items).match(conditions[0]).index]


def _one_shot(vsa: VSA, parts: Sequence[Behaviour], names: Shaped[Tensor, "b d"]) -> Shaped[Tensor, "d"]:
    lengths = [max(float(norms(part.known)), 1.0) for part in parts]
    weights = [max(part.report.pairs, 1) ** 0.5 / length for part, length in zip(parts, lengths, strict=True)]
    # The largest weight is 1, since only the ratios count, and small sums are refused.
    weights = [weight / max(weights) for weight in weights]
    return weighted_sum(vsa, weights, [vsa.bind(name, part.known) for part, name in zip(parts, names, strict=True)])


def _check_chooser(chooser: Behaviour, space: Space, names: Sequence[str]) -> None:
    if not isinstance(chooser, Behaviour):
        raise TypeError(f"chooser is a behaviour that choosing(bank, shown) has learned; got {chooser!r:.80}")
    require_levels("chooser", [chooser])
    actuators = chooser.space.schema.actuators
    if len(actuators) != 1 or actuators[0].name != "behaviour" or actuators[0].levels != max(len(names), 2):
        raise ValueError(
            f"the chooser commands {', '.join(actuator.name for actuator in actuators)}, and not one of the "
            f"{len(names)} behaviours of this bank; make it with choosing(bank, shown)"
        )
    if not same_conditions(chooser.space, space):
        raise ValueError(
            "the chooser was learned over other conditions (sensors, codes or seed) than the behaviours of this bank; "
            "make it with choosing(bank, shown)"
        )
