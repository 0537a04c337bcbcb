"""What is the capacity of one hypervector? Of a trained program, and of each architecture by a published protocol."""

from experiments.capacity.study import study

__all__ = ["study"]
