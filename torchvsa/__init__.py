"""Vector Symbolic Architectures in PyTorch: batched operations on plain tensors, exact for integers."""

from torchvsa import encoders
from torchvsa.architectures import (
    ARCHITECTURES,
    BSC,
    BSDC,
    BSDCSEG,
    FHRR,
    HRR,
    MAP,
    MBAT,
    MCR,
    VSA,
    VTB,
    architecture,
    architecture_near,
)
from torchvsa.capacity import dim_needed, pairs_held, recall_probability
from torchvsa.errors import ShapeError
from torchvsa.memory import (
    MEMORIES,
    ClassicalHopfield,
    CleanUp,
    Factors,
    Hopfield,
    Match,
    Resonator,
    SparseDistributedMemory,
)
from torchvsa.part import Part
from torchvsa.protection import PROTECTIONS, FixedShift, Protection, SelfShift, Unprotected, protection
from torchvsa.readout import Readout

__version__ = "0.4.0"

__all__ = [
    "ARCHITECTURES",
    "BSC",
    "BSDC",
    "BSDCSEG",
    "FHRR",
    "HRR",
    "MAP",
    "MBAT",
    "MCR",
    "MEMORIES",
    "PROTECTIONS",
    "VSA",
    "VTB",
    "ClassicalHopfield",
    "CleanUp",
    "Factors",
    "FixedShift",
    "Hopfield",
    "Match",
    "Part",
    "Protection",
    "Readout",
    "Resonator",
    "SelfShift",
    "ShapeError",
    "SparseDistributedMemory",
    "Unprotected",
    "architecture",
    "architecture_near",
    "dim_needed",
    "encoders",
    "pairs_held",
    "protection",
    "recall_probability",
]
