"""All studies: importing this module registers them."""

from experiments import capacity

__all__ = ["capacity"]
