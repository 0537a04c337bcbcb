"""A behaviour made ready to be asked at every control tick."""

import copy

from jaxtyping import Float64, Shaped
from torch import Tensor

from behaviours.controller import Controller
from behaviours.recall import Recall, recalled
from behaviours.space import Space
from torchvsa import Readout
from torchvsa.blocks import by_blocks


class FrozenBehaviour(Controller):
    """A behaviour that is only asked: what does not depend on the readings is computed once.

    Made by `Behaviour.freeze`; later changes of the behaviour and of its space do not reach it. Integer programs
    answer with the bits of their behaviour, float programs with the same numbers but for rounding.

    It is the form to drive with, and the form to compile:

        tick = torch.compile(behaviour.freeze(), fullgraph=True)
        tick(torch.tensor([[0.3, 1.2, 0.5]], dtype=torch.float64)).commands

    Nothing in it changes: a compiled one need not look at each call whether its modules did, which saves a tenth of it
    (`options={"guard_filter_fn": torch.compiler.skip_guard_on_all_nn_modules_unsafe}`).
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

    def _answer(self, cells: Shaped[Tensor, "batch w"]) -> Recall:
        return by_blocks(
            lambda rows: recalled(self.readout, self.known, self.commands, self.space.encode(rows)),
            cells,
            row_bytes=8 * self.space.vsa.dim,
        )
