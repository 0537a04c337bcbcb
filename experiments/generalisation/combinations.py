"""Combinations of encoder, protection, record and rule, each part by the name of an option of its config group."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from behaviours import Rule, Space
from experiments.kit import Part, part, parts, settings
from experiments.tasks.corral import schema


@dataclass
class Encoders:
    """Codes of one reading."""

    level: Part = part("encoder", "level", "neighbouring bins resemble each other")
    lookup: Part = part("encoder", "lookup", "bins are unrelated, as in the paper")


@dataclass
class Protections:
    """What is done to a condition before it is bound."""

    none: Part = part("protection", "none", "similar conditions stay similar")
    self_shift: Part = part("protection", "self_shift", "the self-derived shift of the paper")
    self_shift_sum: Part = part("protection", "self_shift_sum", "the same with widths spread evenly")


@dataclass
class Records:
    """How the codes of all sensors become a condition."""

    product: Part = part("record", "product", "multiplies the similarities of the sensors")
    sum: Part = part("record", "sum", "averages them, as in the paper")
    subset_product: Part = part("record", "subset_product", "a product over some sensors for each dimension")


@dataclass
class Rules:
    """How a program is learned."""

    error_driven: Part = part("rule", "error_driven", "corrections where the recall is wrong")
    one_shot: Part = part("rule", "one_shot", "each new pair is added once")
    least_squares: Part = part("rule", "least_squares", "ridge regression")
    gradient: Part = part("rule", "gradient", "gradient descent")


@dataclass
class Options:
    """What the names of parts mean."""

    encoder: Encoders = settings(Encoders, "encoders by name")
    protection: Protections = settings(Protections, "protections by name")
    record: Records = settings(Records, "records by name")
    rule: Rules = settings(Rules, "rules by name")


def names(cls: type) -> list[str]:
    """The names of the options in one of the classes above."""
    return [field.name for field in fields(cls)]


@dataclass(frozen=True)
class Combination:
    """The names of the parts that a program is made with."""

    encoder: str
    protection: str
    record: str
    rule: str

    @property
    def name(self) -> str:
        """For example `level/none/product/error_driven`."""
        return "/".join(asdict(self).values())

    @classmethod
    def parse(cls, name: str) -> Combination:
        """The combination of this name."""
        return cls(*name.split("/"))

    def changes(self, other: Combination) -> dict[str, str]:
        """The parts of this one that differ from another's."""
        others = asdict(other)
        return {group: option for group, option in asdict(self).items() if option != others[group]}


def combine(*options: Sequence[str]) -> list[Combination]:
    """All combinations of encoders, protections, records and rules. The first options make the default.

    The default comes first, then those that differ from it in one part, and so on.
    """
    found = [Combination(*chosen) for chosen in itertools.product(*options)]
    return sorted(found, key=lambda combination: len(combination.changes(found[0])))


def codebooks(options: Options, vsa: parts.Options, combination: Combination, seed: int) -> Space:
    """The codebooks of a combination for the corral robot."""
    encoder, protection, record = (chosen(options, combination, group) for group in ("encoder", "protection", "record"))
    return parts.space(schema(), vsa, encoder, record, protection, seed)


def rule(options: Options, combination: Combination) -> Rule:
    """The learning rule of a combination."""
    return parts.rule(chosen(options, combination, "rule"))


def chosen(options: Options, combination: Combination, group: str) -> Any:
    """The option of a group that a combination names."""
    return getattr(getattr(options, group), getattr(combination, group))
