"""Products and norms of hypervectors, exact wherever the type is an integer.

The type alone says which path runs: boolean vectors count as -1 / +1, integer products are exact, complex
ones are Hermitian and give their real part. No value is looked at, so nothing here stalls a GPU or breaks a
graph.
"""

import torch
from jaxtyping import Shaped
from torch import Tensor

from torchvsa.blocks import by_blocks
from torchvsa.operators import integer_product, product


def signed(x: Shaped[Tensor, "*s"]) -> Shaped[Tensor, "*s"]:
    """Bits as votes (False: +1, True: -1, so that XOR is a product); any other tensor as it is."""
    return 1 - 2 * x.to(torch.int8) if x.dtype == torch.bool else x


def is_integer(x: Tensor) -> bool:
    """Whether a tensor holds integers (bits included), whose sums and products are exact."""
    return not (x.is_floating_point() or x.is_complex())


def real_parts(x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch e"]:
    """Complex vectors as real ones with the same products, real and imaginary parts in turns; any other as they are."""
    return torch.view_as_real(x.resolve_conj()).flatten(-2) if x.is_complex() else x


_FEW = 16
"""Rows up to which it does not pay to square them in a type of their own."""


def dots(queries: Shaped[Tensor, "*batch d"], items: Shaped[Tensor, "k d"]) -> Shaped[Tensor, "*batch k"]:
    """The inner product of each query with each item.

    Integers: exact (int8 by int8 accumulates in int32, anything wider in float64, exact below 2^53).
    Complex: the real part of the Hermitian product.
    """
    a, b = signed(queries), signed(items)
    if a.is_complex() or b.is_complex():
        # Re<a, b> as one real product over interleaved parts: half the work of a complex product.
        wide = torch.promote_types(a.dtype, b.dtype)
        return product(real_parts(a.to(wide)), real_parts(b.to(wide)))
    int8 = a.dtype == torch.int8 and b.dtype == torch.int8 and not torch.compiler.is_exporting()
    if int8 and (a.device.type == "cuda" or (a.device.type == "cpu" and a.shape[-1] > 1)):
        # Units for int8; those of a CPU answer nonsense where d = 1.
        return integer_product(a.reshape(-1, a.shape[-1]), b).reshape(*a.shape[:-1], len(b))
    if is_integer(a) or is_integer(b):
        # A float accumulator beside integer codes stays in its own type: it is exact while it holds integers.
        wide = torch.float64 if is_integer(a) and is_integer(b) else torch.promote_types(a.dtype, b.dtype)
    else:
        wide = torch.promote_types(a.dtype, b.dtype)
    return product(a.to(wide), b.to(wide))


def paired_dots(a: Shaped[Tensor, "*#batch d"], b: Shaped[Tensor, "*#batch d"]) -> Shaped[Tensor, "*#batch"]:
    """The inner product of a with b, element by element of the (broadcast) batch; exact for integers."""
    a, b = signed(a), signed(b)
    if a.is_complex() or b.is_complex():
        return (a * b.conj()).real.sum(-1)
    if is_integer(a) and is_integer(b):
        # A product of two int8 fits int16, which moves a quarter of the bytes.
        wide = torch.int16 if a.dtype == b.dtype == torch.int8 else torch.int64
        return (a.to(wide) * b).sum(-1, dtype=torch.int64)
    return (a * b).sum(-1)


def norms(x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch"]:
    """Euclidean length in float64 (integers: the root of an exact sum), with a gradient of 0 at the zero vector."""
    if x.dtype == torch.int8 and x.dim() == 2 and not torch.compiler.is_exporting() and len(x) > _FEW:
        return root(by_blocks(_int8_squares, x, row_bytes=4 * x.shape[-1]))
    return root(paired_dots(x, x))


def _int8_squares(x: Shaped[Tensor, "rows d"]) -> Shaped[Tensor, "rows"]:
    # Floats are summed fastest, and are exact below 2^24, which 1,023 squares of int8 cannot reach.
    squares = x.to(torch.float32)
    squares *= squares
    return torch.stack([part.sum(-1).to(torch.float64) for part in squares.split(1023, -1)]).sum(0)


def root(squares: Shaped[Tensor, "*s"]) -> Shaped[Tensor, "*s"]:
    """The square root in float64, with a gradient of 0 at 0."""
    squares = squares.to(torch.float64)
    return torch.where(squares > 0, torch.where(squares > 0, squares, 1.0).sqrt(), 0.0)


def divide(values: Shaped[Tensor, "*s"], lengths: Shaped[Tensor, "*t"]) -> Shaped[Tensor, "*s"]:
    """`values / lengths`, and 0 where the length is 0: a zero vector is similar to nothing."""
    return torch.where(lengths > 0, values / torch.where(lengths > 0, lengths, 1.0), 0.0)


def scaled(products: Shaped[Tensor, "*batch"], lengths: Shaped[Tensor, "*#batch"]) -> Shaped[Tensor, "*batch"]:
    """`divide` for products with vectors of these lengths: those with a zero vector are 0 already, so one pass does."""
    return products / torch.where(lengths > 0, lengths, 1.0)
