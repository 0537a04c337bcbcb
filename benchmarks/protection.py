"""Protection: each vector is shifted by a width of its own, which is computed from it."""

from collections.abc import Iterator
from typing import Any

import torch
import torchhd
from torch import Tensor

from benchmarks import floors
from benchmarks.harness import INPUTS, Case, variants
from benchmarks.peers import hypervectors, plain
from torchvsa import MAP, SelfShift


def cases(device: str, small: bool = False) -> Iterator[Case]:
    """Both widths of the self-derived shift, width included on both sides."""
    dim, batch = (64, 8) if small else (4000, 2048)
    vsa = MAP(dim, dtype=torch.int8)
    generator = torch.Generator().manual_seed(0)
    inputs = [vsa.bundle(vsa.random(batch, 3, generator=generator)).to(device) for _ in range(INPUTS)]
    floats = [hypervectors(x) for x in inputs]
    for width in ("mean", "sum"):
        protect = SelfShift(vsa, width, seed=1).to(device)
        peer = Peer(protect.h, width)

        for suffix, call in variants(protect, small, compiles=device != "cpu").items():

            def check(call=call, peer=peer) -> None:
                assert torch.equal(call(inputs[0]).float(), plain(peer(floats[0])))

            yield Case(
                f"protect, {width} width{suffix}",
                f"B={batch} d={dim}",
                lambda index, call=call: call(inputs[index]),
                {"loop of torchhd.permute": lambda index, peer=peer: peer(floats[index])},
                check,
                floors.copy(inputs[0]),
            )


class Peer:
    """The self-derived shift in the peer's operations: widths for all rows, then one permutation a row."""

    def __init__(self, h: Tensor, width: str) -> None:
        self.h, self.width = hypervectors(h), width
        self.index = torch.arange(len(h), device=h.device)

    def __call__(self, x: Any) -> Any:
        """Protected rows `[B, d]`."""
        mask = plain(x) > 0
        total, count = (mask * self.index).sum(-1), mask.sum(-1)
        widths = total % len(self.index) if self.width == "sum" else (2 * total + count) // (2 * count).clamp(min=1)
        named: Any = torchhd.bundle(x, self.h)
        named = named.clipping(1)
        return torch.stack(
            [torchhd.permute(row, shifts=width) for row, width in zip(named, widths.tolist(), strict=True)]
        )
