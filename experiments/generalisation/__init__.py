"""What does one hypervector do where it was not shown? Three studies, each in a file of its own."""

from experiments.generalisation import corral, smooth, wall_following

__all__ = ["corral", "smooth", "wall_following"]
