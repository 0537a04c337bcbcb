"""One learned behaviour: a program of d numbers, and what it takes to ask it."""

from typing import Any

import torch
from jaxtyping import Float, Int64, Shaped
from torch import Tensor, nn

from behaviours.controller import Controller
from behaviours.folding import Folded
from behaviours.memory import ResultMemory, check_levels
from behaviours.recall import Recall, scores
from behaviours.report import LearningReport
from behaviours.space import Space
from torchvsa import VSA, ShapeError
from torchvsa.blocks import by_blocks
from torchvsa.exact import is_integer, norms, signed


class Behaviour(Controller):
    """A behaviour as one hypervector, `program` `[d]`; called with readings `[B, n]` it answers with commands.

    `known` `[d]` is the sum of the conditions that it knows; both are raw accumulators, see `clipped`. `memory`
    holds the results that it can answer with.

    Source: Neubert et al. 2016, Algorithm 2.
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
    ) -> None:
        super().__init__()
        for name, vector in (("program", program), ("known", known)):
            _check_vector(space.vsa, name, vector)
        self.space = space
        self.report = report
        if isinstance(program, nn.Parameter):
            self.register_parameter("program", program)
        else:
            self.register_buffer("program", program)
        self.register_buffer("known", known)
        self.memory = ResultMemory(space, results)
        self._folding: tuple[Tensor, Folded] | None = None

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
        return Behaviour(space, program, self.known.to(device), self.results.to(device), self.report)

    @property
    def results(self) -> Int64[Tensor, "k m"]:
        """The stored results as levels of the actuators, in order of first insertion."""
        return self.memory.levels

    def _answer(self, cells: Shaped[Tensor, "batch w"]) -> Recall:
        folded = self._folded()
        # Some rows at a time go all the way to a few products, so that their conditions never leave the cache.
        products = by_blocks(
            lambda rows: folded.products(self.space.encode(rows)), cells, row_bytes=self.space.vsa.row_bytes
        )
        return folded.recall(products, self.memory.commands)

    def ask(self, conditions: Shaped[Tensor, "batch d"]) -> Recall:
        """Answer conditions that are encoded and protected already (Algorithm 2, lines 2 to 8)."""
        folded = self._folded()
        return folded.recall(folded.products(conditions), self.memory.commands)

    def _folded(self) -> Folded:
        """The folded program, kept for as long as what it was made of has the same values."""
        program, known, items = self.program, self.known, self.memory.current_items()
        parts = program, known, items
        if (
            torch.compiler.is_compiling()
            or program.device.type != "cpu"  # comparing values would wait for it
            or any(part.requires_grad for part in parts)
        ):
            return Folded(self.space.vsa, *parts)
        if self._folding is not None:
            kept_items, folded = self._folding
            if _same(folded.program, program) and _same(folded.known, known) and _same(kept_items, items):
                return folded
        # Copies, so that any write into the behaviour's own tensors is found by comparing values.
        copies = [part.clone() for part in parts]
        self._folding = copies[2], Folded(self.space.vsa, *copies)
        return self._folding[1]

    def scores(self, readings: Any) -> Float[Tensor, "batch k"]:
        """What recall compares: how strongly each of `results` is answered, `<unbind(program, c), item> / |item|`.

        In float64, and differentiable by the program, see `trainable`.
        """
        items = self.memory.items
        return scores(self.space.vsa, self.program, self.space.encode(self.space.cells(readings)), items, norms(items))

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
        program = signed(self.program).detach()
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


def _same(kept: Tensor, now: Tensor) -> bool:
    return kept.dtype == now.dtype and kept.device == now.device and torch.equal(kept, now)
