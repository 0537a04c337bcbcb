"""Settings become parts: the chosen options of config groups, by name, over one set of codebooks."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TypeVar

import torchvsa
from behaviours import POLICIES, RULES, BehaviourBank, Policy, Rule, Schema, Space
from experiments.kit.options import takes
from experiments.kit.settings import written
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
    known_only("vsa", vsa, torchvsa.ARCHITECTURES.find(vsa["name"]))
    with _named("vsa", vsa):
        algebra = torchvsa.architecture(**vsa)
    with _named("protection", protection):
        protect = torchvsa.protection(protection, algebra)
    levels = max(actuator.levels for actuator in schema.actuators)
    return Space(
        schema,
        conditions(algebra, len(schema.sensors), encoder, record),
        protection=protect,
        seed=seed,
        command_codes=value_encoder({"name": command_codes, "bins": levels}, algebra),
    )


def conditions(vsa: VSA, sensors: int, encoder: Options, record: Options) -> Encoder:
    """The encoder of all sensors: a record of value encoders, or an encoder that does both at once.

    One that does both at once has the `bins` of `encoder`, if it has bins.
    """
    if (bins := encoder.get("bins", 2)) < 2:
        raise ValueError(f"encoder.bins={bins}: expected 2 or more; with fewer all readings are one condition")
    made = ENCODERS.find(record["name"])
    if takes(made, "values"):
        values = _made("encoder", VALUE_ENCODERS, encoder, vsa)
        return _made("record", ENCODERS, record, values, sensors)
    if takes(made, "bins") and "bins" in encoder:
        record = {**record, "bins": encoder["bins"]}
    return _made("record", ENCODERS, record, vsa, sensors)


def rule(options: Options, setting: str = "rule") -> Rule:
    """The learning rule of the group `rule`; errors name the `setting` that chose it."""
    return _made(setting, RULES, options)


def policy(bank: BehaviourBank, options: Options) -> Policy:
    """The policy of the group `composition`, over all behaviours of a bank."""
    return _made("composition", POLICIES, options, bank)


def refuse_unsupported(rule: Rule, space: Space) -> None:
    """Raise `ValueError` for a rule that cannot train programs of the space's architecture."""
    if not rule.supports(space.vsa):
        raise ValueError(f"the rule {rule.name} cannot train programs of {space.vsa.name}; choose another rule or vsa")


def known_only(group: str, options: Options, part: Callable[..., object]) -> None:
    """Raise `ValueError` for an option that a part does not take; Hydra lets such be added with `+`."""
    names = [name for name in inspect.signature(part).parameters if name in options]
    if unknown := [name for name in options if name not in ("name", *names)]:
        raise ValueError(f"there is no setting '{group}.{unknown[0]}'; {options['name']} takes {', '.join(names)}")


def _made(group: str, registry: Registry[Callable[..., T]], options: Options, *arguments: Any) -> T:
    made = registry.find(options["name"])
    known_only(group, options, made)
    with _named(group, options):
        return made(*arguments, **{key: value for key, value in options.items() if key != "name"})


@contextmanager
def _named(group: str, options: Options) -> Iterator[None]:
    """Name the setting in errors of a part, which knows no settings: the first option of which they speak."""
    try:
        yield
    except ValueError as error:
        spoken = (name for name in options if name != "name" and re.search(rf"\b{name}\b", str(error)))
        option = next(spoken, None)
        setting = group if option is None else f"{group}.{option}={written(options[option])}"
        raise ValueError(f"{setting}: {error}") from error
