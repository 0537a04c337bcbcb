"""Combinations of encoder, protection, record and rule, each part by the name of an option of its config group."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from behaviours import Rule, Space
from experiments.kit import parts, settings
from experiments.kit.settings import named_parts
from experiments.tasks.corral import schema

ENCODERS = {
    "level": "neighbouring bins resemble each other",
    "lookup": "bins are unrelated, as in the paper",
}
PROTECTIONS = {
    "none": "similar conditions stay similar",
    "self_shift": "the self-derived shift of the paper",
    "self_shift_sum": "the same with widths spread evenly",
}
RECORDS = {
    "product": "multiplies the similarities of the sensors",
    "sum": "averages them, as in the paper",
    "subset_product": "a product over some sensors for each dimension",
}
RULES = {
    "error_driven": "corrections where the recall is wrong",
    "one_shot": "each new pair is added once",
    "least_squares": "ridge regression",
    "gradient": "gradient descent",
}


@dataclass
class Options:
    """What the names of parts mean: by default the options of these names."""

    encoder: Any = settings(named_parts("encoder", ENCODERS), "encoders by name")
    protection: Any = settings(named_parts("protection", PROTECTIONS), "protections by name")
    record: Any = settings(named_parts("record", RECORDS), "records by name")
    rule: Any = settings(named_parts("rule", RULES), "rules by name")


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
