"""Encoders: numbers to hypervectors."""

from torchvsa.encoding.combine import COMBINATIONS, Combination
from torchvsa.encoding.record import Record
from torchvsa.encoding.thresholds import Thresholds
from torchvsa.encoding.values import VALUES, balanced, level, lookup

__all__ = ["COMBINATIONS", "VALUES", "Combination", "Record", "Thresholds", "balanced", "level", "lookup"]
