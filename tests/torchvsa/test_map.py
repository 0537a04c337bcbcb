"""MAP: what its variants, types and kinds of atoms do."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from torch.testing import assert_close

import torchvsa

bounded = settings(deadline=None, derandomize=True, max_examples=50)
SHAPES = hnp.array_shapes(min_dims=2, max_dims=3, max_side=6)
CODES = hnp.arrays(np.int8, SHAPES, elements=st.integers(-1, 1))
REALS = hnp.arrays(np.float32, SHAPES, elements=st.floats(-2, 2, width=16))


@bounded
@given(CODES)
def test_integer_codes_are_summed_then_clipped(xs: np.ndarray) -> None:
    total = xs.sum(-2, dtype=np.int64)
    codes = torch.from_numpy(xs)
    for variant, expected in (("C", np.clip(total, -1, 1)), ("I", total)):
        vsa = torchvsa.architecture(f"MAP-{variant}", xs.shape[-1], "int8")
        assert (vsa.bundle(codes).numpy() == expected).all()


@bounded
@given(REALS)
def test_float_atoms_are_summed_then_clipped(xs: np.ndarray) -> None:
    vsa = torchvsa.MAP(xs.shape[-1])
    expected = np.clip(xs.astype(np.float64).sum(-2), -1, 1)
    assert_close(vsa.bundle(torch.from_numpy(xs)).double(), torch.from_numpy(expected), atol=1e-5, rtol=0)


@pytest.mark.parametrize("variant", ["C", "B", "I"])
def test_both_types_hold_the_same_numbers(variant: str) -> None:
    floats = torchvsa.architecture(f"MAP-{variant}", 501)
    codes = torchvsa.architecture(f"MAP-{variant}", 501, "int8")
    x, y = (vsa.random(3, 4, generator=torch.Generator().manual_seed(0)) for vsa in (floats, codes))
    assert y.dtype == torch.int8
    for result, exact in (
        (x, y),
        (floats.bind(x, x[:1]), codes.bind(y, y[:1])),
        (floats.superpose(x), codes.superpose(y)),
        (floats.bundle(x), codes.bundle(y)),
        (floats.bundle(x, weights=torch.tensor([2, 0, 1, 1])), codes.bundle(y, weights=torch.tensor([2, 0, 1, 1]))),
    ):
        assert torch.equal(result, exact.to(torch.float32))
    assert torch.equal(floats.similarity(x[:, None], x), codes.similarity(y[:, None], y))


def test_a_thousand_int8_voters_do_not_overflow() -> None:
    summing, clipping = (torchvsa.architecture(name, 64, "int8") for name in ("MAP-I", "MAP-C"))
    x = summing.random(generator=torch.Generator().manual_seed(0))
    voters = x.expand(1000, 64)
    raw = summing.bundle(voters)
    assert raw.dtype == torch.int32
    assert torch.equal(raw, 1000 * x.to(torch.int32))
    assert torch.equal(clipping.bundle(voters), x)
    assert summing.similarity(raw, x).item() == 1
    assert torch.equal(summing.superpose(x[None], weights=torch.tensor([1000])), raw)


def test_fractions_become_the_nearest_integer_codes() -> None:
    vsa = torchvsa.MAP(64, dtype=torch.int8)
    x = vsa.random(generator=torch.Generator().manual_seed(0))
    assert torch.equal(vsa.bundle(x.expand(3, 64), weights=torch.tensor([0.7, 0.2, 0.0999])), x)
    fractions = torch.tensor([-7.0, -0.9, -0.4, 0.0, 0.4, 0.6, 1.2])
    assert torchvsa.MAP(7, dtype=torch.int8).normalize(fractions).tolist() == [-1, -1, 0, 0, 0, 1, 1]
    assert torchvsa.MAP(7).normalize(fractions).tolist() == fractions.clamp(-1, 1).tolist()


def test_bipolar_atoms_are_fair() -> None:
    x = torchvsa.MAP(4001).random(50, generator=torch.Generator().manual_seed(0))
    assert ((x == 1) | (x == -1)).all()
    assert abs(x.mean()) < 5 / x.numel() ** 0.5


def test_uniform_atoms_fill_the_interval() -> None:
    x = torchvsa.MAP(4000, atoms="uniform").random(50, generator=torch.Generator().manual_seed(0))
    assert x.min() >= -1
    assert x.max() <= 1
    assert x.mean().item() == pytest.approx(0, abs=5 / (3 * x.numel()) ** 0.5)
    assert x.var().item() == pytest.approx(1 / 3, abs=0.005)


def test_a_clip_after_each_vector_forgets_what_one_clip_keeps() -> None:
    vsa = torchvsa.MAP(4000)
    xs = vsa.random(50, generator=torch.Generator().manual_seed(0))
    stepwise = torch.zeros(4000)
    for x in xs:
        stepwise = vsa.normalize(stepwise + x)
    at_once = vsa.similarity(vsa.bundle(xs), xs)
    in_steps = vsa.similarity(stepwise, xs)
    noise = 5 / 4000**0.5
    assert at_once.min() > 0.04
    assert in_steps[-1] > 0.4
    assert in_steps[:10].abs().max() < noise
