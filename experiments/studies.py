"""All studies: importing this module registers them."""

from experiments import capacity, corral

__all__ = ["capacity", "corral"]
