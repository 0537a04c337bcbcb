"""The law suites that users run: they pass on sound parts, and name the law that a broken one breaks."""

import math
from typing import Any

import pytest
import torch
from torch import Tensor

import torchvsa
from torchvsa import HRR, MAP
from torchvsa.encoders import Level, Lookup, Product, Sum
from torchvsa.testing import check_architecture, check_encoder, check_value_encoder


class Leaky(MAP):
    """Binds with a zero at one end."""

    def bind(self, a: Tensor, b: Tensor) -> Tensor:
        bound = super().bind(a, b).clone()
        bound[..., 0] = 0
        return bound


class Asymmetric(MAP):
    """Says that binding commutes, and permutes one side."""

    def bind(self, a: Tensor, b: Tensor) -> Tensor:
        return super().bind(self.permute(a, 1), b)

    def unbind(self, bound: Tensor, key: Tensor) -> Tensor:
        return self.permute(super().unbind(bound, key), -1)


class Boastful(HRR):
    """Says that its approximate inverse is exact."""

    def __init__(self, dim: int) -> None:
        super().__init__(dim)
        self.self_inverse = True


class Backwards(MAP):
    """Rotates the first of a sequence least."""

    def sequence(self, xs: Any, dim: int = -2, *, raw: bool = False) -> Tensor:
        return super().sequence(xs.flip(dim), dim, raw=raw)


class Doubtful(HRR):
    """Takes a hypervector for its own inverse."""

    def inverse(self, x: Tensor) -> Tensor:
        return x


@pytest.mark.parametrize(
    ("vsa", "law"),
    [
        (Backwards(500), "a sequence bundles rotated members"),
        (Doubtful(500), "binding with the inverse unbinds"),
        (Leaky(500), "unbind undoes bind"),
        (Asymmetric(500), "bind commutes and associates"),
        (Boastful(500), "unbind undoes bind"),
    ],
)
def test_a_broken_architecture_is_told_its_law(vsa: torchvsa.VSA, law: str) -> None:
    with pytest.raises(AssertionError, match=rf"\(dim=500, dtype=float32\) breaks the law: {law}"):
        check_architecture(vsa)


class Unclamped(Level):
    """Lets cells leave the range."""

    def cells(self, x: Tensor) -> Tensor:
        return torch.where(x.isnan(), -1, (x * self.bins).long())


class Global(Lookup):
    """Draws from PyTorch's global generator."""

    def _codes(self, generator: torch.Generator | None) -> Tensor:
        return self.vsa.random(self.bins)


class Hidden(Lookup):
    """Keeps codes that no state_dict holds."""

    def encode(self, cells: Tensor) -> Tensor:
        if not hasattr(self, "secret"):
            self.secret = self.codes.flip(0)
        return self.secret[cells]


@pytest.mark.parametrize(
    ("kind", "law"),
    [
        (Unclamped, "codes have the type and dimension of the architecture. IndexError"),
        (Global, "the seed decides the bits"),
        (Hidden, "a state dict carries all that was drawn|copies answer alike and are independent"),
    ],
)
def test_a_broken_value_encoder_is_told_its_law(kind: Any, law: str) -> None:
    with pytest.raises(AssertionError, match=f"{kind.__name__}.* breaks the law: ({law})"):
        check_value_encoder(kind(MAP(400), 4, seed=0))


class Batched(Sum):
    """Depends on the batch."""

    def encode(self, cells: Tensor) -> Tensor:
        return super().encode(cells) * (1 if len(cells) > 1 else -1)


class Stateful(Product):
    """Writes into the state that it was given."""

    def start(self, batch: int) -> Tensor:
        return torch.zeros(batch, 1, self.sensors, dtype=torch.float64)

    def step(self, x: Tensor, past: Tensor) -> tuple[Tensor, Tensor]:
        past[:, 0] = 1
        return x, past


@pytest.mark.parametrize(
    ("kind", "law"),
    [
        (Batched, "a batch is its singles"),
        (Stateful, "windows of recorded readings are those of live ones"),
    ],
)
def test_a_broken_encoder_is_told_its_law(kind: Any, law: str) -> None:
    with pytest.raises(AssertionError, match=f"{kind.__name__}.* breaks the law: {law}"):
        check_encoder(kind(Level(MAP(400), 4), 2))


def test_a_checked_part_stays_as_it_was() -> None:
    plan, drawn = Product(Level(MAP(300), 4), 2), Product(Level(MAP(300), 4), 2, seed=0)
    before = {name: tensor.clone() for name, tensor in drawn.state_dict().items()}
    for encode in (plan, drawn):
        check_encoder(encode)
    assert not plan.drawn
    assert all(torch.equal(tensor, before[name]) for name, tensor in drawn.state_dict().items())


class Square(MAP):
    """Takes square numbers of dimensions only."""

    def __init__(self, dim: int) -> None:
        super().__init__(dim)
        self.name = "square"

    def allows_dim(self, dim: int) -> bool:
        return math.isqrt(dim) ** 2 == dim


def test_a_dim_that_is_not_allowed_is_refused_with_the_nearest() -> None:
    check_architecture(Square(529))
    with pytest.raises(ValueError, match="Square does not allow dim=4000; the nearest allowed: 3969 and 4096"):
        Square(4000)
    with pytest.raises(ValueError, match="Square does not allow dim=2; the nearest allowed: 1 and 4"):
        Square(2)


class Careless(Square):
    """Does not ask its own rule."""

    def allows_dim(self, dim: int) -> bool:
        return dim < 0 or not hasattr(self, "variant") or super().allows_dim(dim)


class Unfinished(HRR):
    """Overrides neither `_bind` nor `bind`."""

    _bind = torchvsa.VSA._bind


def test_a_law_asks_whether_its_own_dim_is_allowed() -> None:
    with pytest.raises(AssertionError, match="breaks the law: a dim that is not allowed is refused"):
        check_architecture(Careless(500))


def test_an_architecture_without_binding_says_what_is_missing() -> None:
    x = torch.ones(8)
    with pytest.raises(NotImplementedError, match="Unfinished must implement _bind"):
        Unfinished(8).bind(x, x)
