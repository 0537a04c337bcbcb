"""Sparse distributed memory."""

from statistics import NormalDist

import torch
from jaxtyping import Float, Shaped
from torch import Tensor

from torchvsa._blocks import by_blocks
from torchvsa._checks import positive_integer, whole_number
from torchvsa._memory_limit import require_memory
from torchvsa._numerics import as_bipolar, inner_products
from torchvsa.memory.attractor import BipolarAttractor, signs


class SparseDistributedMemory(BipolarAttractor):
    """Random addresses, each with a counter per element; an item is added to the counters of all addresses near it.

    Reading sums the counters of the addresses within the radius of the query, and takes the signs; the result is read
    again until it no longer changes. An element that sums to 0 keeps its state.

    The items are kept too, because an index needs them; `retrieve` does not use them.

    Args:
        items: `[K, d]` of -1 / +1, or bits; written at themselves.
        locations: The number of addresses, M.
        radius: The Hamming distance within which an address is active; by default such that a share (2 M K)^(-1/3)
            of the addresses is active, which Kanerva (1993) gives as the best.
        steps: The largest number of readings.
        seed: Decides the addresses.

    Raises:
        ValueError: For other items, and if addresses and counters, 5 M d bytes, do not fit into memory.

    Source: Kanerva 1988, "Sparse distributed memory".
    """

    addresses: Tensor
    counters: Tensor

    def __init__(
        self,
        items: Shaped[Tensor, "k d"],
        locations: int = 2000,
        radius: int | None = None,
        steps: int = 10,
        seed: int = 0,
    ) -> None:
        super().__init__(items)
        count, dim = items.shape
        self.locations = positive_integer("locations", locations)
        self.steps = positive_integer("steps", steps)
        share = (2 * self.locations * max(count, 2)) ** (-1 / 3)
        best = round(dim / 2 + NormalDist().inv_cdf(min(share, 0.5)) * dim**0.5 / 2)
        self.radius = best if radius is None else whole_number(radius, "radius is a whole number")
        require_memory(
            13 * self.locations * dim,
            f"a sparse distributed memory of {self.locations:,} locations at d = {dim:,}",
            "take fewer locations or dimensions",
        )
        generator = torch.Generator().manual_seed(seed)
        bits = torch.randint(2, (self.locations, dim), generator=generator, dtype=torch.int8)
        self.register_buffer("addresses", (1 - 2 * bits).to(items.device))
        self.register_buffer("counters", torch.zeros(self.locations, dim, dtype=torch.int32, device=items.device))
        self.write(items)

    def write(self, items: Shaped[Tensor, "k d"]) -> None:
        """Add each of `[K, d]` to the counters of the addresses near it; it has no index unless it is in `items`."""
        for part in signs(as_bipolar(items)).split(1024):  # whole numbers below 2^24, exact in float32
            self.counters += (self._active(part).T @ part).to(torch.int32)

    def _active(self, states: Float[Tensor, "batch d"]) -> Float[Tensor, "batch locations"]:
        """1 for addresses within the radius, else 0. Unknown elements of a query count as half a difference."""
        products = inner_products(states.to(torch.int8), self.addresses)
        return (products >= states.shape[-1] - 2 * self.radius).to(torch.float32)

    def _completed(self, rows: Shaped[Tensor, "batch d"]) -> Shaped[Tensor, "batch d"]:
        return by_blocks(self._read, rows, row_bytes=8 * (self.locations + 2 * rows.shape[-1]), block_bytes=2**25)

    def _read(self, rows: Shaped[Tensor, "batch d"]) -> Float[Tensor, "batch d"]:
        state, counters = signs(rows), self.counters.to(torch.float64)
        for _ in range(self.steps):
            total = self._active(state).to(torch.float64) @ counters
            new = torch.where(total == 0, state, total.sign().to(torch.float32))
            if torch.equal(new, state):
                break
            state = new
        return state
