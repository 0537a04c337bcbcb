"""All studies: importing this module registers them."""

from experiments import capacity, corral, generalisation, observability, robustness

__all__ = ["capacity", "corral", "generalisation", "observability", "robustness"]
