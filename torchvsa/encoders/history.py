"""Conditions with a memory: the present one bundled with permuted past ones, so that equal readings can differ."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, TypeVar

import torch
from jaxtyping import Float, Int64, Shaped
from torch import Tensor

from torchvsa._blocks import by_blocks
from torchvsa.architectures import VSA
from torchvsa.encoders.base import Encoder, planned
from torchvsa.encoders.registry import encoder
from torchvsa.part import Layout

H = TypeVar("H", bound="History")


class History(Encoder):
    """Encode the present readings together with those `lags` steps ago.

    With `c(t)` the hypervector that `present` gives the readings at step t, permuted to tell the past from the present:

        c(t) ⊕ permute(c(t - lags[0]), 1) ⊕ permute(c(t - lags[1]), 2) ⊕ ...

    The bundle averages the similarities of its moments: what was seen at one of them is not lost if another is odd. (A
    product of whole past conditions would be like nothing else as soon as one reading of one moment differs.) A moment
    without any observed sensor is left out.

    Its inputs are windows `[B, (1 + len(lags)) · n]`, the present first. `windows` makes them of recorded readings,
    `start` and `step` of live ones: the memory of each robot is the tensor that they hand on, and nothing else. With
    `hold`, a reading that was not observed is replaced by the last one of its sensor that was, however old.

    Source: permutation for order in time, e.g. Kanerva 2009, "Hyperdimensional computing", section on sequences.
    """

    name = "history"

    def __init__(self, present: Encoder, lags: Sequence[int], hold: bool = False, seed: int | None = None) -> None:
        super().__init__()
        if isinstance(present, History):
            raise ValueError("a history of histories is not supported; give all lags at once")
        self.present = planned(present)
        self.lags, self.hold = check_lags(lags), bool(hold)
        self.vsa, self.sensors, self.discrete = present.vsa, present.sensors, present.discrete
        self._own(seed)

    @property
    def width(self) -> int:
        """Columns of a window."""
        return (1 + len(self.lags)) * self.sensors

    def own_layout(self) -> Layout:
        """Nothing of its own."""
        return {}

    def config(self) -> dict[str, Any]:
        """See `Part.config`."""
        return {"name": self.name, "present": self.present.config(), "lags": list(self.lags), "hold": self.hold}

    @classmethod
    def from_config(cls: type[H], config: Mapping[str, Any], vsa: VSA) -> H:
        """See `Part.from_config`."""
        return cls(encoder(config["present"], vsa), config["lags"], config["hold"])

    def _draw(self, generator: torch.Generator | None) -> dict[str, Tensor]:
        return {}

    def cells(self, x: Float[Tensor, "batch w"]) -> Shaped[Tensor, "batch w"]:
        """See `Encoder.cells`."""
        moments = x.unflatten(1, (-1, self.sensors))
        return self.present.cells(moments.flatten(0, 1)).reshape(x.shape)

    def encode(self, cells: Shaped[Tensor, "batch w"]) -> Shaped[Tensor, "batch d"]:
        """See `Encoder.encode`."""
        return by_blocks(self._encode, cells, row_bytes=2 * (1 + len(self.lags)) * self.vsa.row_bytes)

    def _encode(self, cells: Tensor) -> Tensor:
        moments = 1 + len(self.lags)
        cells = cells.unflatten(1, (moments, -1))
        conditions = self.present.encode(cells.flatten(0, 1)).unflatten(0, (-1, moments))
        conditions = torch.stack([self.vsa.permute(conditions[:, age], age) for age in range(moments)], 1)
        return self.vsa.bundle(conditions, weights=(cells >= 0).any(-1).to(torch.int32))

    def windows(self, x: Float[Tensor, "N n"], episodes: Int64[Tensor, "N"]) -> Float[Tensor, "N w"]:
        """The windows of recorded readings, whose rows are the steps of one episode after the other.

        Equal to what `start` and `step` give for the same readings, one by one. Raises `ValueError` if the rows of an
        episode are not next to each other.
        """
        return windows(x, episodes, self.lags, self.hold)

    def start(self, batch: int) -> Float[Tensor, "batch past n"]:
        """No past: all of it NaN."""
        return no_past(batch, self.sensors, self.lags, self.hold)

    def step(
        self, x: Float[Tensor, "batch n"], past: Float[Tensor, "batch past n"]
    ) -> tuple[Float[Tensor, "batch w"], Float[Tensor, "batch past n"]]:
        """The window of these readings, and the past of the next step."""
        return window(x, past, self.lags, self.hold)


def no_past(batch: int, sensors: int, lags: Sequence[int], hold: bool = False) -> Float[Tensor, "batch past n"]:
    """What is remembered before the first step: NaN. The latest readings come first."""
    return torch.full((batch, max(lags, default=int(hold)), sensors), torch.nan, dtype=torch.float64)


def window(
    x: Float[Tensor, "batch n"], past: Float[Tensor, "batch past n"], lags: Sequence[int], hold: bool = False
) -> tuple[Float[Tensor, "batch w"], Float[Tensor, "batch past n"]]:
    """The window of these readings after `past`, and the past of the next step; see `History.step`."""
    if hold:
        x = torch.where(x.isnan(), past[:, 0], x)
    seen = torch.cat([x[:, None].to(past.dtype), past], 1)
    return seen[:, [0, *lags]].flatten(1), seen[:, : past.shape[1]]


def windows(
    x: Float[Tensor, "N n"], episodes: Int64[Tensor, "N"], lags: Sequence[int], hold: bool = False
) -> Float[Tensor, "N w"]:
    """Each row with those `lags` rows before it in its episode, NaN where there are none; see `History.windows`."""
    begins = torch.ones(len(episodes), dtype=torch.bool, device=episodes.device)
    begins[1:] = episodes[1:] != episodes[:-1]
    if int(begins.sum()) != len(episodes.unique()):
        raise ValueError("the rows of an episode must stand together, in the order of its steps")
    if hold:
        x = _held(x, begins)
    columns = [x]
    for lag in check_lags(lags):
        past = torch.full_like(x, torch.nan)
        if lag < len(x):
            same = (episodes[lag:] == episodes[:-lag])[:, None]
            past[lag:] = torch.where(same, x[:-lag], torch.nan)
        columns.append(past)
    return torch.cat(columns, -1)


def _held(x: Tensor, begins: Tensor) -> Tensor:
    """Each reading, or the last one of its sensor and episode that was observed."""
    if not len(x):
        return x
    rows = torch.arange(len(x), device=x.device)[:, None].expand_as(x)
    # The first row of an episode counts as observed: what it lacks stays missing, and nothing older comes after it.
    source = torch.where(x.isnan() & ~begins[:, None], 0, rows).cummax(0).values
    return x.gather(0, source)


def check_lags(lags: Sequence[int]) -> tuple[int, ...]:
    """The lags as a tuple. Raises `ValueError` unless they are whole numbers of steps, growing, 1 to 100,000."""
    given = tuple(lags)
    if any(isinstance(lag, bool) or not isinstance(lag, int) or not 1 <= lag <= 100_000 for lag in given) or any(
        later <= sooner for sooner, later in pairwise(given)
    ):
        raise ValueError(f"lags are growing numbers of steps, 1 or more (up to 100,000); got {list(given)}")
    return given
