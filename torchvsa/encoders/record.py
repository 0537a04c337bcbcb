"""Role-filler records: several readings in one hypervector."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import torch
from jaxtyping import Bool, Float, Int64, Shaped
from torch import Tensor, nn

from torchvsa._blocks import by_blocks
from torchvsa._memory_limit import require_memory
from torchvsa.architectures import VSA
from torchvsa.encoders.base import Binned, Encoder, ValueEncoder, planned, whole
from torchvsa.encoders.registry import value_encoder
from torchvsa.part import Layout, Part

R = TypeVar("R", bound="Record")


class Record(Encoder):
    """The base of `Sum`, `Product` and `SubsetProduct`: binds a random role per sensor to the code of its reading.

    `values` is one value encoder for all sensors, or a list with one per sensor. If all of them have bins, the
    role-bound values are kept as a table of n · (bins + 1) · d elements (24 sensors, 64 bins, d = 4,000, int8: 6 MB).
    It is computed from the codebooks and is not part of `state_dict`.

    A new record implements `_join`, `_combine` and `_absent`, and overrides `_arrange` and `_bound` if needed.

    Source: Neubert et al. 2016, Algorithm 1, line 3.
    """

    roles: Tensor
    table: Tensor | None

    def __init__(
        self,
        values: ValueEncoder | Sequence[ValueEncoder],
        sensors: int | None = None,
        seed: int | None = None,
    ) -> None:
        super().__init__()
        shared = isinstance(values, ValueEncoder)
        given = [values] if isinstance(values, ValueEncoder) else list(values)
        if not given or not all(isinstance(value, ValueEncoder) for value in given):
            raise ValueError("a record needs a value encoder such as Level, or a list with one per sensor")
        if shared and sensors is None:
            raise ValueError("a record with one value encoder for all sensors needs their number, sensors=")
        if not shared and sensors not in (None, len(given)):
            raise ValueError(f"{len(given)} value encoders were given for {sensors} sensors")
        if any(value.vsa != given[0].vsa for value in given):
            raise ValueError("all value encoders of a record must be of the same architecture")
        self.vsa, self.shared = given[0].vsa, shared
        self.sensors = whole("sensors", len(given) if sensors is None else sensors)
        # A value encoder that is listed for several sensors is copied once.
        copies = {id(value): planned(value) for value in given}
        self.values = nn.ModuleList([copies[id(value)] for value in given])
        self.discrete = all(value.discrete for value in copies.values())
        self.register_buffer("table", None, persistent=False)
        self._own(seed)

    @property
    def _values(self) -> list[ValueEncoder]:
        """The value encoders: one for all sensors, or one per sensor."""
        values: Any = list(self.values)
        return values

    @property
    def value(self) -> ValueEncoder:
        """The value encoder of all sensors. Raises `ValueError` if there is one per sensor."""
        if not self.shared:
            raise ValueError("this record has one value encoder per sensor; see `values`")
        return self._values[0]

    @property
    def codes(self) -> Shaped[Tensor, "bins d"]:
        """The codes of the bins, common to all sensors. Raises `ValueError` if there are none."""
        if not isinstance(self.value, Binned):
            raise ValueError("a continuous value encoder has no codes of bins")
        return self.value.codes

    @property
    def bins(self) -> int:
        """The largest number of bins per sensor. Raises `ValueError` for continuous value encoders."""
        values: Any = self._values
        if not self.discrete:
            raise ValueError("a continuous value encoder has no bins")
        return max(value.bins for value in values)

    def parts(self) -> dict[str, Part]:
        """The value encoders, each once."""
        return {f"values.{number}": value for number, value in enumerate(self.values) if isinstance(value, Part)}

    def own_layout(self) -> Layout:
        """`roles` `[n, d]`."""
        return {"roles": (self.vsa.dtype, (self.sensors, self.vsa.dim))}

    def config(self) -> dict[str, Any]:
        """The name, the configs of the value encoders, and the number of sensors."""
        values = [value.config() for value in self._values]
        return {"name": self.name, "values": values[0] if self.shared else values, "sensors": self.sensors}

    @classmethod
    def from_config(cls: type[R], config: Mapping[str, Any], vsa: VSA) -> R:
        """Make a plan from what `config` returned."""
        options = {key: value for key, value in config.items() if key not in ("name", "values")}
        given = config["values"]
        one = isinstance(given, Mapping)
        return cls(value_encoder(given, vsa) if one else [value_encoder(value, vsa) for value in given], **options)

    def cells(self, x: Float[Tensor, "batch n"]) -> Shaped[Tensor, "batch n"]:
        """The cell of each reading, from its value encoder."""
        if self.shared:
            return self._values[0].cells(x)
        columns = zip(self._values, x.unbind(1), strict=True)
        # Together with continuous readings, bins are floats too.
        return torch.stack(
            [value.cells(column).to(torch.int64 if self.discrete else x.dtype) for value, column in columns], 1
        )

    def encode(self, cells: Shaped[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        """Combine the role-bound codes of each row."""
        if self.table is not None:
            return self._join(self.table, cells)
        return by_blocks(self._encode, cells, row_bytes=2 * self.sensors * self.vsa.row_bytes)

    def _encode(self, cells: Shaped[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        observed = cells >= 0
        values = self._values * (self.sensors if self.shared else 1)
        codes = [self._code(*pair) for pair in zip(values, cells.clamp(min=0).unbind(1), strict=True)]
        bound = self._bound(self.roles[:, None], torch.stack(codes))
        return self._combine(bound.movedim(0, 1), observed)

    def _code(self, value: ValueEncoder, cells: Shaped[Tensor, "batch"]) -> Shaped[Tensor, "batch d"]:
        return value.encode(cells.to(torch.int64) if value.discrete else cells)

    def _arrange(self, generator: torch.Generator | None) -> Mapping[str, Tensor]:
        """Draw the tensors, other than roles, that tell sensors apart."""
        return {}

    def _bound(self, roles: Shaped[Tensor, "n 1 d"], codes: Shaped[Tensor, "#n k d"]) -> Shaped[Tensor, "n k d"]:
        """Bind codes to roles."""
        return self.vsa.bind(codes, roles)

    @abstractmethod
    def _absent(self, like: Shaped[Tensor, "..."]) -> Shaped[Tensor, "d"]:
        """The table entry for a reading that was not observed; it is neutral in `_join`."""

    @abstractmethod
    def _join(self, table: Shaped[Tensor, "n entries d"], cells: Int64[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        """Look up and combine the entries of each row of cells, where -1 means not observed."""

    @abstractmethod
    def _combine(
        self, bound: Shaped[Tensor, "batch n d"], observed: Bool[Tensor, "batch n"]
    ) -> Shaped[Tensor, "batch d"]:
        """Combine the role-bound codes of each row, without those that were not observed."""

    def _draw(self, generator: torch.Generator | None) -> dict[str, Tensor]:
        bins = max(getattr(value, "bins", 0) for value in self.values)
        require_memory(
            2 * self.sensors * (bins + 1) * self.vsa.row_bytes,
            f"a record of {self.sensors:,} sensors with {bins:,} bins at d = {self.vsa.dim:,}",
            "take fewer sensors, bins or dimensions, or ThresholdFeatures, which keep no table",
        )
        _, (roles, _) = self.own_layout()["roles"]
        drawn = {"roles": self.vsa.random(roles, generator=generator)}
        self.draw_parts(generator)
        return drawn | dict(self._arrange(generator))

    def derive(self) -> None:
        """Recompute the table of role-bound values. Call it after changing codebooks in place."""
        values: Any = self._values
        if not all(isinstance(value, Binned) for value in values):
            return
        if self.shared:
            bound = self._bound(self.roles[:, None], values[0].codes[None])
        else:
            # Sensors with fewer bins are padded with entries that no cell refers to.
            most = max(value.bins for value in values)
            codes = [torch.cat([value.codes, value.codes[:1].expand(most - value.bins, -1)]) for value in values]
            bound = self._bound(self.roles[:, None], torch.stack(codes))
        self.table = torch.cat([bound, self._absent(bound).expand(self.sensors, 1, self.vsa.dim)], 1)


def entry_indices(table: Shaped[Tensor, "n entries d"], cells: Int64[Tensor, "batch n"]) -> Int64[Tensor, "batch n"]:
    """The index of each cell's entry in the table; the last entry is for -1."""
    return torch.where(cells < 0, table.shape[1] - 1, cells)
