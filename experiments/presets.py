"""Names and numbers in `conf/` become parts. Parts are looked up in registries: no config names code to run."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

import sim
import torchvsa
from behaviours import POLICIES, RULES, Actuator, BehaviourBank, Encoder, Policy, Rule, Schema, Sensor, Space

COMMAND_LEVELS = 3
"""Levels that a learner tells apart on each wheel: backward, stop, forward."""


def schema(beyond: Literal["error", "clip"] = "clip") -> Schema:
    """The corral robot's sensors and actuators. Live readings outside a range are clipped, unless told otherwise."""
    return Schema(
        [Sensor(name, low, high, unit, beyond) for name, low, high, unit in sim.SENSORS],
        [Actuator(name, low, high, unit, levels=COMMAND_LEVELS) for name, low, high, unit in sim.ACTUATORS],
    )


def space(vsa: Mapping[str, Any], parts: Mapping[str, Any], seed: int, bins: int | None = None) -> Space:
    """Codebooks for the groups `encoder`, `record` and `protection` in `parts`, with other `bins` if given."""
    options: dict[str, Any] = {**parts["encoder"], **parts["record"]} | ({} if bins is None else {"bins": bins})
    return Space(schema(), torchvsa.architecture(**vsa), Encoder(**options), dict(parts["protection"]), seed)


def rule(options: Mapping[str, Any]) -> Rule:
    """The learning rule of the group `rule`."""
    return _pick(RULES, "learning rule", options)


def policy(bank: BehaviourBank, options: Mapping[str, Any]) -> Policy:
    """The policy of the group `composition`, over all behaviours of the bank."""
    return _pick(POLICIES, "policy", options, bank)


def arena(options: Mapping[str, Any]) -> sim.Arena:
    """The arena of the group `arena`: a preset, with some of its fields changed."""
    if options["preset"] not in sim.ARENAS:
        raise ValueError(f"there is no arena {options['preset']!r}; choose one of {', '.join(sim.ARENAS)}")
    return replace(sim.ARENAS[options["preset"]], **options["change"])


def _pick(registry: Mapping[str, Any], kind: str, options: Mapping[str, Any], *arguments: Any) -> Any:
    choices = dict(options)
    name = choices.pop("name")
    if name not in registry:
        raise ValueError(f"there is no {kind} {name!r}; choose one of {', '.join(registry)}")
    return registry[name](*arguments, **choices)
