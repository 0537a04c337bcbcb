"""The same values as torch-hd, wherever it has the same operation."""

from typing import Any

import pytest
import torch
import torchhd
from torch import Tensor
from torch.testing import assert_close

import torchvsa
from torchvsa import VSA
from torchvsa._numerics import inner_products

DIM = 1000
PEERS = {"MAP-I": "MAP", "MAP-C": "MAP", "MAP-B": "MAP", "HRR": "HRR", "FHRR": "FHRR", "BSC": "BSC"}
both = pytest.mark.parametrize("name", PEERS)


def plain(x: Any) -> Tensor:
    return x.as_subclass(Tensor)


def drawn(name: str, *shape: int) -> tuple[VSA, Tensor, Any]:
    # torch-hd's stubs take slices of its own tensors for plain ones: no type is stated for them.
    vsa = torchvsa.architecture(name, DIM)
    x = vsa.random(*shape, generator=torch.Generator().manual_seed(0))
    return vsa, x, torchhd.ensure_vsa_tensor(x.clone(), PEERS[name])  # pyright: ignore[reportArgumentType]


@both
def test_bind_and_unbind(name: str) -> None:
    vsa, x, peer = drawn(name, 2, 5)
    assert_close(vsa.bind(x[0], x[1]), plain(torchhd.bind(peer[0], peer[1])))
    assert_close(vsa.unbind(x[0], x[1]), plain(torchhd.bind(peer[0], torchhd.inverse(peer[1]))))


@both
def test_identity(name: str) -> None:
    vsa, _, _ = drawn(name)
    theirs = torchhd.identity(1, DIM, PEERS[name])[0]  # pyright: ignore[reportArgumentType]
    assert_close(vsa.identity(), plain(theirs))


@both
@pytest.mark.parametrize("shift", [1, -3, 2 * DIM + 5])
def test_permute(name: str, shift: int) -> None:
    vsa, x, peer = drawn(name, 5)
    assert torch.equal(vsa.permute(x, shift), plain(torchhd.permute(peer, shifts=shift)))


@both
@pytest.mark.parametrize("k", [3, 4])
def test_superpose(name: str, k: int) -> None:
    vsa, x, peer = drawn(name, 6, k)
    if name == "BSC":
        # torch-hd keeps no sum of bits: the votes are counted by hand.
        assert torch.equal(vsa.superpose(x), k - 2 * x.sum(-2, dtype=torch.int32))
    else:
        # torch-hd does not normalise its bundles, which are our raw accumulators.
        assert_close(vsa.superpose(x), plain(torchhd.multibundle(peer)))


def test_bundle_of_map_b_and_bsc_with_an_odd_number_of_voters() -> None:
    # torch-hd draws ties at random (BSC) or sends them to -1 (MAP), so that only odd numbers compare.
    vsa, x, peer = drawn("MAP-B", 6, 5)
    assert torch.equal(vsa.bundle(x), plain(torchhd.normalize(torchhd.multibundle(peer))))
    vsa, x, peer = drawn("BSC", 6, 5)
    assert torch.equal(vsa.bundle(x), plain(torchhd.multibundle(peer)))


def test_bundle_of_map_c_is_a_clipped_sum() -> None:
    vsa, x, _ = drawn("MAP-C", 6, 5)
    clipped = torchhd.MAPTensor.clipping(x.sum(-2).as_subclass(torchhd.MAPTensor), 1)
    assert torch.equal(vsa.bundle(x), plain(clipped))


def test_bundle_of_fhrr_keeps_the_angle_of_the_sum() -> None:
    vsa, x, peer = drawn("FHRR", 6, 5)
    assert_close(vsa.bundle(x), plain(torchhd.normalize(torchhd.multibundle(peer))), atol=1e-5, rtol=0)


@both
def test_similarity(name: str) -> None:
    vsa, x, peer = drawn(name, 2, 5)
    assert_close(vsa.similarity(x[0][:, None], x[1]), plain(torchhd.cosine_similarity(peer[0], peer[1])))


@both
def test_inner_products(name: str) -> None:
    _, x, peer = drawn(name, 2, 5)
    ours = inner_products(x[0], x[1])
    theirs = plain(torchhd.dot_similarity(peer[0], peer[1]))
    assert_close(ours.to(torch.float32), theirs.to(torch.float32), rtol=1e-5, atol=1e-4)


def test_similarity_of_bits_is_their_hamming_distance() -> None:
    vsa, x, peer = drawn("BSC", 2, 5)
    agreeing = plain(torchhd.hamming_similarity(peer[0], peer[1]))
    assert_close(vsa.similarity(x[0][:, None], x[1]), 2 * agreeing / DIM - 1)


def test_vtb_multiplies_by_the_same_matrices() -> None:
    vsa = torchvsa.VTB(900)
    x = vsa.random(2, 5, generator=torch.Generator().manual_seed(0))
    peer: Any = torchhd.ensure_vsa_tensor(x.clone(), "VTB")
    assert_close(vsa.bind(x[0], x[1]), plain(torchhd.bind(peer[0], peer[1])))
    assert_close(vsa.unbind(x[0], x[1]), plain(torchhd.bind(peer[0], torchhd.inverse(peer[1]))))
    assert_close(vsa.identity(), plain(torchhd.identity(1, 900, "VTB")[0]))
    assert_close(vsa.superpose(x), plain(torchhd.multibundle(peer)))
    assert_close(vsa.similarity(x[0][:, None], x[1]), plain(torchhd.cosine_similarity(peer[0], peer[1])))


def test_mcr_adds_the_same_numbers() -> None:
    vsa = torchvsa.MCR(DIM)
    x = vsa.random(2, 5, generator=torch.Generator().manual_seed(0))
    peer: Any = vsa.numbers(x).long().as_subclass(torchhd.MCRTensor)
    peer.block_size = 16
    assert torch.equal(vsa.numbers(vsa.bind(x[0], x[1])).long(), plain(torchhd.bind(peer[0], peer[1])))
    back = torchhd.bind(peer[0], torchhd.inverse(peer[1]))
    assert torch.equal(vsa.numbers(vsa.unbind(x[0], x[1])).long(), plain(back))
    # Of five summands few sums are halfway between two numbers, where rounding decides, or 0.
    bundled, theirs = vsa.numbers(vsa.bundle(x)).long(), plain(torchhd.multibundle(peer))
    assert (bundled == theirs).double().mean() > 0.99


def test_sparse_block_codes_add_the_same_places() -> None:
    vsa = torchvsa.BSDCSEG(900)
    x = vsa.random(2, 5, generator=torch.Generator().manual_seed(0))

    def places(codes: Tensor) -> Tensor:
        return codes.unflatten(-1, (vsa.places, vsa.blocks)).argmax(-2)

    peer: Any = places(x).as_subclass(torchhd.BSBCTensor)
    peer.block_size = vsa.places
    assert torch.equal(places(vsa.bind(x[0], x[1])), plain(torchhd.bind(peer[0], peer[1])))
    back = torchhd.bind(peer[0], torchhd.inverse(peer[1]))
    assert torch.equal(places(vsa.unbind(x[0], x[1])), plain(back))
    assert torch.equal(places(vsa.identity()), plain(torchhd.identity(1, 30, "BSBC", block_size=30)[0]))
    # Codes of the same blocks: torch-hd counts equal places, a cosine divides them by the number of blocks.
    equal = (places(x[0])[:, None] == places(x[1])).double().sum(-1)
    assert_close(vsa.similarity(x[0][:, None], x[1]).double(), equal / vsa.blocks)
