"""A learned behaviour: a program, and the results that it can recall."""

from collections.abc import Sequence
from dataclasses import replace
from numbers import Real
from typing import Any

import torch
from jaxtyping import Float, Int64, Shaped
from torch import Tensor, nn

from behaviours.algebra import (
    Term,
    checked_weight,
    merge_terms,
    merged_report,
    merged_results,
    mirrored_term,
    weighted_sum,
)
from behaviours.controller import Controller
from behaviours.demonstrations import Demonstrations
from behaviours.frozen import FrozenBehaviour
from behaviours.memory import ResultMemory, SmoothMemory, check_levels, check_vector, require_levels
from behaviours.ordered import distinct_rows
from behaviours.recall import Recall, answer_cells, answer_conditions
from behaviours.report import LearningReport, name_list
from behaviours.space import Space, check_addable
from behaviours.storage import checksum
from torchvsa import Readout
from torchvsa._numerics import as_bipolar, is_integer
from torchvsa.encoders.mirrored import mirrored


class Behaviour(Controller):
    """A behaviour as one hypervector, `program` `[d]`, which maps readings `[B, n]` to commands.

    `known` `[d]` is the sum of the known conditions. Both are raw accumulators, see `clipped`. `memory` holds the
    results that can be recalled.

    A weighted sum of behaviours over one space is a behaviour:

        both = seek + 2 * avoid
        both - avoid            # the program of seek + avoid; the same bits if programs are integers
        -flee                   # recalls the result that scores lowest for flee

    Programs and known conditions are added, and so are the scores of each result (`scores`): adding is voting. A sum
    recalls the results of all its `terms`. A term whose weights add up to 0 is removed, with the results that only it
    had.

    A `smooth` behaviour commands any value between the ends of an actuator's range instead of a stored result: the
    inner product of the unbound result with the actuator's role, which is -1 at the lower and 1 at the upper end
    (values beyond are clipped). It is learned by `LeastSquares(smooth=True)`. In a sum the inner products are added, as
    forces are: a command in the middle of the range has none.

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
        smooth: bool = False,
    ) -> None:
        super().__init__()
        for name, vector in (("program", program), ("known", known)):
            check_vector(space.vsa, name, vector)
        self.space = space
        self.report = report
        self.name = ""
        """The name of the behaviour in its bank."""
        self.threshold: float | None = None
        """The familiarity that nearly all of the demonstrated conditions reach, see `calibrate`; None if unknown."""
        self.least_similarity: float | None = None
        """The similarity that nearly all of the demonstrated conditions reach, see `calibrate`; None if unknown."""
        self._terms = tuple(terms)
        if isinstance(program, nn.Parameter):
            self.register_parameter("program", program)
        else:
            self.register_buffer("program", program)
        self.register_buffer("known", known)
        self.memory = SmoothMemory(space, results) if smooth else ResultMemory(space, results)

    def check(self) -> None:
        """Raise `ValueError` unless the behaviour can be saved, see `BehaviourBank.save`."""
        for name in ("program", "known"):
            check_vector(self.space.vsa, name, getattr(self, name))
        check_levels(self.space.schema, self.results)

    @property
    def smooth(self) -> bool:
        """Whether commands may be between the levels."""
        return self.memory.smooth

    def over(self, space: Space) -> "Behaviour":
        """The same behaviour over another space with equal codebooks, on the device of that space."""
        device, sensors = space.device, self.space.sensors
        space = space if sensors == space.sensors else space.using(sensors)
        program = self.program.detach().to(device)
        if isinstance(self.program, nn.Parameter):
            program = nn.Parameter(program)
        known, results = self.known.to(device), self.results.to(device)
        moved = Behaviour(space, program, known, results, self.report, self._terms, self.smooth)
        moved.threshold, moved.least_similarity = self.threshold, self.least_similarity
        return moved

    @property
    def terms(self) -> tuple[Term, ...]:
        """The learned behaviours of a weighted sum; of a learned behaviour, the behaviour itself."""
        if self._terms:
            return self._terms
        tensors = {"program": self.program.detach(), "known": self.known, "results": self.results}
        fingerprint = checksum({}, {name: tensor.cpu().contiguous() for name, tensor in tensors.items()})
        return (Term(self.name, 1, self.report, self.results.cpu(), fingerprint),)

    @classmethod
    def sum(cls, behaviours: Sequence["Behaviour"], weights: Sequence[float] | None = None) -> "Behaviour":
        """The weighted sum of behaviours over equal spaces; exact if programs and weights are integers.

        Args:
            behaviours: The behaviours to add.
            weights: One finite number per behaviour; by default all are 1.

        Raises:
            ValueError: For behaviours over different codebooks, for smooth ones with others, for weights that are not
                finite, and if no term is left because all weights are 0 or all terms cancel.
        """
        weights = [checked_weight(weight) for weight in ([1] * len(behaviours) if weights is None else weights)]
        weighted = [(part, weight) for part, weight in zip(behaviours, weights, strict=True) if weight]
        if not weighted:
            raise ValueError("a sum of behaviours needs at least one with a weight that is not 0")
        space = weighted[0][0].space
        check_addable([part.space for part, _ in weighted])
        if not (smooth := all(part.smooth for part, _ in weighted)):
            require_levels("a sum with behaviours that are not smooth", [part for part, _ in weighted])
        terms = merge_terms([replace(t, weight=weight * t.weight) for part, weight in weighted for t in part.terms])
        if not terms:
            raise ValueError("the behaviours of this sum cancel each other, so that no term is left")
        weights, device = [weight for _, weight in weighted], space.device
        program = weighted_sum(space.vsa, weights, [part.program.detach().to(device) for part, _ in weighted])
        known = weighted_sum(space.vsa, weights, [part.known.to(device) for part, _ in weighted])
        return cls(space, program, known, merged_results(terms).to(device), merged_report(terms), terms, smooth)

    def __add__(self, other: object) -> "Behaviour":
        return Behaviour.sum([self, other]) if isinstance(other, Behaviour) else NotImplemented

    def __radd__(self, other: object) -> "Behaviour":
        # Python's `sum` starts with 0.
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

    def mirror(self) -> "Behaviour":
        """The mirror image: it answers mirrored readings with mirrored commands.

        With the space's sensors and actuators exchanged as `Space(mirror=...)` names them, for behaviour `b`:

            b.mirror()(exchanged readings).commands == exchanged b(readings).commands

        Program and known conditions are rotated by d / 2, and the levels of paired actuators exchanged. What was
        learned on one side is known on both by `b + b.mirror()`. The program of the mirror image is detached.

        Raises `ValueError` for a space without a mirror.
        """
        mirror = self.space.mirror
        if mirror is None:
            raise ValueError(
                "this behaviour has no mirror image, since its space does not say which sensors and actuators swap; "
                "make it with Space(..., mirror={'light_left': 'light_right', 'left_motor': 'right_motor'}) and learn "
                "again"
            )
        terms = [mirrored_term(term, mirror.swapped(term.results)) for term in self.terms]
        program, known = (mirrored(vector) for vector in (self.program.detach(), self.known))
        results = mirror.swapped(self.results)
        space = self.space.using(mirror.exchanged(self.space.sensors))
        # The mirror image of a mirror image is what was learned.
        learned = len(terms) == 1 and terms[0].weight == 1 and not terms[0].mirrored
        report = terms[0].report if learned else merged_report(terms)
        image = Behaviour(space, program, known, results, report, () if learned else terms, self.smooth)
        image.threshold, image.least_similarity = self.threshold, self.least_similarity
        return image

    @property
    def results(self) -> Int64[Tensor, "k m"]:
        """The stored results as levels of the actuators, in order of first insertion."""
        return self.memory.levels

    def readout(self) -> Readout:
        """The scores of all `results` as a function of conditions, see `VSA.readout`."""
        return self.space.vsa.readout(self.program, self.memory.current_items())

    def _answer(self, cells: Shaped[Tensor, "batch w"]) -> Recall:
        return answer_cells(self.space.encode, self.readout(), self.known, self.memory.commands, cells, self.smooth)

    def query(self, conditions: Shaped[Tensor, "batch d"]) -> Recall:
        """The answer to encoded and protected conditions (Algorithm 2, lines 2 to 8)."""
        return answer_conditions(self.readout(), self.known, self.memory.commands, conditions, self.smooth)

    def freeze(self) -> FrozenBehaviour:
        """A read-only copy with the fastest recall, see `FrozenBehaviour`."""
        readout = self.space.vsa.readout(self.program.detach(), self.memory.current_items())
        return FrozenBehaviour(self.space, readout, self.known, self.memory.commands, self.smooth)

    def scores(self, readings: Any) -> Float[Tensor, "batch k"]:
        """The score of each of `results`, `<unbind(program, condition), item> / |item|`, which recall compares.

        In float64, and differentiable with respect to the program, see `trainable`. Of a smooth behaviour it is the
        command of each actuator, `[B, m]`, on a scale from -1 to 1.
        """
        return self.readout()(self.space.encode(self.space.cells(readings)))

    def labels(self, commands: Any) -> Int64[Tensor, "batch"]:
        """The index in `results` of each row of commands `[B, m]`. Raises `ValueError` if it is not stored."""
        require_levels("labels", [self])
        levels = self.space.schema.command_levels(commands).to(self.results.device)
        same = (levels[:, None] == self.results).all(-1)
        if not same.any(-1).all():
            row = int((~same.any(-1)).nonzero()[0])
            raise ValueError(
                f"row {row} has the levels {levels[row].tolist()}, which are none of the {len(self.results)} stored "
                "results; first learn a demonstration that contains them"
            )
        return same.to(torch.int8).argmax(-1)

    def calibrate(self, demonstrations: Demonstrations, quantile: float = 0.02) -> None:
        """Set `threshold` and `least_similarity` from the demonstrated conditions, each counted once.

        They are this quantile of the familiarity, and of the similarity of the result that is recalled.
        """
        with torch.no_grad():
            recall = self.answer(distinct_rows(self.space.cells(demonstrations.sensors, demonstrations.episodes))[0])
        self.threshold, self.least_similarity = (
            float(values.double().quantile(quantile, interpolation="lower"))
            for values in (recall.familiarity, recall.similarity)
        )

    def trainable(self) -> "Behaviour":
        """A copy over the same space whose program is a float `nn.Parameter`, for a PyTorch training loop.

            behaviour = bank["seek_light"].trainable()
            labels = behaviour.labels(shown.commands)
            optimiser = torch.optim.Adam(behaviour.parameters(), lr=0.1)
            for _ in range(100):
                optimiser.zero_grad()
                loss = torch.nn.functional.cross_entropy(behaviour.scores(shown.sensors), labels)
                loss.backward()
                optimiser.step()
            bank.add("seek_light", behaviour)

        It can be called, copied, saved and exported like any behaviour. A bank file holds its program as a plain
        tensor: call `trainable` again after loading.
        """
        program = as_bipolar(self.program).detach()
        dtype = torch.float32 if is_integer(program) else program.dtype
        parameter = nn.Parameter(program.to(dtype, copy=True))
        known, results = self.known.clone(), self.results.clone()
        return Behaviour(self.space, parameter, known, results, self.report, smooth=self.smooth)

    def clipped(self) -> "Behaviour":
        """A copy whose program and known conditions are normalised hypervectors instead of raw sums.

        Clipping loses the counts: a program of many pairs then recalls far fewer of them. Integer codes are rounded to
        -1, 0 or +1, which turns programs with elements far below 1 (`LeastSquares`) into 0.
        """
        vsa = self.space.vsa
        program = vsa.normalize(self.program.detach())
        return Behaviour(self.space, program, vsa.normalize(self.known), self.results, self.report, smooth=self.smooth)

    def __repr__(self) -> str:
        schema, report = self.space.schema, self.report
        used = [sensor for sensor in schema.sensors if sensor.name in self.space.sensors]
        name = f"{self.name!r}, " if self.name else ""
        origin = f"sum of {', '.join(report.terms)}" if report.terms else f"{report.rule}, {report.pairs} pairs"
        return (
            f"Behaviour({name}d={self.space.vsa.dim}, {name_list('sensors', used)}, "
            f"{name_list('actuators', schema.actuators)}, {origin}, "
            f"{'smooth' if self.smooth else f'{len(self.results)} results'})"
        )
