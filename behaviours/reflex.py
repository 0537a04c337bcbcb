"""A behaviour made ready to be asked at every control tick."""

from typing import TYPE_CHECKING, Any

from torch import Tensor, nn

from behaviours.folding import Folded
from behaviours.recall import Recall

if TYPE_CHECKING:
    from behaviours.behaviour import Behaviour


class Reflex(nn.Module):
    """Answers readings `[B, n]` as its behaviour does, bit for bit, from tables that are computed once.

    Changes of the behaviour do not reach it. It is the form to compile:

        tick = torch.compile(Reflex(behaviour), fullgraph=True)
        tick(torch.tensor([[0.3, 1.2, 0.5]], dtype=torch.float64)).commands

    Nothing in it changes: a compiled one need not look at each call whether its modules did, which saves a tenth of it
    (`options={"guard_filter_fn": torch.compiler.skip_guard_on_all_nn_modules_unsafe}`).
    """

    commands: Tensor

    def __init__(self, behaviour: "Behaviour") -> None:
        super().__init__()
        self.space = behaviour.space
        self.folded = Folded(behaviour.space.vsa, behaviour.program, behaviour.known, behaviour.memory.items)
        self.register_buffer("commands", behaviour.memory.commands, persistent=False)

    def forward(self, readings: Any) -> Recall:
        """Commands, similarity, margin and familiarity; see `Behaviour.forward`."""
        cells = self.space.cells(readings)
        recall = self.folded.recall(self.folded.products(self.space.encode(cells)), self.commands)
        return recall.blank((cells < 0).all(-1))
