"""The interface of policies that combine behaviours."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import cast

from jaxtyping import Shaped
from torch import Tensor, nn

from behaviours.bank import BehaviourBank
from behaviours.behaviour import Behaviour
from behaviours.controller import Controller
from behaviours.options import number
from behaviours.recall import Recall
from torchvsa._blocks import by_blocks


class Policy(Controller):
    """Several behaviours of one bank as one: readings `[B, n]` in, a `Recall` with `speaker` out.

    `names` says which behaviours take part; `Recall.speaker` counts within it. A policy is a snapshot: it holds the
    behaviours that the bank had when the policy was made, and what the bank learns later does not change it. A new
    policy implements `query` and is registered in `behaviours.composition.POLICIES`; one with a memory also
    implements `start` and `step`.
    """

    def __init__(self, bank: BehaviourBank, names: list[str]) -> None:
        super().__init__()
        if not names:
            raise ValueError("a policy needs at least one behaviour to combine; the list of names is empty")
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise ValueError(f"a policy combines each behaviour once; {twice!r} is named {names.count(twice)} times")
        self.space = bank.space
        self.names = names
        self._parts = nn.ModuleList([bank[name] for name in names])

    @property
    def parts(self) -> list[Behaviour]:
        """The behaviours that take part, in the order of `names`."""
        return cast(list[Behaviour], list(self._parts))

    def _answer(self, cells: Shaped[Tensor, "batch w"]) -> Recall:
        # Some rows at a time: the conditions of all need not be held.
        return by_blocks(lambda rows: self.query(self.space.encode(rows)), cells, row_bytes=self.space.vsa.row_bytes)

    @abstractmethod
    def query(self, conditions: Shaped[Tensor, "batch d"]) -> Recall:
        """Answer conditions that are encoded and protected already."""

    def per_behaviour(self, given: Mapping[str, float] | None, otherwise: Sequence[float], what: str) -> list[float]:
        """One number per behaviour from a mapping of names, which may name only those that take part.

        Raises `ValueError` for what is no finite number.
        """
        if not isinstance(given := {} if given is None else given, Mapping):
            raise TypeError(f"{what} map names of behaviours to numbers, as in {{{self.names[0]!r}: 1}}; got {given!r}")
        if unknown := set(given) - set(self.names):
            raise ValueError(
                f"{what} names {', '.join(sorted(map(str, unknown)))}; the behaviours are {', '.join(self.names)}"
            )
        return [
            number(f"{what} of {name!r}", given.get(name, default))
            for name, default in zip(self.names, otherwise, strict=True)
        ]
