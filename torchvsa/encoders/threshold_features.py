"""Random boxes: each dimension compares a few sensors with thresholds."""

from collections.abc import Sequence
from typing import Any, Literal

import torch
from jaxtyping import Bool, Float, Float64, Int64, Shaped
from torch import Tensor

from torchvsa._checks import whole_number
from torchvsa._memory_limit import require_memory
from torchvsa.architectures import VSA
from torchvsa.encoders.base import Encoder, binned, negated_where, require_negatable, whole
from torchvsa.part import Layout

_CONSTANT = 1 / 16
"""The fraction of dimensions without a comparison: few, but enough for a constant answer."""
_MOST_CATEGORIES = 2**20
"""Up to this number of categories c, the positions (i + 0.5) / c are distinct in float32."""
Kind = Literal["real", "angle"] | int
"""The kind of a sensor; an int is a number of categories (see `ThresholdFeatures`)."""


class ThresholdFeatures(Encoder):
    """Encode rows of readings by a few comparisons per dimension.

    Each dimension is a random axis-aligned box over 1 to `subset` sensors, like the leaf of a tree but drawn without
    data: it has a threshold and a side for each of its sensors. Its element is random, and negated inside the box. With
    one sensor the kernel is that of thermometer codes, which falls linearly from 1 to almost -1. One dimension in 16
    has no comparison; otherwise a program would have to give opposite answers at both ends of the range.

    A reading that was not observed is not compared: the other sensors decide, and without any the element is not
    negated.

    Thresholds are between `bins` bins of equal width or, with `edges`, between bins with these edges: one sorted tensor
    of at most bins - 1 values in [0, 1] per sensor (see `behaviours.quantile_edges`). An edge belongs to the bin above
    it. No table is kept, so there may be as many bins as readings: the codebooks are 3 · subset · d numbers. The
    thresholds of a sensor are spread evenly over its bins. Needs a `negatable` architecture.

    `kinds` has one entry per sensor; all are "real" by default. The kernels are those of one sensor, apart from the
    dimensions without a comparison.

    | kind | comparison | kernel |
    |---|---|---|
    | `"real"` | Is the reading above a threshold? | 1 - 2·δ, with δ the difference |
    | `"angle"` | Is it in the half circle that begins at an angle? | 1 - 4·δ, with δ the distance in turns |
    | a number c | Is it in a random half of c categories? | 1 for the same, else -1 / (c - 1), or -1 / c for odd c |

    An angle needs an even number of bins; 0 and 1 are the same. Category i of c is any reading from i / c to
    (i + 1) / c, usually (i + 0.5) / c. Neither kind has edges. Categories take another subset · d · c booleans, for the
    largest c.

    Source: thermometer codes, Kleyko et al. 2018; random features of boxes, as in random forests (Breiman 2001),
    without their labels.
    """

    name = "threshold_features"
    start_codes: Tensor
    sensor: Tensor
    threshold: Tensor
    above: Tensor
    members: Tensor
    edges: Tensor
    sizes: Tensor
    angle: Tensor
    category: Tensor

    def __init__(
        self,
        vsa: VSA,
        sensors: int,
        bins: int = 32,
        subset: int | None = None,
        edges: int | Sequence[Float[Tensor, "_"]] | None = None,
        seed: int | None = None,
        kinds: Sequence[Kind] | None = None,
    ) -> None:
        super().__init__()
        require_negatable(vsa, type(self).__name__)
        self.vsa, self.sensors, self.bins = vsa, whole("sensors", sensors), whole("bins", bins)
        self.subset = None if subset is None else whole("subset", subset)
        self.kinds = _kinds(kinds, self.sensors, self.bins)
        self._most_categories = max([0, *(kind for kind in self.kinds or () if isinstance(kind, int))])
        if self.kinds is not None:
            # Computed from the kinds, so no file holds them.
            sizes = [self.bins if isinstance(kind, str) else kind for kind in self.kinds]
            self.register_buffer("sizes", torch.tensor(sizes), persistent=False)
            self.register_buffer("angle", torch.tensor([kind == "angle" for kind in self.kinds]), persistent=False)
            categories = torch.tensor([not isinstance(kind, str) for kind in self.kinds])
            self.register_buffer("category", categories, persistent=False)
        # A number of edges announces edges that a file contains.
        rows = None if edges is None or isinstance(edges, int) else _edges(edges, self.sensors, self.bins, self.kinds)
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
        """`start_codes` `[d]`; `sensor`, `threshold` and `above` `[subset, d]`; if needed `members` and `edges`.

        `members` `[subset, d, c]` holds random halves of the categories, `edges` `[n, edges]` the given edges.
        """
        shape = self._most, self.vsa.dim
        layout: Layout = {"start_codes": (self.vsa.dtype, (self.vsa.dim,))}
        layout |= {"sensor": (torch.int64, shape), "threshold": (torch.int64, shape), "above": (torch.bool, shape)}
        if self._most_categories:
            layout["members"] = torch.bool, (*shape, self._most_categories)
        if self._edge_count is not None:
            layout["edges"] = torch.float64, (self.sensors, self._edge_count)
        return layout

    def config(self) -> dict[str, Any]:
        """The name and the options; edges are tensors, so it has only their number."""
        options = {"sensors": self.sensors, "bins": self.bins, "subset": self.subset, "edges": self._edge_count}
        # Left out if all are real, as in files that precede kinds.
        return {"name": self.name, **options} | ({} if self.kinds is None else {"kinds": list(self.kinds)})

    def check(self) -> None:
        """Raise `ValueError` unless codes, sensors, thresholds and edges are in range."""
        self.vsa.check_codes(self.start_codes, "start_codes")
        for name, end in (("sensor", self.sensors), ("threshold", self.bins)):
            tensor = getattr(self, name)
            if not ((tensor >= 0) & (tensor < end)).all():
                raise ValueError(f"{name} must hold numbers in [0, {end})")
        if self._edge_count is not None:
            _edges(list(self.edges), self.sensors, self.bins, self.kinds)

    def cells(self, x: Float[Tensor, "batch n"]) -> Int64[Tensor, "batch n"]:
        """The bin of each reading, or the number of its category; an angle of 1 is in the first bin."""
        found = self._bins(x)
        return found if self.kinds is None else torch.where(self.angle & (x >= 1), 0, found)

    def _bins(self, x: Float[Tensor, "batch n"]) -> Int64[Tensor, "batch n"]:
        even = self.bins if self.kinds is None else self.sizes
        if self._edge_count is None:
            return binned(x, even)
        within = x.clamp(0, 1)
        if torch.compiler.is_exporting():
            # Comparisons instead of `searchsorted`, which ONNX lacks.
            found = (within[..., None] >= self.edges).sum(-1)
        else:
            columns = within.to(torch.float64).T.contiguous()
            found = torch.searchsorted(self.edges, columns, right=True).T
        if self.kinds is not None:
            found = torch.where(self.angle | self.category, binned(within, even), found)
        return torch.where(x.isnan(), -1, found)

    def encode(self, cells: Int64[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        """Negate the elements of the dimensions whose box contains the reading."""
        # Dimensions first: copying and comparing whole columns is far faster than gathering rows.
        columns = cells.T.contiguous()
        missing = columns < 0
        against = blind = None
        for place, (sensor, above) in enumerate(zip(self.sensor, self.above, strict=True)):
            unseen = missing.index_select(0, sensor)
            side = self._side(place, columns.index_select(0, sensor))
            apart = (side ^ above[:, None]) & ~unseen
            against = apart if against is None else against | apart
            blind = unseen if blind is None else blind & unseen
        assert against is not None
        assert blind is not None
        negated = ~(against | blind).T.contiguous()
        return negated_where(self.vsa, self.start_codes, negated)

    def _side(self, place: int, cells: Int64[Tensor, "d batch"]) -> Bool[Tensor, "d batch"]:
        """The result of the comparison number `place` of each dimension, before `above` selects a side."""
        threshold = self.threshold[place]
        side = cells > threshold[:, None]
        if self.kinds is None:
            return side
        sensor = self.sensor[place]
        # A half circle that does not contain the end of the range; `above` selects the opposite one.
        reach = torch.where(self.angle, self.bins // 2, self.bins).index_select(0, sensor)
        side = side & (cells <= (threshold + reach)[:, None])
        if not self._most_categories:
            return side
        # The results for other kinds are discarded.
        chosen = self.members[place].gather(1, cells.clamp(0, self._most_categories - 1))
        category = self.category.index_select(0, sensor)[:, None]
        # Not `torch.where`, which onnxruntime does not support for booleans.
        return (chosen & category) | (side & ~category)

    def _draw(self, generator: torch.Generator | None) -> dict[str, Tensor]:
        vsa, most, categories = self.vsa, self._most, self._most_categories
        # Random numbers, their ranks and twice the ranks take 20 bytes per category.
        require_memory(
            vsa.dim * (16 * (self.sensors + most) + (most + 20) * categories),
            f"drawing thresholds for {self.sensors:,} sensors at d = {vsa.dim:,}"
            + (f" with up to {categories:,} categories" if categories else ""),
            "take fewer sensors, categories or dimensions",
        )
        start = vsa.random(generator=generator)
        sizes = torch.randint(1, most + 1, (vsa.dim,), generator=generator)
        constant = torch.rand(vsa.dim, generator=generator) < _CONSTANT
        chosen = torch.rand(vsa.dim, self.sensors, generator=generator).argsort(-1)[:, :most].T.contiguous()
        # A dimension with fewer sensors repeats its first one.
        spare = torch.arange(most)[:, None] >= sizes
        threshold = torch.zeros(most, vsa.dim, dtype=torch.int64)
        members = torch.zeros(most, vsa.dim, categories, dtype=torch.bool)
        for place in range(most):
            for sensor, kind in enumerate(self.kinds or ["real"] * self.sensors):
                held = ((chosen[place] == sensor) & ~spare[place] & ~constant).nonzero()[:, 0]
                if isinstance(kind, int):
                    ranks = torch.rand(len(held), kind, generator=generator).argsort(-1)
                    members[place, held, :kind] = 2 * ranks < kind
                    continue
                held = held[torch.randperm(len(held), generator=generator)]
                # The threshold of the i-th of k dimensions is random within the i-th of k equal parts of the range.
                spread = (torch.arange(len(held)) + torch.rand(len(held), generator=generator)) / max(len(held), 1)
                # An angle has half as many; the others are the opposite half circles.
                count = self.bins - 1 if kind == "real" else self.bins // 2
                threshold[place, held] = (spread * count).long().clamp(max=max(count - 1, 0))
        above = torch.rand(most, vsa.dim, generator=generator) < 0.5
        # No cell is above the highest bin or in an empty set of categories.
        threshold[0, constant], above[0, constant] = self.bins - 1, True
        drawn = {"start_codes": start}
        for name, tensor in (("sensor", chosen), ("threshold", threshold), ("above", above)):
            drawn[name] = torch.where(spare, tensor[0], tensor)
        if categories:
            drawn["members"] = torch.where(spare[..., None], members[0], members)
        return drawn


def _kinds(kinds: Sequence[Kind] | None, sensors: int, bins: int) -> tuple[Kind, ...] | None:
    """The kinds of all sensors, None if all are real. Raises `ValueError` that names the sensor for a bad kind."""
    if kinds is None:
        return None
    if isinstance(kinds, str) or not isinstance(kinds, Sequence) or len(kinds) != sensors:
        raise ValueError(f"kinds must be given for each of {sensors} sensors, in a list; got {kinds!r:.200}")
    checked: list[Kind] = []
    for sensor, kind in enumerate(kinds):
        what = f"the kind of sensor {sensor} is 'real', 'angle', or a number of categories from 2 to 2^20"
        if isinstance(kind, str):
            if kind not in ("real", "angle"):
                raise ValueError(f"{what}; got {kind!r:.200}")
            if kind == "angle" and bins % 2:
                raise ValueError(
                    f"sensor {sensor} is an angle, whose half circles need an even number of bins; got {bins}"
                )
            checked.append(kind)
            continue
        number = whole_number(kind, what)
        if not 2 <= number <= _MOST_CATEGORIES:
            raise ValueError(f"{what}; got {number}")
        checked.append(number)
    return None if all(kind == "real" for kind in checked) else tuple(checked)


def _edges(
    edges: Sequence[Tensor], sensors: int, bins: int, kinds: Sequence[Kind] | None
) -> Float64[Tensor, "n edges"]:
    """The edges of all sensors, padded with infinity. Raises `ValueError` unless they are sorted and fit the bins."""
    if len(edges) != sensors:
        raise ValueError(f"edges must be given for each of {sensors} sensors; got {len(edges)} of them")
    rows = [torch.as_tensor(row, dtype=torch.float64).flatten() for row in edges]
    for sensor, row in enumerate(rows):
        if row.isnan().any() or (row[1:] < row[:-1]).any() or (row < 0).any() or (row[row.isfinite()] > 1).any():
            raise ValueError(f"the edges of sensor {sensor} must be sorted and from 0 to 1")
        if kinds is not None and kinds[sensor] != "real" and row.isfinite().any():
            raise ValueError(f"sensor {sensor} is an angle or a category, which has no edges; give it an empty tensor")
        if len(row) >= bins and row[bins - 1 :].isfinite().any():
            raise ValueError(
                f"sensor {sensor} has {len(row)} edges, which need {len(row) + 1} bins; the encoder has {bins}"
            )
    most = max(len(row) for row in rows)
    padded = torch.full((sensors, most), torch.inf, dtype=torch.float64)
    for row, given in zip(padded, rows, strict=True):
        row[: len(given)] = given
    return padded
