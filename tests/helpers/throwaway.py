"""Two architectures that no one should use: they lack what all others have, and must work all the same."""

from typing import ClassVar

import torch
from torch import Tensor

from torchvsa import VSA


class _Bipolar(VSA):
    """Codes of -1 / +1, sums clipped to [-1, 1]."""

    elementwise: ClassVar[bool] = False
    commutative: ClassVar[bool] = False

    def __init__(self, dim: int, dtype: torch.dtype = torch.int8) -> None:
        super().__init__(dim, dtype)

    def random(
        self, *shape: int, generator: torch.Generator | None = None, device: torch.device | str | None = None
    ) -> Tensor:
        return (1 - 2 * torch.randint(0, 2, (*shape, self.dim), generator=generator)).to(device, self.dtype)

    def normalize(self, raw: Tensor) -> Tensor:
        return raw.clamp(-1, 1).to(self.dtype)


class Turned(_Bipolar):
    """Bilinear, and does not commute: the product with the key, which is shifted first."""

    name = "turned"

    def identity(self) -> Tensor:
        return torch.ones(self.dim, dtype=self.dtype)

    def bind(self, a: Tensor, b: Tensor) -> Tensor:
        self.check(a, "a")
        self.check(b, "b")
        return a * torch.roll(b, 1, -1)

    def unbind(self, bound: Tensor, key: Tensor) -> Tensor:
        return self.bind(bound, key)

    def fold(self, program: Tensor, item: Tensor) -> Tensor:
        return torch.roll(program * item, -1, -1)


class Hashed(_Bipolar):
    """Not even bilinear: a shift by a number that hangs on all of the key, as in sparse codes (BSDC-S)."""

    name = "hashed"
    bilinear: ClassVar[bool] = False

    def identity(self) -> Tensor:
        return -torch.ones(self.dim, dtype=self.dtype)

    def bind(self, a: Tensor, b: Tensor) -> Tensor:
        return self.permute(a, self._shift(b))

    def unbind(self, bound: Tensor, key: Tensor) -> Tensor:
        return self.permute(bound, -self._shift(key))

    def _shift(self, key: Tensor) -> Tensor:
        self.check(key, "key")
        places = torch.arange(self.dim, device=key.device)
        return ((key > 0) * places).sum(-1) % self.dim
