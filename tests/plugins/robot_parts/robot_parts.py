"""An architecture, a continuous encoder, a learning rule, and a policy with a memory."""

import math
from collections.abc import Sequence, Sized
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from behaviours import (
    POLICIES,
    RULES,
    Behaviour,
    BehaviourBank,
    Demonstrations,
    Policy,
    Recall,
    Rule,
    Space,
)
from behaviours.learning.samples import Samples
from behaviours.progress import Progress, no_progress, subrange
from torchvsa import ARCHITECTURES, VSA
from torchvsa._numerics import norms
from torchvsa.encoders import VALUE_ENCODERS, ValueEncoder


class SignedProduct(VSA):
    """Codes of -1 / +1 whose bind is the product, with every other sign turned: `a ⊗ b = a · b · s`.

    `s` = +1, -1, +1, ... is the identity of bind, since `s · s` = 1. Bundles are sums, as in MAP-I.
    """

    name = "Signed"
    self_inverse = True

    def __init__(self, dim: int, dtype: torch.dtype = torch.float32) -> None:
        super().__init__(dim, dtype)

    def random(
        self, *shape: int, generator: torch.Generator | None = None, device: torch.device | str | None = None
    ) -> Tensor:
        """Independent random hypervectors `[*shape, d]`."""
        bits = torch.randint(2, (*shape, self.dim), generator=generator)
        return (1 - 2 * bits).to(device=device, dtype=self.dtype)

    def identity(self) -> Tensor:
        """`s`."""
        return 1 - 2 * (torch.arange(self.dim) % 2).to(self.dtype)

    def _bind(self, a: Tensor, b: Tensor) -> Tensor:
        """`bind` after its checks; it undoes itself, so that `unbind` needs no more: `(a · k · s) · k · s = a`."""
        return a * b * self.identity().to(a.device)

    def normalize(self, raw: Tensor) -> Tensor:
        """The sum itself."""
        return raw.to(self.dtype)


class Waves(ValueEncoder):
    """Random square waves: element j of the code of x is the sign of cos(ωⱼ·x + bⱼ)."""

    name = "waves"
    discrete = False
    omega: Tensor
    phase: Tensor

    def __init__(self, vsa: VSA, length: float = 0.1, seed: int | None = None) -> None:
        super().__init__()
        self.vsa, self.length = vsa, float(length)
        self._own(seed)

    def own_layout(self) -> dict[str, tuple[torch.dtype, tuple[int, ...]]]:
        """`omega` and `phase`, one of each per element."""
        return dict.fromkeys(("omega", "phase"), (torch.float64, (self.vsa.dim,)))

    def config(self) -> dict[str, Any]:
        """Its name and its option."""
        return {"name": self.name, "length": self.length}

    def _draw(self, generator: torch.Generator | None) -> dict[str, Tensor]:
        omega = torch.randn(self.vsa.dim, generator=generator, dtype=torch.float64)
        phase = torch.rand(self.vsa.dim, generator=generator, dtype=torch.float64) * 2 * math.pi
        return {"omega": omega, "phase": phase}

    def cells(self, x: Tensor) -> Tensor:
        """The readings themselves, -1 for unobserved ones."""
        return torch.where(x.isnan(), -1.0, x.clamp(0, 1))

    def encode(self, cells: Tensor) -> Tensor:
        """The sign of each wave."""
        angles = cells[..., None] * (self.omega / self.length) + self.phase
        return torch.where(angles.cos() >= 0, 1, -1).to(self.vsa.dtype)


@dataclass(frozen=True)
class Average(Rule):
    """Add each condition bound to the average of the results that were shown with it, each of length 1."""

    name = "average"
    integer_programs = False

    def fit(self, space: Space, demonstrations: Demonstrations, progress: Progress = no_progress) -> Behaviour:
        """Learn one program from the demonstration."""
        samples = Samples.of(space, demonstrations, subrange(progress, 0, 0.5))
        items = space.items(samples.results).to(torch.float32)
        items = items / norms(items)[:, None].to(items.dtype)
        conditions = samples.conditions[:].to(items.dtype)
        shape = len(conditions), len(items)
        counts = torch.bincount(samples.condition * shape[1] + samples.result, minlength=shape[0] * shape[1])
        shares = counts.view(shape).to(items.dtype)
        shares = shares / shares.sum(1, keepdim=True)
        program = space.vsa.bind(shares @ items, conditions).sum(0)
        most = counts.view(shape).argmax(1)
        report = samples.report(self.name, contradicting=int((most[samples.condition] != samples.result).sum()))
        progress(1.0)
        return Behaviour(space, program, samples.condition_sum(space.vsa), samples.results, report)

    @classmethod
    def supports(cls, vsa: VSA) -> bool:
        """Real numbers."""
        return not vsa.dtype.is_complex and vsa.dtype != torch.bool


class Hysteresis(Policy):
    """The most familiar behaviour speaks, and goes on until another was more familiar for `patience` steps."""

    def __init__(self, bank: BehaviourBank, patience: int = 2) -> None:
        super().__init__(bank, bank.names)
        self.patience = patience

    def start(self, episodes: Sized) -> Any:
        """The memory of the sensors, who speaks (-1: nobody yet), and for how long another was more familiar."""
        nobody = torch.full((len(episodes),), -1, device=self.space.device)
        return super().start(episodes), nobody, torch.zeros_like(nobody)

    def step(self, readings: Any, state: Any) -> tuple[Recall, Any]:
        """The answers of who speaks, and the state after it."""
        past, speaker, waited = state
        cells, past = self.space.step(readings, past)
        blind = (cells < 0).all(-1)
        answers = [part.answer(cells) for part in self.parts]
        favourite = torch.stack([answer.familiarity for answer in answers]).argmax(0)
        # Where nothing is observed nobody is more familiar, and the state stays as it is.
        waited = torch.where(blind | (favourite == speaker), torch.where(blind, waited, 0), waited + 1)
        takes_over = ~blind & ((speaker < 0) | (waited >= self.patience))
        speaker, waited = torch.where(takes_over, favourite, speaker), torch.where(takes_over, 0, waited)
        return _spoken(answers, speaker.clamp(min=0)).mask_unobserved(blind), (past, speaker, waited)

    def query(self, conditions: Sequence[Tensor]) -> Recall:
        """The answer at the start of an episode: the most familiar behaviour's."""
        answers = self.answers(conditions)
        return _spoken(answers, torch.stack([answer.familiarity for answer in answers]).argmax(0))


def _spoken(answers: list[Recall], speaker: Tensor) -> Recall:
    """To each robot the answer of its speaker."""
    rows = torch.arange(len(speaker), device=speaker.device)

    def spoken(field: str) -> Tensor:
        return torch.stack([getattr(answer, field) for answer in answers])[speaker, rows]

    return Recall(spoken("commands"), spoken("similarity"), spoken("margin"), spoken("familiarity"), speaker)


ARCHITECTURES.register(SignedProduct.name, SignedProduct)
VALUE_ENCODERS.register(Waves.name, Waves)
RULES.register(Average.name, Average)
POLICIES.register("hysteresis", Hysteresis)
