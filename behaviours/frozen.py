"""A read-only behaviour for control loops, with everything precomputed that does not depend on the readings."""

import copy
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from jaxtyping import Float64, Shaped
from numpy.typing import NDArray
from torch import Tensor

from behaviours.controller import Controller
from behaviours.recall import Recall, answer_cells
from behaviours.space import Space
from torchvsa import Readout
from torchvsa._numerics import as_bipolar, in_units, norms, real_parts
from torchvsa._row_verbs import Row, noise, real
from torchvsa._rows import row_encoder


class FrozenBehaviour(Controller):
    """A read-only copy of a behaviour: what does not depend on the readings is computed once.

    Made by `Behaviour.freeze`; later changes of the behaviour and of its space do not affect it. Integer programs give
    the same bits as the behaviour. Float programs give the same commands (unless two results score within 1e-5), and
    similarity, margin and familiarity that differ by less than 1e-5.

    A single row is computed by NumPy, in less than a tenth of the time, if architecture, encoder and protection support
    it (`torchvsa._rows`); other batches are computed as by the behaviour. It can be compiled too:

        tick = torch.compile(behaviour.freeze(), fullgraph=True)
        tick(torch.tensor([[0.3, 1.2, 0.5]], dtype=torch.float64)).commands
    """

    known: Tensor
    commands: Tensor

    def __init__(
        self,
        space: Space,
        readout: Readout,
        known: Shaped[Tensor, "d"],
        commands: Float64[Tensor, "k m"],
        smooth: bool = False,
    ) -> None:
        super().__init__()
        self.smooth = smooth
        self.space, self.readout = copy.deepcopy(space), copy.deepcopy(readout)
        self.register_buffer("known", known.detach().clone(), persistent=False)
        self.register_buffer("commands", commands.clone(), persistent=False)
        self._tick = _Tick.of(self)

    def forward(self, readings: Any) -> Recall:
        """Commands `[B, m]` for readings `[B, n]`, see `Controller.forward`."""
        recall = self._fast_answer(readings)
        return super().forward(readings) if recall is None else recall

    def step(self, readings: Any, state: Any) -> tuple[Recall, Any]:
        """The answer to the readings `[B, n]` of the next step, see `Controller.step`."""
        recall = self._fast_answer(readings)
        return super().step(readings, state) if recall is None else (recall, state)

    def _fast_answer(self, readings: Any) -> Recall | None:
        """The answer to a single valid row, or None where the fast path does not apply."""
        return None if self._tick is None or torch.compiler.is_compiling() else self._tick(readings)

    def _answer(self, cells: Shaped[Tensor, "batch w"]) -> Recall:
        return answer_cells(self.space.encode, self.readout, self.known, self.commands, cells, self.smooth)

    def __getstate__(self) -> dict[str, Any]:
        # The fast path is made of functions, which no file or other process takes.
        return self.__dict__ | {"_tick": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__(state)
        self._tick = _Tick.of(self)

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> "FrozenBehaviour":
        commands = self.commands
        super()._apply(fn, recurse)
        # Commands stay float64, and follow the program to another device.
        self.commands = commands.to(self.readout.programs.device)
        self._tick = _Tick.of(self)
        return self


Noise = Callable[[NDArray[np.float64], NDArray[np.float64]], float]


class _Tick:
    """Recall of a single row, in NumPy."""

    def __init__(self, frozen: FrozenBehaviour, encode: Row, noise: Noise) -> None:
        space, readout = frozen.space, frozen.readout
        schema = space.schema
        assert readout.folded is not None
        self.encode, self.noise = encode, noise
        self.low, self.high = (
            np.array([getattr(sensor, end) for sensor in schema.sensors], dtype=np.float64) for end in ("low", "high")
        )
        self.width = self.high - self.low
        self.unused = [name not in space.sensors for name in (sensor.name for sensor in schema.sensors)]
        self.ends = self.low.tolist(), self.high.tolist()
        known, _ = in_units(frozen.known)
        rows = [real_parts(as_bipolar(rows)).to(torch.float64) for rows in (readout.folded, known[None])]
        # Sums of integer products are exact in float64, in any order.
        self.table = torch.cat(rows).numpy()
        self.lengths = torch.where(readout.lengths == 0, 1.0, readout.lengths).numpy()
        self.known_length = float(norms(known))
        self.commands, self.smooth = frozen.commands.numpy(), frozen.smooth
        self.unit = 1.0 if readout.units is None else float(readout.units)

    @classmethod
    def of(cls, frozen: FrozenBehaviour) -> "_Tick | None":
        """The fast path, or None if one of the parts does not support it."""
        space, readout = frozen.space, frozen.readout
        encode = row_encoder(space.encoder, space.protect)
        all_real = all(sensor.kind == "real" for sensor in space.schema.sensors)
        if encode is None or not all_real or readout.programs.device.type != "cpu":
            return None
        return cls(frozen, encode, noise(space.vsa, readout.programs.numpy()))

    def __call__(self, readings: Any) -> Recall | None:
        row = _one_row(readings, len(self.low))
        if row is not None and any(self.unused):
            row = np.where(self.unused, np.nan, row)
        # A row with no reading, or with an invalid one, takes the general path.
        if row is None or not self._valid(row.tolist()):
            return None
        condition = real(self.encode((row - self.low) / self.width))
        squares = condition * condition
        products = self.table @ condition
        length, noise = math.sqrt(squares.sum()), math.sqrt(self.noise(condition, squares)) or 1.0
        scores = products[:-1] / self.lengths
        familiarity = products[-1] / (length * self.known_length or 1.0)
        if self.smooth:
            low, high = self.commands
            shares = (np.clip(scores * self.unit, -1, 1) + 1) / 2
            commands = np.minimum(low + shares * (high - low), high)[None]
            similarity, margin = min(math.sqrt(scores @ scores) / noise, 1.0), np.inf
        else:
            best = int(scores.argmax())
            top = scores[best]
            scores[best] = -np.inf
            commands, similarity = self.commands[best : best + 1].copy(), top / noise
            margin = (top - scores.max()) / noise if len(scores) > 1 else np.inf
        scalars = torch.from_numpy(np.array([[similarity], [margin], [familiarity]], dtype=np.float32))
        return Recall(torch.from_numpy(commands), *scalars.unbind())

    def _valid(self, values: list[float]) -> bool:
        """Whether each reading is in range or NaN, and not all are NaN. (For so few numbers NumPy is slower.)"""
        observed = False
        for value, low, high in zip(values, self.ends[0], self.ends[1], strict=True):
            if low <= value <= high:
                observed = True
            elif value == value:
                return False
        return observed


def _one_row(readings: Any, sensors: int) -> NDArray[np.float64] | None:
    """A batch of one row as float64 `[n]`; None for anything else."""
    if isinstance(readings, Tensor):
        if readings.device.type != "cpu" or readings.requires_grad or readings.dtype not in _FLOATS:
            return None
        array = readings.numpy()
    elif isinstance(readings, np.ndarray | list | tuple):
        if len(readings) != 1:
            return None
        array = np.asarray(readings)
    else:
        return None
    if array.shape != (1, sensors) or array.dtype.kind not in "fiu":
        return None
    return array[0].astype(np.float64, copy=False)


_FLOATS = torch.float64, torch.float32
