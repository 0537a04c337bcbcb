"""Reading items out of programs: equal to unbinding and comparing, on every architecture."""

from typing import Any

import numpy as np
import pytest
import torch
from throwaway import Hashed, Turned
from torch import Tensor
from torch.testing import assert_close

from torchvsa import MAP, VSA, CleanUp, ShapeError
from torchvsa._numerics import norms
from torchvsa.testing import check_architecture

THROWAWAY = [Turned(1000), Turned(1000, torch.float32), Hashed(1000), Hashed(1000, torch.float32)]


def pairs(vsa: VSA, count: int = 6) -> tuple[Tensor, Tensor, Tensor]:
    """A program of some pairs, their conditions, and their results."""
    conditions, results = vsa.random(2, count, generator=torch.Generator().manual_seed(0))
    return vsa.superpose(vsa.bind(results, conditions)), conditions, results


@pytest.mark.parametrize("throwaway", THROWAWAY, ids=repr)
def test_architectures_that_do_not_commute_or_are_not_bilinear_keep_the_laws(throwaway: VSA) -> None:
    check_architecture(throwaway)


@pytest.mark.parametrize("throwaway", THROWAWAY, ids=repr)
def test_they_are_read_out_all_the_same(throwaway: VSA) -> None:
    program, conditions, results = pairs(throwaway)
    assert throwaway.readout(program, results).match(conditions).index.tolist() == list(range(6))


def test_what_does_not_commute_must_say_how_it_folds() -> None:
    class Silent(Turned):
        def fold(self, program: Tensor, item: Tensor) -> Tensor:
            return VSA.fold(self, program, item)

    program, _, results = pairs(Silent(200))
    with pytest.raises(NotImplementedError, match="turned is bilinear and does not commute; it must implement fold"):
        Silent(200).readout(program, results)


@pytest.mark.parametrize("largest", [1, 127, 128, 40_000, 2**31 - 1])
@pytest.mark.parametrize("variant", ["C", "B", "I"])
def test_scores_of_integers_are_exact_for_programs_of_any_size(variant: Any, largest: int) -> None:
    vsa, generator = MAP(301, variant, torch.int8), torch.Generator().manual_seed(0)
    program = torch.randint(-largest, largest + 1, (301,), generator=generator, dtype=torch.int64).to(torch.int32)
    conditions, items = vsa.random(20, generator=generator), vsa.random(5, generator=generator)
    readout = vsa.readout(program, items)
    noisy = conditions.numpy().astype(np.int64) * program.numpy()
    products = noisy @ items.numpy().T.astype(np.int64)
    length = 301**0.5
    assert np.array_equal(readout(conditions).numpy(), products / length)
    expected = products.max(1) / length / np.linalg.norm(noisy.astype(np.float64), axis=1)
    assert_close(readout.match(conditions).similarity.numpy(), expected.astype(np.float32), rtol=1e-6, atol=0)


def test_items_that_are_sums_are_read_out_of_the_largest_programs() -> None:
    vsa = MAP(100, "I", torch.int8)
    items = vsa.superpose(vsa.random(3, 4, generator=torch.Generator().manual_seed(0)), 1)
    program = torch.full((100,), 2**31 - 1, dtype=torch.int32)
    expected = (items.double() * (2**31 - 1)).sum(-1) / norms(items)
    assert torch.equal(vsa.readout(program, items)(torch.ones(1, 100, dtype=torch.int8))[0], expected)


@pytest.mark.parametrize("scale", [1e-42, 1e-30, 1e30])
def test_cosines_do_not_depend_on_the_scale_of_float_programs_and_items(vsa: VSA, scale: float) -> None:
    if vsa.integer:
        pytest.skip("integers have no such scale")
    program, conditions, results = pairs(vsa)
    expected = vsa.readout(program, results).match(conditions)
    for readout in (vsa.readout(scale * program, results), vsa.readout(program, scale * results)):
        match = readout.match(conditions)
        assert torch.equal(match.index, expected.index)
        tolerance = 0.05 if scale < 1e-38 else 1e-5  # numbers without a leading digit have lost others
        assert_close(match.similarity, expected.similarity, rtol=tolerance, atol=tolerance)
    assert_close(vsa.readout(8.0 * program, results)(conditions), 8 * vsa.readout(program, results)(conditions))


def test_zero_programs_and_items_score_nothing(vsa: VSA) -> None:
    program, conditions, results = pairs(vsa)
    nothing = torch.zeros(vsa.dim, dtype=vsa.accumulator)
    assert (vsa.readout(nothing, results)(conditions) == 0).all()
    assert (vsa.readout(nothing, results).match(conditions).similarity == 0).all()
    if vsa.dtype != torch.bool:
        assert (vsa.readout(program, torch.zeros_like(results[:1]))(conditions) == 0).all()


def test_scores_have_gradients_for_programs_and_conditions() -> None:
    for vsa in (MAP(64, dtype=torch.float64), Turned(64, torch.float64)):
        program, conditions, results = pairs(vsa, 3)
        program, conditions = program.requires_grad_(), conditions.requires_grad_()
        assert torch.autograd.gradcheck(lambda p, c: vsa.readout(p, results)(c), (program, conditions))  # noqa: B023
    vsa = Hashed(64, torch.float64)
    program, conditions, results = pairs(vsa, 3)
    assert torch.autograd.gradcheck(lambda p: vsa.readout(p, results)(conditions), program.requires_grad_())


def test_a_readout_keeps_what_it_was_made_of(vsa: VSA) -> None:
    program, conditions, results = pairs(vsa)
    readout = vsa.readout(program, results)
    before = readout(conditions)
    other = readout.of(vsa.superpose(vsa.bind(results.flip(0), conditions)))
    assert torch.equal(readout(conditions), before)
    assert other.match(conditions).index.tolist() == [5, 4, 3, 2, 1, 0]


def test_a_match_is_that_of_a_clean_up_memory(vsa: VSA) -> None:
    program, conditions, results = pairs(vsa)
    match = vsa.readout(program, results).match(conditions)
    for got, expected in zip(match, CleanUp(results)(vsa.unbind(program, conditions)), strict=True):
        assert_close(got, expected, rtol=1e-5, atol=1e-6)


def test_other_shapes_are_refused() -> None:
    vsa = MAP(50)
    x = vsa.random(2, 3)
    for programs, items in ((x, x[0]), (x[0, 0], x[0, 0]), (x[0, 0], x[0, :0]), (x[0, 0, 1:], x[0])):
        with pytest.raises(ShapeError, match=r"programs"):
            vsa.readout(programs, items)
    with pytest.raises(ShapeError, match="conditions"):
        vsa.readout(x[0, 0], x[0])(x[0, :, 1:])
