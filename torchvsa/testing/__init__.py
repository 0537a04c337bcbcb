"""Laws that every part keeps, to run on parts of your own.

>>> import torchvsa
>>> from torchvsa.testing import check_architecture, check_encoder, check_value_encoder
>>> vsa = torchvsa.MAP(dim=1000)
>>> check_architecture(vsa)
>>> level = torchvsa.encoders.Level(vsa, bins=8)
>>> check_value_encoder(level)
>>> check_encoder(torchvsa.encoders.Product(level, sensors=3))

Each raises `AssertionError` that names the first law that the part breaks. Laws ask for what the part says of itself
(`vsa.commutative`, `encoder.discrete` and so on), so set these attributes first. Statistical tolerances are five
standard deviations of the similarity of unrelated hypervectors, 1/√d; take at least a few hundred dimensions.
"""

from torchvsa.testing.architectures import check_architecture
from torchvsa.testing.encoders import check_encoder, check_value_encoder

__all__ = ["check_architecture", "check_encoder", "check_value_encoder"]
