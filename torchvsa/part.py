"""Modules whose tensors are drawn from a seed, or taken from a file."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, TypeVar

import torch
from torch import Tensor, nn

from torchvsa.architectures import VSA

P = TypeVar("P", bound="Part")
"""Not `typing.Self`, which checkers of annotations at run time do not take in methods."""
Layout = dict[str, tuple[torch.dtype, tuple[int, ...]]]
"""Tensors by name: their types and shapes."""


class Part(nn.Module, ABC):
    """Something with random codebooks, which it owns as buffers.

    Made with a seed, it draws them at once. Made without, it is a plan: whatever takes it (a record, a space) copies it
    and draws the copy together with its own codebooks. `layout` says what will be there before it is.

    A new part names itself, calls `_own` at the end of its constructor, and implements `own_layout`, `_draw` and
    `config`.
    """

    name: str
    vsa: VSA

    def _own(self, seed: int | None) -> None:
        """Make room for the codebooks, and draw them if there is a seed."""
        for name in self.own_layout():
            self.register_buffer(name, None)
        self.register_load_state_dict_post_hook(_derive_again)
        if seed is not None:
            self.draw(torch.Generator().manual_seed(seed))

    @abstractmethod
    def own_layout(self) -> Layout:
        """The types and shapes of its own tensors, those of its parts left out."""

    def parts(self) -> dict[str, "Part"]:
        """The parts of which it is made, by the names under which `state_dict` has them."""
        return {name: part for name, part in self.named_children() if isinstance(part, Part)}

    @abstractmethod
    def _draw(self, generator: torch.Generator | None) -> Mapping[str, Tensor]:
        """Draw its own tensors. Where the parts come in between, it draws them with `self.draw_parts`."""

    @abstractmethod
    def config(self) -> dict[str, Any]:
        """Its name and plain values from which `from_config` makes an equal plan."""

    @classmethod
    def from_config(cls: type[P], config: Mapping[str, Any], vsa: VSA) -> P:
        """The inverse of `config`: a plan, without codebooks."""
        return cls(vsa, **{key: value for key, value in config.items() if key != "name"})  # type: ignore[call-arg]

    def check(self) -> None:
        """Raise `ValueError` naming the tensor if one holds what cannot have been drawn."""
        for name, (dtype, _) in self.own_layout().items():
            if dtype == self.vsa.dtype:
                self.vsa.check_codes(getattr(self, name), name)

    def derive(self) -> None:
        """Compute what follows from the codebooks; needed after a change of theirs in place."""

    @property
    def drawn(self) -> bool:
        """Whether the codebooks are there."""
        return all(getattr(self, name) is not None for name in self.own_layout()) and all(
            part.drawn for part in self.parts().values()
        )

    def _require_drawn(self) -> None:
        if not self.drawn:
            raise ValueError(f"this {self.name!r} part has no codebooks yet; make it with a seed, or call draw()")

    def layout(self) -> Layout:
        """The types and shapes of all tensors, by the names that they have in `state_dict`."""
        layout = dict(self.own_layout())
        for name, part in self.parts().items():
            layout |= {f"{name}.{key}": wanted for key, wanted in part.layout().items()}
        return layout

    def draw(self: P, generator: torch.Generator | None = None) -> P:
        """Draw all codebooks that are not there yet."""
        for name, tensor in self._draw(generator).items():
            setattr(self, name, tensor)
        self.draw_parts(generator)
        self.derive()
        return self

    def draw_parts(self, generator: torch.Generator | None) -> None:
        """Draw the parts that are plans still."""
        for part in self.parts().values():
            if not part.drawn:
                part.draw(generator)

    def take(self: P, tensors: Mapping[str, Tensor]) -> P:
        """Fill a plan with these tensors, whose layout must be `layout`. Raises `ValueError` as `check` does."""
        for name, part in self.parts().items():
            start = f"{name}."
            part.take({key.removeprefix(start): tensor for key, tensor in tensors.items() if key.startswith(start)})
        for name in self.own_layout():
            setattr(self, name, tensors[name])
        self.check()
        self.derive()
        return self


def _derive_again(module: nn.Module, _: Any) -> None:
    if isinstance(module, Part) and module.drawn:
        module.derive()
