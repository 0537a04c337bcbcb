"""All studies: importing this module registers them."""

from experiments import capacity
from experiments.observability.study import study as observability
from experiments.robustness.study import study as robustness

__all__ = ["capacity", "observability", "robustness"]
