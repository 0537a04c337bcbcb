"""A behaviour in one hypervector whose program, codebooks or queries are damaged."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from behaviours import Behaviour, Space
from experiments.models.damage import Array, Damage, Floats

BLOCK = 512
"""Conditions that are encoded at once, to bound the memory that they take."""


def refuse_undamageable(space: Space) -> None:
    """Raise `ValueError` for codebooks whose elements cannot be damaged: without signs, or without a table of codes."""
    if space.vsa.dtype == torch.bool or space.vsa.dtype.is_complex or not space.vsa.negatable:
        raise ValueError(
            f"robustness damages signed numbers, of which {space.vsa.name} has none; try vsa=map_c or vsa=hrr"
        )
    if getattr(space.encoder, "table", None) is None:
        raise ValueError(
            f"robustness damages a table of sensor values, and {space.encoder.name} has none with these settings; try "
            "encoder=level record=product"
        )


class Program:
    """A behaviour in one hypervector. Its parts:

    - `program`: the d numbers of the raw program;
    - `codebooks`: the table of role-bound sensor values and the results that the clean-up compares with, damaged after
      learning. Conditions are encoded with the damaged table, and the clean-up holds the damaged results: no undamaged
      copy is kept. The program was learned with undamaged ones;
    - `query`: the encoded and protected condition, damaged anew for each condition.
    """

    def __init__(self, behaviour: Behaviour) -> None:
        refuse_undamageable(behaviour.space)
        self.behaviour, self.space, self.items = behaviour, behaviour.space, behaviour.memory.items

    def elements(self, part: str) -> int:
        """See `Learner.elements`."""
        return _values(self.space).numel() + self.items.numel() if part == "codebooks" else self.space.vsa.dim

    def damaged(self, part: str, damage: Damage) -> "DamagedProgram":
        """See `Learner.damaged`."""
        program, commands = self.behaviour.program, self.behaviour.memory.commands
        if part == "query":
            return DamagedProgram(self.space, program, self.items, commands, damage)
        if part == "program":
            (values,) = damage([Array(program.double().numpy())])
            return DamagedProgram(self.space, torch.from_numpy(values), self.items, commands)
        whole = _values(self.space)
        table, items = damage([Array(codes.double().numpy().ravel()) for codes in (whole, self.items)])
        space = _in_floats(self.space)
        _values(space)[:] = torch.from_numpy(table).view(whole.shape)
        return DamagedProgram(space, program, torch.from_numpy(items).view(self.items.shape), commands)


class DamagedProgram:
    """A program of which a part was damaged; equal conditions get equal answers.

    It computes in float64, so that an answer does not depend on how many conditions are asked at once.
    """

    def __init__(
        self, space: Space, program: Tensor, items: Tensor, commands: Tensor, query: Damage | None = None
    ) -> None:
        self.space, self.items, self.query = space, items.double(), query
        self.readout = space.vsa.readout(program.double(), self.items)
        self.commands: Floats = commands.numpy()
        self._answers: dict[tuple[int, ...], int] = {}

    @torch.no_grad()
    def results(self, cells: Tensor) -> NDArray[np.int64]:
        """Which result wins in each condition."""
        winners = []
        for block in cells.split(BLOCK):
            conditions = self.space.encode(block).double()
            if self.query is not None:
                keys = (block + 1).tolist()
                codes = zip(conditions.numpy(), keys, strict=True)
                conditions = torch.from_numpy(np.stack([self.query([Array(code)], key)[0] for code, key in codes]))
            winners.append(self.readout(conditions).argmax(-1).numpy())
        return np.concatenate(winners)

    def __call__(self, sensors: Floats) -> Floats:
        """Commands `[B, 2]` for readings `[B, 3]`. A condition that was asked before is looked up."""
        rows = [tuple(row) for row in self.space.cells(sensors).tolist()]
        if new := [row for row in dict.fromkeys(rows) if row not in self._answers]:
            self._answers |= dict(zip(new, self.results(torch.tensor(new)).tolist(), strict=True))
        return self.commands[[self._answers[row] for row in rows]]


def _values(space: Space) -> Tensor:
    """The table of role-bound sensor values, without each sensor's last entry: that of a missing reading."""
    return space.encoder.table[:, :-1]


def _in_floats(space: Space) -> Space:
    """A copy of the space that can hold any numbers in its codebooks."""
    config = space.config()
    copy = Space.from_config({**config, "vsa": {**config["vsa"], "dtype": "float32"}})
    copy.load_state_dict(space.state_dict())
    return copy
