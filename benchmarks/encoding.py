"""Record encoding: rows of sensor values become hypervectors."""

from collections.abc import Iterator
from typing import Any

import torch
import torchhd
from torch import Tensor

from benchmarks import floors
from benchmarks.harness import INPUTS, Case, variants
from benchmarks.peers import hypervectors, plain
from torchvsa import MAP
from torchvsa.encoders import Level, Sum


def cases(device: str, small: bool = False) -> Iterator[Case]:
    """Level codes of 64 values, bundled: 3 and 24 sensors."""
    dim, batch, levels = (64, 8, 4) if small else (4000, 2048, 64)
    for sensors in (3, 24):
        generator = torch.Generator().manual_seed(sensors)
        vsa = MAP(dim, dtype=torch.int8)
        record = Sum(Level(vsa, levels), sensors).draw(generator).to(device)
        rows = [torch.randint(levels, (batch, sensors), generator=generator).to(device) for _ in range(INPUTS)]
        peer = Peer(record)
        # 3 sensors are bound by writing the result, 24 by reading the entries of the table.
        result = record.encode(rows[0])
        floor = floors.fill(result) if sensors == 3 else floors.read(sensors * result.numel(), device)
        for suffix, call in variants(record.encode, small).items():

            def check(call=call, rows=rows, peer=peer) -> None:
                for theirs in (peer.default, peer.tuned):
                    assert torch.equal(call(rows[0]).float(), plain(theirs(rows[0])).clamp(-1, 1))

            yield Case(
                f"record encoding{suffix}",
                f"B={batch} n={sensors} V={levels} d={dim}",
                lambda index, call=call, rows=rows: call(rows[index]),
                {
                    "torchhd.hash_table": lambda index, peer=peer, rows=rows: peer.default(rows[index]),
                    "torchhd.multiset, table bound by hand": lambda index, peer=peer, rows=rows: peer.tuned(
                        rows[index]
                    ),
                },
                check,
                floor,
            )


class Peer:
    """The same record in the peer's operations, without the clip."""

    def __init__(self, record: Sum) -> None:
        self.keys = hypervectors(record.roles)
        self.codes = hypervectors(record.codes)
        # A user can bind the table of all values once, by hand.
        self.table = torchhd.bind(self.keys[:, None], self.codes)
        self.order = torch.arange(len(self.keys), device=self.keys.device)

    def default(self, rows: Tensor) -> Any:
        """As the peer's documents show it."""
        return torchhd.hash_table(self.keys, self.codes[rows])

    def tuned(self, rows: Tensor) -> Any:
        """From the bound table."""
        entries: Any = self.table[self.order, rows]
        return torchhd.multiset(entries)
