"""Names and numbers in `conf/` become parts. Parts are looked up in registries: no config names code to run."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Literal, TypeVar

import sim
import torchvsa
from behaviours import POLICIES, RULES, Actuator, BehaviourBank, Policy, Rule, Schema, Sensor, Space
from torchvsa import VSA
from torchvsa.encoders import Encoder, Product, SubsetProduct, Sum, ThresholdFeatures, value_encoder
from torchvsa.registry import Registry

T = TypeVar("T")

COMMAND_LEVELS = 3
"""Levels that a learner tells apart on each wheel: backward, stop, forward."""


def schema(out_of_range: Literal["error", "clip"] = "clip") -> Schema:
    """The corral robot's sensors and actuators. Live readings outside a range are clipped, unless told otherwise."""
    return Schema(
        [Sensor(channel.name, channel.low, channel.high, channel.unit, out_of_range) for channel in sim.SENSORS],
        [
            Actuator(channel.name, channel.low, channel.high, channel.unit, levels=COMMAND_LEVELS)
            for channel in sim.ACTUATORS
        ],
    )


def space(vsa: Mapping[str, Any], parts: Mapping[str, Any], seed: int, bins: int | None = None) -> Space:
    """Codebooks for the groups `encoder`, `record` and `protection` in `parts`, with other `bins` if given."""
    options = {**parts["encoder"], **parts["record"]} | ({} if bins is None else {"bins": bins})
    return space_of(schema(), torchvsa.architecture(**vsa), options, parts["protection"], seed)


def space_of(schema: Schema, vsa: VSA, options: Mapping[str, Any], protection: Mapping[str, Any], seed: int) -> Space:
    """Codebooks with the encoder that `options` name (see `encoder`), and the codes of commands (`results`)."""
    given = dict(options)
    codes = {"name": given.pop("results", "lookup"), "bins": max(actuator.levels for actuator in schema.actuators)}
    return Space(
        schema,
        encoder(vsa, len(schema.sensors), **given),
        protection=torchvsa.protection(protection, vsa),
        seed=seed,
        command_codes=value_encoder(codes, vsa),
    )


def encoder(
    vsa: VSA,
    sensors: int,
    bins: int = 32,
    values: str = "lookup",
    combine: str = "bundle",
    span: int | None = None,
    subset: int | None = None,
) -> Encoder:
    """The encoder of the groups `encoder` and `record`, as a plan.

    Raises `ValueError` for names that do not exist, and for options that their parts do not take.
    """
    if span is not None and values != "level":
        raise ValueError(f"{values!r} takes no span; got span={span}")
    if subset is not None and combine not in ("subset", "thresholds"):
        raise ValueError(f"{combine!r} takes no subset; got subset={subset}")
    if combine == "thresholds":
        return ThresholdFeatures(vsa, sensors, bins, subset)
    value = value_encoder({"name": values, "bins": bins} | ({} if span is None else {"span": span}), vsa)
    if combine == "subset":
        return SubsetProduct(value, sensors, subset)
    records = {"bundle": Sum, "bind": Product}
    if combine not in records:
        raise ValueError(f"there is no record {combine!r}; choose one of {', '.join(records)}, subset, thresholds")
    return records[combine](value, sensors)


def rule(options: Mapping[str, Any]) -> Rule:
    """The learning rule of the group `rule`."""
    return _pick(RULES, options)


def policy(bank: BehaviourBank, options: Mapping[str, Any]) -> Policy:
    """The policy of the group `composition`, over all behaviours of the bank."""
    return _pick(POLICIES, options, bank)


def arena(options: Mapping[str, Any]) -> sim.Arena:
    """The arena of the group `arena`: a preset, with some of its fields changed."""
    if options["preset"] not in sim.ARENAS:
        raise ValueError(f"there is no arena {options['preset']!r}; choose one of {', '.join(sim.ARENAS)}")
    return replace(sim.ARENAS[options["preset"]], **options["change"])


def _pick(registry: Registry[Callable[..., T]], options: Mapping[str, Any], *arguments: Any) -> T:
    choices = dict(options)
    return registry.find(choices.pop("name"))(*arguments, **choices)
