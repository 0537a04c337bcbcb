"""Clean-up: which of K items is most similar to each query?"""

from collections.abc import Iterator

import torch
import torchhd

from benchmarks import floors
from benchmarks.harness import INPUTS, Case, variants
from benchmarks.peers import hypervectors, plain
from torchvsa import MAP, CleanUp


def cases(device: str, small: bool = False) -> Iterator[Case]:
    """256 and 4,096 items, as integer codes and as floats; the peer has floats."""
    dim, batch = (64, 8) if small else (4000, 2048)
    for count in (8, 16) if small else (256, 4096):
        generator = torch.Generator().manual_seed(count)
        items = MAP(dim, dtype=torch.int8).random(count, generator=generator)
        asked = []
        for _ in range(INPUTS):
            members = items[torch.randint(count, (batch,), generator=generator)]
            # 3 of 10 elements are flipped.
            asked.append(members * (1 - 2 * (torch.rand(members.shape, generator=generator) < 0.3).to(torch.int8)))
        floats = [hypervectors(query.to(device)) for query in asked]
        peer_items = hypervectors(items.to(device))
        peers = {
            "torchhd.cosine_similarity": lambda index, f=floats, i=peer_items: torchhd.cosine_similarity(
                f[index], i
            ).argmax(-1),
            "torchhd.dot_similarity": lambda index, f=floats, i=peer_items: torchhd.dot_similarity(f[index], i).argmax(
                -1
            ),
        }
        for dtype in (torch.int8, torch.float32):
            clean = CleanUp(items.to(device, dtype))
            queries = [query.to(device, dtype) for query in asked]

            for suffix, call in variants(clean, small, compiles=device != "cpu").items():

                def check(call=call, queries=queries, peers=peers) -> None:
                    for peer in peers.values():
                        assert torch.equal(call(queries[0]).index, plain(peer(0)))

                yield Case(
                    f"clean-up, {str(dtype).removeprefix('torch.')}{suffix}",
                    f"B={batch} K={count} d={dim}",
                    lambda index, call=call, queries=queries: call(queries[index]),
                    peers,
                    check,
                    floors.product(dtype if device == "cpu" else torch.bfloat16, batch * count * dim, device),
                )
