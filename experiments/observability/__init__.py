"""How robust is a learned behaviour to states that are observed in part, and does a memory help?"""

from experiments.observability.study import study

__all__ = ["study"]
