"""Encoders by name."""

from collections.abc import Mapping
from typing import Any

from torchvsa.architectures import VSA
from torchvsa.encoders.base import Encoder, ValueEncoder
from torchvsa.registry import Registry

VALUE_ENCODERS: Registry[type[ValueEncoder]] = Registry("value encoder")
ENCODERS: Registry[type[Encoder]] = Registry("encoder")


def value_encoder(config: Mapping[str, Any], vsa: VSA) -> ValueEncoder:
    """Make the value encoder that `config()` describes, as a plan (without codebooks)."""
    return VALUE_ENCODERS.find(config.get("name")).from_config(config, vsa)


def encoder(config: Mapping[str, Any], vsa: VSA) -> Encoder:
    """Make the encoder that `config()` describes, as a plan (without codebooks)."""
    return ENCODERS.find(config.get("name")).from_config(config, vsa)
