"""The laws of the algebra, on every listed architecture."""

import math
from collections.abc import Callable

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor
from torch.testing import assert_close

import torchvsa
from torchvsa import VSA
from torchvsa.testing import check_architecture

Draw = Callable[..., Tensor]


def test_every_architecture_keeps_the_laws(vsa: VSA) -> None:
    check_architecture(vsa)


@pytest.mark.parametrize(
    "vsa",
    [
        torchvsa.MAP(500, atoms="uniform"),
        torchvsa.MAP(501, dtype=torch.float64),
        torchvsa.HRR(501, torch.float64),
        torchvsa.FHRR(501, torch.complex128),
    ],
    ids=repr,
)
def test_other_types_atoms_and_dimensions_keep_the_laws(vsa: VSA) -> None:
    check_architecture(vsa)


def test_unbind_is_exact_where_the_architecture_says_so(vsa: VSA, draw: Draw) -> None:
    a, key = draw(2, 10)
    recovered = vsa.unbind(vsa.bind(a, key), key)
    if vsa.exact:
        assert_close(recovered, a)
    else:
        # Correlations and transposed matrices give a · (1 + noise of equal power): cosine 1/√2, spread about 1/√d.
        assert_close(vsa.similarity(recovered, a), torch.full((10,), 0.5**0.5), atol=0.1, rtol=0)


def test_an_architecture_says_whether_binding_is_its_own_inverse(vsa: VSA, draw: Draw) -> None:
    a, key = draw(2)
    twice = vsa.bind(vsa.bind(a, key), key)
    assert vsa.self_inverse == (vsa.similarity(twice, a).item() == pytest.approx(1, abs=1e-5))
    assert not torchvsa.MAP(10, atoms="uniform").self_inverse


@settings(deadline=None, derandomize=True, max_examples=30)
@given(data=st.data())
def test_permute_rotates_each_row_by_its_own_shift(vsa: VSA, draw: Draw, data: st.DataObject) -> None:
    batch, shape = data.draw(st.sampled_from([((), ()), ((3,), ()), ((), (3,)), ((2, 1), (3,)), ((2, 3), (2, 3))]))
    count = math.prod(shape)
    drawn = data.draw(st.lists(st.integers(-3 * vsa.dim, 3 * vsa.dim), min_size=count, max_size=count))
    x, shifts = draw(*batch), torch.tensor(drawn).reshape(shape)
    rotated = vsa.permute(x, shifts)
    together = torch.broadcast_shapes(batch, shape)
    rows = zip(x.expand(*together, -1).reshape(-1, vsa.dim), shifts.expand(together).flatten().tolist(), strict=True)
    assert torch.equal(rotated, torch.stack([torch.roll(row, s, -1) for row, s in rows]).reshape(rotated.shape))
    assert rotated.shape == (*together, vsa.dim)


def test_permute_moves_element_i_to_i_plus_shift(vsa: VSA) -> None:
    x = torch.zeros(vsa.dim)
    x[5] = 1
    for shift in (3, 3 - vsa.dim, torch.tensor(3 + vsa.dim)):
        assert vsa.permute(x, shift).argmax() == 8


@pytest.mark.parametrize("dim", [1, 7, 8, 2003])
@pytest.mark.parametrize("name", ["MAP-C", "MAP-B", "MAP-I", "BSC"])
def test_rows_drawn_one_by_one_are_the_rows_drawn_at_once(name: str, dim: int) -> None:
    vsa = torchvsa.architecture(name, dim)
    together, single = torch.Generator().manual_seed(0), torch.Generator().manual_seed(0)
    at_once = vsa.random(2, 3, generator=together)
    one_by_one = torch.stack([vsa.random(generator=single) for _ in range(6)])
    assert torch.equal(at_once.reshape(6, dim), one_by_one)


def test_ngrams_tell_the_order_of_their_members(vsa: VSA, draw: Draw, chance: float) -> None:
    a, b, c = draw(3)
    orders = torch.stack([vsa.ngrams(xs) for xs in ([a, b, c], [b, a, c], [a, c, b], [c, b, a])])
    # As the docstring says, a rotation commutes with HRR's convolution, and the rotations of BSDC-S with one another.
    confused = {"HRR": [0, 1, 2, 3], "BSDC-S": [0, 2]}.get(vsa.name, [0])
    similarity = vsa.similarity(orders[0], orders)
    assert_close(similarity[confused], torch.ones(len(confused)))
    assert all(similarity[i].abs() < chance for i in range(4) if i not in confused)
