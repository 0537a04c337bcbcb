"""Vector Symbolic Architectures in PyTorch: batched operations on plain tensors, exact for integers."""

from torchvsa import encoders
from torchvsa.architectures import ARCHITECTURES, BSC, FHRR, HRR, MAP, VSA, architecture
from torchvsa.capacity import dim_needed, pairs_held, recall_probability
from torchvsa.errors import ShapeError
from torchvsa.memory import CleanUp, Factors, Match, Resonator
from torchvsa.part import Part
from torchvsa.protection import PROTECTIONS, FixedShift, Protection, SelfShift, Unprotected, protection
from torchvsa.readout import Readout

__version__ = "0.4.0"

__all__ = [
    "ARCHITECTURES",
    "BSC",
    "FHRR",
    "HRR",
    "MAP",
    "PROTECTIONS",
    "VSA",
    "CleanUp",
    "Factors",
    "FixedShift",
    "Match",
    "Part",
    "Protection",
    "Readout",
    "Resonator",
    "SelfShift",
    "ShapeError",
    "Unprotected",
    "architecture",
    "dim_needed",
    "encoders",
    "pairs_held",
    "protection",
    "recall_probability",
]
