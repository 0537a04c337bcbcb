"""A mirrored record: exchanging paired readings rotates its hypervectors by d / 2."""

from typing import Any

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from readings import rows
from spaces import ELEMENTWISE
from torch.testing import assert_close

import torchvsa
from torchvsa._rows import row_encoder
from torchvsa.encoders import FractionalPower, Level, Lookup, Mirrored

READING = st.one_of(st.just(float("nan")), st.floats(0, 1))


def half_turn(x: torch.Tensor) -> torch.Tensor:
    return x.roll(x.shape[-1] // 2, -1)


@given(readings=st.lists(st.lists(READING, min_size=5, max_size=5), min_size=1, max_size=6), seed=st.integers(0, 99))
@settings(max_examples=40, deadline=None, derandomize=True)
@pytest.mark.parametrize("name", ELEMENTWISE)
def test_exchanging_pairs_is_a_half_turn(name: str, readings: list[list[float]], seed: int) -> None:
    vsa = torchvsa.architecture(name, 128)
    encode = Mirrored(Level(vsa, 8), [(0, 3), (4, 1)], 5, seed=seed)
    x = torch.tensor(readings, dtype=torch.float64)
    swapped = encode(x[:, [3, 4, 2, 0, 1]])
    if vsa.dtype.is_complex:
        assert_close(swapped, half_turn(encode(x)))
    else:
        assert torch.equal(swapped, half_turn(encode(x)))


def test_other_sensors_have_symmetric_codes_and_pairs_do_not() -> None:
    encode = Mirrored(Lookup(torchvsa.MAP(1000), 4), [(0, 1)], 3, seed=0)
    x = torch.full((3, 3), torch.nan, dtype=torch.float64).fill_diagonal_(0.6)
    left, right, middle = encode(x)
    assert torch.equal(right, half_turn(left))
    assert torch.equal(middle, half_turn(middle))
    assert abs(torchvsa.MAP(1000).similarity(left, right)) < 0.15


def test_which_sensor_reads_a_value_is_told_apart() -> None:
    vsa = torchvsa.MAP(4000)
    encode = Mirrored(Lookup(vsa, 4), [(0, 1), (2, 3)], 6, seed=0)
    x = torch.full((6, 6), 0.1, dtype=torch.float64).fill_diagonal_(0.9)
    codes = encode(x)
    similarity = vsa.similarity(codes[:, None], codes).fill_diagonal_(0)
    assert similarity.abs().max() < 0.1


def test_continuous_values_are_mirrored_too() -> None:
    encode = Mirrored(FractionalPower(torchvsa.FHRR(256)), [(0, 2)], 3, seed=1)
    x = rows(20, 3)
    assert_close(encode(x[:, [2, 1, 0]]), half_turn(encode(x)))


@pytest.mark.parametrize("name", ELEMENTWISE)
def test_a_single_row_in_numpy_has_the_same_code(name: str) -> None:
    vsa = torchvsa.architecture(name, 64)
    encode, protect = Mirrored(Level(vsa, 8), [(0, 1)], 3, seed=2), torchvsa.Unprotected(vsa)
    fast = row_encoder(encode, protect)
    assert fast is not None
    for x in rows(10, 3):
        if not x.isnan().all():
            assert_close(torch.from_numpy(fast(x.numpy())), encode(x[None])[0])


MAP = torchvsa.MAP(64)
LEVEL = Level(MAP, 8)
WRONG: dict[str, Any] = {
    "each column at most once": lambda: Mirrored(LEVEL, [(0, 1), (1, 2)], 3),
    r"each column at most once; got \[\]": lambda: Mirrored(LEVEL, [], 3),
    r"each column at most once; got \[\(0, 1, 2\)": lambda: Mirrored(LEVEL, [(0, 1, 2)], 3),
    r"each column at most once; got \[\(-1": lambda: Mirrored(LEVEL, [(-1, 0)], 3),
    r"each column at most once; got \[0, 1\]": lambda: Mirrored(LEVEL, [0, 1], 3),  # type: ignore[list-item] (refused)
    "each column at most once; got 'left'": lambda: Mirrored(LEVEL, [("left", "right")], 3),  # type: ignore[list-item] (refused)
    "pairs name column 3; with 3 sensors the last one is 2": lambda: Mirrored(LEVEL, [(0, 3)], 3),
    "sensors 0 and 1 are a pair": lambda: Mirrored([LEVEL, Level(MAP, 9), LEVEL], [(0, 1)]),
    "sensors 1 and 2 are a pair": lambda: Mirrored([LEVEL, Level(MAP, 8, seed=0), Level(MAP, 8, seed=1)], [(1, 2)]),
    "element-wise binding, which HRR": lambda: Mirrored(Level(torchvsa.HRR(64), 8), [(0, 1)], 3),
    r"d is even; got MAP-C\(dim=63": lambda: Mirrored(Level(torchvsa.MAP(63), 8), [(0, 1)], 3),
}


@pytest.mark.parametrize("message", WRONG)
def test_what_cannot_be_mirrored_is_refused(message: str) -> None:
    with pytest.raises(ValueError, match=message):
        WRONG[message]()


def test_equal_plans_of_a_pair_are_one_and_the_same() -> None:
    vsa = torchvsa.MAP(64)
    encode = Mirrored([Level(vsa, 8), Lookup(vsa, 3), Level(vsa, 8)], [(0, 2)], seed=0)
    assert encode.values[0] is encode.values[2]
    again = Mirrored.from_config(encode.config(), vsa).take(encode.state_dict())
    x = rows(10, 3)
    assert torch.equal(again(x), encode(x))
