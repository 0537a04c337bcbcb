"""Small robots and random demonstrations for the tests."""

from typing import Any

import numpy as np
import torch

import torchvsa
from behaviours import Actuator, Behaviour, Demonstrations, Schema, Sensor, Space
from torchvsa import VSA
from torchvsa.encoders import Encoder, Product, SubsetProduct, Sum, ThresholdFeatures, value_encoder

BINS = 20
LEVELS = 3

SCHEMA = Schema(
    [Sensor(name, 0, BINS) for name in ("left", "right", "front")],
    [Actuator(name, -1, 1, levels=LEVELS) for name in ("left_motor", "right_motor")],
)
"""3 sensors of 20 values and 9 results from 2 actuators of 3 values: the robot of DESIGN's numbers."""


def _kinds() -> list[str]:
    made = [torchvsa.architecture_near(name, 64) for name in torchvsa.ARCHITECTURES]
    capabilities = {
        (v.dtype, v.elementwise, v.commutative, v.bilinear, v.negatable, v.breaks_ties, v.clips): v.name
        for v in reversed(made)
    }
    return [v.name for v in made if v.name in capabilities.values()]


KINDS = _kinds()
"""The first architecture of each kind: behaviours ask for capabilities, never for a name."""


def space(
    dim: int = 1024,
    vsa: str | VSA = "MAP-C",
    dtype: str | None = None,
    protection: Any = "self_shift",
    seed: int = 0,
    results: str = "lookup",
    **options: Any,
) -> Space:
    """Codebooks for `SCHEMA`; MAP in exact integer codes unless another type is asked for.

    Parts are named, to be listed by parametrised tests: see `encoder` and `protections`.
    """
    if isinstance(vsa, str):
        exact = "int8" if vsa.startswith("MAP") else None
        vsa = torchvsa.architecture_near(vsa, dim, dtype or exact)
    return Space(
        SCHEMA,
        encoder(vsa, **options),
        protection=protected(vsa, protection),
        seed=seed,
        command_codes=value_encoder({"name": results, "bins": LEVELS}, vsa),
    )


def encoder(
    vsa: VSA,
    sensors: int = 3,
    bins: int = BINS,
    values: str = "lookup",
    combine: str = "sum",
    subset: int | None = None,
    **options: Any,
) -> Encoder:
    """An encoder by the names of its parts, as a plan."""
    if combine == "threshold_features":
        return ThresholdFeatures(vsa, sensors, bins, subset)
    value = value_encoder({"name": values, "bins": bins, **options}, vsa)
    if combine == "subset_product":
        return SubsetProduct(value, sensors, subset)
    return {"sum": Sum, "product": Product}[combine](value, sensors)


def protected(vsa: VSA, given: Any) -> torchvsa.Protection:
    """A protection by its name, or its configuration."""
    return torchvsa.protection({"name": given} if isinstance(given, str) else given, vsa)


def random_pairs(count: int, seed: int = 0) -> Demonstrations:
    """Distinct random conditions with random results."""
    rng = np.random.default_rng(seed)
    cells = rng.choice(BINS**3, count, replace=False)
    results = rng.integers(0, LEVELS**2, count)
    sensors = np.stack(np.unravel_index(cells, (BINS,) * 3), 1) + 0.5
    commands = np.stack(np.unravel_index(results, (LEVELS,) * 2), 1) - 1.0
    return Demonstrations(sensors, commands)


def correct(behaviour: Behaviour, demonstrations: Demonstrations) -> torch.Tensor:
    """For each pair, 1.0 if its commands are recalled."""
    return (behaviour(demonstrations.sensors).commands == demonstrations.commands).all(1).double()


def same_bits(a: torch.Tensor, b: torch.Tensor) -> bool:
    """Equal in type, shape and every bit (NaN equals itself)."""
    return a.dtype == b.dtype and a.shape == b.shape and a.numpy().tobytes() == b.numpy().tobytes()
