"""Encoders, protections and operations in PyTorch's hands: compiled whole, mapped over batches, differentiated."""

from collections.abc import Callable, Iterator
from typing import Any, cast

import pytest
import torch
from readings import centres
from torch import Tensor
from torch.func import functional_call, vmap

from torchvsa import ARCHITECTURES, PROTECTIONS, VSA, SelfShift, architecture, architecture_near
from torchvsa.encoders import (
    Circular,
    Concatenated,
    Encoder,
    FractionalPower,
    History,
    Level,
    Lookup,
    ObliqueFeatures,
    Product,
    RandomFourier,
    SubsetProduct,
    Sum,
    ThresholdFeatures,
    ValueEncoder,
)

KINDS = [(name, None) for name in ARCHITECTURES] + [("MAP-C", "int8"), ("MAP-B", "int8")]
architectures = pytest.mark.parametrize(("name", "dtype"), KINDS)
FLOATS = {"MAP-C": "float64", "MAP-I": "float64", "HRR": "float64", "FHRR": "complex128"}
floats = pytest.mark.parametrize("vsa", [architecture(name, 8, dtype) for name, dtype in FLOATS.items()], ids=repr)
INDICES = torch.tensor([[0, 3, 2], [-1, 1, 0], [4, -1, -1], [1, 1, 1]])
READINGS = centres(INDICES, 5)


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


@pytest.fixture(autouse=True)
def forget_graphs() -> Iterator[None]:
    yield
    torch.compiler.reset()


def same_bits(a: Tensor, b: Tensor) -> bool:
    a, b = (torch.view_as_real(x) if x.is_complex() else x for x in (a, b))
    return a.dtype == b.dtype and a.shape == b.shape and a.numpy().tobytes() == b.numpy().tobytes()


def compiled(function: Callable[..., Any], backend: str = "aot_eager", **options: Any) -> Callable[..., Any]:
    return cast(Callable[..., Any], torch.compile(function, fullgraph=True, backend=backend, **options))


def encoders(vsa: VSA) -> list[Encoder]:
    if not vsa.negatable:
        return [Sum(Level(vsa, 5), 3, 0), Product(Level(vsa, 5), 3, 0)]
    made: list[Encoder] = [Sum(Level(vsa, 5), 3, 0), Product(Level(vsa, 5), 3, 0), ThresholdFeatures(vsa, 3, 5, 2)]
    made += [Product([Level(vsa, 5), Circular(vsa, 4), Lookup(vsa, 2)]), History(Sum(Lookup(vsa, 5), 1), [1, 2])]
    edges = [torch.tensor([0.1, 0.5]), torch.tensor([0.3]), torch.tensor([0.2, 0.2, 0.9])]
    made.append(ThresholdFeatures(vsa, 3, 5, edges=edges))
    if vsa.elementwise:
        made.append(SubsetProduct(Level(vsa, 5), 3))
    if vsa.frequencies:
        mixed: list[ValueEncoder] = [FractionalPower(vsa), Level(vsa, 5), FractionalPower(vsa, kernel="sinc")]
        made += [Sum(FractionalPower(vsa), 3), Product(mixed)]
    if "MAP" in vsa.name:
        sums = ObliqueFeatures(architecture(vsa.name, vsa.dim - 24, vsa.dtype), 3)
        boxes = ThresholdFeatures(architecture(vsa.name, 24, vsa.dtype), 3, edges=edges)
        made += [RandomFourier(vsa, 3), Concatenated([boxes, sums])]
    return [encode if encode.drawn else encode.draw(generator()) for encode in made]


@architectures
def test_encoders_compile_whole(name: str, dtype: str | None) -> None:
    # All in MAP-C's integers. In its floats, in MAP-B and in MAP-I all but the bundling are the same lines; the others
    # have a binding and powers of their own, not windows and edges.
    made = encoders(architecture(name, 64, dtype))
    if "MAP" not in name:
        made = made[:4] + made[6:]
    elif (name, dtype) != ("MAP-C", "int8"):
        made = made[:1]
    for encode in made:
        assert same_bits(compiled(encode)(READINGS), encode(READINGS))
        torch.compiler.reset()  # or one method would be compiled for too many classes


@pytest.mark.parametrize(("name", "dtype"), [kind for kind in KINDS if kind not in (("MAP-C", None), ("MAP-B", None))])
@pytest.mark.parametrize("kind", PROTECTIONS)
def test_protections_compile_whole(name: str, dtype: str | None, kind: str) -> None:
    vsa = architecture(name, 64, dtype)
    protect, x = PROTECTIONS[kind](vsa).draw(generator()), vsa.random(7, generator=generator())
    protected = protect(x)
    assert same_bits(compiled(protect)(x), protected)
    assert same_bits(compiled(protect.invert)(protected), protect.invert(protected))


@pytest.mark.parametrize("name", ["MAP-C", "BSC"])
def test_two_graphs_serve_any_batch(name: str) -> None:
    vsa = architecture(name, 64, "int8" if "MAP" in name else None)
    encode, protect = Sum(Lookup(vsa, 5), 3, 0), SelfShift(vsa, seed=0)
    graphs = 0

    def count(module: Any, _: Any) -> Any:
        nonlocal graphs
        graphs += 1
        return module.forward

    both = torch.compile(lambda rows: protect(encode(rows)), fullgraph=True, dynamic=True, backend=count)
    for repeats in (1, 2, 5, 20, 50):
        rows = READINGS.repeat(repeats, 1)
        assert same_bits(both(rows), protect(encode(rows)))
    # One for few rows, and one for many.
    assert graphs <= 2


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:`torch.jit:DeprecationWarning")  # of its own parts
def test_inductor_gives_the_same_bits() -> None:
    vsa = architecture("MAP-C", 512, "int8")
    encode, protect = Sum(Level(vsa, 5), 3, 0), SelfShift(vsa, "sum", seed=0)

    def both(rows: Tensor) -> Tensor:
        return protect(encode(rows))

    assert same_bits(compiled(both, "inductor")(READINGS), both(READINGS))


@architectures
def test_mapped_is_stacked(name: str, dtype: str | None) -> None:
    """What `vmap` answers for a batch is what each of its elements answers alone."""
    vsa = architecture_near(name, 32, dtype)
    a, b = (vsa.random(4, 3, generator=generator(seed)) for seed in (1, 2))
    close = torch.testing.assert_close

    def stacked(function: Callable[..., Tensor], *batches: Tensor) -> Tensor:
        return torch.stack([function(*one) for one in zip(*batches, strict=True)])

    pairwise: list[Callable[..., Tensor]] = [vsa.bind, vsa.unbind, vsa.similarity, vsa._bundle_pair]
    for function in pairwise:
        close(vmap(function)(a, b), stacked(function, a, b))
        close(vmap(function, (0, None))(a, b[0]), stacked(lambda x, f=function: f(x, b[0]), a))
    close(vmap(vsa.bundle)(a), stacked(vsa.bundle, a))
    shifts = torch.tensor([[0, 1, 5], [3, 2, -4], [7, 7, 7], [31, 0, 1]])
    close(vmap(vsa.permute)(a, shifts), stacked(vsa.permute, a, shifts))
    for encode in encoders(vsa):
        rows = torch.stack([READINGS, READINGS.flip(0)])
        close(vmap(encode)(rows), stacked(encode, rows))
    for kind in PROTECTIONS.values():
        protect = kind(vsa).draw(generator())
        close(vmap(protect)(a), stacked(protect, a))
        close(vmap(protect)(a[0]), protect(a[0]))


def slopes(function: Callable[[Tensor], Tensor], x: Tensor, step: float) -> Tensor:
    """The gradient of a real number by central differences; of a complex vector along both parts."""
    flat = torch.view_as_real(x).clone() if x.is_complex() else x.clone()
    found = torch.zeros_like(flat)
    for index in range(flat.numel()):
        moved = []
        for sign in (1, -1):
            there = flat.clone()
            there.view(-1)[index] += sign * step
            moved.append(function(torch.view_as_complex(there) if x.is_complex() else there))
        found.view(-1)[index] = (moved[0] - moved[1]) / (2 * step)
    return torch.view_as_complex(found) if x.is_complex() else found


def weighed(x: Tensor) -> Tensor:
    """Some smooth real number of a tensor, to differentiate."""
    parts = torch.view_as_real(x) if x.is_complex() else x
    return (parts.to(torch.float64).flatten() * torch.linspace(-1, 2, parts.numel(), dtype=torch.float64)).sum()


def agrees(function: Callable[[Tensor], Tensor], x: Tensor, step: float = 1e-5, tolerance: float = 1e-7) -> None:
    x = x.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(function(x), x)
    torch.testing.assert_close(gradient, slopes(function, x.detach(), step), atol=tolerance, rtol=1e-5)
    assert gradient.abs().max() > 0


@floats
def test_gradients_are_slopes(vsa: VSA) -> None:
    # Off the corners of the clip: sums of these elements are not -1 or +1.
    a, b, c = (0.4 * vsa.random(generator=generator(seed)) for seed in (1, 2, 3))
    if not a.is_complex():
        a, b, c = a + 0.05, b - 0.03, c + 0.11
    agrees(lambda x: weighed(vsa.bind(x, b)), a)
    agrees(lambda x: weighed(vsa.unbind(x, b)), a)
    agrees(lambda x: weighed(vsa.unbind(b, x)), a)
    agrees(lambda x: weighed(vsa.bundle(torch.stack([x, b, c]))), a)
    agrees(lambda x: weighed(vsa._bundle_pair(x, b)), a)
    agrees(lambda x: weighed(vsa.permute(x, torch.tensor([3, -2]))), a)
    # Similarities are float32, so their differences are coarse.
    agrees(lambda x: vsa.similarity(x, b).double(), a, step=1e-3, tolerance=2e-3)


@floats
def test_the_gradient_of_a_similarity_is_that_of_the_cosine(vsa: VSA) -> None:
    a, b = (vsa.random(5, generator=generator(seed)) for seed in (1, 2))

    def cosine(x: Tensor) -> Tensor:
        x, y = ((torch.view_as_real(v).flatten(-2) if v.is_complex() else v) for v in (x, b))
        return (x * y).sum(-1) / (x.norm(dim=-1) * y.norm(dim=-1))

    gradients = []
    for function in (lambda x: vsa.similarity(x, b), cosine):
        x = a.clone().requires_grad_()
        gradients += torch.autograd.grad(function(x).sum(), x)
    torch.testing.assert_close(*gradients, atol=1e-6, rtol=1e-5)


@floats
def test_codebooks_have_gradients(vsa: VSA) -> None:
    for record in (Sum, Product):
        encode = record(Lookup(vsa, 4), 3, 0)
        # The corners of the clip lie where bipolar codes do.
        assert encode.table is not None
        table = 0.4 * encode.table + (0 if vsa.dtype.is_complex else 0.03)
        rows = centres(INDICES.clamp(max=3)[:2], 4)

        def answer(table: Tensor, encode: Encoder = encode, rows: Tensor = rows) -> Tensor:
            return weighed(functional_call(encode, {"table": table}, (rows,)))

        agrees(answer, table)


def test_gradients_map_over_a_batch() -> None:
    vsa = architecture("HRR", 16, "float64")
    a, b = (vsa.random(4, generator=generator(seed)) for seed in (1, 2))
    each = vmap(torch.func.grad(lambda x, y: weighed(vsa.bind(x, y))))(a, b)
    for row in range(4):
        x = a[row].clone().requires_grad_()
        (alone,) = torch.autograd.grad(weighed(vsa.bind(x, b[row])), x)
        torch.testing.assert_close(each[row], alone)
