"""Policies that combine the behaviours of a bank, and their registry."""

from collections.abc import Callable

from behaviours.composition.base import Policy
from behaviours.composition.blending import Blending
from behaviours.composition.bundle import Bundle
from behaviours.composition.choosing import choosing
from behaviours.composition.gated import Gated
from behaviours.composition.hierarchy import Hierarchy
from behaviours.composition.motor_schema import MotorSchema
from behaviours.composition.priority import Priority
from behaviours.composition.sequencing import Sequencing
from behaviours.composition.silence import Silence
from behaviours.composition.vote import Vote
from behaviours.composition.winner_takes_all import WinnerTakesAll
from torchvsa.registry import Registry

POLICIES: Registry[Callable[..., Policy]] = Registry(
    "policy",
    {
        "bundle": Bundle,
        "priority": Priority,
        "winner_takes_all": WinnerTakesAll,
        "blending": Blending,
        "motor_schema": MotorSchema,
        "vote": Vote,
        "gated": Gated,
        "hierarchy": Hierarchy,
        "sequencing": Sequencing,
    },
)
"""Policies by name; each is called with a bank and its options."""

__all__ = [
    "POLICIES",
    "Blending",
    "Bundle",
    "Gated",
    "Hierarchy",
    "MotorSchema",
    "Policy",
    "Priority",
    "Sequencing",
    "Silence",
    "Vote",
    "WinnerTakesAll",
    "choosing",
]
