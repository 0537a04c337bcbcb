"""What every architecture can do with its own bind, bundle and permute: sequences, n-grams, records and powers."""

from abc import ABC, abstractmethod
from functools import reduce
from itertools import repeat
from math import isfinite
from numbers import Real
from typing import Any, ClassVar

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor

from torchvsa._checks import positive_integer
from torchvsa._numerics import as_bipolar, paired_products
from torchvsa.architectures._sums import Summands, stacked
from torchvsa.errors import ShapeError


class Derived(ABC):
    """The base of `VSA`, which describes the abstract methods below: what is made of them.

    `sequence`, `ngrams` and `record` return a hypervector, as `bundle` does. With `raw=True` they return the raw
    accumulator, which `superpose` returns, so that further sequences, n-grams or pairs can be added to it.
    """

    name: str
    dim: int
    self_inverse: bool
    negatable: ClassVar[bool]

    @property
    @abstractmethod
    def frequencies(self) -> int | None: ...
    @abstractmethod
    def identity(self) -> Shaped[Tensor, "d"]: ...
    @abstractmethod
    def bind(self, a: Any, b: Any) -> Shaped[Tensor, "..."]: ...
    @abstractmethod
    def permute(self, x: Any, shifts: Any) -> Shaped[Tensor, "..."]: ...
    @abstractmethod
    def superpose(self, xs: Summands, dim: int = -2) -> Shaped[Tensor, "..."]: ...
    @abstractmethod
    def bundle(self, xs: Summands, dim: int = -2) -> Shaped[Tensor, "..."]: ...
    @abstractmethod
    def check(self, x: Tensor, argument: str) -> None: ...

    def sequence(self, xs: Summands, dim: int = -2, *, raw: bool = False) -> Shaped[Tensor, "..."]:
        """The bundle of a sequence: the last hypervector as it is, the one before rotated by 1, the first by k - 1.

        `permute(sequence(xs), i + 1 - k)` resembles hypervector `i` of `k`. A further one is appended to the raw
        accumulator by `permute(raw, 1) + x`.

        Args:
            xs: `[..., k, d]` for the default `dim`, or a list or tuple of `k` hypervectors `[..., d]`.
            dim: The dimension of the sequence.
            raw: Whether the sum is returned as it is.

        Raises:
            ShapeError: `dim` is the hypervector dimension, or there are no hypervectors.

        Source: Sahlgren, Holst and Kanerva 2008, "Permutations as a means to encode order in word space"; Kanerva 2009,
        "Hyperdimensional computing".
        """
        members = self._rows(xs, dim).unbind(-2)
        if not members:
            raise ShapeError("a sequence has at least one hypervector; got none")
        # One by one: in batches faster than with a tensor of shifts.
        rotated = [self.permute(x, len(members) - 1 - i) for i, x in enumerate(members)]
        return self._joined(torch.stack(rotated, -2), raw)

    def ngrams(self, xs: Summands, n: int = 3, dim: int = -2, *, raw: bool = False) -> Shaped[Tensor, "..."]:
        """The bundle of all n-grams of a sequence: of each `n` neighbours, bound to one another.

        The n-gram of a, b, c is `bind(bind(permute(a, 2), permute(b, 1)), c)`: the last one is the key that is unbound
        first. With `n = k` it is one n-gram of the whole sequence, with `n = 1` the bundle.

        Rotations tell the order of the members only where `permute` does not commute with `bind`. It does in HRR: there
        all orders of the same members have the same n-gram. Reorder the elements of `xs[..., i, :]` with a random order
        per place in advance, or use `sequence`. In BSDC-S, n-grams tell the first member, but not the order of others.

        Args:
            xs: `[..., k, d]` for the default `dim`, or a list or tuple of `k` hypervectors `[..., d]`.
            n: The number of members, from 1 to `k`.
            dim: The dimension of the sequence.
            raw: Whether the sum is returned as it is: it counts how often each n-gram occurs.

        Raises:
            ShapeError: `dim` is the hypervector dimension, or there are fewer than `n` hypervectors.
            ValueError: `n` is not a positive whole number.

        Source: Joshi, Halseth and Kanerva 2016, "Language geometry using random indexing".
        """
        xs, n = self._rows(xs, dim), positive_integer("n", n)
        count = xs.shape[-2] - n + 1
        if count < 1:
            raise ShapeError(f"n-grams of n = {n} need at least {n} hypervectors; got {xs.shape[-2]}")
        members = (self.permute(xs[..., i : i + count, :], n - 1 - i) for i in range(n))
        return self._joined(reduce(self.bind, members), raw)

    def record(self, roles: Summands, values: Summands, dim: int = -2, *, raw: bool = False) -> Shaped[Tensor, "..."]:
        """The bundle of role-filler pairs, `bind(value, role)`: `unbind(record, role)` resembles the value.

        Args:
            roles: `[..., k, d]` for the default `dim`, or a list or tuple of `k` hypervectors `[..., d]`.
            values: As many, in the same order; both broadcast over their batches.
            dim: The dimension of the pairs.
            raw: Whether the sum is returned as it is: pairs are added to it and subtracted from it.

        Raises:
            ShapeError: `dim` is the hypervector dimension, or there are not as many roles as values.

        Source: Plate 1995, "Holographic reduced representations"; Kanerva 2009, "Hyperdimensional computing".
        """
        roles, values = self._rows(roles, dim), self._rows(values, dim)
        if roles.shape[-2] != values.shape[-2]:
            raise ShapeError(
                f"a record has a value for each role; got {roles.shape[-2]} roles, {values.shape[-2]} values"
            )
        return self._joined(self.bind(values, roles), raw)

    def negative(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """The hypervector whose similarity to `x` is -1. Raises `ValueError` unless the architecture is `negatable`."""
        if not self.negatable:
            raise ValueError(f"{self.name} has no negative hypervectors")
        self.check(x, "x")
        return ~x if x.dtype == torch.bool else -x

    def inverse(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """The hypervector with `bind(a, inverse(x)) = unbind(a, x)`.

        `x` itself where `unbind` is `bind`; an architecture whose `unbind` differs overrides it if there is an inverse.
        It is as exact as `unbind` (HRR: the involution of Plate 1995).

        Raises:
            ValueError: The architecture has no inverse hypervectors.
        """
        if not self.self_inverse:
            raise ValueError(f"{self.name} has no inverse hypervectors; write unbind(a, x), not bind(a, inverse(x))")
        self.check(x, "x")
        return x

    def power(self, x: Shaped[Tensor, "*batch d"], n: int | float) -> Shaped[Tensor, "*batch d"]:
        """`x` bound to itself `n - 1` times: `power(x, 3)` is `bind(bind(x, x), x)`, `power(x, 0)` the identity.

        `power(x, -n)` is `power(inverse(x), n)`. Where binding does not commute, `x` is the key on the right, and
        `unbind(power(x, n), x)` resembles `power(x, n - 1)`.

        Architectures with a spectrum (FHRR, HRR) take any real `n`: angles are multiplied by `n`, and magnitudes taken
        to the power `|n|`. In HRR the components of frequency 0 and d / 2 are real; a negative one has no fractional
        power, and the real part of its complex one is taken. The encoder `FractionalPower` encodes values as powers.

        Raises:
            ValueError: `n` is not finite, is not a whole number where there is no spectrum, or is negative where there
                are no inverse hypervectors.

        Source: Plate 1995, "Holographic reduced representations", on convolution powers; Plate 1992 for fractions.
        """
        self.check(x, "x")
        if isinstance(n, bool) or not isinstance(n, Real) or not isfinite(n):
            raise ValueError(f"the exponent is one real number; got {n!r}")
        if self.frequencies is None and n != int(n):
            raise ValueError(f"{self.name} has no spectrum; fractional powers need FHRR or HRR; got n = {n}")
        return self._power(x, float(n))

    def _power(self, x: Tensor, n: float) -> Tensor:
        if n == 0:
            return self.identity().to(x.device).expand_as(x).clone()
        return reduce(self.bind, repeat(x if n > 0 else self.inverse(x), abs(int(n))))

    def dot_similarity(
        self, a: Shaped[Tensor, "*#batch d"], b: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch"]:
        """The inner product of `a` and `b`, broadcast over their batches; of complex ones, the real part.

        Integers give the exact product, in int64, or in float64 where their types do not prove that it fits. Bits count
        as +1 (`False`) and -1 (`True`).
        """
        self.check(a, "a")
        self.check(b, "b")
        return paired_products(a, b)

    def hamming_similarity(
        self, a: Shaped[Tensor, "*#batch d"], b: Shaped[Tensor, "*#batch d"]
    ) -> Int64[Tensor, "*#batch"]:
        """The number of equal elements of `a` and `b`, broadcast over their batches.

        It says something of elements that have few values (MAP with -1 / +1, BSC, MCR); unrelated hypervectors of real
        elements have none in common.
        """
        self.check(a, "a")
        self.check(b, "b")
        return (as_bipolar(a) == as_bipolar(b)).sum(-1)

    def _stacked(self, xs: Summands, dim: int) -> tuple[Shaped[Tensor, "..."], int]:
        """The summands as one tensor of hypervectors, and the dimension to sum over. Raises `ShapeError`."""
        xs, dim = stacked(xs, dim)
        self.check(xs, "xs")
        if xs.dim() < 2 or dim in (-1, xs.dim() - 1):
            raise ShapeError(
                f"bundling sums over a dimension other than the last; got shape {tuple(xs.shape)} and "
                f"dim={dim}, expected e.g. [..., k, {self.dim}] and dim=-2"
            )
        return xs, dim

    def _rows(self, xs: Summands, dim: int) -> Shaped[Tensor, "*batch k d"]:
        xs, dim = self._stacked(xs, dim)
        return xs.movedim(dim, -2)

    def _joined(self, xs: Shaped[Tensor, "*batch k d"], raw: bool) -> Shaped[Tensor, "*batch d"]:
        return self.superpose(xs) if raw else self.bundle(xs)
