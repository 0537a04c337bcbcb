"""What is left of a behaviour when a growing share of what it is made of is damaged?"""

from experiments.robustness.study import study

__all__ = ["study"]
