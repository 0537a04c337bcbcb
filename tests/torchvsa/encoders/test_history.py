"""Histories against a transcription in NumPy; live windows against recorded ones."""

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from readings import seeded
from torch.testing import assert_close

import torchvsa
from torchvsa.encoders import Encoder, FractionalPower, History, Level, Product, Sum
from torchvsa.encoders.history import windows

LAGS = (1, 3)
NAN = float("nan")
MAP = torchvsa.MAP(dim=512, dtype=torch.int8)


def present() -> Product:
    return Product(Level(MAP, 6), 2, seed=3)


def recording(count: int = 3, steps: int = 12, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Readings with gaps, of `count` episodes with numbers of their own."""
    rng = np.random.default_rng(seed)
    readings = rng.uniform(size=(count * steps, 2))
    readings[rng.uniform(size=readings.shape) < 0.4] = np.nan
    episodes = np.repeat([40, 7, 19][:count], steps)
    return torch.from_numpy(readings), torch.from_numpy(episodes), torch.arange(steps).repeat(count)


def literal(plain: Encoder, row: NDArray[np.float64]) -> NDArray[np.int64]:
    """One window `[moments, n]` as a condition, moment by moment as the formula says."""
    total = np.zeros(512, dtype=np.int64)
    for age, readings in enumerate(row):
        if not np.isnan(readings).all():
            total += np.roll(plain(torch.from_numpy(readings[None]))[0].numpy().astype(np.int64), age)
    return np.clip(total, -1, 1)


def remembered(
    readings: NDArray[np.float64], episodes: NDArray[np.int64], lags: tuple[int, ...], hold: bool
) -> NDArray[np.float64]:
    """The windows, one reading at a time."""
    result = np.full((len(readings), 1 + len(lags), readings.shape[1]), np.nan)
    for row in range(len(readings)):
        for column, lag in enumerate((0, *lags)):
            for sensor in range(readings.shape[1]):
                at = row - lag
                while hold and at >= 0 and episodes[at] == episodes[row] and np.isnan(readings[at, sensor]):
                    at -= 1
                if at >= 0 and episodes[at] == episodes[row]:
                    result[row, column, sensor] = readings[at, sensor]
    return result.reshape(len(readings), -1)


def test_conditions_are_what_the_formula_says() -> None:
    plain = present()
    encode = History(plain, LAGS)
    assert encode.drawn
    readings, episodes, _ = recording()
    x = encode.windows(readings, episodes)
    assert x.isnan().any()
    expected = [literal(plain, row) for row in x.view(len(x), 3, 2).numpy()]
    np.testing.assert_array_equal(encode(x).numpy(), np.stack(expected))


@pytest.mark.parametrize("name", torchvsa.ARCHITECTURES)
def test_every_architecture_bundles_permuted_moments(name: str) -> None:
    vsa = torchvsa.architecture_near(name, 200)
    plain = Sum(Level(vsa, 6), 2, seed=3)
    encode = History(plain, LAGS)
    readings, episodes, _ = recording(1)
    x = encode.windows(readings, episodes)
    for row, condition in zip(x, encode(x), strict=True):
        moments = [(age, some) for age, some in enumerate(row.view(3, 2)) if not some.isnan().all()]
        if moments:
            parts = [vsa.permute(plain(some[None])[0], age) for age, some in moments]
            assert_close(condition, vsa.bundle(torch.stack(parts)))


def test_the_first_condition_of_an_episode_has_no_past() -> None:
    plain = present()
    readings = torch.rand(10, 2, generator=seeded(), dtype=torch.float64)
    encode = History(plain, LAGS)
    conditions = encode(encode.windows(readings, torch.zeros(10, dtype=torch.int64)))
    assert torch.equal(conditions[0], plain(readings)[0])
    assert not torch.equal(conditions[1], plain(readings)[1])


def test_what_is_old_can_be_told_from_what_is_new() -> None:
    rows = torch.tensor([[0.1, 0.9, NAN, NAN], [NAN, NAN, 0.1, 0.9]], dtype=torch.float64)
    now, before = History(present(), [1])(rows)
    assert torch.equal(before, torch.roll(now, 1))
    assert abs(float(MAP.similarity(now, before))) < 4 / 512**0.5


def test_a_history_averages_the_kernels_of_its_moments() -> None:
    vsa = torchvsa.MAP(20_000, "I")
    encode = History(Sum(Level(vsa, 11), 1), [1, 2], seed=0)
    # Bins 1, 5 and 8 against 3, 5 and 0 of 11.
    pair = torch.tensor([[0.14, 0.5, 0.77], [0.32, 0.5, 0.05]], dtype=torch.float64)
    expected = (0.8 + 1 + 0.2) / 3
    assert vsa.similarity(*encode(pair)).item() == pytest.approx(expected, abs=5 / 20_000**0.5)


def test_windows_hold_the_readings_of_the_lags_and_do_not_cross_episodes() -> None:
    readings = torch.arange(10, dtype=torch.float64).view(5, 2)
    seen = windows(readings, torch.tensor([4, 4, 4, 1, 1]), [1, 2])
    expected = torch.tensor(
        [
            [0, 1, NAN, NAN, NAN, NAN],
            [2, 3, 0, 1, NAN, NAN],
            [4, 5, 2, 3, 0, 1],
            [6, 7, NAN, NAN, NAN, NAN],
            [8, 9, 6, 7, NAN, NAN],
        ],
        dtype=torch.float64,
    )
    assert_close(seen, expected, rtol=0, atol=0, equal_nan=True)


@pytest.mark.parametrize("lags", [(), (1,), LAGS, (20,)])
@pytest.mark.parametrize("hold", [False, True])
def test_windows_are_those_of_a_plain_loop(lags: tuple[int, ...], hold: bool) -> None:
    readings, episodes, _ = recording()
    found = History(present(), lags, hold).windows(readings, episodes).numpy()
    np.testing.assert_array_equal(found, remembered(readings.numpy(), episodes.numpy(), lags, hold))


def test_a_reading_is_held_until_the_next_one_arrives() -> None:
    readings = torch.tensor([[NAN], [0.2], [NAN], [NAN], [0.7], [NAN]], dtype=torch.float64)
    seen = windows(readings, torch.tensor([8, 8, 8, 8, 8, 9]), [], hold=True)
    expected = torch.tensor([[NAN], [0.2], [0.2], [0.2], [0.7], [NAN]], dtype=torch.float64)
    assert_close(seen, expected, rtol=0, atol=0, equal_nan=True)


@pytest.mark.parametrize("lags", [(), (2,), LAGS])
@pytest.mark.parametrize("hold", [False, True])
@pytest.mark.parametrize("together", [1, 2, 3])
def test_live_windows_are_recorded_ones_at_any_batch_size(together: int, hold: bool, lags: tuple[int, ...]) -> None:
    readings, episodes, _ = recording()
    encode = History(present(), lags, hold)
    expected = encode.windows(readings, episodes).view(3, 12, -1)
    live = readings.view(3, 12, 2)
    for robots in torch.arange(3).split(together):
        past = encode.start(len(robots))
        for step in range(12):
            given = past.clone()
            window, after = encode.step(live[robots, step], past)
            assert_close(window, expected[robots, step], rtol=0, atol=0, equal_nan=True)
            assert_close(past, given, rtol=0, atol=0, equal_nan=True)
            past = after


@pytest.mark.parametrize("hold", [False, True])
def test_the_order_of_robots_does_not_matter(hold: bool) -> None:
    readings = recording()[0].view(3, 12, 2)
    encode, order = History(present(), LAGS, hold), torch.tensor([2, 0, 1])
    past, other = encode.start(3), encode.start(3)
    for step in range(12):
        window, past = encode.step(readings[:, step], past)
        turned, other = encode.step(readings[order, step], other)
        assert torch.equal(encode(turned), encode(window)[order])
        assert_close(other, past[order], rtol=0, atol=0, equal_nan=True)


def test_the_memory_is_what_was_handed_on_and_nothing_else() -> None:
    encode = History(present(), [1], hold=True)
    _, past = encode.step(torch.tensor([[0.5, NAN]]).double(), encode.start(1))
    for _ in range(2):  # the same step twice, from the same past
        window, _ = encode.step(torch.tensor([[NAN, 0.25]]).double(), past)
        assert_close(window, torch.tensor([[0.5, 0.25, 0.5, NAN]]).double(), equal_nan=True)
    fresh, _ = encode.step(torch.tensor([[NAN, 0.25]]).double(), encode.start(1))
    assert_close(fresh, torch.tensor([[NAN, 0.25, NAN, NAN]]).double(), equal_nan=True)


def test_readings_in_float32_have_windows_of_one_type_live_and_recorded() -> None:
    encode = History(Sum(FractionalPower(torchvsa.FHRR(50)), 2), [1], hold=True, seed=0)
    x = torch.rand(5, 2, generator=seeded())
    recorded = encode.windows(x, torch.zeros(5, dtype=torch.int64))
    past = encode.start(1)
    for step in range(5):
        window, past = encode.step(x[step : step + 1], past)
        assert_close(window[0].double(), recorded[step].double(), rtol=0, atol=0, equal_nan=True)


@pytest.mark.parametrize("lags", [[0], [2, 1], [1, 1], [1.5]])
def test_wrong_lags_are_refused(lags: list[int]) -> None:
    with pytest.raises(ValueError, match="increasing whole numbers of steps"):
        History(present(), lags)


def test_scattered_episodes_are_refused() -> None:
    with pytest.raises(ValueError, match="must be next to each other"):
        windows(torch.zeros(3, 1), torch.tensor([0, 1, 0]), [1])
