"""torch-hd's example for MNIST, on scikit-learn's digits: draw codebooks, sum up each class, recognise the rest."""

from collections.abc import Iterator
from typing import Any

import torch
import torchhd
from jaxtyping import Float, Int64
from sklearn.datasets import load_digits
from sklearn.model_selection import train_test_split
from torch import Tensor

from benchmarks.harness import INPUTS, Case
from benchmarks.peers import plain
from torchvsa import MAP, CleanUp
from torchvsa.encoders import Level, Sum

GREYS, PIXELS, CLASSES = 17, 64, 10
Split = tuple[Float[Tensor, "train 64"], Float[Tensor, "test 64"], Int64[Tensor, "train"]]


def cases(device: str, small: bool = False) -> Iterator[Case]:
    """1,347 images are learned and 450 recognised, another split in each call. The peer takes batches of 1 or of 64."""
    dim, images = (128, 200) if small else (10_000, 1797)
    splits = [_split(seed, images, device) for seed in range(INPUTS)]

    def check() -> None:
        encode = _record(dim, 0, device)
        mine = _recognised(encode, splits[0])
        for batch in (1, 64):
            peer = _peer(dim, device)
            peer.keys.weight.data.copy_(encode.roles)
            peer.levels.weight.data.copy_(encode.codes)
            # Their cosines are rounded, so that a tie may be decided otherwise.
            assert (_peer_recognised(peer, splits[0], batch) == mine).double().mean() > 0.98

    yield Case(
        "digits, torch-hd's MNIST example",
        f"images={images} n={PIXELS} d={dim}",
        lambda index: _recognised(_record(dim, index, device), splits[index]),
        {
            f"torchhd Vanilla, batches of {batch}": lambda index, batch=batch: _peer_recognised(
                _peer(dim, device), splits[index], batch
            )
            for batch in (1, 64)
        },
        check,
    )


def _split(seed: int, images: int, device: str) -> Split:
    greys, digits = load_digits(return_X_y=True)
    train, test, shown, _ = train_test_split(greys[:images] / 16, digits[:images], random_state=seed)
    return torch.tensor(train, device=device), torch.tensor(test, device=device), torch.tensor(shown, device=device)


def _record(dim: int, seed: int, device: str) -> Sum:
    return Sum(Level(MAP(dim, dtype=torch.int8), bins=GREYS), sensors=PIXELS, seed=seed).to(device)


def _recognised(encode: Sum, split: Split) -> Int64[Tensor, "test"]:
    train, test, shown = split
    centroids = torch.zeros(CLASSES, encode.vsa.dim, device=train.device).index_add(0, shown, encode(train).float())
    return CleanUp(centroids)(encode(test)).index


def _peer(dim: int, device: str) -> Any:
    return torchhd.classifiers.Vanilla(PIXELS, dim, CLASSES, n_levels=GREYS, min_level=0, device=torch.device(device))


def _peer_recognised(peer: Any, split: Split, batch: int) -> Int64[Tensor, "test"]:
    train, test, shown = split
    peer.fit(zip(train.float().split(batch), shown.split(batch), strict=True))
    return plain(torch.cat([peer.predict(rows) for rows in test.float().split(batch)]))
