"""The codebooks that behaviours share, so that their programs can be added."""

from dataclasses import asdict, dataclass
from typing import Any

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor, nn

import torchvsa
from behaviours.schema import Schema
from torchvsa import PROTECTIONS, VSA, Protection, Record, Thresholds


@dataclass(frozen=True)
class Encoder:
    """How readings become conditions: bins, the codes of their values, and how a record joins them.

    `values`, `combine`, `span` and `subset` are those of `torchvsa.Record`, except that `combine="thresholds"` means
    `torchvsa.Thresholds`, which has no codes of values: bins and `subset` alone. `results` names the codes of the
    actuators' levels, in `torchvsa.encoding.VALUES`.
    """

    bins: int = 32
    values: str = "lookup"
    combine: str = "bundle"
    span: int | None = None
    subset: int | None = None
    results: str = "lookup"


class Space(nn.Module):
    """Encode readings as conditions and commands as results, with one set of random codebooks.

    `protection` is a name in `torchvsa.PROTECTIONS`, with options if need be
    (`{"name": "self_shift", "width": "sum"}`), or a `Protection`. The same seed draws the same codebooks.
    """

    # A `Record`, or the like of it that `combine` names: indices `[B, n]` in, hypervectors `[B, d]` out.
    conditions: Any

    def __init__(
        self,
        schema: Schema,
        vsa: VSA,
        encoder: Encoder | None = None,
        protection: str | dict[str, Any] | Protection = "self_shift",
        seed: int = 0,
    ) -> None:
        super().__init__()
        self.schema, self.vsa, self.seed = schema, vsa, seed
        self.encoder = encoder or Encoder()
        generator = torch.Generator().manual_seed(seed)
        options = asdict(self.encoder)
        bins, results = options.pop("bins"), options.pop("results")
        if self.encoder.combine == "thresholds":
            self.conditions = Thresholds(vsa, len(schema.sensors), bins, self.encoder.subset, generator)
        else:
            self.conditions = Record(vsa, len(schema.sensors), bins, generator=generator, **options)
        most = max(actuator.levels for actuator in schema.actuators)
        self.results = Record(vsa, len(schema.actuators), most, results, generator=generator)
        if not isinstance(protection, Protection):
            given: dict[str, Any] = {"name": protection} if isinstance(protection, str) else dict(protection)
            name = given.pop("name")
            if name not in PROTECTIONS:
                raise ValueError(f"there is no protection {name!r}; choose one of {', '.join(PROTECTIONS)}")
            if name == "self_shift":
                given["h"] = vsa.random(generator=generator)
            protection = PROTECTIONS[name](vsa, **given)
        elif protection.vsa != vsa:
            raise ValueError(f"the protection works on {protection.vsa}, this space on {vsa}")
        self.protect = protection

    def bins(self, readings: Any) -> Int64[Tensor, "batch n"]:
        """The bin of each reading, -1 where it was not observed; raises for invalid readings."""
        return self.schema.sensor_bins(readings, self.encoder.bins).to(self.results.table.device)

    def encode(self, bins: Int64[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        """The protected condition of each row of bins (Algorithm 1, line 3, and the protection of line 6)."""
        return self.protect(self.conditions(bins))

    def config(self) -> dict[str, Any]:
        """What `Space.from_config` needs, beside the tensors, to make an equal space."""
        return {
            "schema": self.schema.to_dict(),
            "vsa": self.vsa.config(),
            "encoder": asdict(self.encoder),
            "protection": self.protect.config(),
            "seed": self.seed,
        }

    @classmethod
    def from_config(cls, config: dict[str, Any]) -> "Space":
        """The inverse of `config`; parts are looked up by name, nothing in it is run."""
        return cls(
            Schema.from_dict(config["schema"]),
            torchvsa.architecture(**config["vsa"]),
            Encoder(**config["encoder"]),
            config["protection"],
            config["seed"],
        )
