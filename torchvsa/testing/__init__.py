"""Checks of the laws that every architecture and encoder keeps, for your own ones too.

>>> import torchvsa
>>> from torchvsa.testing import check_architecture, check_encoder, check_value_encoder
>>> vsa = torchvsa.MAP(dim=1000)
>>> check_architecture(vsa)
>>> level = torchvsa.encoders.Level(vsa, bins=8)
>>> check_value_encoder(level)
>>> check_encoder(torchvsa.encoders.Product(level, sensors=3))

Each raises `AssertionError` that names the first broken law. The laws read attributes such as `vsa.commutative` and
`encoder.discrete`, so set these first. Statistical tolerances are five standard deviations of the similarity of
unrelated hypervectors, 1/√d: use at least a few hundred dimensions.
"""

from torchvsa.testing.architectures import check_architecture
from torchvsa.testing.encoders import check_encoder, check_value_encoder
from torchvsa.testing.memories import check_memory

__all__ = ["check_architecture", "check_encoder", "check_memory", "check_value_encoder"]
