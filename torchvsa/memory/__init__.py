"""Memories of hypervectors."""

from torchvsa.memory.cleanup import CleanUp, Match, best

__all__ = ["CleanUp", "Match", "best"]
