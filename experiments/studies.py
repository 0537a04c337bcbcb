"""All studies: importing this module registers them."""

from experiments import capacity
from experiments.robustness import study as robustness

__all__ = ["capacity", "robustness"]
