"""The laws of reading items out of programs."""

from collections.abc import Callable

import torch
from torch.testing import assert_close

from torchvsa._numerics import norms
from torchvsa.architectures import VSA
from torchvsa.testing._laws import draw


def _unbind_is_linear_over_a_raw_accumulator(vsa: VSA) -> None:
    xs, key, weights = draw(vsa, 6), draw(vsa, seed=1), torch.tensor([1, 2, 0, -1, 3, 1])
    raw = vsa.superpose(xs, weights=weights)
    assert_close(vsa.unbind(raw, key), vsa.superpose(vsa.unbind(xs, key), weights=weights))


def _a_readout_unbinds_and_compares(vsa: VSA) -> None:
    programs, conditions, items = (
        vsa.superpose(draw(vsa, 2, 9), -2),
        vsa.bundle(draw(vsa, 4, 3, seed=1)),
        draw(vsa, 5),
    )
    for program in (programs[0], programs):
        noisy = vsa.unbind(program, conditions if program.dim() == 1 else conditions[:, None])
        cosines = vsa.similarity(noisy[..., None, :], items).double()
        readout = vsa.readout(program, items)
        assert_close(readout(conditions), cosines * norms(noisy)[..., None], rtol=1e-5, atol=1e-5)
        match, top = readout.match(conditions), cosines.float().topk(2)
        clear = match.margin > 1e-5  # sparse items often score the same
        assert_close(match.index[clear], top.indices[..., 0][clear])
        assert_close(match.similarity, top.values[..., 0], rtol=1e-5, atol=1e-6)
        assert_close(match.margin, top.values[..., 0] - top.values[..., 1], rtol=1e-5, atol=1e-6)


def _unbound_norm_is_the_norm_of_the_unbound(vsa: VSA) -> None:
    program, keys = vsa.superpose(draw(vsa, 9)), vsa.bundle(draw(vsa, 4, 3, seed=1))
    expected = norms(vsa.unbind(program, keys))
    assert_close(vsa.unbound_norm(program, keys), expected, rtol=0 if vsa.integer else 1e-6, atol=0)


READOUT_LAWS: tuple[Callable[[VSA], None], ...] = (
    _unbind_is_linear_over_a_raw_accumulator,
    _a_readout_unbinds_and_compares,
    _unbound_norm_is_the_norm_of_the_unbound,
)
