"""Memories of hypervectors, by name."""

from torchvsa.memory.attractor import Attractor
from torchvsa.memory.classical import ClassicalHopfield, Completion
from torchvsa.memory.cleanup import CleanUp, Match, best
from torchvsa.memory.hopfield import Hopfield
from torchvsa.memory.resonator import Factors, Resonator
from torchvsa.memory.sparse_distributed import SparseDistributedMemory
from torchvsa.registry import Registry

MEMORIES: Registry[type[CleanUp]] = Registry(
    "memory",
    {
        "clean_up": CleanUp,
        "hopfield": Hopfield,
        "classical_hopfield": ClassicalHopfield,
        "sparse_distributed": SparseDistributedMemory,
    },
)
"""Classes with the interface of `CleanUp`: made of items `[K, d]`, and called with queries."""

__all__ = [
    "MEMORIES",
    "Attractor",
    "ClassicalHopfield",
    "CleanUp",
    "Completion",
    "Factors",
    "Hopfield",
    "Match",
    "Resonator",
    "SparseDistributedMemory",
    "best",
]
