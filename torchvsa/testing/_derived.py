"""The laws of what is made of the primitives: sequences, n-grams, records, inverses, powers, products."""

from collections.abc import Callable

import torch
from torch import Tensor
from torch.testing import assert_close

from torchvsa._numerics import as_bipolar
from torchvsa.architectures import VSA
from torchvsa.errors import ShapeError
from torchvsa.testing._laws import draw, refuses, require, same, seeded


def _a_sequence_bundles_rotated_members(vsa: VSA) -> None:
    xs = draw(vsa, 2, 5)
    rotated = torch.stack([vsa.permute(x, 4 - i) for i, x in enumerate(xs.unbind(-2))], -2)
    assert_close(vsa.sequence(xs), vsa.bundle(rotated))
    assert_close(vsa.sequence(xs, raw=True), vsa.superpose(rotated))
    for i in range(5):
        member = vsa.permute(vsa.sequence(xs[0]), i - 4)
        require(vsa.similarity(member, xs[0]).argmax() == i, f"member {i} is not found")


def _a_raw_sequence_goes_on(vsa: VSA) -> None:
    xs = draw(vsa, 4)
    longer = vsa.permute(vsa.sequence(xs[:3], raw=True), 1) + as_bipolar(xs[3])
    assert_close(longer, vsa.sequence(xs, raw=True))


def _ngrams_bundle_bound_neighbours(vsa: VSA) -> None:
    xs = draw(vsa, 2, 5)
    a, b, c, d, e = xs.unbind(-2)
    three = [
        vsa.bind(vsa.bind(vsa.permute(x, 2), vsa.permute(y, 1)), z) for x, y, z in ((a, b, c), (b, c, d), (c, d, e))
    ]
    assert_close(vsa.ngrams(xs), vsa.bundle(three))
    assert_close(vsa.ngrams(xs, raw=True), vsa.superpose(three))
    assert_close(vsa.ngrams(xs[:, :2], 2, raw=True), vsa.superpose([vsa.bind(vsa.permute(a, 1), b)]))
    assert_close(vsa.ngrams(xs, 1), vsa.bundle(xs))
    refuses(ShapeError, lambda: vsa.ngrams(xs, 6))


def _a_record_holds_a_value_per_role(vsa: VSA) -> None:
    roles, values = draw(vsa, 5), draw(vsa, 2, 5, seed=1)
    pairs = [vsa.bind(value, role) for value, role in zip(values.unbind(-2), roles, strict=True)]
    assert_close(vsa.record(roles, values), vsa.bundle(pairs))
    assert_close(vsa.record(list(roles), values, raw=True), vsa.superpose(pairs))
    for i, role in enumerate(roles):
        found = vsa.unbind(vsa.record(roles, values[0]), role)
        require(vsa.similarity(found, values[0]).argmax() == i, f"value {i} is not found")
    refuses(ShapeError, lambda: vsa.record(roles, values[:, :4]))


def _they_sum_over_any_dimension(vsa: VSA) -> None:
    xs, roles = draw(vsa, 3, 4, 5), draw(vsa, 3, 4, 5, seed=1)
    for dim in (0, 1, 2, -2, -3):
        rows = xs.movedim(dim, -2)
        assert_close(vsa.sequence(xs, dim), vsa.sequence(rows))
        assert_close(vsa.ngrams(xs, 2, dim), vsa.ngrams(rows, 2))
        assert_close(vsa.record(roles, xs, dim), vsa.record(roles.movedim(dim, -2), rows))
    for verb in (vsa.sequence, vsa.ngrams, lambda xs, dim: vsa.record(xs, xs, dim)):
        refuses(ShapeError, lambda verb=verb: verb(xs, dim=-1))


def _inverse(vsa: VSA, x: Tensor) -> Tensor | None:
    """The inverse, or None if there is none, which is right only where binding does not undo itself."""
    try:
        return vsa.inverse(x)
    except ValueError:
        require(not vsa.self_inverse, "binding undoes itself, and there is no inverse")
        return None


def _binding_with_the_inverse_unbinds(vsa: VSA) -> None:
    a, key = draw(vsa, 2, 3)
    if (inverse := _inverse(vsa, key)) is not None:
        vsa.check_codes(inverse, "an inverse")
        assert_close(vsa.bind(a, inverse), vsa.unbind(a, key))
        assert_close(vsa.inverse(inverse), key)


def _powers_bind_with_themselves(vsa: VSA) -> None:
    x = draw(vsa, 3)
    assert_close(vsa.power(x, 0), vsa.identity().expand_as(x))
    assert_close(vsa.power(x, 1), x)
    assert_close(vsa.power(x, 2), vsa.bind(x, x))
    assert_close(vsa.power(x, 3), vsa.bind(vsa.bind(x, x), x))
    if (inverse := _inverse(vsa, x)) is not None:
        assert_close(vsa.power(x, -2), vsa.bind(inverse, inverse))
    else:
        refuses(ValueError, lambda: vsa.power(x, -2))


def _fractional_powers_add_up(vsa: VSA) -> None:
    if vsa.frequencies is None:
        refuses(ValueError, lambda: vsa.power(draw(vsa), 0.5))
        return
    # Angles within half a turn, of which every fraction is meant.
    angles = 6 * torch.rand(2, vsa.frequencies, generator=seeded(0), dtype=torch.float64) - 3
    x = vsa.from_angles(angles)
    assert_close(vsa.power(x, 0.3), vsa.from_angles(0.3 * angles), rtol=1e-4, atol=1e-4)
    assert_close(vsa.bind(vsa.power(x, -1.7), vsa.power(x, 2.7)), x, rtol=1e-4, atol=1e-4)


def _the_dot_similarity_is_that_of_the_elements(vsa: VSA) -> None:
    a, b = draw(vsa, 2, 3)
    numbers = [as_bipolar(x).to(torch.complex128 if x.is_complex() else torch.float64) for x in (a, b)]
    products = (numbers[0][:, None] * numbers[1].conj()).real.sum(-1)
    dots = vsa.dot_similarity(a[:, None], b)
    assert_close(dots.to(torch.float64), products, rtol=1e-5, atol=1e-4)
    require(not vsa.integer or not dots.is_floating_point(), "the product of integers is not an integer")
    lengths = [vsa.dot_similarity(x, x).to(torch.float64).sqrt() for x in (a, b)]
    assert_close(
        vsa.similarity(a[:, None], b).double(), products / (lengths[0][:, None] * lengths[1]), rtol=1e-5, atol=1e-6
    )


def _the_hamming_similarity_counts_equal_elements(vsa: VSA) -> None:
    a, b = draw(vsa, 2, 3)
    half = torch.cat([a[:, : vsa.dim // 2], b[:, vsa.dim // 2 :]], -1)
    equal = vsa.hamming_similarity(half[:, None], a)
    same(equal, (half[:, None] == a).sum(-1))
    require(equal.diagonal().min() >= vsa.dim // 2 and bool((vsa.hamming_similarity(a, a) == vsa.dim).all()))


DERIVED_LAWS: tuple[Callable[[VSA], None], ...] = (
    _a_sequence_bundles_rotated_members,
    _a_raw_sequence_goes_on,
    _ngrams_bundle_bound_neighbours,
    _a_record_holds_a_value_per_role,
    _they_sum_over_any_dimension,
    _binding_with_the_inverse_unbinds,
    _powers_bind_with_themselves,
    _fractional_powers_add_up,
    _the_dot_similarity_is_that_of_the_elements,
    _the_hamming_similarity_counts_equal_elements,
)
