"""The laws of architectures."""

from collections.abc import Callable

import torch
from torch import Tensor
from torch.testing import assert_close

from torchvsa.architectures import ARCHITECTURES, VSA, architecture
from torchvsa.errors import ShapeError
from torchvsa.testing._derived import DERIVED_LAWS
from torchvsa.testing._laws import check, draw, refuses, require, same, seeded
from torchvsa.testing._readout import READOUT_LAWS


def check_architecture(vsa: VSA) -> None:
    """Check the laws of architectures. Raises `AssertionError` that names the first broken law."""
    check(vsa, _LAWS)


def _chance(vsa: VSA) -> float:
    # Two sparse hypervectors have few ones in common: a Poisson number, whose tail is longer than a normal one.
    return (8 if vsa.sparse else 5) / vsa.dim**0.5


def _the_seed_decides_the_atoms(vsa: VSA) -> None:
    same(draw(vsa, 3, 2, seed=4), draw(vsa, 3, 2, seed=4))
    require(not torch.equal(draw(vsa, 3, seed=4), draw(vsa, 3, seed=5)))


def _atoms_are_codes_of_their_own_type(vsa: VSA) -> None:
    atoms = draw(vsa, 2, 3)
    require(atoms.shape == (2, 3, vsa.dim), f"shape {tuple(atoms.shape)}")
    vsa.check_codes(atoms, "random hypervectors")
    vsa.check(vsa.identity(), "the identity")
    refuses(ShapeError, lambda: vsa.check(atoms[..., 1:], "x"))


def _atoms_are_unrelated(vsa: VSA) -> None:
    atoms = draw(vsa, 20)
    gram = vsa.similarity(atoms[:, None], atoms)
    assert_close(gram.diagonal(), torch.ones(20))
    require((gram - torch.eye(20)).abs().max() < _chance(vsa))


def _bind_commutes_and_associates(vsa: VSA) -> None:
    if vsa.commutative:
        a, b, c = draw(vsa, 3)
        assert_close(vsa.bind(a, b), vsa.bind(b, a))
        assert_close(vsa.bind(vsa.bind(a, b), c), vsa.bind(a, vsa.bind(b, c)))


def _bound_is_dissimilar_to_both(vsa: VSA) -> None:
    a, b = draw(vsa, 2)
    require(vsa.similarity(vsa.bind(a, b), torch.stack([a, b])).abs().max() < _chance(vsa))


def _unbind_undoes_bind(vsa: VSA) -> None:
    a, key = draw(vsa, 2, 10)
    recovered = vsa.unbind(vsa.bind(a, key), key)
    if vsa.self_inverse:
        assert_close(recovered, a)
        assert_close(vsa.bind(vsa.bind(a, key), key), a)
    if vsa.exact:
        assert_close(recovered, a)
    # Approximate inverses add noise of the signal's own power: cosine 1/√2.
    require(vsa.similarity(recovered, a).min() > 0.5**0.5 - _chance(vsa))


def _the_identity_binds_to_nothing(vsa: VSA) -> None:
    a = draw(vsa, 3)
    assert_close(vsa.bind(a, vsa.identity()), a)
    assert_close(vsa.unbind(a, vsa.identity()), a)


def _bind_is_linear_over_a_raw_accumulator(vsa: VSA) -> None:
    xs, key, weights = draw(vsa, 6), draw(vsa, seed=1), torch.tensor([1, 2, 0, -1, 3, 1])
    raw = vsa.superpose(xs, weights=weights)
    assert_close(vsa.permute(raw, 7), vsa.superpose(vsa.permute(xs, 7), weights=weights))
    assert_close(vsa.bind(raw, key), vsa.superpose(vsa.bind(xs, key), weights=weights))
    if vsa.bilinear:
        assert_close(vsa.bind(key, raw), vsa.superpose(vsa.bind(key, xs), weights=weights))
        assert_close(vsa.unbind(key, raw), vsa.superpose(vsa.unbind(key, xs), weights=weights))


def _superpose_adds_up(vsa: VSA) -> None:
    xs = draw(vsa, 5)
    assert_close(vsa.superpose(xs[:2]) + vsa.superpose(xs[2:]), vsa.superpose(xs))
    require(vsa.superpose(xs).dtype == vsa.accumulator, "sums are not of the type `accumulator`")


def _a_bundle_resembles_its_members_only(vsa: VSA) -> None:
    atoms = draw(vsa, 10)
    similarity = vsa.similarity(vsa.bundle(atoms[:5]), atoms)
    # The majority keeps the least: for each of 5 summands a similarity of C(4, 2) / 2^4 = 3/8.
    require(similarity[:5].min() > 3 / 8 - _chance(vsa), f"members: {similarity[:5].tolist()}")
    require(similarity[5:].abs().max() < _chance(vsa), f"others: {similarity[5:].tolist()}")


def _a_bundle_does_not_depend_on_order(vsa: VSA) -> None:
    xs = draw(vsa, 7)
    assert_close(vsa.bundle(xs[torch.tensor([3, 6, 0, 5, 1, 4, 2])]), vsa.bundle(xs))


def _two_are_bundled_as_any_number_is(vsa: VSA) -> None:
    a, b = draw(vsa, 4, 3), draw(vsa, 3)
    for x, y in ((a, b), (a[0], a[1]), (vsa.bundle(a, 0), b)):
        same(vsa._bundle_pair(x, y), vsa.bundle(torch.stack(torch.broadcast_tensors(x, y.to(x.dtype)), -2)))


def _bundle_sums_over_any_dimension(vsa: VSA) -> None:
    xs = draw(vsa, 3, 4, 5)
    for dim in (0, 1, 2, -2, -3):
        weights = torch.tensor([1, 3, 2, 1, 1])[: xs.shape[dim]]
        rows = xs.movedim(dim, -2).flatten(0, 1)
        assert_close(vsa.bundle(xs, dim).flatten(0, 1), torch.stack([vsa.bundle(row) for row in rows]))
        expected = torch.stack([vsa.bundle(row, weights=weights) for row in rows])
        assert_close(vsa.bundle(xs, dim, weights).flatten(0, 1), expected)


def _integer_weights_repeat_and_zero_weights_leave_out(vsa: VSA) -> None:
    xs = draw(vsa, 4)
    # An even number of summands, so that a majority has ties.
    for weights in ([1, 2, 1, 0], [0, 1, 2, 3], [0, 1, 0, 1]):
        repeated = xs.repeat_interleave(torch.tensor(weights), 0)
        assert_close(vsa.bundle(xs, weights=torch.tensor(weights)), vsa.bundle(repeated))


def _each_batch_element_may_have_its_own_weights(vsa: VSA) -> None:
    xs = draw(vsa, 3, 4)
    weights = torch.tensor([[1, 1, 1, 1], [0, 1, 0, 1], [2, 0, 1, 1]])
    singles = torch.stack([vsa.bundle(x, weights=w) for x, w in zip(xs, weights, strict=True)])
    same(vsa.bundle(xs, weights=weights), singles)


def _real_weights_scale_the_members(vsa: VSA) -> None:
    a, b = draw(vsa, 2)
    raw = vsa.superpose(torch.stack([a, b]), weights=torch.tensor([0.25, 0.75]))
    expected = torch.tensor([1.0, 3.0]) / 10**0.5
    assert_close(vsa.similarity(raw, torch.stack([a, b])), expected, atol=_chance(vsa), rtol=0)


def _permute_rotates_keeps_similarity_and_is_undone(vsa: VSA) -> None:
    a, b = draw(vsa), vsa.bundle(draw(vsa, 3))
    rotated = vsa.permute(a, 17)
    require(abs(vsa.similarity(rotated, a)) < _chance(vsa))
    assert_close(vsa.similarity(rotated, vsa.permute(b, 17)), vsa.similarity(a, b))
    same(rotated, torch.roll(a, 17, -1))
    same(vsa.permute(rotated, -17), a)
    same(vsa.permute(vsa.permute(a, 5), 12), rotated)


def _a_batch_is_its_singles(vsa: VSA) -> None:
    a, b = draw(vsa, 2, 5)
    xs = draw(vsa, 5, 4, seed=1)
    raw = vsa.superpose(xs)
    shifts = torch.tensor([0, 1, -1, 700, 5000])
    verbs: list[tuple[Callable[..., Tensor], tuple[Tensor, ...]]] = [
        (vsa.bind, (a, b)),
        (vsa.unbind, (a, b)),
        (vsa.bundle, (xs,)),
        (vsa.normalize, (raw,)),
        (vsa.permute, (a, shifts)),
        (vsa.similarity, (a, raw)),
    ]
    for verb, batches in verbs:
        singles = torch.stack([verb(*row) for row in zip(*batches, strict=True)])
        if vsa.elementwise and not vsa.dtype.is_complex:
            same(verb(*batches), singles)
        else:
            # Fourier transforms and complex magnitudes round in another order in a batch.
            assert_close(verb(*batches), singles, rtol=1e-5, atol=1e-7)


def _an_empty_batch_gives_an_empty_batch(vsa: VSA) -> None:
    nothing, key = draw(vsa, 0), draw(vsa)
    for result in (vsa.bind(nothing, key), vsa.unbind(key, nothing), vsa.permute(nothing, torch.empty(0).long())):
        require(result.shape == (0, vsa.dim))
    require(vsa.bundle(draw(vsa, 0, 3)).shape == (0, vsa.dim))
    require(vsa.similarity(nothing, key).shape == (0,))


def _similarity_is_symmetric_and_bounded(vsa: VSA) -> None:
    x = torch.cat([vsa.superpose(draw(vsa, 6, 3)), 1000 * vsa.superpose(draw(vsa, 1, 1, seed=1))])
    gram = vsa.similarity(x[:, None], x)
    same(gram, gram.T)
    require(gram.abs().max() <= 1 + 1e-6)
    assert_close(vsa.similarity(x, -x), -torch.ones(7))


def _a_zero_vector_is_similar_to_nothing(vsa: VSA) -> None:
    zero = torch.zeros(vsa.dim, dtype=vsa.accumulator)
    require(vsa.similarity(zero, draw(vsa)) == 0)
    require(vsa.similarity(zero, zero) == 0)


def _a_zero_vector_has_a_gradient_without_nan(vsa: VSA) -> None:
    if vsa.integer:
        return
    a = torch.cat([torch.zeros(1, vsa.dim, dtype=vsa.dtype), draw(vsa, 2)]).requires_grad_()
    loss = vsa.similarity(a[:, None], a).sum() + vsa.unbound_norm(a[0], a).sum() + vsa.bundle(a[:1]).abs().sum()
    (gradient,) = torch.autograd.grad(loss, a)
    require(gradient.isfinite().all())
    require(gradient[1:].abs().max() > 0)


def _a_negative_is_opposite(vsa: VSA) -> None:
    if vsa.negatable:
        a = draw(vsa, 3)
        assert_close(vsa.similarity(a, vsa.negative(a)), -torch.ones(3))
        same(vsa.negative(vsa.negative(a)), a)
    else:
        refuses(ValueError, lambda: vsa.negative(draw(vsa)))


def _angles_add_up_under_binding(vsa: VSA) -> None:
    if vsa.frequencies is None:
        refuses(ValueError, lambda: vsa.from_angles(torch.zeros(vsa.dim)))
        return
    a, b = 6 * torch.rand(2, vsa.frequencies, generator=seeded(0), dtype=torch.float64)
    x, y = vsa.from_angles(a), vsa.from_angles(b)
    vsa.check_codes(x, "a hypervector made of angles")
    assert_close(vsa.bind(x, y), vsa.from_angles(a + b), rtol=1e-4, atol=1e-4)
    assert_close(vsa.unbind(vsa.bind(x, y), y), x, rtol=1e-4, atol=1e-4)


def _a_dim_that_is_not_allowed_is_refused(vsa: VSA) -> None:
    require(vsa.allows_dim(vsa.dim), f"its own dim, {vsa.dim}, is not allowed")
    for dim in range(max(vsa.dim - 3, 1), vsa.dim + 4):
        if vsa.name in ARCHITECTURES and not vsa.allows_dim(dim):
            refuses(ValueError, lambda dim=dim: architecture(**(vsa.config() | {"dim": dim})))  # type: ignore[arg-type] (plain values)


def _it_is_made_again_from_its_config(vsa: VSA) -> None:
    require(set(vsa.config()) >= {"name", "dim", "dtype"})
    if vsa.name in ARCHITECTURES:
        for dim in filter(vsa.allows_dim, range(vsa.dim, vsa.dim + 2)):
            again = architecture(**(vsa.config() | {"dim": dim}))  # type: ignore[arg-type] (plain values)
            require((again == vsa) == (dim == vsa.dim), f"{again} is compared wrongly")
            require(again != vsa or hash(again) == hash(vsa))


_LAWS: tuple[Callable[[VSA], None], ...] = (
    _the_seed_decides_the_atoms,
    _atoms_are_codes_of_their_own_type,
    _atoms_are_unrelated,
    _bind_commutes_and_associates,
    _bound_is_dissimilar_to_both,
    _unbind_undoes_bind,
    _the_identity_binds_to_nothing,
    _bind_is_linear_over_a_raw_accumulator,
    _superpose_adds_up,
    _a_bundle_resembles_its_members_only,
    _a_bundle_does_not_depend_on_order,
    _two_are_bundled_as_any_number_is,
    _bundle_sums_over_any_dimension,
    _integer_weights_repeat_and_zero_weights_leave_out,
    _each_batch_element_may_have_its_own_weights,
    _real_weights_scale_the_members,
    _permute_rotates_keeps_similarity_and_is_undone,
    _a_batch_is_its_singles,
    _an_empty_batch_gives_an_empty_batch,
    _similarity_is_symmetric_and_bounded,
    _a_zero_vector_is_similar_to_nothing,
    _a_zero_vector_has_a_gradient_without_nan,
    _a_negative_is_opposite,
    _angles_add_up_under_binding,
    _a_dim_that_is_not_allowed_is_refused,
    _it_is_made_again_from_its_config,
    *DERIVED_LAWS,
    *READOUT_LAWS,
)
