"""The clean-up memory of results and the commands that each result decodes to; the roles of smooth commands."""

from collections.abc import Callable, Iterable
from typing import Any

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor, nn

from behaviours.ordered import distinct_rows, in_order_of_appearance
from behaviours.schema import Schema
from behaviours.space import Space
from torchvsa import VSA, CleanUp, ShapeError


class ResultMemory(nn.Module):
    """The stored results as levels of the actuators, `levels` `[K, m]`, in order of first appearance.

    Derived from them: `items` `[K, d]`, the hypervectors, and `commands` `[K, m]`, which Algorithm 2 decodes from the
    items. The clean-up memory of an actuator holds the codes of its levels in `levels`, in order of first appearance.
    """

    smooth = False
    """Whether commands may be between the levels, see `SmoothMemory`."""
    levels: Tensor
    items: Tensor
    commands: Tensor

    def __init__(self, space: Space, levels: Int64[Tensor, "k m"]) -> None:
        super().__init__()
        check_levels(space.schema, levels)
        # In a tuple, so that it is no submodule: the codebooks are in the state of the behaviour already.
        self._space = (space,)
        self.register_buffer("levels", levels)
        self.register_buffer("items", None, persistent=False)
        self.register_buffer("commands", None, persistent=False)
        self.derive()
        self.register_load_state_dict_post_hook(_derive_again)

    def derive(self) -> None:
        """Compute `items` and `commands` from `levels` and the codebooks."""
        (space,) = self._space
        self.items = space.items(self.levels)
        self.commands = decode(space, self.levels, self.items)
        self._derived_from = tuple(tensor.clone() for tensor in self._sources())

    def current_items(self) -> Shaped[Tensor, "k d"]:
        """`items`; on a CPU, they and `commands` are derived again if levels or codebooks were changed in place."""
        if not torch.compiler.is_compiling() and self.levels.device.type == "cpu":
            sources = zip(self._derived_from, self._sources(), strict=True)
            if not all(saved.dtype == current.dtype and torch.equal(saved, current) for saved, current in sources):
                self.derive()
        return self.items

    def _sources(self) -> tuple[Tensor, ...]:
        (space,) = self._space
        return self.levels, *space.result_encoder.state_dict().values()

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> "ResultMemory":
        # Commands stay float64, and follow the levels to another device.
        commands = self.commands
        super()._apply(fn, recurse)
        self.commands = commands.to(self.levels.device)
        return self


class SmoothMemory(ResultMemory):
    """What a smooth behaviour reads out: `items` `[m, d]` are the roles of the actuators.

    `commands` `[2, m]` are the lowest and the highest command of each. `levels` are the results that were shown,
    rounded to levels; nothing is compared with them.
    """

    smooth = True

    def derive(self) -> None:
        """Take the roles and the ends from the space."""
        (space,) = self._space
        self.items = space.result_encoder.roles.clone()
        ends = [[getattr(actuator, end) for actuator in space.schema.actuators] for end in ("low", "high")]
        self.commands = torch.tensor(ends, dtype=torch.float64, device=self.items.device)
        self._derived_from = tuple(tensor.clone() for tensor in self._sources())


def require_levels(what: str, behaviours: Iterable[Any]) -> None:
    """Raise `ValueError` that begins with `what` if one of these behaviours, or other modules, is smooth."""
    for behaviour in behaviours:
        if getattr(behaviour, "smooth", False):
            raise ValueError(
                f"{what} compares stored results, and the commands of the smooth behaviour "
                f"{getattr(behaviour, 'name', '')!r} are none of them; learn it by a rule without smooth=True"
            )


def _derive_again(module: nn.Module, _: Any) -> None:
    assert isinstance(module, ResultMemory)
    module.derive()


def check_levels(schema: Schema, levels: Int64[Tensor, "k m"]) -> None:
    """Raise `ValueError` unless `levels` is at least one row of valid levels, and all rows differ."""
    actuators = schema.actuators
    if levels.dim() != 2 or levels.shape[1] != len(actuators) or len(levels) == 0:
        raise ShapeError(
            f"results must be rows of one level per actuator, [k, {len(actuators)}] with k at least 1; "
            f"got shape {tuple(levels.shape)}"
        )
    if levels.dtype != torch.int64:
        raise ValueError(f"results must be levels in torch.int64; got {levels.dtype}")
    ends = torch.tensor([actuator.levels for actuator in actuators], device=levels.device)
    wrong = (levels < 0) | (levels >= ends)
    if wrong.any():
        row, column = wrong.nonzero()[0].tolist()
        raise ValueError(
            f"results has level {levels[row, column]} in row {row} for actuator {actuators[column].name!r}, "
            f"which has the levels 0 to {actuators[column].levels - 1}"
        )
    if len(distinct_rows(levels)[0]) < len(levels):
        raise ValueError("results must differ from each other; two rows are equal")


def decode(space: Space, levels: Int64[Tensor, "k m"], items: Shaped[Tensor, "k d"]) -> Tensor:
    """The commands of each stored result (Algorithm 2, lines 4 to 8).

    They depend only on the recalled result, so that they are computed once: for actuator i, the result is unbound from
    the role of i and compared with the stored codes of that actuator.
    """
    columns = []
    for actuator in range(levels.shape[1]):
        stored = in_order_of_appearance(levels[:, actuator])
        values = CleanUp(space.result_encoder.value.encode(stored))
        noisy = space.vsa.unbind(items, space.result_encoder.roles[actuator])
        columns.append(stored[values(noisy).index])
    return space.schema.command_values(torch.stack(columns, -1))


_REAL = (torch.int8, torch.int32, torch.int64, torch.float32, torch.float64)


def check_vector(vsa: VSA, name: str, vector: Tensor) -> None:
    """Raise `ValueError` unless `vector` can be a program, or a sum of conditions, of this architecture."""
    if vector.shape != (vsa.dim,):
        raise ShapeError(f"{name} must be one hypervector [{vsa.dim}]; got shape {tuple(vector.shape)}")
    kinds = (torch.complex64, torch.complex128) if vsa.dtype.is_complex else (*_REAL, vsa.dtype)
    if vector.dtype not in kinds:
        raise ValueError(f"{name} of {vsa} cannot be {vector.dtype}; it is one of {', '.join(map(str, kinds))}")
    if not vector.isfinite().all():
        raise ValueError(f"{name} holds values that are not finite")
