"""Vector-derived Transformation Binding."""

import math

import torch
from jaxtyping import Shaped
from torch import Tensor

from torchvsa.architectures._unit_length import NormalElements


class VTB(NormalElements):
    """Vector-derived Transformation Binding: the key is a matrix that multiplies each part of the hypervector.

    With m = √d, the key `k` is the m × m matrix K of its elements, row by row, and so is `a`:

        bind(a, k) = m^½ · A Kᵀ        unbind(b, k) = m^½ · B K

    so that `d` is a square number. Elements are normal with variance 1/d, for which √m · K is orthogonal on average:
    unbinding is an approximate inverse. Bundle is the sum scaled to length 1. Binding is bilinear; it neither commutes
    nor associates, and the identity is one on the right only: `bind(a, identity) = a`.

    Source: Gosmann and Eliasmith 2019, "Vector-derived transformation binding".
    """

    name = "VTB"
    commutative = False

    def allows_dim(self, dim: int) -> bool:
        """Square numbers."""
        return math.isqrt(dim) ** 2 == dim

    def identity(self) -> Shaped[Tensor, "d"]:
        """The identity matrix, divided by m^½."""
        self.require_room((), self.dtype.itemsize)
        return (torch.eye(self._side, dtype=self.dtype) / self._scale).flatten()

    def inverse(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """The transposed matrix: `bind(b, inverse(k)) = unbind(b, k)`."""
        self.check(x, "x")
        return self._matrix(x).mT.flatten(-2)

    @property
    def _side(self) -> int:
        return math.isqrt(self.dim)

    @property
    def _scale(self) -> float:
        return self._side**0.5

    def _matrix(self, x: Tensor) -> Tensor:
        return x.unflatten(-1, (self._side, self._side))

    def _bind(self, a: Tensor, b: Tensor) -> Tensor:
        return self._transformed(a, self._matrix(b).mT)

    def _unbind(self, bound: Tensor, key: Tensor) -> Tensor:
        return self._transformed(bound, self._matrix(key))

    def _transformed(self, x: Tensor, matrix: Tensor) -> Tensor:
        return (self._scale * (self._matrix(x) @ matrix)).flatten(-2)

    def fold(
        self, program: Shaped[Tensor, "*#batch d"], item: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """`m^½ · Pᵀ R`: from `<P K, R> = <K, Pᵀ R>`, the sums of element-wise products of matrices."""
        return (self._scale * (self._matrix(program).mT @ self._matrix(item))).flatten(-2)
