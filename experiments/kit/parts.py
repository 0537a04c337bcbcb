"""Settings become parts: the chosen options of config groups, by name, over one set of codebooks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import torchvsa
from behaviours import POLICIES, RULES, BehaviourBank, Policy, Rule, Schema, Space
from experiments.kit.options import takes
from torchvsa import VSA
from torchvsa.encoders import ENCODERS, VALUE_ENCODERS, Encoder, value_encoder
from torchvsa.registry import Registry

T = TypeVar("T")

Options = Mapping[str, Any]


def space(
    schema: Schema,
    vsa: Options,
    encoder: Options,
    record: Options,
    protection: Options,
    seed: int,
    command_codes: str = "lookup",
) -> Space:
    """Codebooks for the options of these groups; `command_codes` names the value encoder of the actuators' levels."""
    algebra = torchvsa.architecture(**vsa)
    levels = max(actuator.levels for actuator in schema.actuators)
    return Space(
        schema,
        conditions(algebra, len(schema.sensors), encoder, record),
        protection=torchvsa.protection(protection, algebra),
        seed=seed,
        command_codes=value_encoder({"name": command_codes, "bins": levels}, algebra),
    )


def conditions(vsa: VSA, sensors: int, encoder: Options, record: Options) -> Encoder:
    """The encoder of all sensors: a record of value encoders, or an encoder that does both at once.

    One that does both at once has the `bins` of `encoder`, if it has bins.
    """
    made = ENCODERS.find(record["name"])
    options = {key: value for key, value in record.items() if key != "name"}
    if takes(made, "values"):
        kind = VALUE_ENCODERS.find(encoder["name"])
        values = kind(vsa, **{key: value for key, value in encoder.items() if key != "name"})
        return made(values, sensors, **options)
    if takes(made, "bins"):
        options["bins"] = encoder.get("bins", 32)
    return made(vsa, sensors, **options)


def rule(options: Options) -> Rule:
    """The learning rule of the group `rule`."""
    return _made(RULES, options)


def policy(bank: BehaviourBank, options: Options) -> Policy:
    """The policy of the group `composition`, over all behaviours of a bank."""
    return _made(POLICIES, options, bank)


def refuse_unsupported(rule: Rule, space: Space) -> None:
    """Raise `ValueError` for a rule that cannot train programs of the space's architecture."""
    if not rule.supports(space.vsa):
        raise ValueError(f"the rule {rule.name} cannot train programs of {space.vsa.name}; choose another rule or vsa")


def _made(registry: Registry[Callable[..., T]], options: Options, *arguments: Any) -> T:
    given = dict(options)
    return registry.find(given.pop("name"))(*arguments, **given)
