"""Encode and protect a single row in NumPy, for a robot's control loop.

The plain line is `protection(encoder(x))`. For one row it takes PyTorch about a hundred calls of several microseconds;
those of NumPy take a tenth. Integers are equal in every bit, floats up to rounding. Measured with
`python -m benchmarks --only recall`.

Parts are looked up by their exact class. A subclass may behave differently, and takes the plain line.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from torchvsa.architectures import BSC, FHRR, HRR, MAP, VSA
from torchvsa.encoders import Encoder, Mirrored, Product, SubsetProduct, Sum, ThresholdFeatures
from torchvsa.encoders.base import ROUNDING, Binned
from torchvsa.protection import FixedShift, Protection, SelfShift, Unprotected

Array = NDArray[Any]
Row = Callable[[Array], Array]


class Verbs(NamedTuple):
    """The operations of an architecture on rows `[k, d]`."""

    bind: Row
    bundle: Row
    noise: Callable[[Array], Callable[[Array, Array], float]] | None = None
    """Maps a program to a function of a key and its squares (see `real`) that returns `|unbind(program, key)|²`.

    None if that is the product of the squares, as for element-wise binding.
    """


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


def real(code: Array) -> Array:
    """A hypervector in float64 with the same products: bits as -1 / +1, complex elements as pairs."""
    if code.dtype == np.bool_:
        return 1.0 - 2.0 * code
    return (code.view(np.real(code).dtype) if np.iscomplexobj(code) else code).astype(np.float64)


def verbs(vsa: VSA) -> Verbs | None:
    """The NumPy operations of an architecture; None if it has none."""
    return _VERBS[type(vsa)](vsa) if type(vsa) in _VERBS else None


def noise(vsa: VSA, program: Array) -> Callable[[Array, Array], float]:
    """A function of a key in the form of `real` and its squares that returns `|unbind(program, key)|²`."""
    known = verbs(vsa)
    if known is not None and known.noise is not None:
        return known.noise(program)
    sizes = np.abs(program).repeat(2) if np.iscomplexobj(program) else real(program)
    weights = sizes.astype(np.float64) ** 2
    return lambda _, squares: float(squares @ weights)


def _product(rows: Array) -> Array:
    return np.multiply.reduce(rows, 0, dtype=rows.dtype)


def _sum(rows: Array) -> Array:
    # Integer codes are -1, 0 and +1.
    return np.add.reduce(rows, 0, dtype=np.int32 if rows.dtype == np.int8 and len(rows) > 127 else rows.dtype)


def _map(vsa: Any) -> Verbs:
    def clipped(rows: Array) -> Array:
        total = _sum(rows)
        # For integers the sign equals the clipped value, and is far faster.
        return np.sign(total).astype(rows.dtype, copy=False) if vsa.integer else total.clip(-1, 1)

    def majority(rows: Array) -> Array:
        total = np.sign(_sum(rows))
        return np.where(total == 0, _rolled(rows[0] * rows[min(1, len(rows) - 1)], 1), total).astype(rows.dtype)

    def summed(rows: Array) -> Array:
        return np.add.reduce(rows, 0, dtype=np.int32 if vsa.integer else rows.dtype)

    return Verbs(_product, {"C": clipped, "I": summed, "B": majority}[vsa.variant])


def _bsc(_: VSA) -> Verbs:
    def majority(rows: Array) -> Array:
        ones = 2 * np.add.reduce(rows, 0, dtype=np.int32)
        return np.where(ones == len(rows), _rolled(rows[0] ^ rows[min(1, len(rows) - 1)], 1), ones > len(rows))

    return Verbs(lambda rows: np.logical_xor.reduce(rows, 0), majority)


def _fhrr(_: VSA) -> Verbs:
    def unit(rows: Array) -> Array:
        raw = _sum(rows)
        size = np.abs(raw)
        return np.divide(raw, size, out=np.zeros_like(raw), where=size > 0)

    return Verbs(_product, unit)


def _hrr(vsa: VSA) -> Verbs:
    def convolved(rows: Array) -> Array:
        return np.fft.irfft(_product(np.fft.rfft(rows)), vsa.dim).astype(rows.dtype)

    def unit(rows: Array) -> Array:
        raw = _sum(rows)
        return raw / (np.linalg.norm(raw) or 1)

    def noise(program: Array) -> Callable[[Array, Array], float]:
        # Parseval's theorem; every frequency of a real vector counts twice, except the first and, for even d, the last.
        power = np.abs(np.fft.rfft(program)) ** 2 * 2 / vsa.dim
        power[0] /= 2
        if vsa.dim % 2 == 0:
            power[-1] /= 2
        return lambda key, _: float(power @ np.abs(np.fft.rfft(key)) ** 2)

    return Verbs(convolved, unit, noise)


_VERBS: dict[type, Callable[[Any], Verbs]] = {MAP: _map, BSC: _bsc, FHRR: _fhrr, HRR: _hrr}


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

    def encode(x: Array) -> Array:
        cells, observed = binned(x), ~np.isnan(x)
        if observed.all():
            return join(table[sensors, cells.astype(np.int64)])
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


def _rolled(x: Array, shift: int) -> Array:
    return np.concatenate((x[-shift:], x[:-shift])) if shift else x


def _fixed(protection: Any, _: Verbs) -> Row:
    shift = protection.shift % protection.vsa.dim
    return lambda x: _rolled(x, shift)


def _self_shift(protection: Any, known: Verbs) -> Row:
    bundle, dim, name = known.bundle, protection.vsa.dim, protection.h.numpy()

    def protect(x: Array) -> Array:
        pair = np.empty((2, dim), x.dtype)
        pair[1] = name
        positions = np.flatnonzero(~x if x.dtype == np.bool_ else np.real(x) > 0)
        count, total = len(positions), int(positions.sum())
        width = total % dim if protection.width_rule == "sum" else (2 * total + count) // max(2 * count, 1)
        pair[0] = x
        return _rolled(bundle(pair), width)

    return protect


_PROTECTIONS: dict[type, Callable[[Any, Verbs], Row]] = {
    Unprotected: lambda _, __: lambda x: x,
    FixedShift: _fixed,
    SelfShift: _self_shift,
}
