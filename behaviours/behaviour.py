"""One learned behaviour: a program of d numbers, and what it takes to ask it."""

from collections.abc import Sequence
from dataclasses import replace
from numbers import Real
from typing import Any

import torch
from jaxtyping import Float, Int64, Shaped
from torch import Tensor, nn

from behaviours.algebra import Term, added, checked_weight, report_of, results_of, weighted_sum
from behaviours.controller import Controller
from behaviours.frozen import FrozenBehaviour
from behaviours.memory import ResultMemory, check_levels
from behaviours.recall import Recall, recalled
from behaviours.report import LearningReport
from behaviours.schema import Actuator, Sensor
from behaviours.space import Space
from behaviours.storage import checksum
from torchvsa import VSA, Readout, ShapeError
from torchvsa._blocks import by_blocks
from torchvsa._numerics import as_bipolar, is_integer


class Behaviour(Controller):
    """A behaviour as one hypervector, `program` `[d]`; called with readings `[B, n]` it answers with commands.

    `known` `[d]` is the sum of the conditions that it knows; both are raw accumulators, see `clipped`. `memory`
    holds the results that it can answer with.

    Behaviours over one space add up to behaviours:

        both = seek + 2 * avoid
        both - avoid            # the program of seek + avoid, bit for bit if programs are integers
        -flee                   # answers what flee answers least

    Program and known conditions are the weighted sums of theirs. A sum answers with the results of all its `terms`, and
    what is taken away as often as it was added is gone, with the results that only it had. The scores of a sum are the
    weighted sums of the scores (`scores`), so that adding is voting.

    Source: Neubert et al. 2016, Algorithm 2; sums of programs, section V.
    """

    program: Tensor
    known: Tensor

    def __init__(
        self,
        space: Space,
        program: Shaped[Tensor, "d"],
        known: Shaped[Tensor, "d"],
        results: Int64[Tensor, "k m"],
        report: LearningReport,
        terms: Sequence[Term] = (),
    ) -> None:
        super().__init__()
        for name, vector in (("program", program), ("known", known)):
            _check_vector(space.vsa, name, vector)
        self.space = space
        self.report = report
        self.name = ""
        """The name under which a bank keeps it."""
        self._terms = tuple(terms)
        if isinstance(program, nn.Parameter):
            self.register_parameter("program", program)
        else:
            self.register_buffer("program", program)
        self.register_buffer("known", known)
        self.memory = ResultMemory(space, results)

    def check(self) -> None:
        """Raise `ValueError` naming what could not be kept: see `BehaviourBank.save`."""
        for name in ("program", "known"):
            _check_vector(self.space.vsa, name, getattr(self, name))
        check_levels(self.space.schema, self.results)

    def over(self, space: Space) -> "Behaviour":
        """The same behaviour over a space with equal codebooks, on its device."""
        device = space.device
        program = self.program.detach().to(device)
        if isinstance(self.program, nn.Parameter):
            program = nn.Parameter(program)
        return Behaviour(space, program, self.known.to(device), self.results.to(device), self.report, self._terms)

    # -- sums ---------------------------------------------------------------------------------------------

    @property
    def terms(self) -> tuple[Term, ...]:
        """The learned behaviours of which it is a weighted sum; itself, if it is none."""
        if self._terms:
            return self._terms
        tensors = {"program": self.program.detach(), "known": self.known, "results": self.results}
        fingerprint = checksum({}, {name: tensor.cpu().contiguous() for name, tensor in tensors.items()})
        return (Term(self.name, 1, self.report, self.results.cpu(), fingerprint),)

    @classmethod
    def sum(cls, behaviours: Sequence["Behaviour"], weights: Sequence[float] | None = None) -> "Behaviour":
        """The weighted sum of behaviours over equal spaces, exact where programs and weights are whole.

        Raises `ValueError` for behaviours over different codebooks, for weights that are no finite numbers, and if
        nothing is left: everything cancels, or all weights are 0.
        """
        weights = [checked_weight(weight) for weight in ([1] * len(behaviours) if weights is None else weights)]
        held = [(part, weight) for part, weight in zip(behaviours, weights, strict=True) if weight]
        if not held:
            raise ValueError("a sum of behaviours needs at least one with a weight that is not 0")
        space = held[0][0].space
        if not all(space.same_as(part.space) for part, _ in held):
            raise ValueError("behaviours over different spaces (other sensors, codes or seeds) do not add up")
        terms = added([replace(t, weight=weight * t.weight) for part, weight in held for t in part.terms])
        if not terms:
            raise ValueError("nothing is left of this sum: its behaviours cancel each other")
        parts, weights = [part.over(space) for part, _ in held], [weight for _, weight in held]
        program = weighted_sum(space.vsa, weights, [part.program.detach() for part in parts])
        known = weighted_sum(space.vsa, weights, [part.known for part in parts])
        return cls(space, program, known, results_of(terms).to(space.device), report_of(terms), terms)

    def __add__(self, other: object) -> "Behaviour":
        return Behaviour.sum([self, other]) if isinstance(other, Behaviour) else NotImplemented

    def __radd__(self, other: object) -> "Behaviour":
        # `sum` of Python begins with 0.
        return self if isinstance(other, int) and other == 0 else NotImplemented

    def __sub__(self, other: object) -> "Behaviour":
        return Behaviour.sum([self, other], [1, -1]) if isinstance(other, Behaviour) else NotImplemented

    def __neg__(self) -> "Behaviour":
        return Behaviour.sum([self], [-1])

    def __mul__(self, weight: Any) -> "Behaviour":
        return Behaviour.sum([self], [checked_weight(weight)]) if isinstance(weight, Real) else NotImplemented

    __rmul__ = __mul__

    def __truediv__(self, weight: Any) -> "Behaviour":
        return self * (1 / weight) if isinstance(weight, Real) else NotImplemented

    # -- answers ------------------------------------------------------------------------------------------

    @property
    def results(self) -> Int64[Tensor, "k m"]:
        """The stored results as levels of the actuators, in order of first insertion."""
        return self.memory.levels

    def readout(self) -> Readout:
        """The program, ready to be asked for each of `results`: see `VSA.readout`."""
        return self.space.vsa.readout(self.program, self.memory.current_items())

    def _answer(self, cells: Shaped[Tensor, "batch w"]) -> Recall:
        readout = self.readout()
        # Some rows at a time go all the way, so that their conditions, in float64, never leave the cache.
        return by_blocks(
            lambda rows: recalled(readout, self.known, self.memory.commands, self.space.encode(rows)),
            cells,
            row_bytes=8 * self.space.vsa.dim,
        )

    def query(self, conditions: Shaped[Tensor, "batch d"]) -> Recall:
        """Answer conditions that are encoded and protected already (Algorithm 2, lines 2 to 8)."""
        return recalled(self.readout(), self.known, self.memory.commands, conditions)

    def freeze(self) -> FrozenBehaviour:
        """The read-only form, fastest to ask: see `FrozenBehaviour`."""
        readout = self.space.vsa.readout(self.program.detach(), self.memory.current_items())
        return FrozenBehaviour(self.space, readout, self.known, self.memory.commands)

    def scores(self, readings: Any) -> Float[Tensor, "batch k"]:
        """What recall compares: how strongly each of `results` is answered, `<unbind(program, c), item> / |item|`.

        In float64, and differentiable by the program, see `trainable`.
        """
        return self.readout()(self.space.encode(self.space.cells(readings)))

    def labels(self, commands: Any) -> Int64[Tensor, "batch"]:
        """Where each row of commands `[B, m]` stands in `results`; raises `ValueError` if it is not stored."""
        levels = self.space.schema.command_levels(commands).to(self.results.device)
        same = (levels[:, None] == self.results).all(-1)
        if not same.any(-1).all():
            row = int((~same.any(-1)).nonzero()[0])
            raise ValueError(
                f"row {row} asks for levels {levels[row].tolist()}, which are none of the {len(self.results)} stored "
                "results; learn a demonstration that holds them first"
            )
        return same.to(torch.int8).argmax(-1)

    def trainable(self) -> "Behaviour":
        """A copy over the same space whose program is a float `nn.Parameter`, for an ordinary training loop.

            behaviour = bank["seek_light"].trainable()
            labels = behaviour.labels(shown.commands)
            optimiser = torch.optim.Adam(behaviour.parameters(), lr=0.1)
            for _ in range(100):
                optimiser.zero_grad()
                loss = torch.nn.functional.cross_entropy(behaviour.scores(shown.sensors), labels)
                loss.backward()
                optimiser.step()
            bank.add("seek_light", behaviour)

        It is a behaviour like any other: asked, copied, saved in a bank, exported. (A bank file holds its program as a
        tensor; what is loaded from one can be made trainable again.)
        """
        program = as_bipolar(self.program).detach()
        wide = torch.float32 if is_integer(program) else program.dtype
        parameter = nn.Parameter(program.to(wide, copy=True))
        return Behaviour(self.space, parameter, self.known.clone(), self.results.clone(), self.report)

    def clipped(self) -> "Behaviour":
        """A copy whose program and known conditions are hypervectors of the architecture, not raw sums.

        Clipping loses the counts: a program of many pairs recalls far fewer of them afterwards. Integer codes take the
        nearest of -1, 0 and +1, so that a program of fractions far below 1 (`LeastSquares`) is lost in them.
        """
        vsa = self.space.vsa
        program = vsa.normalize(self.program.detach())
        return Behaviour(self.space, program, vsa.normalize(self.known), self.results, self.report)

    def __repr__(self) -> str:
        schema, report = self.space.schema, self.report
        name = f"{self.name!r}, " if self.name else ""
        made = f"sum of {', '.join(report.terms)}" if report.terms else f"{report.rule}, {report.pairs} pairs"
        return (
            f"Behaviour({name}d={self.space.vsa.dim}, {listed('sensors', schema.sensors)}, "
            f"{listed('actuators', schema.actuators)}, {made}, {len(self.results)} results)"
        )


def listed(what: str, parts: Sequence[Sensor] | Sequence[Actuator], most: int = 6) -> str:
    """How many there are, and the names of the first of them."""
    names = ", ".join(part.name for part in parts[:most]) + (", ..." if len(parts) > most else "")
    return f"{len(parts)} {what} ({names})"


_REAL = (torch.int8, torch.int32, torch.int64, torch.float32, torch.float64)


def _check_vector(vsa: VSA, name: str, vector: Tensor) -> None:
    """Raise unless `vector` can be a program, or a sum of conditions, of this architecture."""
    if vector.shape != (vsa.dim,):
        raise ShapeError(f"{name} must be one hypervector [{vsa.dim}]; got shape {tuple(vector.shape)}")
    kinds = (torch.complex64, torch.complex128) if vsa.dtype.is_complex else (*_REAL, vsa.dtype)
    if vector.dtype not in kinds:
        raise ValueError(f"{name} of {vsa} cannot be {vector.dtype}; it is one of {', '.join(map(str, kinds))}")
    if not vector.isfinite().all():
        raise ValueError(f"{name} holds values that are not finite")
