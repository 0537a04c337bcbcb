"""The base class of policies that combine behaviours."""

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import cast

import torch
from jaxtyping import Float64, Int64, Shaped
from torch import Tensor, nn

from behaviours.algebra import merged_results
from behaviours.bank import BehaviourBank
from behaviours.behaviour import Behaviour
from behaviours.controller import Controller
from behaviours.memory import ResultMemory, require_levels
from behaviours.options import as_float
from behaviours.recall import Recall
from behaviours.space import conditions_of
from torchvsa import VSA
from torchvsa._blocks import by_blocks


class Policy(Controller):
    """A controller that combines several behaviours of one bank: readings `[B, n]` in, a `Recall` with `speaker` out.

    `names` lists the behaviours; `Recall.speaker` is an index into it. A policy is a snapshot: it keeps the behaviours
    that the bank has when the policy is created, and later changes of the bank do not affect it. A new
    policy implements `query` and is registered in `behaviours.composition.POLICIES`; one with a memory also
    implements `start` and `step`.
    """

    def __init__(self, bank: BehaviourBank, names: list[str]) -> None:
        super().__init__()
        if not names:
            raise ValueError("a policy needs at least one behaviour; the list of names is empty")
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise ValueError(f"a policy combines each behaviour once; {twice!r} is named {names.count(twice)} times")
        self.space = bank.space
        self.names = names
        self._parts = nn.ModuleList([bank[name] for name in names])

    @classmethod
    def supports(cls, vsa: VSA) -> bool:
        """Whether it can be made of behaviours of this architecture, with its default options."""
        return True

    @property
    def parts(self) -> list[Behaviour]:
        """The combined behaviours, in the order of `names`."""
        return cast(list[Behaviour], list(self._parts))

    def _answer(self, cells: Shaped[Tensor, "batch w"]) -> Recall:
        # In blocks, so that not all conditions are in memory at once.
        return by_blocks(lambda rows: self.query(self.conditions(rows)), cells, row_bytes=self.space.vsa.row_bytes)

    def conditions(self, cells: Shaped[Tensor, "batch w"]) -> list[Shaped[Tensor, "batch d"]]:
        """The encoded and protected condition for each behaviour, made of the sensors that it uses.

        Those that use the same sensors share one tensor. A behaviour none of whose sensors was observed has a condition
        of zeros, which is similar to nothing.
        """
        return conditions_of([part.space for part in self.parts], cells)

    @abstractmethod
    def query(self, conditions: Sequence[Shaped[Tensor, "batch d"]]) -> Recall:
        """The answer to conditions, one tensor for each behaviour, see `conditions`."""

    def answers(self, conditions: Sequence[Shaped[Tensor, "batch d"]]) -> list[Recall]:
        """What each behaviour answers."""
        return [part.query(condition) for part, condition in zip(self.parts, conditions, strict=True)]

    def known(self, answers: Sequence[Recall]) -> Float64[Tensor, "batch b"]:
        """How well each behaviour knows its condition: familiarity times √k, for k pairs in its program.

        A condition that is one of k unrelated ones has a familiarity of about 1/√k.
        """
        columns = zip(self.parts, answers, strict=True)
        return torch.stack(
            [max(part.report.pairs, 1) ** 0.5 * recall.familiarity.double() for part, recall in columns], -1
        )

    def spoken(self, answers: Sequence[Recall], speaker: Int64[Tensor, "batch"]) -> Recall:
        """The answer of one behaviour for each row: that of `speaker`."""
        rows = torch.arange(speaker.shape[0], device=speaker.device)

        def of_speaker(field: str) -> Tensor:
            return torch.stack([getattr(recall, field) for recall in answers])[speaker, rows]

        return Recall(
            of_speaker("commands"), of_speaker("similarity"), of_speaker("margin"), of_speaker("familiarity"), speaker
        )

    def joint_memory(self) -> ResultMemory:
        """The results of all behaviours. Raises `ValueError` if one of them is smooth."""
        require_levels(type(self).__name__, self.parts)
        results = merged_results([term for part in self.parts for term in part.terms])
        return ResultMemory(self.space, results.to(self.space.device))

    def weights_of(self, given: Mapping[str, float] | None) -> list[float]:
        """One weight per behaviour, 1 for those that are not named. Raises `ValueError` if all are 0."""
        weights = self.per_behaviour(given, [1.0] * len(self.names), "weights")
        if not any(weights):
            raise ValueError(f"at least one weight must differ from 0; got 0 for each of {', '.join(self.names)}")
        return weights

    def per_behaviour(self, given: Mapping[str, float] | None, otherwise: Sequence[float], what: str) -> list[float]:
        """One number per behaviour.

        Args:
            given: Numbers by name, or None.
            otherwise: The default number of each behaviour.
            what: The name of the option, for errors.

        Raises:
            ValueError: For unknown names, and for values that are not finite numbers.
            TypeError: If `given` is not a mapping.
        """
        if not isinstance(given := {} if given is None else given, Mapping):
            raise TypeError(f"{what} map names of behaviours to numbers, as in {{{self.names[0]!r}: 1}}; got {given!r}")
        if unknown := set(given) - set(self.names):
            raise ValueError(
                f"{what} names {', '.join(sorted(map(str, unknown)))}; the behaviours are {', '.join(self.names)}"
            )
        return [
            as_float(f"{what} of {name!r}", given.get(name, default))
            for name, default in zip(self.names, otherwise, strict=True)
        ]


def threshold_of(part: Behaviour) -> float:
    """The familiarity from which a behaviour knows a condition: its `threshold`, or half of 1/√k for k pairs."""
    # Rounding must not make the least familiar condition unknown.
    return 0.5 / max(part.report.pairs, 1) ** 0.5 if part.threshold is None else part.threshold - _ROUNDING


_ROUNDING = 1e-6


def half_similarity(part: Behaviour) -> float:
    """Half of the similarity that nearly all of the behaviour's own conditions reach; 0 if that is unknown."""
    return 0.5 * (part.least_similarity or 0.0)


THRESHOLDS: dict[str, Callable[[Behaviour], float]] = {"familiarity": threshold_of, "similarity": half_similarity}
"""From which value of a field of its `Recall` on a behaviour knows a condition."""
