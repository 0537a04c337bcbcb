"""What are good policies to combine behaviours? The study, and what it measures beside driving."""

from experiments.composition.study import study

__all__ = ["study"]
