"""Products and norms of hypervectors, exact wherever the type is an integer.

The dtype selects the path: boolean vectors count as -1 / +1, integer products are exact, and complex products are the
real part of the Hermitian product. Floats whose squares would overflow or vanish are scaled by a power of two. A CPU
checks the lengths first; in graphs and on other devices, where reading values breaks or stalls, all floats are scaled.
The results are the same.
"""

import torch
from jaxtyping import Shaped
from torch import Tensor

from torchvsa._blocks import by_blocks
from torchvsa._checks import readable, type_bound
from torchvsa._kernels.integer_products import FLOAT_TERMS, integer_products


def as_bipolar(x: Shaped[Tensor, "*s"]) -> Shaped[Tensor, "*s"]:
    """Convert bits to int8 (False: +1, True: -1, so that XOR is a product); return other tensors unchanged."""
    return 1 - 2 * x.to(torch.int8) if x.dtype == torch.bool else x


def is_integer(x: Tensor) -> bool:
    """Whether a tensor holds integers or bits, whose sums and products are exact."""
    return not (x.is_floating_point() or x.is_complex())


def real_parts(x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch e"]:
    """View complex vectors as interleaved real ones with the same products; return others unchanged."""
    return torch.view_as_real(x.resolve_conj()).flatten(-2) if x.is_complex() else x


_MAX_PLAIN_ROWS = 16
"""Up to this number of rows, squaring int8 in float32 does not pay."""


def inner_products(queries: Shaped[Tensor, "*batch d"], items: Shaped[Tensor, "k d"]) -> Shaped[Tensor, "*batch k"]:
    """The inner product of each query with each item.

    Integers: int8 by int8 is exact, in int32, or in int64 from d = 131,041 on. Wider types are summed in float64, exact
    while sums of absolute products stay below 2^53.
    Integers by floats: in the type of the floats, at least float32 for int8 and float64 for wider integers.
    Floats: in the wider of both types, at least float32.
    Complex: the real part of the Hermitian product.
    """
    a, b = as_bipolar(queries), as_bipolar(items)
    if a.is_complex() or b.is_complex():
        # Re<a, b> as one real product over interleaved parts: half the work of a complex product.
        wide = torch.promote_types(a.dtype, b.dtype)
        return real_parts(a.to(wide)) @ real_parts(b.to(wide)).T
    if a.dtype == torch.int8 and b.dtype == torch.int8 and not torch.compiler.is_exporting():
        return integer_products(a.reshape(-1, a.shape[-1]), b).reshape(*a.shape[:-1], len(b))
    wide = torch.promote_types(torch.promote_types(a.dtype, b.dtype), torch.float32)
    if is_integer(a) and is_integer(b):
        wide = torch.float64
    elif any(is_integer(x) and x.dtype.itemsize > 2 for x in (a, b)):
        wide = torch.float64  # float32 does not hold every int32
    return a.to(wide) @ b.to(wide).T


def paired_products(a: Shaped[Tensor, "*#batch d"], b: Shaped[Tensor, "*#batch d"]) -> Shaped[Tensor, "*#batch"]:
    """The inner product of a with b, element by element of the (broadcast) batch.

    Integers: exact, in int64, if their types and d prove that the sum fits (for example int8 by int32). Otherwise in
    float64: the exact sum, rounded once, if it is below 2^62, else a sum in float64.
    Integers wider than int16 by floats: the integers count as float64. Half precision counts as float32.
    """
    a, b = widened(a), widened(b)
    if a.is_complex() or b.is_complex():
        return (a * b.conj()).real.sum(-1)
    if not (is_integer(a) and is_integer(b)):
        a, b = (x.to(torch.float64) if is_integer(x) and x.dtype.itemsize > 2 else x for x in (a, b))
        return (a * b).sum(-1)
    # A product of two int8 numbers fits int16, a quarter of the bytes of int64.
    wide = torch.int16 if a.dtype == b.dtype == torch.int8 else torch.int64
    whole = (a.to(wide) * b).sum(-1, dtype=torch.int64)
    if type_bound(a.dtype) * type_bound(b.dtype) * max(a.shape[-1], b.shape[-1]) < 2**63:
        return whole
    # Integer sums that wrap around on the way are right if the result fits. The estimate says whether it does.
    estimate = (a.to(torch.float64) * b).sum(-1)
    return torch.where(estimate.abs() < 2.0**62, whole.to(torch.float64), estimate)


def norms(x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch"]:
    """Euclidean length in float64, with a gradient of 0 at the zero vector.

    Integers: the square root of `paired_products`. Floats: correct at any scale; NaN if an element is NaN or infinite.
    """
    if x.dtype == torch.int8 and x.dim() == 2 and not torch.compiler.is_exporting() and len(x) > _MAX_PLAIN_ROWS:
        return safe_sqrt(by_blocks(_int8_squares, x, row_bytes=4 * x.shape[-1]))
    _, lengths, unit = in_range(x)
    return lengths if unit is None else lengths * unit[..., 0].to(torch.float64)


def cosines(a: Shaped[Tensor, "*#batch d"], b: Shaped[Tensor, "*#batch d"]) -> Shaped[Tensor, "*#batch"]:
    """The cosine of a and b, element by element of the (broadcast) batch, in float64; independent of scale."""
    (a, a_lengths, _), (b, b_lengths, _) = in_range(a), in_range(b)
    return safe_divide(paired_products(a, b), a_lengths * b_lengths)


def widened(x: Shaped[Tensor, "*s"]) -> Shaped[Tensor, "*s"]:
    """Convert bits to -1 / +1 and half precision to float32; return other tensors unchanged."""
    return x.to(torch.float32) if x.dtype in (torch.float16, torch.bfloat16) else as_bipolar(x)


_SHORTEST, _LONGEST = 2.0**-30, 2.0**50
"""Between these lengths, squares and products of two vectors neither overflow in float32 nor lose digits."""


def ordinary(lengths: Shaped[Tensor, "*batch"]) -> bool:
    """Whether all lengths are within `_SHORTEST` and `_LONGEST`; False where values are not readable."""
    if not readable(lengths) or lengths.numel() == 0:
        return lengths.numel() == 0
    low, high = torch.aminmax(lengths.detach())
    return float(low) > _SHORTEST and float(high) < _LONGEST


def units(x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch 1"]:
    """A power of two per vector; divided by it, the largest absolute element is from 1 to 2.

    Dividing by a power of two does not round. 1 for a zero vector, NaN if an element is NaN or infinite.
    """
    largest = x.detach().abs().amax(-1, keepdim=True)
    if torch.compiler.is_exporting():
        power = torch.exp2(torch.log2(largest).floor())  # ONNX lacks `frexp`, which is exact
    else:
        power = largest / (2 * torch.frexp(largest).mantissa)
    return torch.where(largest == 0, torch.ones_like(power), power)


def _lengths(x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch"]:
    if x.dim() != 2:
        return safe_sqrt(paired_products(x, x))
    # In blocks, the squares stay in the cache.
    return by_blocks(
        lambda rows: safe_sqrt(paired_products(rows, rows)), x, row_bytes=2 * x.shape[1] * x.dtype.itemsize
    )


def in_range(
    x: Shaped[Tensor, "*batch d"],
) -> tuple[Shaped[Tensor, "*batch d"], Shaped[Tensor, "*batch"], Shaped[Tensor, "*batch 1"] | None]:
    """Scale vectors so that their squares neither overflow nor vanish.

    Returns the vectors, their lengths in float64, and the `units` that divided them: None if nothing was scaled, as for
    integers and floats of ordinary length (which are only `widened`).
    """
    x = widened(x)
    if is_integer(x):
        return x, safe_sqrt(paired_products(x, x)), None
    if readable(x) and ordinary(lengths := _lengths(x)):
        return x, lengths, None
    unit = units(x)
    # Dividing complex numbers would multiply them, and the products could vanish.
    x = torch.view_as_complex(torch.view_as_real(x.resolve_conj()) / unit[..., None]) if x.is_complex() else x / unit
    return x, safe_sqrt(paired_products(x, x)), unit


def in_units(x: Shaped[Tensor, "*batch d"]) -> tuple[Shaped[Tensor, "*batch d"], Shaped[Tensor, "*batch 1"] | None]:
    """Scale floats as `in_range` does, and return their `units` too; return integers and bits unchanged."""
    if is_integer(x):
        return x, None
    x, _, unit = in_range(x)
    return x, unit


def _int8_squares(x: Shaped[Tensor, "rows d"]) -> Shaped[Tensor, "rows"]:
    # Floats are summed fastest.
    squares = x.to(torch.float32)
    squares *= squares
    return torch.stack([part.sum(-1).to(torch.float64) for part in squares.split(FLOAT_TERMS, -1)]).sum(0)


def safe_sqrt(squares: Shaped[Tensor, "*s"]) -> Shaped[Tensor, "*s"]:
    """The square root in float64, with a gradient of 0 at 0."""
    squares = squares.to(torch.float64)
    return torch.where(squares == 0, 0.0, torch.where(squares == 0, 1.0, squares).sqrt())


def safe_divide(values: Shaped[Tensor, "*s"], lengths: Shaped[Tensor, "*t"]) -> Shaped[Tensor, "*s"]:
    """`values / lengths`, or 0 if the length is 0: a zero vector is similar to nothing."""
    return torch.where(lengths == 0, 0.0, values / torch.where(lengths == 0, 1.0, lengths))


def over_lengths(products: Shaped[Tensor, "*batch"], lengths: Shaped[Tensor, "*#batch"]) -> Shaped[Tensor, "*batch"]:
    """`safe_divide` for products with vectors of these lengths, which are 0 already for zero vectors."""
    return products / torch.where(lengths == 0, 1.0, lengths)
