"""Sparse codes beside dense ones: time and bytes against d."""

from collections.abc import Iterator

import torch

from benchmarks import floors
from benchmarks.harness import Call, Case
from torchvsa import BSDC, BSDCSEG, MAP, VSA, CleanUp, architecture_near

DIMS = (1000, 4000, 16_000)
ROWS, ITEMS = 256, 100


def cases(device: str, small: bool = False) -> Iterator[Case]:
    """256 hypervectors are bound, unbound and looked for among 100 items; the peer is MAP-C in int8.

    The bytes are those of one item: as it is computed with, and as the list of its ones.
    """
    for name in ("BSDC-S", "BSDC-SEG"):
        for dim in (64,) if small else DIMS:
            vsa = architecture_near(name, dim)
            dense = MAP(vsa.dim, dtype=torch.int8)
            assert isinstance(vsa, BSDC | BSDCSEG)
            item = vsa.random(generator=torch.Generator().manual_seed(0))
            listed = vsa.positions(item)

            def check(vsa: BSDC | BSDCSEG = vsa) -> None:
                values, keys, memory = _drawn(vsa, device)
                assert torch.equal(vsa.unbind(vsa.bind(values, keys), keys), values)
                assert (memory(values[:ITEMS]).index == torch.arange(min(ITEMS, len(values)), device=device)).all()

            calls = [_work(one, device) for one in (vsa, dense)]
            yield Case(
                f"sparse codes, {name}",
                f"B={ROWS} K={ITEMS} d={vsa.dim}",
                calls[0],
                {"MAP-C int8": calls[1]},
                check,
                floors.fill(vsa.random(ROWS).to(device)),
                more={"dense_bytes": item.nbytes, "positions_bytes": listed.nbytes},
            )


def _drawn(vsa: VSA, device: str) -> tuple[torch.Tensor, torch.Tensor, CleanUp]:
    generator = torch.Generator().manual_seed(0)
    values, keys = (vsa.random(ROWS, generator=generator).to(device) for _ in range(2))
    return values, keys, CleanUp(values[:ITEMS])


def _work(vsa: VSA, device: str) -> Call:
    values, keys, memory = _drawn(vsa, device)
    return lambda _: memory(vsa.unbind(vsa.bind(values, keys), keys))
