"""What does one hypervector do where it was not shown? Three studies, each in a file of its own; the corral's leads."""

from experiments.generalisation.corral import study

__all__ = ["study"]
