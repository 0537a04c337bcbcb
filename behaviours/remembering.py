"""Conditions with a memory: the present one bundled with permuted past ones, so that equal readings can differ."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, Self

import numpy as np
import torch
from jaxtyping import Float64, Int64, Shaped
from numpy.typing import NDArray
from torch import Tensor, nn

from behaviours.schema import Schema
from behaviours.space import Space
from torchvsa.blocks import by_blocks


class RememberingSpace(Space):
    """A space whose conditions hold the present readings and those `lags` steps ago.

    With `c(t)` the condition of `space`, permuted to tell the past from the present:

        c(t) ⊕ permute(c(t - lags[0]), 1) ⊕ permute(c(t - lags[1]), 2) ⊕ ...

    The bundle averages the similarities of its moments: what was seen at one of them is not lost if another is odd.
    (A product of whole past conditions would be like nothing else as soon as one reading of one moment differs.) A
    moment without any observed sensor is left out.

    Rows of readings are windows, `[B, (1 + len(lags)) · n]`: the present first (see `windows` and `Recent`).
    Codebooks are those of `space`. Learning rules and `Behaviour` take it as they take any other space.

    Source: permutation for order in time, e.g. Kanerva 2009, "Hyperdimensional computing", section on sequences.
    """

    def __init__(self, space: Space, lags: Sequence[int]) -> None:
        nn.Module.__init__(self)  # the parts of `space` are shared, so none is drawn here
        self.lags = check_lags(lags)
        self.present = space
        self.vsa, self.seed, self.encoder = space.vsa, space.seed, space.encoder
        self.conditions, self.results, self.protect = space.conditions, space.results, space.protect
        past = [
            replace(sensor, name=f"{sensor.name}, {lag} ago") for lag in self.lags for sensor in space.schema.sensors
        ]
        self.schema = Schema([*space.schema.sensors, *past], space.schema.actuators)

    def encode(self, bins: Int64[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        """The condition with its memory, for each window of bins (-1: not observed)."""
        return by_blocks(self._encode, bins, row_bytes=2 * (1 + len(self.lags)) * self.vsa.row_bytes)

    def _encode(self, bins: Tensor) -> Tensor:
        moments = 1 + len(self.lags)
        bins = bins.unflatten(1, (moments, -1))
        conditions = self.present.encode(bins.flatten(0, 1)).unflatten(0, (-1, moments))
        conditions = torch.stack([self.vsa.permute(conditions[:, age], age) for age in range(moments)], 1)
        return self.vsa.bundle(conditions, weights=(bins >= 0).any(-1).to(torch.int32))

    def config(self) -> dict[str, Any]:
        """What `RememberingSpace.from_config` needs, beside the tensors, to make an equal space."""
        return {"kind": "remembering", "space": self.present.config(), "lags": list(self.lags)}

    def codebooks(self) -> dict[str, Tensor]:
        """See `Space.codebooks`: those of the present."""
        return self.present.codebooks()

    @classmethod
    def layout(cls, config: dict[str, Any]) -> dict[str, tuple[torch.dtype, tuple]]:
        """See `Space.layout`."""
        return Space.layout(config["space"])

    @classmethod
    def from_config(cls, config: dict[str, Any], codebooks: Mapping[str, Tensor] | None = None) -> Self:
        """See `Space.from_config`."""
        lags = check_lags(config["lags"])
        return cls(Space.from_config(config["space"], codebooks), lags)


class Recent:
    """The latest readings of robots that drive, as windows; like an RNN cell, with an explicit state.

    With `hold`, a reading that was not observed is replaced by the last one of its sensor that was, however old.

    The state is the past of each robot, `[B, p, sensors]`, the latest first; before its first step, NaN (not observed).
    Robots do not influence each other.
    """

    def __init__(self, sensors: int, lags: Sequence[int], hold: bool = False) -> None:
        self.sensors, self.lags, self.hold = sensors, check_lags(lags), hold

    def start(self, batch: int) -> NDArray[np.float64]:
        """The past of `batch` robots that have seen nothing yet."""
        return np.full((batch, max(self.lags, default=int(self.hold)), self.sensors), np.nan)

    def step(
        self, readings: NDArray[np.float64], past: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Windows `[B, (1 + len(lags)) · n]` for readings `[B, n]`, and the past for the next step."""
        if self.hold:
            readings = np.where(np.isnan(readings), past[:, 0], readings)
        seen = np.concatenate([readings[:, None], past], axis=1)
        return seen[:, [0, *self.lags]].reshape(len(readings), -1), seen[:, : past.shape[1]]


def windows(
    readings: Float64[Tensor, "N n"], episodes: Int64[Tensor, "N"], lags: Sequence[int], hold: bool = False
) -> Float64[Tensor, "N w"]:
    """The windows of recorded readings, whose rows are the steps of one episode after the other.

    Equal to what `Recent` returns for the same readings, step by step. Raises `ValueError` if an episode's rows do
    not stand together.
    """
    lags = check_lags(lags)
    begins = torch.ones(len(episodes), dtype=torch.bool, device=episodes.device)
    begins[1:] = episodes[1:] != episodes[:-1]
    if int(begins.sum()) != len(episodes.unique()):
        raise ValueError("the rows of an episode must stand together, in the order of its steps")
    if hold:
        readings = _held(readings, begins)
    columns = [readings]
    for lag in lags:
        past = torch.full_like(readings, torch.nan)
        if lag < len(readings):
            same = episodes[lag:] == episodes[:-lag]
            past[lag:][same] = readings[:-lag][same]
        columns.append(past)
    return torch.cat(columns, -1)


def _held(readings: Tensor, begins: Tensor) -> Tensor:
    """Each reading, or the last one of its sensor and episode that was observed."""
    if not len(readings):
        return readings
    rows = torch.arange(len(readings), device=readings.device)[:, None].expand_as(readings)
    # The first row of an episode counts as observed: what it lacks stays missing, and nothing older comes after it.
    source = torch.where(readings.isnan() & ~begins[:, None], 0, rows).cummax(0).values
    return readings.gather(0, source)


def check_lags(lags: Sequence[int]) -> tuple[int, ...]:
    """The lags as a tuple. Raises `ValueError` unless they are whole numbers of steps, 1 or more, growing."""
    given = tuple(lags)
    if any(isinstance(lag, bool) or not isinstance(lag, int) or lag < 1 for lag in given) or any(
        later <= sooner for sooner, later in pairwise(given)
    ):
        raise ValueError(f"lags are growing numbers of steps, 1 or more; got {list(given)}")
    return given
