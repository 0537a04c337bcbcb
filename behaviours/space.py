"""The codebooks that encode readings and commands."""

import copy
from collections.abc import Mapping, Sequence
from typing import Any, Self

import torch
from jaxtyping import Float64, Int64, Shaped
from torch import Tensor, nn

import torchvsa
from behaviours.default_encoder import check_distinguishable, check_value_bins, default_encoder
from behaviours.mirroring import Mirror
from behaviours.options import as_int
from behaviours.schema import Schema
from behaviours.storage import Layout, check_layout, error_context
from torchvsa import MAP, VSA, Part, Protection, Unprotected
from torchvsa.encoders import Balanced, Encoder, Lookup, Sum, ValueEncoder
from torchvsa.encoders.base import UNOBSERVED


class Space(nn.Module):
    """Encode readings as conditions and commands as results, with one set of random codebooks.

    Programs can be added if they were learned over the same space. Parts that have no codebooks yet are copied, and
    their codebooks are drawn from `seed`: first the encoder, then the codes of commands, then the protection. The same
    seed draws the same codebooks.

    Args:
        schema: The sensors and actuators.
        encoder: Encodes readings; it holds its architecture. By default `ThresholdFeatures` with one or two sensors per
            dimension, which did best on robots for which nothing was tuned.
        vsa: The architecture of the default encoder; by default `MAP(4000, dtype=torch.int8)`. Give `encoder` or `vsa`.
        protection: By default none.
        seed: A whole number.
        command_codes: Encodes the levels of the actuators; by default `Balanced` codes, or `Lookup` codes if the
            architecture has no negatives.
        mirror: The names of sensors that swap in a mirror image of the robot, and the names of actuators that swap, as
            in `{"light_left": "light_right", "left_motor": "right_motor"}`. Behaviours then have a mirror image, see
            `Behaviour.mirror`. The encoder is `Mirrored`, by default with `Level` codes of 32 bins.

    Raises:
        ValueError: For parts of different architectures or numbers of sensors, for an encoder that has the same code
            for two values of a categorical or binary sensor, and for parts that do not mirror what `mirror` names.
    """

    _unused: Tensor

    def __init__(
        self,
        schema: Schema,
        encoder: Encoder | None = None,
        vsa: VSA | None = None,
        protection: Protection | None = None,
        seed: int = 0,
        command_codes: ValueEncoder | None = None,
        mirror: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__()
        self.schema, self.seed = schema, as_int("seed", seed, 0, 2**63 - 1)
        _check_kinds(encoder, vsa, protection, command_codes)
        sensors, actuators = len(schema.sensors), schema.actuators
        self.mirror = None if mirror is None else Mirror(schema, mirror)
        if encoder is None:
            vsa = vsa or MAP(dim=4000, dtype=torch.int8)
            encoder = default_encoder(schema, vsa) if self.mirror is None else self.mirror.encoder(vsa, sensors)
        elif vsa is not None and vsa != encoder.vsa:
            raise ValueError(f"the encoder works on {encoder.vsa}, which is not the given {vsa}; give one of them")
        if encoder.sensors != sensors:
            raise ValueError(f"the encoder is for {encoder.sensors} sensors; the schema has {sensors}")
        check_value_bins(schema, encoder)
        self.vsa = encoder.vsa
        most = max(actuator.levels for actuator in actuators)
        result_encoder = Sum(command_codes or _command_codes(self.vsa, most), sensors=len(actuators))
        if result_encoder.bins != most:
            raise ValueError(f"the codes of commands are for {result_encoder.bins} levels; the schema has {most}")
        protection = protection or Unprotected(self.vsa)
        if self.mirror is not None:
            self.mirror.check(encoder, protection)
        generator = torch.Generator().manual_seed(self.seed)
        self.encoder = _drawn(encoder, self.vsa, generator)
        check_distinguishable(schema, self.encoder)
        self.result_encoder = _drawn(result_encoder, self.vsa, generator)
        if self.mirror is not None:
            self.mirror.apply(self.result_encoder)
        self.protect = _drawn(protection, self.vsa, generator)
        self.sensors = tuple(sensor.name for sensor in schema.sensors)
        """The names of the sensors that are used, see `using`."""
        self.register_buffer("_unused", torch.zeros(sensors, dtype=torch.bool), persistent=False)

    def using(self, sensors: Sequence[str]) -> Self:
        """The same codebooks for a behaviour that uses only these sensors: readings of all others count as unobserved.

        Raises `ValueError` for names that the schema does not have, and for none.
        """
        known = [sensor.name for sensor in self.schema.sensors]
        if isinstance(sensors, str) or not sensors or not set(sensors) <= set(known):
            raise ValueError(f"sensors is a list of names out of {', '.join(known)}; got {sensors!r}")
        if set(sensors) == set(self.sensors):
            return self
        view = copy.copy(self)
        view._buffers = {"_unused": torch.tensor([name not in sensors for name in known], device=self.device)}
        view.sensors = tuple(name for name in known if name in sensors)
        return view

    def seen(self, cells: Shaped[Tensor, "batch w"]) -> Shaped[Tensor, "batch w"]:
        """The cells with those of unused sensors as not observed."""
        if len(self.sensors) == len(self.schema.sensors):
            return cells
        return cells.masked_fill(self._unused.repeat(cells.shape[1] // len(self._unused)), UNOBSERVED)

    def cells(self, readings: Any, episodes: Int64[Tensor, "N"] | None = None) -> Shaped[Tensor, "batch w"]:
        """The cells that the encoder derives from readings `[B, n]`, see `Encoder.cells`.

        An encoder of past readings needs `episodes`, the run of each row, see `History.windows`. Raises `ValueError`
        for invalid readings.
        """
        x = self.schema.normalise(readings).to(self.device)
        if self.encoder.width != self.encoder.sensors:
            if episodes is None:
                raise ValueError(
                    "the encoder uses past readings: give the episodes of recorded rows, or use start() and step() for "
                    "live ones"
                )
            x = self.encoder.windows(x, episodes.to(self.device))
        return self.seen(self.encoder.cells(x))

    def encode(self, cells: Shaped[Tensor, "batch w"]) -> Shaped[Tensor, "batch d"]:
        """The protected condition of each row of cells (Algorithm 1, line 3, and the protection of line 6)."""
        return self.protect(self.encoder.encode(cells))

    def start(self, batch: int) -> Float64[Tensor, "batch past n"]:
        """The past readings before the first step."""
        return self.encoder.start(batch).to(self.device)

    def step(
        self, readings: Any, past: Float64[Tensor, "batch past n"]
    ) -> tuple[Shaped[Tensor, "batch w"], Float64[Tensor, "batch past n"]]:
        """The cells of live readings `[B, n]`, given the readings `past`, and the past of the next step."""
        x, past = self.encoder.step(self.schema.normalise(readings).to(self.device), past)
        return self.seen(self.encoder.cells(x)), past

    def items(self, levels: Int64[Tensor, "k m"]) -> Shaped[Tensor, "k d"]:
        """The hypervector of each result, a row of one level per actuator."""
        return self.result_encoder.encode(levels)

    @property
    def device(self) -> torch.device:
        """The device of the codebooks."""
        return self.result_encoder.roles.device

    def config(self) -> dict[str, Any]:
        """Plain values from which, with the codebooks, `Space.from_config` makes an equal space."""
        return {
            "schema": self.schema.to_dict(),
            "vsa": self.vsa.config(),
            "encoder": self.encoder.config(),
            "command_codes": self.result_encoder.value.config(),
            "protection": self.protect.config(),
            "seed": self.seed,
        } | ({} if self.mirror is None else {"mirror": dict(self.mirror.names)})

    def same_as(self, other: "Space") -> bool:
        """Whether configurations and codebooks are equal; devices, and the sensors that are used, may differ."""
        if self is other:
            return True
        mine, theirs = self.state_dict(), other.state_dict()
        return (
            self.config() == other.config()
            and mine.keys() == theirs.keys()
            and all(torch.equal(tensor.cpu(), theirs[name].cpu()) for name, tensor in mine.items())
        )

    @staticmethod
    def layout(config: Mapping[str, Any]) -> Layout:
        """The types and shapes of the codebooks of a space with this configuration, without creating it."""
        _, _, parts = _plans(config)
        return _layout(parts)

    @classmethod
    def from_config(cls, config: Mapping[str, Any], codebooks: Mapping[str, Tensor] | None = None) -> Self:
        """Make the space that `config` describes; parts are found by registered name, and no code is run.

        Args:
            config: A configuration, see `config`.
            codebooks: The codebooks by name; without them they are drawn from the seed.

        Raises:
            ValueError: Naming what is wrong. Codebooks are compared with the configuration before anything is created.
        """
        schema, vsa, parts = _plans(config)
        if codebooks is not None:
            check_layout(codebooks, _layout(parts))
            for name, part in parts.items():
                prefix = f"{name}."
                with error_context(name):
                    part.take({key.removeprefix(prefix): t for key, t in codebooks.items() if key.startswith(prefix)})
        result_encoder: Any = parts["result_encoder"]
        made: Any = parts
        mirror = config.get("mirror")
        space = cls(schema, made["encoder"], vsa, made["protect"], config["seed"], result_encoder.value, mirror)
        if result_encoder.drawn:
            space.result_encoder = result_encoder
            if space.mirror is not None:
                space.mirror.check_applied(result_encoder)
        return space


def check_addable(spaces: Sequence[Space]) -> None:
    """Raise `ValueError` unless behaviours over these spaces add up: codebooks and sensors that are used are equal."""
    if not all(spaces[0].same_as(space) for space in spaces):
        raise ValueError("behaviours over different spaces (other sensors, codes or seeds) do not add up")
    if len({space.sensors for space in spaces}) > 1:
        raise ValueError(
            "behaviours that use different sensors do not add up, since no condition is one of both; combine them by a "
            "policy that asks each of them, such as MotorSchema or Priority"
        )


def conditions_of(spaces: Sequence[Space], cells: Shaped[Tensor, "batch w"]) -> list[Shaped[Tensor, "batch d"]]:
    """The protected condition of each row of cells in each of these spaces, which differ in the sensors that are used.

    Spaces that use the same sensors share one tensor. Where none of its sensors was observed, a condition is zero and
    similar to nothing.
    """
    encoded: dict[tuple[str, ...], Tensor] = {}
    for space in {space.sensors: space for space in spaces}.values():
        seen = space.seen(cells)
        condition = space.encode(seen)
        # Rows in which no sensor at all was observed are masked in the answer.
        everything = len(space.sensors) == len(space.schema.sensors)
        encoded[space.sensors] = condition if everything else condition.masked_fill((seen < 0).all(-1, keepdim=True), 0)
    return [encoded[space.sensors] for space in spaces]


def _command_codes(vsa: VSA, levels: int) -> ValueEncoder:
    return Balanced(vsa, levels) if vsa.negatable else Lookup(vsa, levels)


def _layout(parts: Mapping[str, Part]) -> Layout:
    return {f"{name}.{key}": spec for name, part in parts.items() for key, spec in part.layout().items()}


def _plans(config: Mapping[str, Any]) -> tuple[Schema, VSA, dict[str, Part]]:
    """The parts that a configuration describes, without codebooks, so that they take no memory."""
    with error_context("schema"):
        schema = Schema.from_dict(config["schema"])
    with error_context("vsa"):
        vsa = torchvsa.architecture(**config["vsa"])
    parts: dict[str, Part] = {}
    with error_context("encoder"):
        parts["encoder"] = torchvsa.encoders.encoder(config["encoder"], vsa)
    with error_context("command_codes"):
        values = torchvsa.encoders.value_encoder(config["command_codes"], vsa)
        parts["result_encoder"] = Sum(values, sensors=len(schema.actuators))
    with error_context("protection"):
        parts["protect"] = torchvsa.protection(config["protection"], vsa)
    return schema, vsa, parts


def _drawn(part: Any, vsa: VSA, generator: torch.Generator) -> Any:
    """The part if it has codebooks, else a copy with drawn ones."""
    if part.vsa != vsa:
        raise ValueError(f"{type(part).__name__} works on {part.vsa}, this space on {vsa}")
    return part if part.drawn else copy.deepcopy(part).draw(generator)


def _check_kinds(encoder: object, vsa: object, protection: object, command_codes: object) -> None:
    kinds = {"encoder": Encoder, "vsa": VSA, "protection": Protection, "command_codes": ValueEncoder}
    given = {"encoder": encoder, "vsa": vsa, "protection": protection, "command_codes": command_codes}
    for name, value in given.items():
        if value is not None and not isinstance(value, kinds[name]):
            raise ValueError(f"{name} is an object such as {_EXAMPLES[name]}, not a name or a class; got {value!r:.80}")


_EXAMPLES = {
    "encoder": "torchvsa.encoders.Product(Level(vsa, bins=32), sensors=3)",
    "vsa": "torchvsa.MAP(dim=4000)",
    "protection": "torchvsa.SelfShift(vsa)",
    "command_codes": "torchvsa.encoders.Lookup(vsa, bins=3)",
}
