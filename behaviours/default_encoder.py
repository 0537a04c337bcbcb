"""The default encoder of a schema, and checks that an encoder suits its sensors."""

import torch

from behaviours.schema import Schema
from torchvsa import VSA
from torchvsa.encoders import Encoder, History, Record, ThresholdFeatures
from torchvsa.encoders.threshold_features import Kind


def default_encoder(schema: Schema, vsa: VSA, bins: int = 256) -> Encoder:
    """Threshold features with the kind of each sensor, and an even number of bins for the others."""
    # Every threshold separates 0 from 1, so that binary readings count as real ones.
    kinds: list[Kind] = [
        len(sensor.values) if sensor.kind == "categorical" else "angle" if sensor.kind == "angle" else "real"
        for sensor in schema.sensors
    ]
    return ThresholdFeatures(vsa, len(kinds), bins=bins, subset=2, kinds=kinds)


def check_value_bins(schema: Schema, encoder: Encoder) -> None:
    """Raise `ValueError`, naming sensor and remedy, if a record has the wrong number of bins for a sensor.

    A categorical sensor needs as many bins as values. The bins of angles and real readings must differ in float64.
    """
    present = encoder.present if isinstance(encoder, History) else encoder
    if not isinstance(present, Record):
        return
    values = [present.value] * present.sensors if present.shared else present.values
    for sensor, value in zip(schema.sensors, values, strict=True):
        bins, count = getattr(value, "bins", None), len(sensor.values)
        if sensor.kind == "categorical" and bins not in (None, count):
            raise ValueError(
                f"sensor {sensor.name!r} has {count} values, but its value encoder {type(value).__name__} has {bins} "
                f"bins; give a list of value encoders, one per sensor, with one such as Lookup(vsa, bins={count}) here"
            )
    if encoder is present and present.discrete:
        schema.check_bins(present.bins)


def check_distinguishable(schema: Schema, encoder: Encoder) -> None:
    """Raise `ValueError`, naming sensor and remedy, if an encoder has the same code for two values of a sensor.

    An encoder without codebooks is not checked.
    """
    if not encoder.drawn:
        return
    for column, sensor in enumerate(schema.sensors):
        count = len(sensor.choices)
        if not count:
            continue
        readings = torch.full((count, len(schema.sensors)), torch.nan, dtype=torch.float64)
        readings[:, column] = torch.tensor(sensor.choices, dtype=torch.float64)
        x = schema.normalise(readings)
        x = x.to(next(encoder.buffers(), x).device)
        cells = encoder.cells(encoder.windows(x, torch.arange(count, device=x.device)))
        seen: dict[tuple[float, ...], int] = {}
        for index, row in enumerate(map(tuple, cells.tolist())):
            if row in seen:
                first, second = (repr((sensor.values or sensor.choices)[i]) for i in (seen[row], index))
                raise ValueError(
                    f"sensor {sensor.name!r}: {type(encoder).__name__} has the same code for {first} and {second}; "
                    f"give this sensor its own value encoder, such as Lookup(vsa, bins={count}), or in "
                    f"ThresholdFeatures the kind {count}"
                )
            seen[row] = index
