"""All studies: importing this module registers them."""

from experiments import capacity, generalisation

__all__ = ["capacity", "generalisation"]
