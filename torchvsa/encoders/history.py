"""Encode present and past readings together."""

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

    With `c(t)` the hypervector of the readings at step t from the encoder `present`, and ⊕ the bundle:

        c(t) ⊕ permute(c(t - lags[0]), 1) ⊕ permute(c(t - lags[1]), 2) ⊕ ...

    Bundling averages the similarities of the steps: a match at one of them counts even if another differs. (A product
    would be dissimilar to all others as soon as one reading at one step differs.) A step without an observed sensor is
    left out.

    The inputs are windows `[B, (1 + len(lags)) · n]`, the present first. `windows` builds them from recorded readings,
    `start` and `step` from live ones; the tensor that these return is all the memory of a robot. With `hold`, a reading
    that was not observed is replaced by the last observed one of its sensor, however old.

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
        """The number of columns of a window."""
        return (1 + len(self.lags)) * self.sensors

    def own_layout(self) -> Layout:
        """No tensors of its own."""
        return {}

    def config(self) -> dict[str, Any]:
        """The name, the options, and the config of the encoder of the present."""
        return {"name": self.name, "present": self.present.config(), "lags": list(self.lags), "hold": self.hold}

    @classmethod
    def from_config(cls: type[H], config: Mapping[str, Any], vsa: VSA) -> H:
        """Make a plan from what `config` returned."""
        return cls(encoder(config["present"], vsa), config["lags"], config["hold"])

    def _draw(self, generator: torch.Generator | None) -> dict[str, Tensor]:
        return {}

    def cells(self, x: Float[Tensor, "batch w"]) -> Shaped[Tensor, "batch w"]:
        """The cells of each step of the window."""
        moments = x.unflatten(1, (-1, self.sensors))
        return self.present.cells(moments.flatten(0, 1)).reshape(x.shape)

    def encode(self, cells: Shaped[Tensor, "batch w"]) -> Shaped[Tensor, "batch d"]:
        """Bundle the permuted conditions of each window."""
        return by_blocks(self._encode, cells, row_bytes=2 * (1 + len(self.lags)) * self.vsa.row_bytes)

    def _encode(self, cells: Tensor) -> Tensor:
        moments = 1 + len(self.lags)
        cells = cells.unflatten(1, (moments, -1))
        conditions = self.present.encode(cells.flatten(0, 1)).unflatten(0, (-1, moments))
        conditions = torch.stack([self.vsa.permute(conditions[:, age], age) for age in range(moments)], 1)
        return self.vsa.bundle(conditions, weights=(cells >= 0).any(-1).to(torch.int32))

    def windows(self, x: Float[Tensor, "N n"], episodes: Int64[Tensor, "N"]) -> Float[Tensor, "N w"]:
        """The windows of recorded readings, whose rows are the steps of one episode after another.

        They equal those of `start` and `step` for the same readings. Raises `ValueError` if the rows of an
        episode are not next to each other.
        """
        return windows(x, episodes, self.lags, self.hold)

    def start(self, batch: int) -> Float[Tensor, "batch past n"]:
        """An empty memory: all NaN."""
        return no_past(batch, self.sensors, self.lags, self.hold)

    def step(
        self, x: Float[Tensor, "batch n"], past: Float[Tensor, "batch past n"]
    ) -> tuple[Float[Tensor, "batch w"], Float[Tensor, "batch past n"]]:
        """The window of these readings, and the memory for the next step."""
        return window(x, past, self.lags, self.hold)


def no_past(batch: int, sensors: int, lags: Sequence[int], hold: bool = False) -> Float[Tensor, "batch past n"]:
    """The memory before the first step: all NaN. The latest readings come first."""
    return torch.full((batch, max(lags, default=int(hold)), sensors), torch.nan, dtype=torch.float64)


def window(
    x: Float[Tensor, "batch n"], past: Float[Tensor, "batch past n"], lags: Sequence[int], hold: bool = False
) -> tuple[Float[Tensor, "batch w"], Float[Tensor, "batch past n"]]:
    """The window of readings `x` after `past`, and the memory for the next step (see `History.step`)."""
    if hold:
        x = torch.where(x.isnan(), past[:, 0], x)
    seen = torch.cat([x[:, None].to(past.dtype), past], 1)
    return seen[:, [0, *lags]].flatten(1), seen[:, : past.shape[1]]


def windows(
    x: Float[Tensor, "N n"], episodes: Int64[Tensor, "N"], lags: Sequence[int], hold: bool = False
) -> Float[Tensor, "N w"]:
    """Join each row with the rows `lags` before it in its episode, or NaN (see `History.windows`)."""
    begins = torch.ones(len(episodes), dtype=torch.bool, device=episodes.device)
    begins[1:] = episodes[1:] != episodes[:-1]
    if int(begins.sum()) != len(episodes.unique()):
        raise ValueError("the rows of an episode must be next to each other, in the order of its steps")
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
    """Each reading or, if it is missing, the last observed one of its sensor and episode."""
    if not len(x):
        return x
    rows = torch.arange(len(x), device=x.device)[:, None].expand_as(x)
    # The first row of an episode counts as observed, so that no reading comes from an earlier episode.
    source = torch.where(x.isnan() & ~begins[:, None], 0, rows).cummax(0).values
    return x.gather(0, source)


def check_lags(lags: Sequence[int]) -> tuple[int, ...]:
    """The lags as a tuple. Raises `ValueError` unless they are increasing whole numbers from 1 to 100,000."""
    checked = tuple(lags)
    if any(isinstance(lag, bool) or not isinstance(lag, int) or not 1 <= lag <= 100_000 for lag in checked) or any(
        later <= earlier for earlier, later in pairwise(checked)
    ):
        raise ValueError(f"lags are increasing whole numbers of steps from 1 to 100,000; got {list(checked)}")
    return checked
