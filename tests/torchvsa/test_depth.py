"""How much of a hypervector is left after binding it to n keys and unbinding them in reverse order (d = 1,024)."""

import pytest
import torch

import torchvsa
from torchvsa import VSA

LOSSY = {
    torchvsa.MAP(1024, atoms="uniform"): {1: 0.74, 2: 0.55, 5: 0.22},
    torchvsa.HRR(1024): {1: 0.71, 2: 0.49, 5: 0.21},
    torchvsa.VTB(1024): {1: 0.71, 2: 0.58, 5: 0.41},
}


def left_after(vsa: VSA, keys: int) -> torch.Tensor:
    generator = torch.Generator().manual_seed(keys)
    x, key = vsa.random(50, generator=generator), vsa.random(keys, 50, generator=generator)
    y = x
    for k in key:
        y = vsa.bind(y, k)
    for k in key.flip(0):
        y = vsa.unbind(y, k)
    return vsa.similarity(x, y)


@pytest.mark.parametrize("vsa", LOSSY, ids=["MAP-C uniform", "HRR", "VTB"])
def test_approximate_inverses_fade(vsa: VSA) -> None:
    for keys, expected in LOSSY[vsa].items():
        assert left_after(vsa, keys).mean().item() == pytest.approx(expected, abs=0.04)


@pytest.mark.parametrize("name", sorted(set(torchvsa.ARCHITECTURES) - {"HRR", "VTB"}))
def test_exact_inverses_do_not(name: str) -> None:
    torch.testing.assert_close(left_after(torchvsa.architecture(name, 1024), 10), torch.ones(50), rtol=0, atol=1e-5)
