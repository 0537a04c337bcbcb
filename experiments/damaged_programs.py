"""A behaviour in one hypervector whose program, codebooks or queries are damaged."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from behaviours import Behaviour, Space
from behaviours.ordered import distinct_rows
from experiments.damage import PARTS, Array, Damage, Floats, Learner


class DamagedProgram:
    """A program that is asked about one condition at a time; equal conditions get equal answers."""

    def __init__(
        self, space: Space, program: Tensor, items: Tensor, commands: Tensor, query: Damage | None = None
    ) -> None:
        # In float64, so that an answer does not depend on how many conditions are asked at once.
        self.space, self.program, self.items, self.query = space, program.double(), items.double(), query
        self.commands: Floats = commands.numpy()
        self._known: dict[tuple[int, ...], int] = {}

    @torch.no_grad()
    def results(self, bins: Tensor, conditions: Tensor | None = None) -> NDArray[np.int64]:
        """Which result wins for each row of bins; `conditions` are their codes, if they are known already."""
        winners = []
        readout = self.space.vsa.readout(self.program, self.items)
        for start in range(0, len(bins), 512):
            rows = slice(start, start + 512)
            codes = self.space.encode(bins[rows]) if conditions is None else conditions[rows]
            if self.query is not None:
                damaged = [
                    self.query([Array(code)], key)[0]
                    for code, key in zip(codes.double().numpy(), (bins[rows] + 1).tolist(), strict=True)
                ]
                codes = torch.from_numpy(np.stack(damaged))
            winners.append(readout(codes.double()).argmax(-1).numpy())
        return np.concatenate(winners)

    def __call__(self, sensors: Floats) -> Floats:
        """Commands `[B, 2]` for readings `[B, 3]`."""
        rows = [tuple(row) for row in self.space.cells(sensors).tolist()]
        new = [row for row in dict.fromkeys(rows) if row not in self._known]
        if new:
            self._known |= dict(zip(new, self.results(torch.tensor(new)).tolist(), strict=True))
        return self.commands[[self._known[row] for row in rows]]


class Programmed(Learner):
    """A behaviour in one hypervector. What its parts are:

    - `program`: the d numbers of the raw program;
    - `codebooks`: the table of role-bound sensor values and the results that the clean-up compares with, damaged after
      learning. Conditions are encoded with the damaged table, and the clean-up holds the damaged results: nothing
      undamaged is kept beside them. The program was learned with undamaged ones;
    - `query`: the encoded and protected condition, damaged anew for each condition.
    """

    parts = PARTS

    def __init__(self, behaviour: Behaviour) -> None:
        vsa = behaviour.space.vsa
        if vsa.dtype == torch.bool or vsa.dtype.is_complex:
            raise ValueError(
                f"robustness damages signed numbers, of which {vsa.name} has none; try vsa=map_c or vsa=hrr"
            )
        self.behaviour, self.space = behaviour, behaviour.space
        self.items: Tensor = behaviour.memory.items
        self._float_space = _in_floats(self.space)
        self._asked: tuple[Floats, Tensor, Tensor, Tensor] | None = None

    def elements(self, part: str) -> int:
        """See `Learner.elements`."""
        dim = self.space.vsa.dim
        return self._values().numel() + self.items.numel() if part == "codebooks" else dim

    def damaged(self, part: str, damage: Damage) -> DamagedProgram:
        """See `Learner.damaged`."""
        program, commands = self.behaviour.program, self.behaviour.memory.commands
        if part == "query":
            return DamagedProgram(self.space, program, self.items, commands, damage)
        if part == "program":
            (values,) = damage([Array(program.double().numpy())])
            return DamagedProgram(self.space, torch.from_numpy(values), self.items, commands)
        table, items = damage([Array(codes.double().numpy().ravel()) for codes in (self._values(), self.items)])
        space = _in_floats(self._float_space)
        space.encoder.table[:, :-1] = torch.from_numpy(table).view(self._values().shape)
        return DamagedProgram(space, program, torch.from_numpy(items).view(self.items.shape), commands)

    def commands(self, part: str, damage: Damage, sensors: Floats) -> Floats:
        """See `Learner.commands`; each distinct condition is asked, and as far as possible encoded, once."""
        if self._asked is None or self._asked[0] is not sensors:
            bins, which = distinct_rows(self.space.cells(sensors))
            self._asked = sensors, bins, which, self.space.encode(bins)
        _, bins, which, conditions = self._asked
        mind = self.damaged(part, damage)
        return mind.commands[mind.results(bins, None if part == "codebooks" else conditions)[which.numpy()]]

    def _values(self) -> Tensor:
        # Without the last entry of each sensor, which stands for a reading that is missing.
        return self.space.encoder.table[:, :-1]


def _in_floats(space: Space) -> Space:
    """A copy of the space that can hold any numbers in its codebooks."""
    config = space.config()
    copy = Space.from_config({**config, "vsa": {**config["vsa"], "dtype": "float32"}})
    copy.load_state_dict(space.state_dict())
    return copy
