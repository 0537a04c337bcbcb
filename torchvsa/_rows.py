"""Encode and protect a single row in NumPy, for a robot's control loop.

The plain line is `protection(encoder(x))`. For one row it takes PyTorch about a hundred calls of several microseconds;
those of NumPy take a tenth. Integers are equal in every bit, floats up to rounding. Measured with
`python -m benchmarks --only recall`.

Parts are looked up by their exact class. A subclass may behave differently, and takes the plain line.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from torchvsa._row_verbs import Array, Row, Verbs, rolled, verbs
from torchvsa.encoders import Encoder, Mirrored, Product, SubsetProduct, Sum, ThresholdFeatures
from torchvsa.encoders.base import ROUNDING, Binned
from torchvsa.protection import FixedShift, Protection, SelfShift, Unprotected


def row_encoder(encoder: Encoder, protection: Protection) -> Row | None:
    """A function equal to `protection(encoder(x))` for one row of readings `[n]` in [0, 1], not all of them NaN.

    None for parts without a NumPy form, and on devices other than the CPU.
    """
    known = verbs(encoder.vsa)
    if known is None or type(encoder) not in _ENCODERS or type(protection) not in _PROTECTIONS:
        return None
    if any(tensor.device.type != "cpu" for tensor in (*encoder.buffers(), *protection.buffers())):
        return None
    encode = _ENCODERS[type(encoder)](encoder, known)
    protect = _PROTECTIONS[type(protection)](protection, known)
    return None if encode is None else lambda x: protect(encode(x))


def _binned(bins: Any) -> Row:
    """`torchvsa.encoders.base.binned` for `bins` per reading, as floats; NaN stays NaN."""
    scale, last = bins * (1 + ROUNDING), bins - 1
    return lambda x: np.minimum(np.floor(x * scale), last)


def _record(encoder: Any, join: Row) -> Row | None:
    values = list(encoder.values) * (encoder.sensors if encoder.shared else 1)
    if encoder.table is None or any(type(value).cells is not Binned.cells for value in values):
        return None
    table, sensors = encoder.table.numpy(), np.arange(encoder.sensors)
    binned = _binned(np.array([value.bins for value in values], dtype=np.float64))
    # An identity on the right only must stay in its place.
    in_order, absent = isinstance(encoder, Product) and not encoder.vsa.commutative, table.shape[1] - 1

    def encode(x: Array) -> Array:
        cells, observed = binned(x), ~np.isnan(x)
        if observed.all():
            return join(table[sensors, cells.astype(np.int64)])
        if in_order:
            return join(table[sensors, np.where(observed, cells, absent).astype(np.int64)])
        return join(table[sensors[observed], cells[observed].astype(np.int64)])

    return encode


def _thresholds(encoder: Any, _: Verbs) -> Row | None:
    if encoder.kinds is not None:
        return None
    vsa, binned = encoder.vsa, _binned(encoder.bins)
    start, negative = encoder.start_codes.numpy(), vsa.negative(encoder.start_codes).resolve_neg().numpy()
    # int32 compares faster than int64.
    sensor, threshold, above = encoder.sensor.numpy(), encoder.threshold.int().numpy(), encoder.above.numpy()
    comparisons = list(zip(sensor, threshold, above, strict=True))
    edges = encoder.edges.numpy() if hasattr(encoder, "edges") else None

    def encode(x: Array) -> Array:
        found = binned(x) if edges is None else (edges <= x[:, None]).sum(1)
        unseen = np.isnan(x)
        missing = bool(unseen.any())
        cells = (np.where(unseen, -1, found) if missing else found).astype(np.int32)
        against, blind = np.zeros(vsa.dim, np.bool_), missing
        for sensor, threshold, above in comparisons:
            compared = cells.take(sensor)
            apart = (compared > threshold) != above
            if missing:
                apart &= compared >= 0
                blind = blind & (compared < 0)
            against |= apart
        return np.where(against | blind if missing else against, start, negative)

    return encode


_ENCODERS: dict[type, Callable[[Any, Verbs], Row | None]] = {
    Sum: lambda encoder, known: _record(encoder, known.bundle),
    Product: lambda encoder, known: _record(encoder, known.bind),
    SubsetProduct: lambda encoder, known: _record(encoder, known.bind),
    Mirrored: lambda encoder, known: _record(encoder, known.bind),
    ThresholdFeatures: _thresholds,
}


def _fixed(protection: Any, _: Verbs) -> Row:
    shift = protection.shift % protection.vsa.dim
    return lambda x: rolled(x, shift)


def _self_shift(protection: Any, known: Verbs) -> Row:
    bundle, dim, name = known.bundle, protection.vsa.dim, protection.h.numpy()

    def protect(x: Array) -> Array:
        pair = np.empty((2, dim), x.dtype)
        pair[1] = name
        positions = np.flatnonzero(~x if x.dtype == np.bool_ else np.real(x) > 0)
        count, total = len(positions), int(positions.sum())
        width = total % dim if protection.width_rule == "sum" else (2 * total + count) // max(2 * count, 1)
        pair[0] = x
        return rolled(bundle(pair), width)

    return protect


_PROTECTIONS: dict[type, Callable[[Any, Verbs], Row]] = {
    Unprotected: lambda _, __: lambda x: x,
    FixedShift: _fixed,
    SelfShift: _self_shift,
}
