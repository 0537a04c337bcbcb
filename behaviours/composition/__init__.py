"""Policies that combine the behaviours of a bank, by name."""

from behaviours.composition.base import Policy
from behaviours.composition.bundle import Bundle
from behaviours.composition.priority import Priority

POLICIES: dict[str, type[Policy]] = {"bundle": Bundle, "priority": Priority}

__all__ = ["POLICIES", "Bundle", "Policy", "Priority"]
