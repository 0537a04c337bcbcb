"""Sparse codes against plain NumPy: ones at positions, shifts by widths, and segments whose places add up."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from readings import seeded
from torch import Tensor

from torchvsa import BSDC, BSDCSEG

SPARSE = [BSDC(400), BSDC(401), BSDCSEG(400), BSDCSEG(391)]
sparse = pytest.mark.parametrize("vsa", SPARSE, ids=repr)
Sparse = BSDC | BSDCSEG


@sparse
def test_random_hypervectors_have_about_the_root_of_d_ones(vsa: Sparse) -> None:
    x = vsa.random(50, generator=seeded())
    assert x.dtype == torch.int8
    assert (x.sum(-1) == vsa.ones).all()
    assert vsa.ones == pytest.approx(vsa.dim**0.5, rel=0.2)


@sparse
def test_every_position_is_as_likely(vsa: Sparse) -> None:
    share = vsa.random(4000, generator=seeded()).double().mean(0)
    expected = vsa.ones / vsa.dim
    assert (share - expected).abs().max() < 5 * (expected / 4000) ** 0.5


@sparse
def test_positions_list_the_ones_and_make_them_again(vsa: Sparse) -> None:
    x = torch.cat([vsa.random(5, generator=seeded()), vsa.bundle(vsa.random(2, 3, generator=seeded(1)))])
    positions = vsa.positions(x)
    assert positions.dtype == torch.int32
    for row, found in zip(x.numpy(), positions.tolist(), strict=True):
        ones = np.flatnonzero(row).tolist()
        assert found == ones + [-1] * (positions.shape[1] - len(ones))
    assert torch.equal(vsa.from_positions(positions), x)
    assert vsa.positions(x[:0]).shape == (0, 0)


@sparse
def test_positions_take_a_fraction_of_the_bytes(vsa: Sparse) -> None:
    x = vsa.random(3, generator=seeded())
    positions = vsa.positions(x)
    assert positions.numel() * positions.element_size() == 3 * 4 * vsa.ones
    assert x.numel() * x.element_size() == 3 * vsa.dim


@pytest.mark.parametrize("wrong", [[-2], [400]])
def test_positions_out_of_range_are_refused(wrong: list[int]) -> None:
    with pytest.raises(ValueError, match=r"from 0 to 399, or -1 for none"):
        BSDC(400).from_positions(torch.tensor(wrong))


@sparse
def test_a_bundle_is_the_disjunction(vsa: Sparse) -> None:
    xs = vsa.random(7, 4, generator=seeded())
    assert torch.equal(vsa.bundle(xs), xs.amax(-2))


@pytest.mark.parametrize("vsa", SPARSE[:2], ids=repr)
def test_the_key_names_a_shift(vsa: BSDC) -> None:
    x, keys = vsa.random(20, generator=seeded()), vsa.random(20, generator=seeded(1))
    widths = [int(np.flatnonzero(key).sum()) % vsa.dim for key in keys.numpy()]
    assert vsa.width(keys).tolist() == widths
    shifted = np.stack([np.roll(row, width) for row, width in zip(x.numpy(), widths, strict=True)])
    assert torch.equal(vsa.bind(x, keys), torch.from_numpy(shifted))
    assert torch.equal(vsa.unbind(vsa.bind(x, keys), keys), x)


@pytest.mark.parametrize("vsa", SPARSE[2:], ids=repr)
def test_places_of_segments_add_up(vsa: BSDCSEG) -> None:
    x, keys = vsa.random(20, generator=seeded()), vsa.random(20, generator=seeded(1))

    def places(rows: Tensor) -> np.ndarray:
        return rows.numpy().reshape(-1, vsa.places, vsa.blocks).argmax(1)

    assert (places(vsa.bind(x, keys)) == (places(x) + places(keys)) % vsa.places).all()
    assert (places(vsa.unbind(x, keys)) == (places(x) - places(keys)) % vsa.places).all()
    assert (places(vsa.inverse(x)) == -places(x) % vsa.places).all()
    assert (vsa.bind(x, keys).sum(-1) == vsa.ones).all()
    # A rotation keeps one place per segment.
    assert (vsa.permute(x, 3).reshape(-1, vsa.places, vsa.blocks).sum(1) == 1).all()


@settings(deadline=None, derandomize=True, max_examples=30)
@given(seed=st.integers(0, 2**16), largest=st.sampled_from([1, 100, 2**12]))
def test_segments_of_sums_are_convolved_exactly(seed: int, largest: int) -> None:
    vsa = BSDCSEG(30)
    a, b = torch.randint(-largest, largest + 1, (2, 3, 30), generator=seeded(seed), dtype=torch.int32)
    here, there = (x.numpy().astype(object).reshape(3, vsa.places, vsa.blocks) for x in (a, b))
    bound, unbound = np.zeros_like(here), np.zeros_like(here)
    for i in range(vsa.places):
        for j in range(vsa.places):
            bound[:, (i + j) % vsa.places] += here[:, i] * there[:, j]
            unbound[:, (i - j) % vsa.places] += here[:, i] * there[:, j]
    assert vsa.bind(a, b).tolist() == bound.reshape(3, 30).tolist()
    assert vsa.unbind(a, b).tolist() == unbound.reshape(3, 30).tolist()


def test_products_that_would_not_be_exact_are_refused() -> None:
    vsa = BSDCSEG(30)
    big = torch.full((30,), 2**30, dtype=torch.int32)
    with pytest.raises(ValueError, match="too large to be exact"):
        vsa.bind(big, big)
    with pytest.raises(ValueError, match="beyond the limit of int32"):
        vsa.bind(big, vsa.superpose(vsa.random(3, generator=seeded())))


@pytest.mark.parametrize("dim", [7, 11, 401, 2 * 211])
def test_segments_need_a_divisor_near_the_root(dim: int) -> None:
    with pytest.raises(ValueError, match=f"BSDCSEG does not allow dim={dim}; the nearest allowed"):
        BSDCSEG(dim)
