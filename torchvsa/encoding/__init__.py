"""Encoders: numbers to hypervectors."""

from torchvsa.encoding.combine import COMBINATIONS, Combination
from torchvsa.encoding.record import Record
from torchvsa.encoding.values import VALUES, level, lookup

__all__ = ["COMBINATIONS", "VALUES", "Combination", "Record", "level", "lookup"]
