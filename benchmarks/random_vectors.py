"""Random bipolar hypervectors."""

from collections.abc import Iterator

import torch
import torchhd

from benchmarks import floors
from benchmarks.harness import Case
from torchvsa import MAP


def cases(device: str, small: bool = False) -> Iterator[Case]:
    """2,048 at once, as integer codes; the peer has floats."""
    dim, batch = (64, 8) if small else (4000, 2048)
    vsa = MAP(dim, dtype=torch.int8)
    generator, theirs = (torch.Generator(device).manual_seed(0) for _ in range(2))

    def check() -> None:
        drawn = vsa.random(batch, generator=generator)
        assert (drawn.abs() == 1).all()
        # Five standard deviations of a fair coin.
        assert drawn.double().mean().abs() < 5 / drawn.numel() ** 0.5

    yield Case(
        "random hypervectors",
        f"B={batch} d={dim}",
        lambda _: vsa.random(batch, generator=generator),
        {"torchhd.random": lambda _: torchhd.random(batch, dim, generator=theirs, device=device)},
        check,
        floors.fill(vsa.random(batch, generator=generator)),
    )
