"""The operations of architectures on the few rows of one answer, in NumPy: see `torchvsa._rows`."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from torchvsa.architectures import BSC, BSDCSEG, FHRR, HRR, MAP, MBAT, MCR, VSA, VTB
from torchvsa.architectures.mcr import CANCELLED, HALFWAY

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
        return np.where(total == 0, rolled(rows[0] * rows[min(1, len(rows) - 1)], 1), total).astype(rows.dtype)

    def summed(rows: Array) -> Array:
        return np.add.reduce(rows, 0, dtype=np.int32 if vsa.integer else rows.dtype)

    return Verbs(_product, {"C": clipped, "I": summed, "B": majority}[vsa.variant])


def _bsc(_: VSA) -> Verbs:
    def majority(rows: Array) -> Array:
        ones = 2 * np.add.reduce(rows, 0, dtype=np.int32)
        return np.where(ones == len(rows), rolled(rows[0] ^ rows[min(1, len(rows) - 1)], 1), ones > len(rows))

    return Verbs(lambda rows: np.logical_xor.reduce(rows, 0), majority)


def _fhrr(_: VSA) -> Verbs:
    def unit(rows: Array) -> Array:
        raw = _sum(rows)
        size = np.abs(raw)
        return np.divide(raw, size, out=np.zeros_like(raw), where=size > 0)

    return Verbs(_product, unit)


def _mcr(vsa: Any) -> Verbs:
    roots = vsa.from_numbers(torch.arange(vsa.modulus)).numpy()

    def nearest(raw: Array) -> Array:
        sizes = np.abs(raw)
        steps = np.floor(np.angle(raw) * (vsa.modulus / (2 * np.pi)) + (0.5 - HALFWAY)).astype(np.int64)
        return np.where(sizes <= CANCELLED * sizes.max(), 0, roots[steps % vsa.modulus])

    return Verbs(lambda rows: nearest(_product(rows)), lambda rows: nearest(_sum(rows)))


def _unit(rows: Array) -> Array:
    raw = _sum(rows)
    return raw / (np.linalg.norm(raw) or 1)


def _hrr(vsa: VSA) -> Verbs:
    def convolved(rows: Array) -> Array:
        return np.fft.irfft(_product(np.fft.rfft(rows)), vsa.dim).astype(rows.dtype)

    def noise(program: Array) -> Callable[[Array, Array], float]:
        # Parseval's theorem; every frequency of a real vector counts twice, except the first and, for even d, the last.
        power = np.abs(np.fft.rfft(program)) ** 2 * 2 / vsa.dim
        power[0] /= 2
        if vsa.dim % 2 == 0:
            power[-1] /= 2
        return lambda key, _: float(power @ np.abs(np.fft.rfft(key)) ** 2)

    return Verbs(convolved, _unit, noise)


def _mbat(vsa: VSA) -> Verbs:
    scale = vsa.dim**0.5 / 2

    def multiplied(rows: Array) -> Array:
        product = rows[0].reshape(4, -1)
        for row in rows[1:]:
            (a, b, c, e), (p, q, r, s) = product, row.reshape(4, -1)
            parts = (a * p - b * q - c * r - e * s, a * q + b * p + c * s - e * r)
            parts += (a * r - b * s + c * p + e * q, a * s + b * r - c * q + e * p)
            product = scale * np.stack(parts)
        return product.reshape(-1).astype(rows.dtype, copy=False)

    def noise(program: Array) -> Callable[[Array, Array], float]:
        power = scale**2 * (real(program) ** 2).reshape(4, -1).sum(0)
        return lambda _, squares: float(power @ squares.reshape(4, -1).sum(0))

    return Verbs(multiplied, _unit, noise)


def _vtb(vsa: VSA) -> Verbs:
    side = round(vsa.dim**0.5)
    scale = side**0.5

    def transformed(rows: Array) -> Array:
        first, *others = rows.reshape(-1, side, side)
        for matrix in others:
            first = scale * (first @ matrix.T)
        return first.reshape(-1).astype(rows.dtype, copy=False)

    def noise(program: Array) -> Callable[[Array, Array], float]:
        matrix = scale * real(program).reshape(side, side)
        return lambda key, _: float(np.square(matrix @ key.reshape(side, side)).sum())

    return Verbs(transformed, _unit, noise)


def _bsdc_seg(vsa: Any) -> Verbs:
    shape = vsa.places, vsa.blocks

    def spectrum(rows: Array) -> Array:
        return np.fft.rfft(rows.reshape(*rows.shape[:-1], *shape).astype(np.float64), axis=-2)

    def whole(product: Array) -> Array:
        return np.rint(np.fft.irfft(product, vsa.places, axis=-2)).reshape(-1)

    def noise(program: Array) -> Callable[[Array, Array], float]:
        own = spectrum(program)
        return lambda key, _: float(np.square(whole(own * spectrum(key).conj())).sum())

    return Verbs(
        lambda rows: whole(_product(spectrum(rows))).astype(rows.dtype),
        lambda rows: rows.any(0).astype(rows.dtype),
        noise,
    )


_VERBS: dict[type, Callable[[Any], Verbs]] = {
    MAP: _map, BSC: _bsc, FHRR: _fhrr, MCR: _mcr, HRR: _hrr, MBAT: _mbat, VTB: _vtb, BSDCSEG: _bsdc_seg
}  # fmt: skip


def rolled(x: Array, shift: int) -> Array:
    """The row rotated to the right."""
    return np.concatenate((x[-shift:], x[:-shift])) if shift else x
