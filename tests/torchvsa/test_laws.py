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
from torchvsa.exact import norms

Draw = Callable[..., Tensor]


def test_atoms_are_unrelated(vsa: VSA, draw: Draw, chance: float) -> None:
    atoms = draw(20)
    gram = vsa.similarity(atoms[:, None], atoms)
    assert_close(gram.diagonal(), torch.ones(20))
    assert (gram - torch.eye(20)).abs().max() < chance


def test_bind_commutes_and_associates(vsa: VSA, draw: Draw) -> None:
    a, b, c = draw(3)
    assert_close(vsa.bind(a, b), vsa.bind(b, a))
    assert_close(vsa.bind(vsa.bind(a, b), c), vsa.bind(a, vsa.bind(b, c)))


def test_bound_is_dissimilar_to_both(vsa: VSA, draw: Draw, chance: float) -> None:
    a, b = draw(2)
    assert vsa.similarity(vsa.bind(a, b), torch.stack([a, b])).abs().max() < chance


def test_unbind_undoes_bind(vsa: VSA, draw: Draw) -> None:
    a, key = draw(2, 10)
    recovered = vsa.unbind(vsa.bind(a, key), key)
    if vsa.elementwise:
        assert_close(recovered, a)
    else:
        # Circular correlation gives a · (1 + noise of equal power): cosine 1/√2, with a spread of about 1/√d.
        assert_close(vsa.similarity(recovered, a), torch.full((10,), 0.5**0.5), atol=0.1, rtol=0)


def test_the_identity_binds_to_nothing(vsa: VSA, draw: Draw) -> None:
    a = draw(3)
    assert_close(vsa.bind(a, vsa.identity()), a)
    assert_close(vsa.unbind(a, vsa.identity()), a)


def test_bind_is_linear_over_a_raw_accumulator(vsa: VSA, draw: Draw) -> None:
    xs, key = draw(6), draw(seed=1)
    weights = torch.tensor([1, 2, 0, -1, 3, 1])
    raw = vsa.superpose(xs, weights=weights)
    assert_close(vsa.bind(raw, key), vsa.superpose(vsa.bind(xs, key), weights=weights))
    assert_close(vsa.bind(key, raw), vsa.superpose(vsa.bind(key, xs), weights=weights))
    assert_close(vsa.unbind(raw, key), vsa.superpose(vsa.unbind(xs, key), weights=weights))
    assert_close(vsa.permute(raw, 7), vsa.superpose(vsa.permute(xs, 7), weights=weights))


def test_superpose_adds_up(vsa: VSA, draw: Draw) -> None:
    xs = draw(5)
    assert_close(vsa.superpose(xs[:2]) + vsa.superpose(xs[2:]), vsa.superpose(xs))
    assert vsa.superpose(xs).dtype == vsa.accumulator


def test_a_bundle_resembles_its_members_only(vsa: VSA, draw: Draw, chance: float) -> None:
    atoms = draw(10)
    similarity = vsa.similarity(vsa.bundle(atoms[:5]), atoms)
    # The weakest rule is the majority: of 5 voters each keeps C(4, 2) / 2^4 = 3/8 of the similarity.
    assert similarity[:5].min() > 3 / 8 - chance
    assert similarity[5:].abs().max() < chance


def test_a_bundle_does_not_depend_on_order(vsa: VSA, draw: Draw) -> None:
    xs = draw(7)
    assert_close(vsa.bundle(xs[torch.tensor([3, 6, 0, 5, 1, 4, 2])]), vsa.bundle(xs))


def test_two_are_bundled_as_any_number_is(vsa: VSA, draw: Draw) -> None:
    a, b = draw(4, 3), draw(3)
    for x, y in ((a, b), (a[0], a[1]), (vsa.bundle(a, 0), b)):
        assert_close(
            vsa.bundle_two(x, y), vsa.bundle(torch.stack(torch.broadcast_tensors(x, y.to(x.dtype)), -2)), rtol=0, atol=0
        )


@pytest.mark.parametrize("dim", [0, 1, 2, -2, -3])
def test_bundle_sums_over_any_dimension(vsa: VSA, draw: Draw, dim: int) -> None:
    xs = draw(3, 4, 5)
    weights = torch.tensor([1, 3, 2, 1, 1])[: xs.shape[dim]]
    rows = xs.movedim(dim, -2).flatten(0, 1)
    assert_close(vsa.bundle(xs, dim).flatten(0, 1), torch.stack([vsa.bundle(row) for row in rows]))
    expected = torch.stack([vsa.bundle(row, weights=weights) for row in rows])
    assert_close(vsa.bundle(xs, dim, weights).flatten(0, 1), expected)


def test_integer_weights_repeat_and_zero_weights_leave_out(vsa: VSA, draw: Draw) -> None:
    xs = draw(4)
    # Four votes, and six: architectures that decide by majority meet ties here.
    for weights in ([1, 2, 1, 0], [0, 1, 2, 3], [0, 1, 0, 1]):
        repeated = xs.repeat_interleave(torch.tensor(weights), 0)
        assert_close(vsa.bundle(xs, weights=torch.tensor(weights)), vsa.bundle(repeated))


def test_each_batch_element_may_have_weights_of_its_own(vsa: VSA, draw: Draw) -> None:
    xs = draw(3, 4)
    weights = torch.tensor([[1, 1, 1, 1], [0, 1, 0, 1], [2, 0, 1, 1]])
    singles = torch.stack([vsa.bundle(x, weights=w) for x, w in zip(xs, weights, strict=True)])
    assert torch.equal(vsa.bundle(xs, weights=weights), singles)


def test_real_weights_scale_the_members(vsa: VSA, draw: Draw) -> None:
    a, b = draw(2)
    raw = vsa.superpose(torch.stack([a, b]), weights=torch.tensor([0.25, 0.75]))
    ratio = vsa.similarity(raw, b) / vsa.similarity(raw, a)
    assert ratio.item() == pytest.approx(3, rel=0.25)


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


def test_permute_keeps_similarity_and_is_undone(vsa: VSA, draw: Draw, chance: float) -> None:
    a, b = draw(), vsa.bundle(draw(3))
    rotated = vsa.permute(a, 17)
    assert abs(vsa.similarity(rotated, a)) < chance
    assert_close(vsa.similarity(rotated, vsa.permute(b, 17)), vsa.similarity(a, b))
    assert torch.equal(vsa.permute(rotated, -17), a)
    assert torch.equal(vsa.permute(vsa.permute(a, 5), 12), rotated)


def test_a_batch_is_its_singles(vsa: VSA, draw: Draw) -> None:
    a, b = draw(2, 5)
    xs = draw(5, 4, seed=1)
    raw = vsa.superpose(xs)
    shifts = torch.tensor([0, 1, -1, 700, 5000])

    def same(verb: Callable[..., Tensor], *batches: Tensor) -> None:
        singles = torch.stack([verb(*row) for row in zip(*batches, strict=True)])
        if vsa.elementwise:
            assert torch.equal(verb(*batches), singles)
        else:
            # A Fourier transform rounds in another order in a batch.
            assert_close(verb(*batches), singles, rtol=1e-5, atol=1e-7)

    same(vsa.bind, a, b)
    same(vsa.unbind, a, b)
    same(vsa.bundle, xs)
    same(vsa.normalize, raw)
    same(vsa.permute, a, shifts)
    same(vsa.similarity, a, raw)


def test_an_empty_batch_gives_an_empty_batch(vsa: VSA, draw: Draw) -> None:
    nothing, key = draw(0), draw()
    for result in (vsa.bind(nothing, key), vsa.unbind(key, nothing), vsa.permute(nothing, torch.empty(0).long())):
        assert result.shape == (0, vsa.dim)
    assert vsa.bundle(draw(0, 3)).shape == (0, vsa.dim)
    assert vsa.similarity(nothing, key).shape == (0,)


def test_similarity_is_symmetric_and_bounded(vsa: VSA, draw: Draw) -> None:
    x = torch.cat([vsa.superpose(draw(6, 3)), 1000 * vsa.superpose(draw(1, 1, seed=1))])
    gram = vsa.similarity(x[:, None], x)
    assert torch.equal(gram, gram.T)
    assert gram.abs().max() <= 1 + 1e-6
    assert_close(vsa.similarity(x, -x), -torch.ones(7))


def test_a_zero_vector_is_similar_to_nothing(vsa: VSA, draw: Draw) -> None:
    zero = torch.zeros(vsa.dim, dtype=vsa.accumulator)
    assert vsa.similarity(zero, draw()).item() == 0
    assert vsa.similarity(zero, zero).item() == 0


def test_a_zero_vector_has_a_gradient_without_nan(vsa: VSA, draw: Draw) -> None:
    if vsa.integer:
        pytest.skip("integer codes have no gradient")
    a = torch.cat([torch.zeros(1, vsa.dim, dtype=vsa.dtype), draw(2)]).requires_grad_()
    loss = vsa.similarity(a[:, None], a).sum() + vsa.unbound_norm(a[0], a).sum() + vsa.bundle(a[:1]).abs().sum()
    (gradient,) = torch.autograd.grad(loss, a)
    assert gradient.isfinite().all()
    assert gradient[1:].abs().max() > 0


def test_unbound_norm_is_the_norm_of_the_unbound(vsa: VSA, draw: Draw) -> None:
    program, keys = vsa.superpose(draw(9)), vsa.bundle(draw(4, 3, seed=1))
    assert_close(vsa.unbound_norm(program, keys), norms(vsa.unbind(program, keys)), rtol=1e-6, atol=0)
    if vsa.integer:
        assert torch.equal(vsa.unbound_norm(program, keys), norms(vsa.unbind(program, keys)))


def test_the_same_seed_draws_the_same_bits(vsa: VSA, draw: Draw) -> None:
    assert torch.equal(draw(3, 2, seed=4), draw(3, 2, seed=4))
    assert not torch.equal(draw(3, seed=4), draw(3, seed=5))


@pytest.mark.parametrize("dim", [1, 7, 8, 2003])
@pytest.mark.parametrize("name", ["MAP-C", "MAP-B", "MAP-I", "BSC"])
def test_rows_drawn_one_by_one_are_the_rows_drawn_at_once(name: str, dim: int) -> None:
    vsa = torchvsa.architecture(name, dim)
    together, single = torch.Generator().manual_seed(0), torch.Generator().manual_seed(0)
    at_once = vsa.random(2, 3, generator=together)
    one_by_one = torch.stack([vsa.random(generator=single) for _ in range(6)])
    assert torch.equal(at_once.reshape(6, dim), one_by_one)


def test_an_architecture_is_made_again_from_its_config(vsa: VSA) -> None:
    config = vsa.config()
    again = torchvsa.architecture(str(config["name"]), int(config["dim"]), str(config["dtype"]))
    assert again == vsa
    assert hash(again) == hash(vsa)
    assert again != torchvsa.architecture(vsa.name, vsa.dim + 1, vsa.dtype)
