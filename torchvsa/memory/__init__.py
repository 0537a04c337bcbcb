"""Memories of hypervectors."""

from torchvsa.memory.cleanup import CleanUp, Match, best
from torchvsa.memory.resonator import Factors, Resonator

__all__ = ["CleanUp", "Factors", "Match", "Resonator", "best"]
