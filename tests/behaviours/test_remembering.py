"""Conditions with a memory, against a transcription in NumPy; online against offline."""

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

import torchvsa
from behaviours import Actuator, Demonstrations, Encoder, ErrorDriven, Schema, Sensor, Space
from behaviours.remembering import Recent, RememberingSpace, windows

LAGS = (1, 3)
NAN = float("nan")


def space(bins: int = 6) -> Space:
    schema = Schema([Sensor("a", 0, 1), Sensor("b", 0, 1)], [Actuator("x", -1, 1, levels=3)])
    vsa = torchvsa.MAP(dim=512, dtype=torch.int8)
    return Space(schema, vsa, Encoder(bins=bins, combine="bind"), "none", seed=3)


def recording(count: int = 3, steps: int = 12, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Readings with gaps, of `count` episodes with numbers of their own."""
    rng = np.random.default_rng(seed)
    readings = rng.uniform(size=(count * steps, 2))
    readings[rng.uniform(size=readings.shape) < 0.4] = np.nan
    episodes = np.repeat([40, 7, 19][:count], steps)
    return torch.from_numpy(readings), torch.from_numpy(episodes), torch.arange(steps).repeat(count)


def literal(plain: Space, row: NDArray[np.int64]) -> NDArray[np.int64]:
    """One window of bins `[moments, n]` as a condition, moment by moment as the formula says."""
    total = np.zeros(512, dtype=np.int64)
    for age, bins in enumerate(row):
        if (bins >= 0).any():
            total += np.roll(plain.encode(torch.from_numpy(bins[None]))[0].numpy().astype(np.int64), age)
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
    plain = space()
    memory = RememberingSpace(plain, LAGS)
    readings, episodes, _ = recording()
    bins = memory.bins(windows(readings, episodes, LAGS))
    assert (bins < 0).any()
    assert (bins >= 0).any()
    expected = [literal(plain, row) for row in bins.view(len(bins), 3, 2).numpy()]
    np.testing.assert_array_equal(memory.encode(bins).numpy(), np.stack(expected))


def test_the_first_condition_of_an_episode_has_no_past() -> None:
    plain = space()
    readings = torch.rand(10, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    memory = RememberingSpace(plain, LAGS)
    conditions = memory.encode(memory.bins(windows(readings, torch.zeros(10, dtype=torch.int64), LAGS)))
    present = plain.encode(plain.bins(readings))
    assert torch.equal(conditions[0], present[0])
    assert not torch.equal(conditions[1], present[1])


def test_what_is_old_can_be_told_from_what_is_new() -> None:
    memory = RememberingSpace(space(), [1])
    rows = torch.tensor([[0.1, 0.9, NAN, NAN], [NAN, NAN, 0.1, 0.9]], dtype=torch.float64)
    now, before = memory.encode(memory.bins(rows))
    assert torch.equal(before, torch.roll(now, 1))
    assert abs(float(memory.vsa.similarity(now, before))) < 4 / 512**0.5


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
    torch.testing.assert_close(seen, expected, rtol=0, atol=0, equal_nan=True)


@pytest.mark.parametrize("lags", [(), (1,), LAGS])
@pytest.mark.parametrize("hold", [False, True])
def test_windows_are_those_of_a_plain_loop(lags: tuple[int, ...], hold: bool) -> None:
    readings, episodes, _ = recording()
    found = windows(readings, episodes, lags, hold).numpy()
    np.testing.assert_array_equal(found, remembered(readings.numpy(), episodes.numpy(), lags, hold))


def test_a_reading_is_held_until_the_next_one_arrives() -> None:
    readings = torch.tensor([[NAN], [0.2], [NAN], [NAN], [0.7], [NAN]], dtype=torch.float64)
    seen = windows(readings, torch.tensor([8, 8, 8, 8, 8, 9]), [], hold=True)
    expected = torch.tensor([[NAN], [0.2], [0.2], [0.2], [0.7], [NAN]], dtype=torch.float64)
    torch.testing.assert_close(seen, expected, rtol=0, atol=0, equal_nan=True)


@pytest.mark.parametrize("lags", [(), (1,), LAGS])
@pytest.mark.parametrize("hold", [False, True])
@pytest.mark.parametrize("together", [1, 2, 3])
def test_online_memory_is_offline_memory_at_any_batch_size(lags: tuple[int, ...], together: int, hold: bool) -> None:
    readings, episodes, steps = (column.numpy() for column in recording())
    expected = windows(torch.from_numpy(readings), torch.from_numpy(episodes), lags, hold).numpy()
    recent, found = Recent(2, lags, hold), np.zeros_like(expected)
    groups = [np.unique(episodes)[i : i + together] for i in range(0, 3, together)]
    for group in groups:
        past = recent.start(len(group))
        for step in range(12):
            rows = np.array([np.flatnonzero((steps == step) & (episodes == one))[0] for one in group])
            found[rows], past = recent.step(readings[rows], past)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("hold", [False, True])
def test_a_past_is_a_value_that_can_be_taken_up_again(hold: bool) -> None:
    recent = Recent(1, [1], hold)
    _, past = recent.step(np.array([[1.0]]), recent.start(1))
    before = past.copy()
    for _ in range(2):
        window, later = recent.step(np.array([[3.0]]), past)
        assert window[0].tolist() == [3.0, 1.0]
        assert later.tolist() == [[[3.0]]]
    np.testing.assert_array_equal(past, before)
    assert np.isnan(recent.step(np.array([[NAN]]), recent.start(1))[0]).all()


def test_memory_tells_apart_what_looks_alike_now() -> None:
    # The command is the sign of the reading one step ago; the present reading says nothing about it.
    rng = np.random.default_rng(0)
    readings = torch.from_numpy(rng.choice([0.1, 0.9], size=(200, 2)))
    episodes = torch.zeros(200, dtype=torch.int64)
    commands = torch.ones(200, 1)
    commands[1:, 0] = torch.where(readings[:-1, 0] > 0.5, 1.0, -1.0)
    seen = windows(readings, episodes, [1])
    plain = space()
    memory = RememberingSpace(plain, [1])
    rule = ErrorDriven(passes=20)
    blind = rule.fit(plain, Demonstrations(readings[1:], commands[1:]))(readings[1:]).commands
    remembering = rule.fit(memory, Demonstrations(seen[1:], commands[1:]))(seen[1:]).commands
    assert (remembering == commands[1:]).all()
    assert (blind == commands[1:]).double().mean() < 0.75


def test_a_space_is_made_again_from_its_settings() -> None:
    memory = RememberingSpace(space(), LAGS)
    again = RememberingSpace.from_config(memory.config())
    bins = torch.tensor([[1, 2, 3, -1, 0, 5]])
    assert torch.equal(again.encode(bins), memory.encode(bins))
    assert [sensor.name for sensor in again.schema.sensors[2:4]] == ["a, 1 ago", "b, 1 ago"]


@pytest.mark.parametrize("lags", [[0], [2, 1], [1, 1], [1.5]])
def test_wrong_lags_are_refused(lags: list[int]) -> None:
    with pytest.raises(ValueError, match="growing numbers of steps"):
        RememberingSpace(space(), lags)


def test_scattered_episodes_are_refused() -> None:
    with pytest.raises(ValueError, match="must stand together"):
        windows(torch.zeros(3, 1), torch.tensor([0, 1, 0]), [1])
