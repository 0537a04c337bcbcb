"""Encoders: turn readings in [0, 1], NaN for unobserved, into hypervectors."""

from torchvsa.encoders.balanced import Balanced
from torchvsa.encoders.base import Binned, Encoder, ValueEncoder
from torchvsa.encoders.circular import Circular
from torchvsa.encoders.concatenated import Concatenated
from torchvsa.encoders.fractional_power import FractionalPower
from torchvsa.encoders.history import History
from torchvsa.encoders.level import Level
from torchvsa.encoders.lookup import Lookup
from torchvsa.encoders.mirrored import Mirrored
from torchvsa.encoders.oblique_features import ObliqueFeatures
from torchvsa.encoders.product import Product
from torchvsa.encoders.random_fourier import RandomFourier
from torchvsa.encoders.record import Record
from torchvsa.encoders.registry import ENCODERS, VALUE_ENCODERS, encoder, value_encoder
from torchvsa.encoders.subset_product import SubsetProduct
from torchvsa.encoders.sum import Sum
from torchvsa.encoders.thermometer import Thermometer
from torchvsa.encoders.threshold_features import ThresholdFeatures
from torchvsa.part import Part

for part in (Lookup, Level, Balanced, Thermometer, Circular, FractionalPower):
    VALUE_ENCODERS.register(part.name, part)
for part in (
    Sum,
    Product,
    SubsetProduct,
    ThresholdFeatures,
    ObliqueFeatures,
    RandomFourier,
    Concatenated,
    History,
    Mirrored,
):
    ENCODERS.register(part.name, part)

__all__ = [
    "ENCODERS",
    "VALUE_ENCODERS",
    "Balanced",
    "Binned",
    "Circular",
    "Concatenated",
    "Encoder",
    "FractionalPower",
    "History",
    "Level",
    "Lookup",
    "Mirrored",
    "ObliqueFeatures",
    "Part",
    "Product",
    "RandomFourier",
    "Record",
    "SubsetProduct",
    "Sum",
    "Thermometer",
    "ThresholdFeatures",
    "ValueEncoder",
    "encoder",
    "value_encoder",
]
