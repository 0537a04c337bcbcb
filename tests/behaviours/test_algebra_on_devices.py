"""The algebra and its modules compute on another device as on the CPU; see `test_devices`."""

from collections.abc import Callable
from typing import Any

import pytest
import torch
from devices import other
from on_devices import same, seeded
from torch import Tensor

import torchvsa
from torchvsa import ARCHITECTURES, PROTECTIONS, CleanUp, SelfShift
from torchvsa._blocks import by_blocks
from torchvsa.encoders import Encoder, Product, SubsetProduct, Sum, ThresholdFeatures, value_encoder


def test_it_is_as_strict_as_a_gpu(there: Callable[..., None]) -> None:
    there(check_strictness)


def check_strictness() -> None:
    here = torch.arange(4)
    away = other().moved(here)
    assert away.device.type == torch.ones(1, device=other().NAME).device.type == other().NAME
    mixed: list[Callable[[], Any]] = [lambda: away + here, lambda: here[away], lambda: torch.stack([here, away])]
    for mix in mixed:
        with pytest.raises(RuntimeError, match="device"):
            mix()
    with pytest.raises(TypeError, match=r"[Nn]um[Pp]y"):
        away.numpy()
    with pytest.raises(AssertionError, match="on the CPU"):
        other().brought_back(here)
    away[here[:2]] += 1
    assert other().brought_back(away).tolist() == [1, 2, 2, 3]
    waits: list[Callable[[], Any]] = [away.sum().item, away.cpu, away.tolist, away.unique, lambda: away[away > 1]]
    waits += [lambda: torch.tensor([1, 2], device=other().NAME), lambda: away[[0, 1]]]
    for wait in waits:
        other().waited.clear()
        wait()
        assert other().waited
    other().waited.clear()
    looked_up = away.to(torch.int8).clamp(0, 1)[away]
    assert other().waited == []
    assert other().brought_back(looked_up).tolist() == [1, 1, 1, 1]


@pytest.mark.parametrize("rows", [3, 200])
@pytest.mark.parametrize("name", ARCHITECTURES)
def test_the_algebra(there: Callable[..., None], name: str, rows: int) -> None:
    there(check_algebra, name, rows)


def check_algebra(name: str, rows: int) -> None:
    vsa = torchvsa.architecture_near(name, 100)
    a, b = (vsa.random(rows, generator=seeded(seed)) for seed in (0, 1))
    numbers = torch.arange(rows) * 7
    for verb in (vsa.bind, vsa.unbind, vsa._bundle_pair, vsa.similarity, vsa.unbundle):
        same(verb, a, b, exact=vsa.integer)
    same(vsa.permute, a, numbers)
    same(lambda a: vsa.permute(a, -3), a)
    # Circular convolution and complex numbers round in an order of the device's own.
    rounds_alike = vsa.elementwise and not vsa.dtype.is_complex
    same(lambda a, b: vsa.bundle(torch.stack([a, b]), 0), a, b, exact=rounds_alike)
    same(lambda a, w: vsa.bundle(a, weights=w), a, numbers, exact=vsa.integer)
    same(lambda a, w: vsa.normalize(vsa.superpose(a, weights=w)), a, numbers, exact=vsa.integer)
    same(lambda a, b, w: vsa.permute(vsa._bundle_pair(a, b[0]), w), a, b, numbers, exact=vsa.integer)
    same(lambda a, b: vsa.unbound_norm(a[0], b), a, b, exact=vsa.integer)
    same(vsa.positive, a)
    same(lambda a, b: CleanUp(a)(b), a, b, exact=False)
    same(lambda a: vsa.random(4, generator=seeded(2), device=a.device), a)


def test_blocks_on_it_are_larger(there: Callable[..., None]) -> None:
    there(check_blocks)


def check_blocks() -> None:
    seen: list[int] = []

    def work(rows: Tensor) -> Tensor:
        seen.append(len(rows))
        return rows + 1

    answer = by_blocks(work, other().moved(torch.arange(10)), row_bytes=2**26, block_bytes=1)
    assert seen == [4, 4, 2]
    assert other().brought_back(answer).tolist() == list(range(1, 11))


def test_a_graph_rotates_in_one_pass(there: Callable[..., None]) -> None:
    there(check_graph)


def check_graph() -> None:
    vsa = torchvsa.MAP(100, dtype=torch.int8)
    vectors = vsa.bundle(vsa.random(200, 3, generator=seeded(0)))
    protect, asked = other().moved(SelfShift(vsa, seed=0)), other().moved(vectors)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(torch.compiler, "is_compiling", lambda: True)
        patch.setattr("torch.Tensor.as_strided", None)
        answer = other().brought_back(protect(asked))
    assert torch.equal(answer, SelfShift(vsa, seed=0)(vectors))


@pytest.mark.parametrize("rows", [3, 200])
@pytest.mark.parametrize("name", ARCHITECTURES)
def test_modules(there: Callable[..., None], name: str, rows: int) -> None:
    there(check_modules, name, rows)


def check_modules(name: str, rows: int) -> None:
    vsa = torchvsa.architecture_near(name, 100)
    vectors = vsa.random(rows, generator=seeded(0))
    for protection in PROTECTIONS:
        protect = torchvsa.protection({"name": protection}, vsa).draw(seeded(3))
        same(lambda protect, x: protect(x), protect, vectors, exact=vsa.integer)
        same(lambda protect, y: protect.invert(y), protect, protect(vectors), exact=vsa.integer)
    memory = CleanUp(vectors[:3])
    same(lambda memory, x: memory(x)[1:], memory, vectors, exact=False)
    # Where two vectors are as good as equally similar, either may win.
    best = vsa.similarity(vectors[:, None], vectors[:3]).topk(2).values
    clear = best[:, 0] - best[:, 1] > other().TOLERANCE
    assert clear.any()
    same(lambda memory, x: memory(x)[0], memory, vectors[clear])
    x = torch.rand(rows, 3, generator=seeded(1), dtype=torch.float64)
    x[::4, 1] = torch.nan
    encoders: list[Encoder] = [
        record(value_encoder({"name": values, "bins": 5}, vsa), 3)
        for values in ("lookup", "level", "balanced", "thermometer", "circular")[: 5 if vsa.negatable else 2]
        for record in (Sum, Product, SubsetProduct)
        if vsa.elementwise or record is not SubsetProduct
    ]
    if vsa.elementwise:
        encoders.append(ThresholdFeatures(vsa, 3, 5))
    for encoder in encoders:
        same(lambda encode, rows: encode(rows), encoder.draw(seeded(2)), x, exact=vsa.integer)
