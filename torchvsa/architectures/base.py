"""What every Vector Symbolic Architecture shares."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import reduce
from typing import ClassVar

import torch
from jaxtyping import Bool, Float, Int, Shaped
from torch import Tensor

from torchvsa._blocks import by_blocks
from torchvsa._checks import INTEGERS, whole_number
from torchvsa._kernels.look_up import entries
from torchvsa._kernels.rotation import roll_rows
from torchvsa._memory_limit import require_memory
from torchvsa._numerics import as_bipolar, cosines, is_integer, norms
from torchvsa.architectures._sums import check_weights, integer_sum, stacked, weighted
from torchvsa.errors import ShapeError
from torchvsa.readout import Readout

Summands = Shaped[Tensor, "..."] | Sequence[Shaped[Tensor, "..."]]
"""Hypervectors to bundle: stacked in one tensor, or in a list or tuple."""
_DIM = "dim is the number of elements of a hypervector, a positive integer"


class VSA(ABC):
    """A space of hypervectors of `dim` numbers, and the operations on them.

    Hypervectors are plain tensors `[..., d]`; leading dimensions are batches. A **raw accumulator** is what
    `superpose` returns: a sum that has not been normalised yet. `bind`, `unbind`, `permute` and `similarity`
    accept it in place of a hypervector, which keeps them linear; `normalize` turns it into a hypervector.

    A new architecture implements `random`, `identity`, `bind`, `unbind` and `normalize`, names itself, and is
    listed in `torchvsa.architectures.ARCHITECTURES`.
    """

    name: str
    elementwise: ClassVar[bool] = True
    """Whether `bind` acts on every dimension by itself."""
    commutative: ClassVar[bool] = True
    """Whether `bind(a, b)` equals `bind(b, a)`."""
    bilinear: ClassVar[bool] = True
    """Whether `bind` and `unbind` are linear in the key as well, so that programs can be folded into items."""
    self_inverse: bool = False
    """Whether `bind` with the same key undoes itself."""
    negatable: ClassVar[bool] = True
    """Whether hypervectors have a `negative`."""
    sparse: ClassVar[bool] = False
    """Whether few elements of a hypervector differ from 0."""
    breaks_ties: bool = False
    """Whether `bundle` needs the voters themselves, to decide split votes, and not just their sum."""

    def __init__(self, dim: int, dtype: torch.dtype) -> None:
        self.dim = whole_number(dim, _DIM)
        if self.dim < 1:
            raise ValueError(f"{_DIM}; got {dim!r}")
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

    # -- what an architecture defines ------------------------------------------------------------------

    @abstractmethod
    def random(
        self, *shape: int, generator: torch.Generator | None = None, device: torch.device | str | None = None
    ) -> Shaped[Tensor, "*shape d"]:
        """Independent random hypervectors `[*shape, d]`.

        They are drawn on the generator's device (the same seed gives the same bits wherever they go) and
        moved to `device`. Without a generator PyTorch's global one is used.
        """

    @abstractmethod
    def identity(self) -> Shaped[Tensor, "d"]:
        """The hypervector that leaves others as they are when bound."""

    @abstractmethod
    def bind(self, a: Shaped[Tensor, "*#batch d"], b: Shaped[Tensor, "*#batch d"]) -> Shaped[Tensor, "*#batch d"]:
        """Join two hypervectors into one that is dissimilar to both; `b` is the key.

        Linear in `a`, so that it distributes over raw accumulators. Whether it is in `b` too, and whether it commutes,
        the architecture says (`bilinear`, `commutative`).
        """

    @abstractmethod
    def unbind(
        self, bound: Shaped[Tensor, "*#batch d"], key: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """Undo `bind`: `unbind(bind(a, key), key)` is (or resembles) `a`. Linear in `bound`."""

    @abstractmethod
    def normalize(self, raw: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """Turn a raw accumulator into a hypervector of this architecture."""

    # -- what follows from it --------------------------------------------------------------------------

    def negative(self, x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
        """The hypervector that is as unlike `x` as can be: similarity -1."""
        if not self.negatable:
            raise ValueError(f"{self.name} has no negative hypervectors")
        self.check(x, "x")
        return ~x if x.dtype == torch.bool else -x

    @property
    def frequencies(self) -> int | None:
        """How many angles `from_angles` takes; None for an architecture without a spectrum."""
        return None

    def from_angles(self, angles: Float[Tensor, "*batch frequencies"]) -> Shaped[Tensor, "*batch d"]:
        """The hypervector whose spectrum has these angles, and magnitude 1: what `FractionalPower` is made of."""
        raise ValueError(f"{self.name} has no spectrum; fractional powers need FHRR or HRR")

    def permute(
        self, x: Shaped[Tensor, "*#batch d"], shifts: int | Int[Tensor, "*#batch"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """Rotate the elements to the right: element `i` moves to `(i + shift) mod d`.

        `shifts` is one number, or a tensor with one for each hypervector (any shape that broadcasts with the
        batch). Negative shifts rotate to the left. Raises `ValueError` unless shifts are whole numbers, of a signed
        integer type or uint8.
        """
        self.check(x, "x")
        if not isinstance(shifts, Tensor):
            shift = whole_number(shifts, "shifts are a whole number or a tensor of integers")
            return torch.roll(x, shift % self.dim, -1)
        if shifts.dtype not in INTEGERS:
            raise ValueError(f"shifts are a whole number or a tensor of integers; got a tensor of {shifts.dtype}")
        return self._permuted(x, shifts)

    def _permuted(self, x: Shaped[Tensor, "*#batch d"], shifts: Int[Tensor, "*#batch"]) -> Shaped[Tensor, "*#batch d"]:
        """`permute` with a tensor of shifts."""
        if shifts.shape != x.shape[:-1]:
            batch = torch.broadcast_shapes(x.shape[:-1], shifts.shape)
            x, shifts = x.expand(*batch, self.dim), shifts.expand(batch)
        # Small types cannot hold every shift up to d, nor any type the negative of its lowest number.
        starts = (-shifts.to(torch.int64).remainder(self.dim)).remainder(self.dim)
        # Rows are written twice on the way.
        rows = by_blocks(
            roll_rows, x.reshape(-1, self.dim), starts.reshape(-1), row_bytes=4 * self.dim * x.element_size()
        )
        return rows.reshape(x.shape)

    def superpose(
        self, xs: Summands, dim: int = -2, weights: Shaped[Tensor, "..."] | None = None
    ) -> Shaped[Tensor, "..."]:
        """Sum `k` hypervectors over dimension `dim` into a raw accumulator.

        Args:
            xs: A tensor, `[..., k, d]` for the default `dim`, or a list or tuple of `k` tensors `[..., d]`.
            dim: The dimension to sum over.
            weights: One number per summand: `[k]`, or `[*batch, k]` for one in each batch element too.

        Integers (bits count as votes) with integer weights give an exact sum in int32. Integers with float weights give
        a sum in the weights' type, float32 at least; other summands keep their own type.

        Raises:
            ShapeError: `dim` is the hypervector dimension, or the weights do not fit.
            ValueError: The sum does not fit int32, an intermediate product does not fit int64, or weights are NaN or
                infinite. Where looking at values would stall or break something (on another device than the CPU, in
                compiled and exported graphs, under `vmap`) only types are checked: there a sum of int8 codes fits if
                `k` times the largest absolute weight is below 2^24, and one that does not fit wraps around.
        """
        xs, dim = stacked(xs, dim)
        self.check(xs, "xs")
        if xs.dim() < 2 or dim in (-1, xs.dim() - 1):
            raise ShapeError(
                f"bundling sums over one dimension beside the hypervectors' own; got shape {tuple(xs.shape)} and "
                f"dim={dim}, expected e.g. [..., k, {self.dim}] and dim=-2"
            )
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
        """Superpose `k` hypervectors into one that is similar to each of them: sum in one step, then normalise.

        Order-free, but not associative: bundle all at once, or keep a raw accumulator.
        Arguments as in `superpose`.
        """
        return self.normalize(self.superpose(xs, dim, weights))

    def _bundle_pair(
        self, a: Shaped[Tensor, "*#batch d"], b: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """`bundle` of `a` and `b`, element by element of the (broadcast) batch."""
        return self.bundle([a, b])

    def _bundle_entries(
        self, table: Shaped[Tensor, "k entries d"], places: Int[Tensor, "batch k"]
    ) -> Shaped[Tensor, "batch d"]:
        """`bundle` of the hypervectors `table[i, places[:, i]]`, where it needs only their sum (see `breaks_ties`)."""
        wide = self._type_of_sums(len(table))

        def bundled(rows: Tensor) -> Tensor:
            vectors = entries(table, rows)
            return self.normalize(reduce(Tensor.add_, vectors, next(vectors).to(wide)))

        return by_blocks(bundled, places, row_bytes=self.dim * (wide.itemsize + self.dtype.itemsize))

    def _type_of_sums(self, count: int) -> torch.dtype:
        """The smallest type that holds sums of so many hypervectors, which is the fastest to add."""
        return self.dtype if count < 128 else self.accumulator  # integer codes are -1, 0 and +1

    def _bind_entries(
        self, table: Shaped[Tensor, "k entries d"], places: Int[Tensor, "batch k"]
    ) -> Shaped[Tensor, "batch d"]:
        """The hypervectors `table[i, places[:, i]]`, bound one after the other."""
        return by_blocks(lambda rows: reduce(self.bind, entries(table, rows)), places, row_bytes=2 * self.row_bytes)

    def similarity(self, a: Shaped[Tensor, "*#batch d"], b: Shaped[Tensor, "*#batch d"]) -> Float[Tensor, "*#batch"]:
        """Cosine of `a` and `b`, broadcast over their batches; a zero vector has 0 with everything.

        It does not depend on their lengths, however large or small. NaN where an element is NaN or infinite.
        """
        self.check(a, "a")
        self.check(b, "b")
        return cosines(a, b).to(torch.float32)

    def positive(self, x: Shaped[Tensor, "*batch d"]) -> Bool[Tensor, "*batch d"]:
        """The elements that count as > 0, from which a self-derived shift takes its width."""
        return (x.real if x.is_complex() else as_bipolar(x)) > 0

    def unbundle(
        self, bundled: Shaped[Tensor, "*#batch d"], known: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """Estimate `x` from `bundle([x, known])`, given `known`."""
        return bundled - known

    def fold(
        self, program: Shaped[Tensor, "*#batch d"], item: Shaped[Tensor, "*#batch d"]
    ) -> Shaped[Tensor, "*#batch d"]:
        """The vector to compare keys with: `<fold(program, item), key> = <unbind(program, key), item>`.

        `readout` needs it where `bind` is bilinear. Where it commutes, this is `unbind(program, item)`; an architecture
        that does not commute implements its own.
        """
        if not self.commutative:
            raise NotImplementedError(f"{self.name} is bilinear and does not commute; it must implement fold")
        return self.unbind(program, item)

    def readout(self, programs: Shaped[Tensor, "*b d"], items: Shaped[Tensor, "K d"]) -> Readout:
        """Ask one program `[d]`, or a stack `[b, d]`, for items `[K, d]`: see `Readout`."""
        return Readout(self, programs, items)

    def unbound_norm(self, program: Shaped[Tensor, "d"], keys: Shaped[Tensor, "*batch d"]) -> Float[Tensor, "*batch"]:
        """`norms(unbind(program, key))` for each key, in float64, without building the vectors where that pays."""
        return norms(self.unbind(program, keys))

    def require_room(self, shape: Sequence[int], element_bytes: int, generator: torch.Generator | None = None) -> None:
        """Raise `ValueError` unless hypervectors `[*shape, d]` fit into memory at so many bytes per element."""
        if not torch.compiler.is_compiling() and (generator is None or generator.device.type == "cpu"):
            count = math.prod(shape)
            require_memory(
                count * self.dim * element_bytes,
                f"making {count} hypervectors of d = {self.dim} elements",
                "take fewer dimensions, or some hypervectors at a time",
            )

    def check(self, x: Tensor, argument: str) -> None:
        """Raise `ShapeError` unless `x` holds hypervectors of this dimension."""
        if x.dim() == 0 or x.shape[-1] != self.dim:
            raise ShapeError(f"{argument} must end in d = {self.dim} elements; got shape {tuple(x.shape)}")

    def check_codes(self, x: Tensor, what: str) -> None:
        """Raise `ValueError` unless `x` holds hypervectors as `random` draws them, or parts of them put together."""
        self.check(x, what)
        if x.dtype != self.dtype or not self._are_codes(x):
            raise ValueError(f"{what} must hold codes of {self}; it holds other values, or another type ({x.dtype})")

    def _are_codes(self, x: Shaped[Tensor, "*batch d"]) -> bool:
        """Whether the elements are such as a hypervector can have."""
        return bool(x.isfinite().all())
