"""A threshold per dimension: records whose elements each ask about a few sensors."""

import torch
from jaxtyping import Int, Int64, Shaped
from torch import Tensor, nn

from torchvsa._checks import whole_number
from torchvsa._memory_limit import require_memory
from torchvsa.architectures import VSA
from torchvsa.blocks import by_blocks
from torchvsa.encoding.indices import check_indices

_CONSTANT = 1 / 16
"""The share of dimensions that ask nothing: few, and enough to carry a constant answer."""

_BYTES = 16
"""What comparing one index for one dimension takes: a copy of it in int64, and some truth values."""
_BLOCK_BYTES = 2**28


class Thresholds(nn.Module):
    """Encode rows of `n` values, each an index into `levels`, by a few comparisons per dimension.

    Each dimension draws 1 to `subset` sensors, and for each of them a threshold and a side of it. It holds a
    random element, negated where all of its sensors lie on their sides: an axis-aligned box, as the leaf of
    a tree is, but drawn blindly. With one sensor the kernel is that of thermometer codes, which falls linearly from 1
    to almost -1: one dimension in 16 asks nothing, or a program would have to answer one end of the range with
    the opposite of the other.

    An index of -1 is *unobserved*, and not asked: the sensors that are left decide, and a dimension without any is not
    negated.

    Unlike `Record` it keeps no table of values, so `levels` may be as many as there are readings: it holds 3 · subset
    · d numbers. The thresholds of a sensor are spread evenly, so that few dimensions serve it well.

    Source: thermometer codes, Kleyko et al. 2018; random features of boxes, as in random forests (Breiman 2001),
    without their labels.
    """

    start: Tensor
    sensor: Tensor
    threshold: Tensor
    above: Tensor

    def __init__(
        self,
        vsa: VSA,
        sensors: int,
        levels: int,
        subset: int | None = None,
        generator: torch.Generator | None = None,
    ) -> None:
        super().__init__()
        sensors, levels = whole_number(sensors, "sensors is a number"), whole_number(levels, "levels is a number")
        if sensors < 1 or levels < 1:
            raise ValueError(f"a record needs at least one sensor and one level; got {sensors} and {levels}")
        if subset is not None and subset < 1:
            raise ValueError(
                f"subset is the largest number of sensors bound in one dimension, at least 1; got {subset}"
            )
        self.vsa, self.sensors, self.levels = vsa, sensors, levels
        most = min(subset or sensors, sensors)
        # An order of all sensors is sorted in float32 and int64, and three buffers are made in two steps.
        require_memory(
            max(28 * sensors, 48 * most) * vsa.dim + 2 * vsa.row_bytes,
            f"thresholds of {sensors} sensors, up to {most} in each of d = {vsa.dim} dimensions",
            "take fewer dimensions or a smaller subset",
        )
        self.register_buffer("start", vsa.random(generator=generator))
        sizes = torch.randint(1, most + 1, (vsa.dim,), generator=generator)
        constant = torch.rand(vsa.dim, generator=generator) < _CONSTANT
        chosen = torch.rand(vsa.dim, sensors, generator=generator).argsort(-1)[:, :most].T.contiguous()
        # Where a dimension has fewer sensors, its first one stands in their places too.
        spare = torch.arange(most)[:, None] >= sizes
        threshold = torch.zeros(most, vsa.dim, dtype=torch.int64)
        for place in range(most):
            for sensor in range(sensors):
                held = ((chosen[place] == sensor) & ~spare[place] & ~constant).nonzero()[:, 0]
                held = held[torch.randperm(len(held), generator=generator)]
                # The i-th of k dimensions passes somewhere in the i-th of k equal stretches of the range.
                spread = (torch.arange(len(held)) + torch.rand(len(held), generator=generator)) / max(len(held), 1)
                threshold[place, held] = (spread * (levels - 1)).long().clamp(max=max(levels - 2, 0))
        above = torch.rand(most, vsa.dim, generator=generator) < 0.5
        # Nothing lies above the highest level.
        threshold[0, constant], above[0, constant] = levels - 1, True
        self.register_buffer("sensor", torch.where(spare, chosen[0], chosen))
        self.register_buffer("threshold", torch.where(spare, threshold[0], threshold))
        self.register_buffer("above", torch.where(spare, above[0], above))

    @staticmethod
    def layout(vsa: VSA, sensors: int, subset: int | None = None) -> dict[str, tuple[torch.dtype, tuple]]:
        """The types and shapes of the tensors of such an encoder, found without making it."""
        shape = min(subset or sensors, sensors), vsa.dim
        layout = {"start": (vsa.dtype, (vsa.dim,)), "sensor": (torch.int64, shape), "threshold": (torch.int64, shape)}
        return layout | {"above": (torch.bool, shape)}

    def check(self) -> None:
        """Raise `ValueError` naming the tensor if one asks about what is not there."""
        self.vsa.check_codes(self.start, "start")
        for name, end in (("sensor", self.sensors), ("threshold", self.levels)):
            tensor = getattr(self, name)
            if not ((tensor >= 0) & (tensor < end)).all():
                raise ValueError(f"{name} must hold numbers in [0, {end})")

    def forward(self, indices: Int[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        """Encode each row of indices in `[-1, levels)`; -1 is *unobserved*.

        Raises `ShapeError` unless the rows have one index per sensor, and `ValueError` for an index outside of that
        range or of a type other than a signed integer or uint8. Values are checked on a CPU; another device asserts
        them without being waited for, and graphs and `vmap` do not check them.
        """
        # Blocks bound what the comparisons of whole columns take beside the answer.
        rows = check_indices(indices, self.sensors, self.levels)
        return by_blocks(self._encode, rows, row_bytes=_BYTES * self.vsa.dim, block_bytes=_BLOCK_BYTES)

    def _encode(self, indices: Int64[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        # Dimension by dimension: whole columns are copied and compared far faster than rows are gathered.
        columns = indices.T.contiguous()
        missing = columns < 0
        against = blind = None
        for sensor, threshold, above in zip(self.sensor, self.threshold, self.above, strict=True):
            unseen = missing.index_select(0, sensor)
            side = columns.index_select(0, sensor) > threshold[:, None]
            apart = (side ^ above[:, None]) & ~unseen
            against = apart if against is None else against | apart
            blind = unseen if blind is None else blind & unseen
        assert against is not None
        assert blind is not None
        negated = ~(against | blind).T.contiguous()
        if self.start.dtype == torch.bool:
            return self.start ^ negated
        return torch.where(negated, -self.start, self.start)
