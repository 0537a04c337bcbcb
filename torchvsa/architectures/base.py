"""The interface of Vector Symbolic Architectures, and what all of them share."""

import math
from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import torch
from jaxtyping import Bool, Float, Int, Shaped
from torch import Tensor

from torchvsa._checks import INTEGERS, nearest, whole_number
from torchvsa._kernels.rotation import rotate
from torchvsa._memory_limit import require_memory
from torchvsa._numerics import as_bipolar, cosines, is_integer, norms
from torchvsa.architectures._derived import Derived
from torchvsa.architectures._sums import Summands, check_weights, integer_sum, weighted
from torchvsa.errors import ShapeError
from torchvsa.readout import Readout

_DIM = "dim is the number of elements of a hypervector, a positive integer"


class VSA(Derived):
    """A space of hypervectors of `dim` numbers, and the operations on them.

    Hypervectors are plain tensors `[..., d]`; leading dimensions are batches. A **raw accumulator** is what
    `superpose` returns: a sum that is not normalised yet. `bind`, `unbind`, `permute` and `similarity`
    accept it in place of a hypervector, which keeps them linear; `normalize` turns it into a hypervector.

    A new architecture implements `random`, `identity`, `_bind`, `_unbind` (not needed if `_bind` undoes itself) and
    `normalize`. It sets `name` and every attribute below that differs, overrides `allows_dim` if not every `dim` works
    and `inverse` if there is one, and is registered in `torchvsa.ARCHITECTURES`. `bind` and `unbind` check shapes and
    then call `_bind` and `_unbind`; an architecture that needs other checks overrides the public methods instead.
    """

    name: str
    elementwise: ClassVar[bool] = True
    """Whether element i of `bind(a, b)` depends on the elements i of `a` and `b` only."""
    commutative: ClassVar[bool] = True
    """Whether `bind(a, b)` equals `bind(b, a)`."""
    bilinear: ClassVar[bool] = True
    """Whether `bind` and `unbind` are linear in the key too, so that `readout` can fold programs into items."""
    self_inverse: bool = False
    """Whether binding twice with the same key gives back the hypervector."""
    exact: bool = False
    """Whether `unbind(bind(a, key), key)` is `a`, up to rounding, for every key that `random` draws."""
    negatable: ClassVar[bool] = True
    """Whether hypervectors have a `negative`."""
    sparse: ClassVar[bool] = False
    """Whether most elements of a hypervector are 0."""
    breaks_ties: bool = False
    """Whether `bundle` needs the summands themselves to decide ties, not only their sum."""
    clips: bool = False
    """Whether `normalize` clips to [-1, 1], and nothing else."""
    in_place: ClassVar[str | None] = None
    """The name of PyTorch's method that writes `bind(a, b)` of two hypervectors into `a`, if there is one."""

    def __init__(self, dim: int, dtype: torch.dtype) -> None:
        self.dim = whole_number(dim, _DIM)
        if self.dim < 1:
            raise ValueError(f"{_DIM}; got {dim!r}")
        if not self.allows_dim(self.dim):
            allowed = nearest(self.allows_dim, self.dim)
            raise ValueError(f"{type(self).__name__} does not allow dim={self.dim}; {allowed}")
        self.dtype = dtype

    def __repr__(self) -> str:
        return f"{self.name}(dim={self.dim}, dtype={str(self.dtype).removeprefix('torch.')})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, VSA) and self.config() == other.config()

    def __hash__(self) -> int:
        return hash(repr(self))

    def config(self) -> dict[str, str | int]:
        """Name, dim and dtype, from which `torchvsa.architecture(**config)` makes an equal object."""
        return {"name": self.name, "dim": self.dim, "dtype": str(self.dtype).removeprefix("torch.")}

    def allows_dim(self, dim: int) -> bool:
        """Whether hypervectors can have `dim` elements (for example only a square number). Any number by default.

        The constructor of `VSA` calls it: an override may read attributes that are set before `super().__init__()`.
        """
        return True

    @property
    def blocks(self) -> int:
        """The number of blocks; element i belongs to block i mod `blocks`. `dim` by default: one element each.

        Encoders that mix or reorder the elements of hypervectors keep the elements of a block together.
        """
        return self.dim

    @property
    def integer(self) -> bool:
        """Whether hypervectors and raw accumulators hold integers, so that every sum is exact."""
        return not (self.dtype.is_floating_point or self.dtype.is_complex)

    @property
    def accumulator(self) -> torch.dtype:
        """The type of a raw accumulator: int32 for integer codes, else the type of the hypervectors."""
        return torch.int32 if self.integer else self.dtype

    @property
    def row_bytes(self) -> int:
        """Bytes of one hypervector."""
        return self.dim * self.dtype.itemsize

    @abstractmethod
    def random(
        self, *shape: int, generator: torch.Generator | None = None, device: torch.device | str | None = None
    ) -> Shaped[Tensor, "*shape d"]:
        """Independent random hypervectors `[*shape, d]`.

        They are drawn on the generator's device and then moved to `device`: a seed gives the same bits on every
        device. Without a generator, PyTorch's global one is used.
        """

    @abstractmethod
    def identity(self) -> Shaped[Tensor, "d"]:
        """The hypervector `e` with `bind(a, e) = a`."""

    def bind(self, a: Shaped[Tensor, "*#batch d"], b: Shaped[Tensor, "*#batch d"]) -> Shaped[Tensor, "*#batch d"]:
        """Combine two hypervectors into one that is dissimilar to both; `b` is the key.

        Linear in `a`, so that it distributes over raw accumulators. The attributes `bilinear` and `commutative` say
        whether it is linear in `b` too, and whether it commutes.

        Raises:
            ShapeError: `a` or `b` does not end in `d` elements.
            ValueError: A product of two raw accumulators of integers does not fit their type (see `superpose`).
        """
        self.check(a, "a")
        self.check(b, "b")
        return self._bind(a, b)

    def unbind(
        self, bound: Shaped[Tensor, "*#batch d"], key: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """Undo `bind`: `unbind(bind(a, key), key)` equals or resembles `a`. Linear in `bound`; raises like `bind`."""
        self.check(bound, "bound")
        self.check(key, "key")
        return self._unbind(bound, key)

    def _bind(self, a: Tensor, b: Tensor) -> Tensor:
        raise NotImplementedError(f"{type(self).__name__} must implement _bind (or override bind and unbind)")

    def _unbind(self, bound: Tensor, key: Tensor) -> Tensor:
        return self._bind(bound, key)

    @abstractmethod
    def normalize(self, raw: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Turn a raw accumulator into a hypervector of this architecture."""

    @property
    def frequencies(self) -> int | None:
        """The number of angles that `from_angles` takes; None for an architecture without a spectrum."""
        return None

    def from_angles(self, angles: Float[Tensor, "*batch frequencies"]) -> Shaped[Tensor, "*batch d"]:
        """The hypervector whose spectrum has these angles and magnitude 1, as `FractionalPower` needs it."""
        raise ValueError(f"{self.name} has no spectrum; fractional powers need FHRR or HRR")

    def permute(
        self, x: Shaped[Tensor, "*#batch d"], shifts: int | Int[Tensor, "*#batch"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """Rotate the elements to the right: element `i` moves to `(i + shift) mod d`.

        Args:
            x: Hypervectors `[..., d]`.
            shifts: One number, or a tensor with one per hypervector (any shape that broadcasts with the batch).
                Negative shifts rotate to the left.

        Raises:
            ValueError: Shifts are not whole numbers, of a signed integer type or uint8.
        """
        self.check(x, "x")
        if not isinstance(shifts, Tensor):
            shift = whole_number(shifts, "shifts are a whole number or a tensor of integers")
            return torch.roll(x, shift % self.dim, -1)
        if shifts.dtype not in INTEGERS:
            raise ValueError(f"shifts are a whole number or a tensor of integers; got a tensor of {shifts.dtype}")
        return rotate(x, shifts)

    def superpose(
        self, xs: Summands, dim: int = -2, weights: Shaped[Tensor, "..."] | None = None
    ) -> Shaped[Tensor, "..."]:
        """Sum `k` hypervectors over dimension `dim` into a raw accumulator.

        Args:
            xs: A tensor, `[..., k, d]` for the default `dim`, or a list or tuple of `k` tensors `[..., d]`.
            dim: The dimension to sum over.
            weights: One number per summand, `[k]`, or other ones for each batch element, `[*batch, k]`.

        Integers (bits count as votes) with integer weights give an exact sum in int32. Integers with float weights give
        a sum in the weights' type, float32 at least; other summands keep their own type.

        Raises:
            ShapeError: `dim` is the hypervector dimension, or the weights do not fit.
            ValueError: The sum does not fit int32, an intermediate product does not fit int64, or weights are NaN or
                infinite. Values are checked on a CPU only, outside of compiled and exported graphs and of `vmap`;
                elsewhere a sum of int8 codes fits if `k` times the largest absolute weight is below 2^24, and a sum
                that does not fit wraps around.
        """
        xs, dim = self._stacked(xs, dim)
        votes = as_bipolar(xs)
        if weights is not None:
            check_weights(weights, votes, xs.shape[dim])
        if is_integer(votes) and not self.integer:
            votes = votes.to(self.dtype)
        if is_integer(votes) and (weights is None or not weights.is_floating_point()):
            return integer_sum(votes, dim, weights)
        return votes.sum(dim) if weights is None else weighted(votes, dim, weights)

    def bundle(
        self, xs: Summands, dim: int = -2, weights: Shaped[Tensor, "..."] | None = None
    ) -> Shaped[Tensor, "..."]:
        """Superpose `k` hypervectors into one that is similar to each of them: the sum, normalised.

        Takes the arguments of `superpose`. The order of the summands does not matter, but bundling is not associative:
        bundle all at once, or keep a raw accumulator.
        """
        return self.normalize(self.superpose(xs, dim, weights))

    def _bundle_pair(
        self, a: Shaped[Tensor, "*#batch d"], b: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """`bundle` of `a` and `b`, element by element of the (broadcast) batch."""
        return self.bundle([a, b])

    def similarity(self, a: Shaped[Tensor, "*#batch d"], b: Shaped[Tensor, "*#batch d"]) -> Float[Tensor, "*#batch"]:
        """Cosine of `a` and `b`, broadcast over their batches; a zero vector has 0 with everything.

        Independent of their lengths, however large or small. NaN where an element is NaN or infinite.
        """
        self.check(a, "a")
        self.check(b, "b")
        return cosines(a, b).to(torch.float32)

    def positive(self, x: Shaped[Tensor, "*batch d"]) -> Bool[Tensor, "*batch d"]:
        """Which elements are above 0 (real parts of complex ones, votes of bits); `SelfShift` needs it."""
        return (x.real if x.is_complex() else as_bipolar(x)) > 0

    def unbundle(
        self, bundled: Shaped[Tensor, "*#batch d"], known: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """Estimate `x` from `bundle([x, known])`, given `known`."""
        return bundled - known

    def fold(
        self, program: Shaped[Tensor, "*#batch d"], item: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """The vector `f` with `<f, key> = <unbind(program, key), item>` for every key.

        `readout` uses it where `bind` is bilinear. Where `bind` commutes too, it is `unbind(program, item)`; an
        architecture that is bilinear and does not commute overrides it.
        """
        if not self.commutative:
            raise NotImplementedError(f"{self.name} is bilinear and does not commute; it must implement fold")
        return self.unbind(program, item)

    def readout(self, programs: Shaped[Tensor, "*b d"], items: Shaped[Tensor, "K d"]) -> Readout:
        """A `Readout` of one program `[d]`, or of a stack `[b, d]`, that compares with the items `[K, d]`."""
        return Readout(self, programs, items)

    def unbound_norm(self, program: Shaped[Tensor, "d"], keys: Shaped[Tensor, "*batch d"]) -> Float[Tensor, "*batch"]:
        """The length of `unbind(program, key)` for each key, in float64."""
        return norms(self.unbind(program, keys))

    def require_room(self, shape: Sequence[int], element_bytes: int, generator: torch.Generator | None = None) -> None:
        """Raise `ValueError` unless hypervectors `[*shape, d]` of `element_bytes` per element fit into memory."""
        if not torch.compiler.is_compiling() and (generator is None or generator.device.type == "cpu"):
            count = math.prod(shape)
            require_memory(
                count * self.dim * element_bytes,
                f"making {count} hypervectors of d = {self.dim} elements",
                "take fewer dimensions, or fewer hypervectors at a time",
            )

    def check(self, x: Tensor, argument: str) -> None:
        """Raise `ShapeError` unless `x` holds hypervectors of this dimension."""
        if x.dim() == 0 or x.shape[-1] != self.dim:
            raise ShapeError(f"{argument} must end in d = {self.dim} elements; got shape {tuple(x.shape)}")

    def check_codes(self, x: Tensor, what: str) -> None:
        """Raise `ValueError` unless the elements of `x` have the type and the range of those that `random` draws."""
        self.check(x, what)
        if x.dtype != self.dtype or not self._are_codes(x):
            raise ValueError(f"{what} must hold codes of {self}; it holds other values or another type ({x.dtype})")

    def _are_codes(self, x: Shaped[Tensor, "*batch d"]) -> bool:
        """Whether every element has a value that an element of a hypervector can have."""
        return bool(x.isfinite().all())
