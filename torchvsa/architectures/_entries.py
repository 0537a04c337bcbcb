"""Look up one hypervector per codebook and combine them, without a copy of all that was looked up."""

from functools import reduce

from jaxtyping import Int, Shaped
from torch import Tensor

from torchvsa._blocks import by_blocks
from torchvsa._kernels.look_up import entries, gather_reduce
from torchvsa.architectures.base import VSA


def bundle_entries(
    vsa: VSA, table: Shaped[Tensor, "k entries d"], indices: Int[Tensor, "batch k"]
) -> Shaped[Tensor, "batch d"]:
    """`vsa.bundle` of the hypervectors `table[i, indices[:, i]]`, for architectures that need only their sum.

    Those with `breaks_ties` need the summands too.
    """
    # Integer codes are -1, 0 and +1. The smallest type that holds their sum is the fastest to add.
    wide = vsa.dtype if len(table) < 128 else vsa.accumulator
    if vsa.clips and table.dtype == wide:
        return gather_reduce(table, indices, Tensor.add_, clip=True)

    def bundled(rows: Tensor) -> Tensor:
        vectors = entries(table, rows)
        return vsa.normalize(reduce(Tensor.add_, vectors, next(vectors).to(wide)))

    return by_blocks(bundled, indices, row_bytes=vsa.dim * (wide.itemsize + vsa.dtype.itemsize))


def bind_entries(
    vsa: VSA, table: Shaped[Tensor, "k entries d"], indices: Int[Tensor, "batch k"]
) -> Shaped[Tensor, "batch d"]:
    """The hypervectors `table[i, indices[:, i]]`, bound one after the other."""
    if vsa.in_place is not None:
        return gather_reduce(table, indices, getattr(Tensor, vsa.in_place))
    return by_blocks(lambda rows: reduce(vsa.bind, entries(table, rows)), indices, row_bytes=2 * vsa.row_bytes)
