"""Random half-spaces: each dimension compares a weighted sum of a few sensors with a threshold."""

from typing import Any

import torch
from jaxtyping import Float, Shaped
from torch import Tensor

from torchvsa._memory_limit import require_memory
from torchvsa.architectures import VSA
from torchvsa.encoders.base import Encoder, continuous, negated_where, require_negatable, whole
from torchvsa.part import Layout


class ObliqueFeatures(Encoder):
    """Encode rows of readings by one comparison of a weighted sum per dimension.

    Each dimension weights `subset` random sensors, like a split of an oblique tree but drawn without labels. Its
    element is random, and negated where the weighted sum is above a threshold. The kernel falls with the distance
    between two rows, nearly in proportion to it, in whatever direction they differ; that of `ThresholdFeatures` falls
    along the axes.

    Weights are normal random numbers divided by the spread of their sensor, its standard deviation over `rows`, and of
    length 1 before. The boundary passes through a random point between two random rows. Without `rows` all spreads are
    equal, and the points lie between points of the unit cube. Rows are used once, to draw codebooks: `config` has
    their number, which announces the codebooks of a file.

    A reading that was not observed counts as the mean of its sensor, ½ without rows; if none of those that a dimension
    compares was observed, its element is not negated. Needs a `negatable` architecture. The codebooks are
    (2 · subset + 2) · d numbers.

    Args:
        vsa: The architecture.
        sensors: The number n of sensors.
        subset: The number of sensors in a sum; n if there are fewer.
        rows: Examples `[k, n]` of readings in [0, 1], NaN for unobserved.
        seed: Draws the codebooks.

    Raises:
        ValueError: For an architecture without negatives, and for rows of another shape or range.

    Source: random linear combinations of inputs in the splits of trees, Breiman 2001, section 5 ("Forest-RC"), without
    their labels; random tessellations by hyperplanes, Plan and Vershynin 2014.
    """

    name = "oblique_features"
    discrete = False
    start_codes: Tensor
    sensor: Tensor
    weight: Tensor
    threshold: Tensor
    center: Tensor

    def __init__(
        self,
        vsa: VSA,
        sensors: int,
        subset: int = 3,
        rows: int | Float[Tensor, "k n"] | None = None,
        seed: int | None = None,
    ) -> None:
        super().__init__()
        require_negatable(vsa, type(self).__name__)
        self.vsa, self.sensors, self.subset = vsa, whole("sensors", sensors), whole("subset", subset)
        self._rows = rows if rows is None or isinstance(rows, int) else _checked(rows, self.sensors)
        self._own(seed)

    def own_layout(self) -> Layout:
        """`start_codes` and `threshold` `[d]`, `sensor` and `weight` `[subset, d]`, `center` `[n]`."""
        dim, shape = self.vsa.dim, (min(self.subset, self.sensors), self.vsa.dim)
        return {
            "start_codes": (self.vsa.dtype, (dim,)),
            "sensor": (torch.int64, shape),
            "weight": (torch.float64, shape),
            "threshold": (torch.float64, (dim,)),
            "center": (torch.float64, (self.sensors,)),
        }

    def config(self) -> dict[str, Any]:
        """The name and the options; of rows, which are readings, only their number."""
        count = len(self._rows) if isinstance(self._rows, Tensor) else self._rows
        return {"name": self.name, "sensors": self.sensors, "subset": self.subset, "rows": count}

    def check(self) -> None:
        """Raise `ValueError` unless codes and sensors are in range, and all numbers finite."""
        self.vsa.check_codes(self.start_codes, "start_codes")
        if not ((self.sensor >= 0) & (self.sensor < self.sensors)).all():
            raise ValueError(f"sensor must hold numbers in [0, {self.sensors})")
        for name in ("weight", "threshold", "center"):
            if not getattr(self, name).isfinite().all():
                raise ValueError(f"{name} must hold finite numbers")

    def cells(self, x: Float[Tensor, "batch n"]) -> Float[Tensor, "batch n"]:
        """The readings, and -1 for NaN."""
        return continuous(x)

    def encode(self, cells: Float[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        """Negate the elements of the dimensions whose weighted sum is above the threshold."""
        # Dimensions first, as in `ThresholdFeatures`; sums sensor by sensor have the same bits at any batch size.
        missing = (cells < 0).T.contiguous()
        columns = torch.where(cells < 0, self.center, cells.to(self.center.dtype)).T.contiguous()
        total = blind = None
        for sensor, weight in zip(self.sensor, self.weight, strict=True):
            part, unseen = columns.index_select(0, sensor) * weight[:, None], missing.index_select(0, sensor)
            total = part if total is None else total + part
            blind = unseen if blind is None else blind & unseen
        assert total is not None
        assert blind is not None
        negated = ((total > self.threshold[:, None]) & ~blind).T.contiguous()
        return negated_where(self.vsa, self.start_codes, negated)

    def _draw(self, generator: torch.Generator | None) -> dict[str, Tensor]:
        dim, sensors, most = self.vsa.dim, self.sensors, min(self.subset, self.sensors)
        require_memory(
            dim * (40 * sensors + 40 * most),
            f"drawing weighted sums of {sensors:,} sensors at d = {dim:,}",
            "take fewer sensors or dimensions",
        )
        if isinstance(self._rows, int):
            return {}  # its codebooks are those of a file
        drawn = {"start_codes": self.vsa.random(generator=generator)}
        sensor = torch.rand(dim, sensors, generator=generator).argsort(-1)[:, :most].T.contiguous()
        weight = torch.randn(most, dim, generator=generator, dtype=torch.float64)
        weight = weight / weight.norm(dim=0)
        center = torch.full((sensors,), 0.5, dtype=torch.float64)
        if self._rows is None:
            ends = torch.rand(2, dim, sensors, generator=generator, dtype=torch.float64)
        else:
            center = self._rows.nanmean(0).nan_to_num(0.5)
            seen = torch.where(self._rows.isnan(), center, self._rows)
            spread = seen.std(0, correction=0)
            weight = weight / torch.where(spread > 0, spread, 1.0)[sensor]
            ends = seen[torch.randint(len(seen), (2, dim), generator=generator)]
        share = torch.rand(dim, 1, generator=generator, dtype=torch.float64)
        point = (ends[0] * share + ends[1] * (1 - share)).gather(1, sensor.T).T
        return drawn | {"sensor": sensor, "weight": weight, "threshold": (weight * point).sum(0), "center": center}


def _checked(rows: Float[Tensor, "k n"], sensors: int) -> Float[Tensor, "k n"]:
    """The rows in float64. Raises `ValueError` for another shape, none, and readings outside [0, 1]."""
    rows = torch.as_tensor(rows, dtype=torch.float64)
    if rows.dim() != 2 or rows.shape[1] != sensors or not len(rows):
        raise ValueError(f"rows are examples [k, {sensors}], one column per sensor; got {list(rows.shape)}")
    if ((rows < 0) | (rows > 1)).any():
        raise ValueError("rows hold readings in [0, 1], NaN for unobserved; Schema.normalise scales them")
    return rows
