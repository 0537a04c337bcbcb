"""Errors name what was given and what was expected."""

from collections.abc import Callable

import pytest
import torch

import torchvsa
from torchvsa import CleanUp, SelfShift, ShapeError
from torchvsa.encoders import (
    Balanced,
    FractionalPower,
    History,
    Level,
    Lookup,
    RandomFourier,
    SubsetProduct,
    Sum,
    ThresholdFeatures,
    encoder,
    value_encoder,
)

SMALL = torchvsa.MAP(16)
LOOKUP = Lookup(SMALL, 4)
ROW = torch.zeros(3)

REFUSED: dict[str, tuple[Callable[[], object], type[ValueError], list[str]]] = {
    "an unknown architecture": (lambda: torchvsa.architecture("MAP", 8), ValueError, ["'MAP'", "MAP-C", "BSC"]),
    "an unknown type": (lambda: torchvsa.architecture("HRR", 8, "float31"), ValueError, ["'float31'", "int8"]),
    "no type at all": (lambda: torchvsa.architecture("HRR", 8, "nn"), ValueError, ["'nn'", "float32"]),
    "no dimensions": (lambda: torchvsa.MAP(0), ValueError, ["dim", "positive", "0"]),
    "half a dimension": (lambda: torchvsa.MAP(1.5), ValueError, ["dim", "1.5"]),  # pyright: ignore[reportArgumentType]
    "a truth as dimension": (lambda: torchvsa.MAP(True), ValueError, ["dim", "True"]),
    "an unknown variant": (
        lambda: torchvsa.MAP(8, "D"),  # pyright: ignore[reportArgumentType]
        ValueError,
        ["'D'", "'C', 'B' and 'I'"],
    ),
    "MAP of bits": (lambda: torchvsa.MAP(8, dtype=torch.bool), ValueError, ["torch.bool", "float32", "int8"]),
    "uniform codes": (lambda: torchvsa.MAP(8, dtype=torch.int8, atoms="uniform"), ValueError, ["uniform", "int8"]),
    "uniform MAP-B": (lambda: torchvsa.MAP(8, "B", atoms="uniform"), ValueError, ["uniform", "'B'", "'C'"]),
    "unknown atoms": (
        lambda: torchvsa.MAP(8, atoms="normal"),  # pyright: ignore[reportArgumentType]
        ValueError,
        ["'normal'", "'bipolar'", "'uniform'"],
    ),
    "integer HRR": (lambda: torchvsa.HRR(8, torch.int8), ValueError, ["HRR", "float32", "torch.int8"]),
    "real FHRR": (lambda: torchvsa.FHRR(8, torch.float32), ValueError, ["FHRR", "complex64", "torch.float32"]),
    "real BSC": (lambda: torchvsa.BSC(8, torch.float32), ValueError, ["BSC", "torch.bool", "torch.float32"]),
    "one vector to bundle": (lambda: SMALL.bundle(torch.ones(16)), ShapeError, ["(16,)", "[..., k, 16]"]),
    "elements to bundle": (lambda: SMALL.bundle(torch.ones(3, 16), dim=-1), ShapeError, ["dim=-1", "(3, 16)"]),
    "elements to bundle, counted": (lambda: SMALL.bundle(torch.ones(3, 16), dim=1), ShapeError, ["dim=1", "dim=-2"]),
    "bundle of others": (lambda: SMALL.bundle(torch.ones(3, 8)), ShapeError, ["xs", "d = 16", "(3, 8)"]),
    "too few weights": (
        lambda: SMALL.bundle(torch.ones(3, 16), weights=torch.ones(2)),
        ShapeError,
        ["weights", "3", "(2,)"],
    ),
    "one weight for all": (
        lambda: SMALL.bundle(torch.ones(3, 16), weights=torch.ones(1)),
        ShapeError,
        ["weights", "3", "(1,)"],
    ),
    "a bare weight": (
        lambda: SMALL.bundle(torch.ones(3, 16), weights=torch.tensor(1)),
        ShapeError,
        ["weights", "3", "()"],
    ),
    "a sequence of elements": (lambda: SMALL.sequence(torch.ones(3, 16), dim=-1), ShapeError, ["dim=-1", "(3, 16)"]),
    "a sequence of none": (lambda: SMALL.sequence(torch.ones(0, 16)), ShapeError, ["at least one", "none"]),
    "too long n-grams": (lambda: SMALL.ngrams(torch.ones(2, 16), 3), ShapeError, ["n = 3", "at least 3", "got 2"]),
    "n-grams of none": (lambda: SMALL.ngrams(torch.ones(2, 16), 0), ValueError, ["n is a positive integer", "0"]),
    "a role without a value": (
        lambda: SMALL.record(torch.ones(3, 16), torch.ones(2, 16)),
        ShapeError,
        ["3 roles", "2 values"],
    ),
    "half a power of MAP": (lambda: SMALL.power(torch.ones(16), 0.5), ValueError, ["MAP-C", "FHRR or HRR", "0.5"]),
    "an endless power": (lambda: torchvsa.HRR(8).power(torch.ones(8), float("inf")), ValueError, ["real", "inf"]),
    "an unknown width": (
        lambda: SelfShift(SMALL, "median"),  # pyright: ignore[reportArgumentType]
        ValueError,
        ["'mean'", "'sum'", "'median'"],
    ),
    "no span": (lambda: Level(SMALL, 4, span=0), ValueError, ["span", "at least 1", "0"]),
    "half a bin": (lambda: Balanced(SMALL, 2.5), ValueError, ["bins", "whole", "2.5"]),  # pyright: ignore[reportArgumentType]
    "no bins": (lambda: Lookup(SMALL, 0), ValueError, ["bins", "at least 1", "0"]),
    "an unknown value encoder": (
        lambda: value_encoder({"name": "thermo"}, SMALL),
        ValueError,
        ["'thermo'", "lookup", "level", "fractional_power"],
    ),
    "an unknown encoder": (
        lambda: encoder({"name": "bundle"}, SMALL),
        ValueError,
        ["'bundle'", "sum", "product", "subset_product", "history"],
    ),
    "no name of an encoder": (lambda: encoder({}, SMALL), ValueError, ["None", "sum", "product"]),
    "no sensors": (lambda: Sum(LOOKUP, 0), ValueError, ["sensors", "at least 1", "0"]),
    "a number of sensors left out": (lambda: Sum(LOOKUP), ValueError, ["one value encoder", "sensors="]),
    "value encoders for other sensors": (lambda: Sum([LOOKUP] * 2, 3), ValueError, ["2 value encoders", "3 sensors"]),
    "no value encoders": (lambda: Sum([]), ValueError, ["value encoder", "one per sensor"]),
    "value encoders of two spaces": (
        lambda: Sum([LOOKUP, Lookup(torchvsa.MAP(8), 4)]),
        ValueError,
        ["the same architecture"],
    ),
    "an empty subset": (lambda: SubsetProduct(LOOKUP, 2, 0), ValueError, ["subset", "at least 1", "0"]),
    "a subset in HRR": (
        lambda: SubsetProduct(Lookup(torchvsa.HRR(8), 4), 2),
        ValueError,
        ["subset", "element-wise", "HRR"],
    ),
    "one row of readings": (lambda: Sum(LOOKUP, 3, 0)(ROW), ShapeError, ["readings", "[batch, 3]", "(3,)"]),
    "a missing sensor": (lambda: Sum(LOOKUP, 2, 0)(ROW[None]), ShapeError, ["[batch, 2]", "(1, 3)"]),
    "a reading out of range": (
        lambda: Sum(LOOKUP, 2, 0)(torch.tensor([[0.5, 1], [0, 1.5]])),
        ValueError,
        ["[0, 1]", "1.5 at [1, 1]", "Schema.normalise"],
    ),
    "a plan": (lambda: Sum(LOOKUP, 3)(ROW[None]), ValueError, ["'sum'", "no codebooks", "seed", "draw()"]),
    "a value that was not observed": (
        lambda: Lookup(SMALL, 4, 0)(torch.tensor(torch.nan)),
        ValueError,
        ["not observed", "records"],
    ),
    "powers without a spectrum": (lambda: FractionalPower(SMALL), ValueError, ["spectrum", "FHRR, HRR", "MAP-C"]),
    "an unknown kernel": (
        lambda: FractionalPower(torchvsa.HRR(8), kernel="cauchy"),  # pyright: ignore[reportArgumentType]
        ValueError,
        ["'sinc'", "'gaussian'", "'cauchy'"],
    ),
    "no length": (lambda: FractionalPower(torchvsa.HRR(8), 0), ValueError, ["length", "above 0", "0"]),
    "no width of the kernel": (lambda: RandomFourier(SMALL, 2, -1), ValueError, ["length", "above 0", "-1"]),
    "random features of bits": (lambda: RandomFourier(torchvsa.BSC(8), 2), ValueError, ["real elements", "BSC"]),
    "fractions in int8": (
        lambda: RandomFourier(torchvsa.MAP(8, dtype=torch.int8), 2, sign=False),
        ValueError,
        ["no fractions", "sign=True", "int8"],
    ),
    "edges of another sensor": (
        lambda: ThresholdFeatures(SMALL, 2, edges=[torch.tensor([0.5])]),
        ValueError,
        ["edges", "2 sensors", "1 of them"],
    ),
    "edges in disorder": (
        lambda: ThresholdFeatures(SMALL, 1, edges=[torch.tensor([0.5, 0.2])]),
        ValueError,
        ["sensor 0", "sorted"],
    ),
    "an edge out of range": (
        lambda: ThresholdFeatures(SMALL, 1, edges=[torch.tensor([0.5, 1.5])]),
        ValueError,
        ["sensor 0", "from 0 to 1"],
    ),
    "more edges than bins part": (
        lambda: ThresholdFeatures(SMALL, 1, 2, edges=[torch.tensor([0.2, 0.5])]),
        ValueError,
        ["sensor 0", "2 edges", "has 2"],
    ),
    "a history of histories": (lambda: History(History(Sum(LOOKUP, 2), [1]), [2]), ValueError, ["all lags at once"]),
    "no items": (lambda: CleanUp(torch.ones(0, 4)), ShapeError, ["items", "at least 1", "(0, 4)"]),
    "one bare item": (lambda: CleanUp(torch.ones(4)), ShapeError, ["[K, d]", "(4,)"]),
    "another query": (
        lambda: CleanUp(torch.ones(2, 4))(torch.ones(3, 5)),
        ShapeError,
        ["queries", "d = 4", "(3, 5)"],
    ),
    "a bare query": (lambda: CleanUp(torch.ones(2, 4))(torch.tensor(1.0)), ShapeError, ["queries", "d = 4", "()"]),
}


@pytest.mark.parametrize("name", REFUSED)
def test_the_message_names_what_was_given_and_what_was_expected(name: str) -> None:
    call, kind, words = REFUSED[name]
    with pytest.raises(kind) as refused:
        call()
    for word in words:
        assert word in str(refused.value)


@pytest.mark.parametrize("verb", ["bind", "unbind", "similarity", "dot_similarity", "hamming_similarity"])
@pytest.mark.parametrize("name", torchvsa.ARCHITECTURES)
def test_no_architecture_takes_vectors_of_another_dimension(name: str, verb: str) -> None:
    vsa, other = torchvsa.architecture(name, 16), torchvsa.architecture_near(name, 8)
    size = other.dim
    right, wrong = vsa.random(2), other.random(2)
    for pair in ((right, wrong), (wrong, right), (wrong, wrong), (right, right[:, :1])):
        with pytest.raises(ShapeError, match=rf"must end in d = 16 elements; got shape \(2, ({size}|1)\)"):
            getattr(vsa, verb)(*pair)


@pytest.mark.parametrize("name", torchvsa.ARCHITECTURES)
def test_no_permutation_or_protection_takes_vectors_of_another_dimension(name: str) -> None:
    vsa, wrong = torchvsa.architecture(name, 16), torchvsa.architecture_near(name, 8).random(2)
    calls = (lambda: vsa.permute(wrong, 1), lambda: SelfShift(vsa, seed=0)(wrong), lambda: vsa.power(wrong, 2))
    for call in calls:
        with pytest.raises(ShapeError, match=rf"x must end in d = 16 elements; got shape \(2, {wrong.shape[1]}\)"):
            call()
