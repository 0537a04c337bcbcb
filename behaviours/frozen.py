"""A behaviour made ready to be asked at every control tick."""

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
from behaviours.recall import Recall, recalled
from behaviours.space import Space
from torchvsa import Readout
from torchvsa._blocks import by_blocks
from torchvsa._numerics import as_bipolar, in_units, norms, real_parts
from torchvsa._rows import Row, noise, real, row_encoder


class FrozenBehaviour(Controller):
    """A behaviour that is only asked: what does not depend on the readings is computed once.

    Made by `Behaviour.freeze`; later changes of the behaviour and of its space do not reach it. It answers as its
    behaviour does: integer programs with the same bits, float programs with the same commands (where no two results are
    equally good within 1e-5) and with similarity, margin and familiarity that differ by less than 1e-5.

    One row is answered by NumPy, in less than a tenth of the time, where architecture, encoder and protection have a
    form for it (`torchvsa._rows`); any other batch as its behaviour would. It can be compiled too:

        tick = torch.compile(behaviour.freeze(), fullgraph=True)
        tick(torch.tensor([[0.3, 1.2, 0.5]], dtype=torch.float64)).commands
    """

    known: Tensor
    commands: Tensor

    def __init__(
        self, space: Space, readout: Readout, known: Shaped[Tensor, "d"], commands: Float64[Tensor, "k m"]
    ) -> None:
        super().__init__()
        self.space, self.readout = copy.deepcopy(space), copy.deepcopy(readout)
        self.register_buffer("known", known.detach().clone(), persistent=False)
        self.register_buffer("commands", commands.clone(), persistent=False)
        self._tick = _Tick.of(self)

    def forward(self, readings: Any) -> Recall:
        """See `Controller.forward`."""
        return self._at_once(readings) or super().forward(readings)

    def step(self, readings: Any, state: Any) -> tuple[Recall, Any]:
        """See `Controller.step`."""
        recall = self._at_once(readings)
        return super().step(readings, state) if recall is None else (recall, state)

    def _at_once(self, readings: Any) -> Recall | None:
        """The answer to one row, where there is a short way to it and nothing is to be refused."""
        return None if self._tick is None or torch.compiler.is_compiling() else self._tick(readings)

    def _answer(self, cells: Shaped[Tensor, "batch w"]) -> Recall:
        return by_blocks(
            lambda rows: recalled(self.readout, self.known, self.commands, self.space.encode(rows)),
            cells,
            row_bytes=8 * self.space.vsa.dim,
        )

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> "FrozenBehaviour":
        commands = self.commands
        super()._apply(fn, recurse)
        # Commands stay in float64, and go with the program to another device.
        self.commands = commands.to(self.readout.programs.device)
        self._tick = _Tick.of(self)
        return self


Noise = Callable[[NDArray[np.float64], NDArray[np.float64]], float]


class _Tick:
    """The steps from one row of readings to an answer, on NumPy's arrays."""

    def __init__(self, frozen: FrozenBehaviour, encode: Row, noise: Noise) -> None:
        schema, readout = frozen.space.schema, frozen.readout
        assert readout.folded is not None
        self.encode, self.noise = encode, noise
        self.low, self.high = (
            np.array([getattr(sensor, end) for sensor in schema.sensors], dtype=np.float64) for end in ("low", "high")
        )
        self.width = self.high - self.low
        self.ends = self.low.tolist(), self.high.tolist()
        known, _ = in_units(frozen.known)
        rows = [real_parts(as_bipolar(rows)).to(torch.float64) for rows in (readout.folded, known[None])]
        # Products of integers are exact in float64, whatever the order of their sums.
        self.table = torch.cat(rows).numpy()
        self.lengths = torch.where(readout.lengths == 0, 1.0, readout.lengths).numpy()
        self.known_length = float(norms(known))
        self.commands = frozen.commands.numpy()

    @classmethod
    def of(cls, frozen: FrozenBehaviour) -> "_Tick | None":
        """None where one of the parts has no form in NumPy."""
        space, readout = frozen.space, frozen.readout
        encode = row_encoder(space.encoder, space.protect)
        all_real = all(sensor.kind == "real" for sensor in space.schema.sensors)
        if encode is None or not all_real or readout.programs.device.type != "cpu":
            return None
        return cls(frozen, encode, noise(space.vsa, readout.programs.numpy()))

    def __call__(self, readings: Any) -> Recall | None:
        row = _one_row(readings, len(self.low))
        # A row without any reading, or with a wrong one, goes the long way.
        if row is None or not self._sound(row.tolist()):
            return None
        condition = real(self.encode((row - self.low) / self.width))
        squares = condition * condition
        products = self.table @ condition
        length, noise = math.sqrt(squares.sum()), math.sqrt(self.noise(condition, squares)) or 1.0
        scores = products[:-1] / self.lengths
        best = int(scores.argmax())
        top = scores[best]
        scores[best] = -np.inf
        familiarity = products[-1] / (length * self.known_length or 1.0)
        margin = top - scores.max() if len(scores) > 1 else np.inf
        sure = torch.from_numpy(np.array([[top / noise], [margin / noise], [familiarity]], dtype=np.float32))
        return Recall(torch.from_numpy(self.commands[best : best + 1].copy()), *sure.unbind())

    def _sound(self, values: list[float]) -> bool:
        """Whether all readings are in range or, some of them, NaN. (So few numbers take NumPy longer.)"""
        seen = False
        for value, low, high in zip(values, self.ends[0], self.ends[1], strict=True):
            if low <= value <= high:
                seen = True
            elif value == value:
                return False
        return seen


def _one_row(readings: Any, sensors: int) -> NDArray[np.float64] | None:
    """One row of numbers as float64 `[n]`; None for anything else."""
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
