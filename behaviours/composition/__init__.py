"""Policies that combine the behaviours of a bank, and their registry."""

from collections.abc import Callable

from behaviours.composition.base import Policy
from behaviours.composition.bundle import Bundle
from behaviours.composition.priority import Priority
from torchvsa.registry import Registry

POLICIES: Registry[Callable[..., Policy]] = Registry("policy", {"bundle": Bundle, "priority": Priority})
"""Policies by name; each is called with a bank and its options."""

__all__ = ["POLICIES", "Bundle", "Policy", "Priority"]
