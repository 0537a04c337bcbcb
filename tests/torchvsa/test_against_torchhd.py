"""The same values as torch-hd, wherever it has the same operation."""

from collections.abc import Callable
from functools import reduce
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


@both
def test_inverse(name: str) -> None:
    vsa, x, peer = drawn(name, 5)
    assert torch.equal(vsa.inverse(x), plain(torchhd.inverse(peer)))


def bound_sequence(x: Any) -> Any:
    if not isinstance(x, torchhd.HRRTensor):
        return torchhd.bind_sequence(x)
    # torch-hd's `multibind` drops the imaginary parts of the spectrum, which gives another vector.
    members: list[Any] = list(x.movedim(1, 0))
    return reduce(torchhd.bind, [torchhd.permute(member, shifts=6 - i) for i, member in enumerate(members)])


JOINED: dict[str, tuple[Callable[..., Tensor], Callable[..., Any]]] = {
    "sequence": (lambda vsa, x, raw: vsa.sequence(x[0], raw=raw), lambda x: torchhd.bundle_sequence(x[0])),
    "3-grams": (lambda vsa, x, raw: vsa.ngrams(x[0], raw=raw), lambda x: torchhd.ngrams(x[0])),
    "5-grams": (lambda vsa, x, raw: vsa.ngrams(x[0], 5, raw=raw), lambda x: torchhd.ngrams(x[0], 5)),
    "bound sequence": (lambda vsa, x, raw: vsa.ngrams(x[0], 7, raw=raw), lambda x: bound_sequence(x[0])),
    "record": (lambda vsa, x, raw: vsa.record(x[0], x[1], raw=raw), lambda x: torchhd.hash_table(x[0], x[1])),
    "graph": (
        lambda vsa, x, raw: vsa.record(vsa.permute(x[1], 1), x[0], raw=raw),
        lambda x: torchhd.graph(x.movedim(0, -3), directed=True),
    ),
}


@both
@pytest.mark.parametrize("structure", JOINED)
def test_structures(name: str, structure: str) -> None:
    # Seven members, so that each structure sums an odd number: torch-hd draws the ties of bits at random.
    vsa, x, peer = drawn(name, 2, 4, 7)
    ours, theirs = JOINED[structure]
    raw, expected = ours(vsa, x, raw=True), plain(theirs(peer))
    if name == "BSC":
        assert torch.equal(ours(vsa, x, raw=False), expected)
        raw = vsa.normalize(raw)
    assert_close(raw, expected, rtol=1e-4, atol=1e-5)


@both
def test_dot_and_hamming_similarity(name: str) -> None:
    vsa, x, peer = drawn(name, 2, 5)
    half = torch.cat([x[0, :, : DIM // 2], x[1, :, DIM // 2 :]], -1)
    theirs: Any = torchhd.ensure_vsa_tensor(half.clone(), PEERS[name])  # pyright: ignore[reportArgumentType]
    products, equal = (torchhd.dot_similarity(theirs, peer[0]), torchhd.hamming_similarity(theirs, peer[0]))
    ours = vsa.dot_similarity(half[:, None], x[0])
    assert_close(ours.to(torch.float32), plain(products).to(torch.float32), rtol=1e-5, atol=1e-4)
    assert torch.equal(vsa.hamming_similarity(half[:, None], x[0]), plain(equal))


@pytest.mark.parametrize("name", ["HRR", "FHRR"])
def test_powers_are_the_points_of_a_fractional_power_encoding(name: str) -> None:
    vsa = torchvsa.architecture(name, DIM)
    torch.manual_seed(0)
    encode = torchhd.embeddings.FractionalPower(1, DIM, vsa=name)  # pyright: ignore[reportArgumentType]
    base = plain(encode.basis())[0].detach()
    for value in (0.0, 0.3, -1.7, 2.0):
        expected = plain(encode(torch.tensor([[value]])))[0].detach()
        assert_close(vsa.power(base, value), expected, rtol=1e-4, atol=1e-4)


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


def test_what_is_made_of_the_operations_of_vtb() -> None:
    vsa = torchvsa.VTB(900)
    x = vsa.random(2, 4, 7, generator=torch.Generator().manual_seed(0))
    peer: Any = torchhd.ensure_vsa_tensor(x.clone(), "VTB")
    assert_close(vsa.sequence(x[0], raw=True), plain(torchhd.bundle_sequence(peer[0])))
    assert_close(vsa.ngrams(x[0], raw=True), plain(torchhd.ngrams(peer[0])), rtol=1e-4, atol=1e-5)
    assert_close(vsa.ngrams(x[0], 7, raw=True), plain(torchhd.bind_sequence(peer[0])), rtol=1e-4, atol=1e-5)
    # torch-hd's table takes the values for the keys, with which its own `get` does not unbind.
    assert_close(vsa.record(x[0], x[1], raw=True), plain(torchhd.hash_table(peer[1], peer[0])))
    assert torch.equal(vsa.inverse(x), plain(torchhd.inverse(peer)))


def test_what_is_made_of_the_operations_of_mcr() -> None:
    vsa = torchvsa.MCR(DIM)
    x = vsa.random(2, 5, generator=torch.Generator().manual_seed(0))
    peer: Any = vsa.numbers(x).long().as_subclass(torchhd.MCRTensor)
    peer.block_size = 16
    assert torch.equal(vsa.numbers(vsa.inverse(x)).long(), plain(torchhd.inverse(peer)))
    assert torch.equal(vsa.numbers(vsa.ngrams(x[0], 5)).long(), plain(torchhd.bind_sequence(peer[0])))
    assert torch.equal(vsa.numbers(vsa.power(x, -3)).long(), (-3 * plain(peer)) % 16)
    bound = vsa.bind(x[0], x[1])
    theirs: Any = torchhd.bind(peer[0], peer[1])
    equal = plain(torchhd.hamming_similarity(theirs, peer[0]))
    assert torch.equal(vsa.hamming_similarity(bound[:, None], x[0]), equal)
    assert (vsa.hamming_similarity(vsa.unbind(bound, x[1]), x[0]) == DIM).all()
