"""Modules and functions as PyTorch expects them: state, copies, types, gradients, vmap."""

import copy
import io
from collections.abc import Callable

import pytest
import torch
from readings import centres, seeded
from torch import Tensor, nn
from torch.testing import assert_close

import torchvsa
from torchvsa import PROTECTIONS, VSA, CleanUp, SelfShift
from torchvsa.encoders import Encoder, Lookup, Sum, ThresholdFeatures

READINGS = centres(torch.tensor([[0, 3], [-1, 2], [1, 1]]), 4)


def record(vsa: VSA, seed: int) -> nn.Module:
    return Sum(Lookup(vsa, 4), 2, seed)


def threshold_features(vsa: VSA, seed: int) -> nn.Module:
    if not vsa.negatable:
        pytest.skip("these codes negate elements")
    return ThresholdFeatures(vsa, 2, 9, seed=seed)


def self_shift(vsa: VSA, seed: int) -> nn.Module:
    return SelfShift(vsa, seed=seed)


def clean_up(vsa: VSA, seed: int) -> nn.Module:
    # Raw accumulators, whose lengths differ.
    weights = torch.randint(1, 4, (5, 3), generator=seeded(seed))
    return CleanUp(vsa.superpose(vsa.random(5, 3, generator=seeded(seed)), weights=weights))


def answers(module: nn.Module, vsa: VSA) -> list[Tensor]:
    if isinstance(module, Encoder):
        return [module(READINGS)]
    answer = module(vsa.random(6, generator=seeded(9)))
    return [answer] if isinstance(answer, Tensor) else list(answer)


def equal(these: list[Tensor], those: list[Tensor]) -> bool:
    return all(torch.equal(a, b) for a, b in zip(these, those, strict=True))


@pytest.fixture(params=[record, threshold_features, self_shift, clean_up])
def make(request: pytest.FixtureRequest) -> Callable[[VSA, int], nn.Module]:
    return request.param


Make = Callable[[VSA, int], nn.Module]


def test_a_state_dict_carries_all_that_was_drawn(vsa: VSA, make: Make) -> None:
    first, second = make(vsa, 0), make(vsa, 1)
    assert not equal(answers(first, vsa), answers(second, vsa))
    file = io.BytesIO()
    torch.save(first.state_dict(), file)
    file.seek(0)
    second.load_state_dict(torch.load(file, weights_only=True))
    assert equal(answers(first, vsa), answers(second, vsa))


def test_a_deep_copy_is_independent(vsa: VSA, make: Make) -> None:
    first = make(vsa, 0)
    before = answers(first, vsa)
    twin = copy.deepcopy(first)
    assert equal(answers(twin, vsa), before)
    twin.load_state_dict(make(vsa, 1).state_dict())
    assert not equal(answers(twin, vsa), before)
    assert equal(answers(first, vsa), before)


def test_a_pickled_module_answers_alike(vsa: VSA, make: Make) -> None:
    file = io.BytesIO()
    module = make(vsa, 0)
    torch.save(module, file)
    file.seek(0)
    assert equal(answers(torch.load(file, weights_only=False), vsa), answers(module, vsa))


@pytest.mark.parametrize("name", ["MAP-C", "MAP-B", "MAP-I"])
@pytest.mark.parametrize("dtype", [torch.float64, torch.float16])
def test_another_float_type_keeps_bipolar_answers(name: str, dtype: torch.dtype, make: Make) -> None:
    vsa = torchvsa.architecture(name, 1000)
    module = make(vsa, 0)
    before = answers(module, vsa)
    moved = module.to(dtype)
    assert moved is module
    if isinstance(module, CleanUp):
        queries = vsa.random(6, generator=seeded(9)).to(dtype)
        # float16 cannot hold the inner products themselves.
        after = list(module(queries)) if dtype == torch.float64 else list(module.float()(queries.float()))
    else:
        after = answers(module, vsa)
    for a, b in zip(after, before, strict=True):
        assert torch.equal(a.to(b.dtype), b)


def test_float32_items_are_compared_in_float64_wherever_they_were_moved() -> None:
    x = torch.randint(-1, 2, (40, 999), generator=seeded(0)).float()
    plain, moved = CleanUp(x), CleanUp(x.double()).to(torch.float32)
    assert equal(list(moved(x[:, [*range(998, -1, -1)]])), list(plain(x[:, [*range(998, -1, -1)]])))


@pytest.mark.parametrize("name", PROTECTIONS)
def test_no_protection_has_parameters(name: str) -> None:
    assert list(PROTECTIONS[name](torchvsa.MAP(10)).parameters()) == []


@pytest.mark.parametrize("name", ["MAP-C", "MAP-I", "HRR"])
def test_gradients_are_those_of_finite_differences(name: str) -> None:
    vsa = torchvsa.architecture(name, 12, torch.float64)
    x = (0.3 * torch.randn(3, 12, generator=seeded(0), dtype=torch.float64)).requires_grad_()
    key = vsa.random(generator=seeded(1)).requires_grad_()
    shifts = torch.tensor([1, 5, -2])
    assert torch.autograd.gradcheck(vsa.bind, (x, key))
    assert torch.autograd.gradcheck(vsa.unbind, (x, key))
    assert torch.autograd.gradcheck(vsa.bundle, (x,))
    assert torch.autograd.gradcheck(lambda x: vsa.permute(x, shifts), (x,))
    # Similarity answers in float32, too coarse for finite differences: the cosine's own formula instead.
    (ours,) = torch.autograd.grad(vsa.similarity(x, key).sum(), x)
    (theirs,) = torch.autograd.grad(torch.cosine_similarity(x, key, -1).sum(), x)
    assert_close(ours, theirs)


@pytest.mark.parametrize("name", ["MAP-C", "MAP-I", "HRR"])
def test_gradients_flow_through_a_whole_program_in_float32(name: str) -> None:
    vsa = torchvsa.architecture(name, 200)
    encode = Sum(Lookup(vsa, 4), 2, 0)
    encode.codes.requires_grad_()
    conditions = vsa.bundle(vsa.bind(encode.roles, encode.codes[torch.tensor([[0, 3], [1, 1]])]))
    program = torch.zeros(200, requires_grad=True)
    loss = vsa.similarity(vsa.unbind(program + vsa.bind(conditions, conditions.flip(0)).sum(0), conditions), conditions)
    for gradient in torch.autograd.grad(loss.sum(), [program, encode.codes]):
        assert gradient.isfinite().all()
        assert gradient.abs().max() > 0


def test_the_gradient_of_a_rotation_is_rotated_back() -> None:
    vsa = torchvsa.MAP(500)
    x = vsa.random(3, generator=seeded(0)).requires_grad_()
    arriving = torch.randn(3, 500, generator=seeded(1))
    shifts = torch.tensor([1, 499, -7])
    (gradient,) = torch.autograd.grad(vsa.permute(x, shifts), x, arriving)
    assert torch.equal(gradient, vsa.permute(arriving, -shifts))
    assert torch.equal(vsa.permute(x, shifts), vsa.permute(x.detach(), shifts))


def test_vmap_equals_the_loop(vsa: VSA) -> None:
    a, b = vsa.random(2, 4, generator=seeded(0))
    xs = vsa.random(4, 5, generator=seeded(1))
    verbs: list[tuple[Callable[..., Tensor], tuple[Tensor, ...]]] = [
        (vsa.bind, (a, b)),
        (vsa.unbind, (a, b)),
        (vsa.bundle, (xs,)),
        (vsa.similarity, (a, b)),
    ]
    for verb, arguments in verbs:
        loop = torch.stack([verb(*row) for row in zip(*arguments, strict=True)])
        assert_close(torch.vmap(verb)(*arguments), loop)
    shared = torch.vmap(vsa.bind, in_dims=(0, None))(a, b[0])
    assert_close(shared, vsa.bind(a, b[0]))


def test_an_accelerator_gives_the_same_answers(make: Make) -> None:
    if not torch.cuda.is_available():
        pytest.skip("there is no CUDA device")
    vsa = torchvsa.MAP(1000, dtype=torch.int8)
    module = make(vsa, 0)
    before = answers(module, vsa)
    module.cuda()
    given = READINGS if isinstance(module, Encoder) else vsa.random(6, generator=seeded(9))
    after = module(given.cuda())
    assert equal([x.cpu() for x in ([after] if isinstance(after, Tensor) else after)], before)
