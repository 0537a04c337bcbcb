"""The codebooks that behaviours share, so that their programs can be added."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from operator import index
from typing import Any, Self, SupportsIndex

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor, nn

import torchvsa
from behaviours.schema import Schema
from behaviours.storage import check_layout, naming
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

    def __post_init__(self) -> None:
        for name in ("bins", "span", "subset"):
            value = getattr(self, name)
            if name != "bins" and value is None:
                continue
            if isinstance(value, bool) or not isinstance(value, SupportsIndex) or index(value) < 1:
                raise ValueError(f"{name} is a whole number of at least 1; got {value!r}")
            object.__setattr__(self, name, index(value))
        for name in ("values", "combine", "results"):
            if not isinstance(getattr(self, name), str):
                raise ValueError(f"{name} is the name of a part; got {getattr(self, name)!r}")


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
        if isinstance(seed, bool) or not isinstance(seed, SupportsIndex) or not 0 <= index(seed) < 2**63:
            raise ValueError(f"seed is a whole number in [0, 2^63); got {seed!r}")
        seed = index(seed)
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
        if isinstance(protection, Protection):
            if protection.vsa != vsa:
                raise ValueError(f"the protection works on {protection.vsa}, this space on {vsa}")
            self.protect = protection
        else:
            kind, options = _protection(protection)
            if "h" in kind.layout(vsa):
                options["h"] = vsa.random(generator=generator)
            self.protect = kind(vsa, **options)

    def bins(self, readings: Any) -> Int64[Tensor, "batch n"]:
        """The bin of each reading, -1 where it was not observed; raises for invalid readings."""
        return self.schema.sensor_bins(readings, self.encoder.bins).to(self.results.table.device)

    def encode(self, bins: Int64[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        """The protected condition of each row of bins (Algorithm 1, line 3, and the protection of line 6)."""
        return self.protect(self.conditions(bins))

    def config(self) -> dict[str, Any]:
        """What `Space.from_config` needs, beside the tensors, to make an equal space."""
        return {
            "kind": "space",
            "schema": self.schema.to_dict(),
            "vsa": self.vsa.config(),
            "encoder": asdict(self.encoder),
            "protection": self.protect.config(),
            "seed": self.seed,
        }

    def codebooks(self) -> dict[str, Tensor]:
        """The tensors that, with `config`, make an equal space."""
        return self.state_dict()

    def same_as(self, other: "Space") -> bool:
        """Whether both encode everything alike: equal configurations and equal codebooks, wherever they are."""
        if self is other:
            return True
        mine, theirs = self.codebooks(), other.codebooks()
        return (
            self.config() == other.config()
            and mine.keys() == theirs.keys()
            and all(torch.equal(tensor.cpu(), theirs[name].cpu()) for name, tensor in mine.items())
        )

    @classmethod
    def layout(cls, config: dict[str, Any]) -> dict[str, tuple[torch.dtype, tuple]]:
        """The types and shapes of the codebooks of a space with this configuration, found without making it."""
        schema, vsa, encoder = _parts(config)
        sensors, actuators = len(schema.sensors), len(schema.actuators)
        if encoder.combine == "thresholds":
            conditions = Thresholds.layout(vsa, sensors, encoder.subset)
        else:
            conditions = Record.layout(vsa, sensors, encoder.bins, encoder.combine)
        results = Record.layout(vsa, actuators, max(actuator.levels for actuator in schema.actuators))
        parts = {
            "conditions": conditions,
            "results": results,
            "protect": _protection(config["protection"])[0].layout(vsa),
        }
        return {f"{part}.{name}": wanted for part, layout in parts.items() for name, wanted in layout.items()}

    @classmethod
    def from_config(cls, config: dict[str, Any], codebooks: Mapping[str, Tensor] | None = None) -> Self:
        """The inverse of `config`; parts are looked up by name, nothing in it is run.

        Without `codebooks` they are drawn from the seed. Raises `ValueError` naming what does not fit; codebooks are
        compared with the configuration before anything is made.
        """
        if codebooks is not None:
            check_layout(codebooks, cls.layout(config))
        schema, vsa, encoder = _parts(config)
        with naming("space"):
            space = cls(schema, vsa, encoder, config["protection"], config["seed"])
        if codebooks is not None:
            space.load_state_dict(dict(codebooks))
            for name in ("conditions", "results", "protect"):
                with naming(name):
                    getattr(space, name).check()
        return space


def _parts(config: dict[str, Any]) -> tuple[Schema, VSA, Encoder]:
    """What of a configuration takes no memory."""
    with naming("schema"):
        schema = Schema.from_dict(config["schema"])
    with naming("vsa"):
        vsa = torchvsa.architecture(**config["vsa"])
    with naming("encoder"):
        return schema, vsa, Encoder(**config["encoder"])


def _protection(given: str | dict[str, Any]) -> tuple[type[Protection], dict[str, Any]]:
    """The class of a protection, by its name, and its options."""
    options: dict[str, Any] = {"name": given} if isinstance(given, str) else dict(given)
    name = options.pop("name", None)
    if name not in PROTECTIONS:
        raise ValueError(f"there is no protection {name!r}; choose one of {', '.join(PROTECTIONS)}")
    return PROTECTIONS[name], options
