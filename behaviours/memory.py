"""The clean-up memory of results, and the commands that each of them stands for."""

from typing import Any

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor, nn

from behaviours.ordered import in_order_of_appearance
from behaviours.space import Space
from torchvsa import CleanUp, ShapeError


class ResultMemory(nn.Module):
    """The stored results as levels of the actuators, `levels` `[K, m]`, in order of first insertion.

    Derived from them: `items` `[K, d]`, their hypervectors, and `commands` `[K, m]`, what Algorithm 2 decodes
    from each. The codes of the levels that appear, again in order, are the clean-up memory of each actuator.
    """

    levels: Tensor
    items: Tensor
    commands: Tensor

    def __init__(self, space: Space, levels: Int64[Tensor, "k m"]) -> None:
        super().__init__()
        if levels.dim() != 2 or levels.shape[1] != len(space.schema.actuators):
            raise ShapeError(
                f"results must be rows of one level per actuator, [k, {len(space.schema.actuators)}]; "
                f"got shape {tuple(levels.shape)}"
            )
        # In a tuple: the behaviour owns the space, whose codebooks must not stand twice in its state.
        self._space = (space,)
        self.register_buffer("levels", levels)
        self.register_buffer("items", None, persistent=False)
        self.register_buffer("commands", None, persistent=False)
        self.derive()
        self.register_load_state_dict_post_hook(_derive_again)

    def derive(self) -> None:
        """Compute `items` and `commands` from `levels` and the codebooks."""
        (space,) = self._space
        self.items = space.results(self.levels)
        self.commands = decode(space, self.levels, self.items)


def _derive_again(module: nn.Module, _: Any) -> None:
    assert isinstance(module, ResultMemory)
    module.derive()


def decode(space: Space, levels: Int64[Tensor, "k m"], items: Shaped[Tensor, "k d"]) -> Tensor:
    """The commands of each stored result (Algorithm 2, lines 4 to 8).

    They depend on the winning result alone, so they are a table: for actuator i the result is unbound from
    its role and compared with the values of that actuator that were stored.
    """
    columns = []
    for actuator in range(levels.shape[1]):
        stored = in_order_of_appearance(levels[:, actuator])
        values = CleanUp(space.results.codes[stored])
        noisy = space.vsa.unbind(items, space.results.roles[actuator])
        columns.append(stored[values(noisy).index])
    return space.schema.command_values(torch.stack(columns, -1))
