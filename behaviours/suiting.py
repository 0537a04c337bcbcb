"""Which encoder suits the sensors of a schema: the default one, and what is plainly wrong with another."""

import torch

from behaviours.schema import Schema
from torchvsa import VSA
from torchvsa.encoders import Encoder, History, Record, ThresholdFeatures
from torchvsa.encoders.threshold_features import Kind


def default_encoder(schema: Schema, vsa: VSA) -> Encoder:
    """Threshold features that ask each sensor what suits its kind."""
    # Every threshold parts 0 from 1: a binary reading needs no question of its own.
    kinds: list[Kind] = [
        len(sensor.values) if sensor.kind == "categorical" else "angle" if sensor.kind == "angle" else "real"
        for sensor in schema.sensors
    ]
    return ThresholdFeatures(vsa, len(kinds), bins=256, subset=2, kinds=kinds)


def check_value_bins(schema: Schema, encoder: Encoder) -> None:
    """Raise `ValueError`, naming sensor and remedy, where a record has bins that a sensor cannot be parted into.

    A categorical sensor has as many bins as values. Two angles or real readings must be told apart in float64.
    """
    present = encoder.present if isinstance(encoder, History) else encoder
    if not isinstance(present, Record):
        return
    values = [present.value] * present.sensors if present.shared else present.values
    for sensor, value in zip(schema.sensors, values, strict=True):
        bins, count = getattr(value, "bins", None), len(sensor.values)
        if sensor.kind == "categorical" and bins not in (None, count):
            raise ValueError(
                f"sensor {sensor.name!r} has {count} values, and its value encoder {type(value).__name__} {bins} bins; "
                f"give it one of its own, such as Lookup(vsa, bins={count}), in a list with one per sensor"
            )
    if encoder is present and present.discrete:
        schema.check_bins(present.bins)


def check_told_apart(schema: Schema, encoder: Encoder) -> None:
    """Raise `ValueError`, naming sensor and remedy, where an encoder has one code for two values of a sensor.

    An encoder that waits for tensors of a file is not looked at.
    """
    if not encoder.drawn:
        return
    for place, sensor in enumerate(schema.sensors):
        count = len(sensor.choices)
        if not count:
            continue
        readings = torch.full((count, len(schema.sensors)), torch.nan, dtype=torch.float64)
        readings[:, place] = torch.tensor(sensor.choices, dtype=torch.float64)
        x = schema.normalise(readings)
        x = x.to(next(encoder.buffers(), x).device)
        cells = encoder.cells(encoder.windows(x, torch.arange(count, device=x.device)))
        seen: dict[tuple[float, ...], int] = {}
        for later, row in enumerate(map(tuple, cells.tolist())):
            if row in seen:
                first, second = (repr((sensor.values or sensor.choices)[which]) for which in (seen[row], later))
                raise ValueError(
                    f"sensor {sensor.name!r}: {type(encoder).__name__} has one code for {first} and {second}; give "
                    f"this sensor a value encoder of its own, such as Lookup(vsa, bins={count}), or in "
                    f"ThresholdFeatures the kind {count}"
                )
            seen[row] = later
