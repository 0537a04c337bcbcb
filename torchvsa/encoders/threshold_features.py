"""A few thresholds per dimension: conditions whose elements each ask about a few sensors."""

from collections.abc import Sequence
from typing import Any

import torch
from jaxtyping import Float, Float64, Int64, Shaped
from torch import Tensor

from torchvsa._memory_limit import require_memory
from torchvsa.architectures import VSA
from torchvsa.encoders.base import Encoder, binned, whole
from torchvsa.part import Layout

_CONSTANT = 1 / 16
"""The share of dimensions that ask nothing: few, and enough to carry a constant answer."""


class ThresholdFeatures(Encoder):
    """Encode rows of readings by a few comparisons per dimension.

    Each dimension draws 1 to `subset` sensors, and for each of them a threshold and a side of it. It holds a random
    element, negated where all of its sensors are on their sides: an axis-aligned box, as the leaf of a tree is, but
    drawn blindly. With one sensor the kernel is that of thermometer codes, which falls linearly from 1 to almost -1:
    one dimension in 16 asks nothing, or a program would have to answer one end of the range with the opposite of the
    other.

    A reading that was not observed is not asked: the sensors that are left decide, and a dimension without any is not
    negated.

    Thresholds lie between `bins` bins, of equal width or, with `edges`, one sorted tensor of at most bins - 1 values in
    [0, 1] per sensor (see `quantile_edges` of the behaviours), between those; an edge belongs to the bin above it. No
    table is kept, so there may be as many bins as there are readings: the codebooks are 3 · subset · d numbers. The
    thresholds of a sensor are spread evenly over its bins, so that few dimensions serve it well. Needs an architecture
    that can negate.

    Source: thermometer codes, Kleyko et al. 2018; random features of boxes, as in random forests (Breiman 2001),
    without their labels.
    """

    name = "threshold_features"
    start_codes: Tensor
    sensor: Tensor
    threshold: Tensor
    above: Tensor
    edges: Tensor

    def __init__(
        self,
        vsa: VSA,
        sensors: int,
        bins: int = 32,
        subset: int | None = None,
        edges: int | Sequence[Float[Tensor, "_"]] | None = None,
        seed: int | None = None,
    ) -> None:
        super().__init__()
        self.vsa, self.sensors, self.bins = vsa, whole("sensors", sensors), whole("bins", bins)
        self.subset = None if subset is None else whole("subset", subset)
        # A number of edges stands for those that a file brings.
        rows = None if edges is None or isinstance(edges, int) else _edges(edges, self.sensors, self.bins)
        self._edge_count = edges if isinstance(edges, int) else None if rows is None else rows.shape[1]
        self._own(None)
        if rows is not None:
            self.edges = rows
        if seed is not None:
            self.draw(torch.Generator().manual_seed(seed))

    @property
    def _most(self) -> int:
        return min(self.subset or self.sensors, self.sensors)

    def own_layout(self) -> Layout:
        """`start_codes` `[d]`; `sensor`, `threshold` and `above` `[subset, d]`; `edges` `[n, edges]` where given."""
        shape = self._most, self.vsa.dim
        layout: Layout = {"start_codes": (self.vsa.dtype, (self.vsa.dim,))}
        layout |= {"sensor": (torch.int64, shape), "threshold": (torch.int64, shape), "above": (torch.bool, shape)}
        if self._edge_count is not None:
            layout["edges"] = torch.float64, (self.sensors, self._edge_count)
        return layout

    def config(self) -> dict[str, Any]:
        """See `Part.config`."""
        options = {"sensors": self.sensors, "bins": self.bins, "subset": self.subset, "edges": self._edge_count}
        return {"name": self.name, **options}

    def check(self) -> None:
        """See `Part.check`."""
        self.vsa.check_codes(self.start_codes, "start_codes")
        for name, end in (("sensor", self.sensors), ("threshold", self.bins)):
            tensor = getattr(self, name)
            if not ((tensor >= 0) & (tensor < end)).all():
                raise ValueError(f"{name} must hold numbers in [0, {end})")
        if self._edge_count is not None:
            _edges(list(self.edges), self.sensors, self.bins)

    def cells(self, x: Float[Tensor, "batch n"]) -> Int64[Tensor, "batch n"]:
        """The bin of each reading."""
        if self._edge_count is None:
            return binned(x, self.bins)
        x = x.clamp(0, 1)
        if torch.compiler.is_exporting():
            # The same by comparisons: interchange formats have no bucket search.
            found = (x[..., None] >= self.edges).sum(-1)
        else:
            columns = x.to(torch.float64).T.contiguous()
            found = torch.searchsorted(self.edges, columns, right=True).T
        return torch.where(x.isnan(), -1, found)

    def encode(self, cells: Int64[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        """See `Encoder.encode`."""
        # Dimension by dimension: whole columns are copied and compared far faster than rows are gathered.
        columns = cells.T.contiguous()
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
        if self.start_codes.dtype == torch.bool:
            return self.start_codes ^ negated
        return torch.where(negated, self.vsa.negative(self.start_codes), self.start_codes)

    def _draw(self, generator: torch.Generator | None) -> dict[str, Tensor]:
        vsa, most = self.vsa, self._most
        require_memory(
            16 * vsa.dim * (self.sensors + most),
            f"drawing thresholds for {self.sensors:,} sensors at d = {vsa.dim:,}",
            "take fewer sensors or dimensions",
        )
        start = vsa.random(generator=generator)
        sizes = torch.randint(1, most + 1, (vsa.dim,), generator=generator)
        constant = torch.rand(vsa.dim, generator=generator) < _CONSTANT
        chosen = torch.rand(vsa.dim, self.sensors, generator=generator).argsort(-1)[:, :most].T.contiguous()
        # Where a dimension has fewer sensors, its first one is in their places too.
        spare = torch.arange(most)[:, None] >= sizes
        threshold = torch.zeros(most, vsa.dim, dtype=torch.int64)
        for place in range(most):
            for sensor in range(self.sensors):
                held = ((chosen[place] == sensor) & ~spare[place] & ~constant).nonzero()[:, 0]
                held = held[torch.randperm(len(held), generator=generator)]
                # The i-th of k dimensions passes somewhere in the i-th of k equal stretches of the range.
                spread = (torch.arange(len(held)) + torch.rand(len(held), generator=generator)) / max(len(held), 1)
                threshold[place, held] = (spread * (self.bins - 1)).long().clamp(max=max(self.bins - 2, 0))
        above = torch.rand(most, vsa.dim, generator=generator) < 0.5
        # Nothing is above the highest bin.
        threshold[0, constant], above[0, constant] = self.bins - 1, True
        drawn = {"start_codes": start}
        for name, tensor in (("sensor", chosen), ("threshold", threshold), ("above", above)):
            drawn[name] = torch.where(spare, tensor[0], tensor)
        return drawn


def _edges(edges: Sequence[Tensor], sensors: int, bins: int) -> Float64[Tensor, "n edges"]:
    """The edges of all sensors, padded with infinity. Raises `ValueError` unless they are sorted and fit the bins."""
    if len(edges) != sensors:
        raise ValueError(f"edges must be given for each of {sensors} sensors; got {len(edges)} of them")
    rows = [torch.as_tensor(row, dtype=torch.float64).flatten() for row in edges]
    for sensor, row in enumerate(rows):
        if row.isnan().any() or (row[1:] < row[:-1]).any() or (row < 0).any() or (row[row.isfinite()] > 1).any():
            raise ValueError(f"the edges of sensor {sensor} must be sorted and from 0 to 1")
        if len(row) >= bins and row[bins - 1 :].isfinite().any():
            raise ValueError(
                f"sensor {sensor} has {len(row)} edges, which part one bin more than that; the encoder has {bins}"
            )
    most = max(len(row) for row in rows)
    padded = torch.full((sensors, most), torch.inf, dtype=torch.float64)
    for row, given in zip(padded, rows, strict=True):
        row[: len(given)] = given
    return padded
