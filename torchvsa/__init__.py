"""Vector Symbolic Architectures in PyTorch: batched, exact where integers allow, and plain tensors throughout."""

from torchvsa.architectures import ARCHITECTURES, BSC, FHRR, HRR, MAP, VSA, architecture
from torchvsa.capacity import dim_needed, pairs_held, recall_probability
from torchvsa.encoding import Record, Thresholds, balanced, level, lookup
from torchvsa.errors import ShapeError
from torchvsa.memory import CleanUp, Match
from torchvsa.protection import PROTECTIONS, FixedShift, Protection, SelfShift, Unprotected

__version__ = "0.1.0"

__all__ = [
    "ARCHITECTURES",
    "BSC",
    "FHRR",
    "HRR",
    "MAP",
    "PROTECTIONS",
    "VSA",
    "CleanUp",
    "FixedShift",
    "Match",
    "Protection",
    "Record",
    "SelfShift",
    "ShapeError",
    "Thresholds",
    "Unprotected",
    "architecture",
    "balanced",
    "dim_needed",
    "level",
    "lookup",
    "pairs_held",
    "recall_probability",
]
