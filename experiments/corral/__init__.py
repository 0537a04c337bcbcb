"""The main job: demonstrations of the corral escape become one hypervector, which drives and is compared."""

from experiments.corral.study import study

__all__ = ["study"]
