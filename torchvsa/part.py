"""Modules with random tensors that are drawn from a seed or read from a file."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, TypeVar

import torch
from torch import Tensor, nn

from torchvsa.architectures import VSA

P = TypeVar("P", bound="Part")
"""Not `typing.Self`, which run-time type checkers do not support in methods."""
Layout = dict[str, tuple[torch.dtype, tuple[int, ...]]]
"""The dtype and shape of each tensor, by name."""


class Part(nn.Module, ABC):
    """A module with random codebooks as buffers: an encoder or a protection.

    With a seed, the codebooks are drawn at once. Without, the part is a plan: a record or space that takes it copies it
    and draws the copy together with its own codebooks. `layout` gives dtypes and shapes before anything is drawn.

    A new part sets `name`, calls `_own` at the end of its constructor, and implements `own_layout`, `_draw` and
    `config`.
    """

    name: str
    vsa: VSA

    def _own(self, seed: int | None) -> None:
        """Register buffers for the codebooks, and draw them if there is a seed."""
        for name in self.own_layout():
            self.register_buffer(name, None)
        self.register_load_state_dict_post_hook(_derive_again)
        if seed is not None:
            self.draw(torch.Generator().manual_seed(seed))

    @abstractmethod
    def own_layout(self) -> Layout:
        """The dtypes and shapes of its own tensors, without those of its parts."""

    def parts(self) -> dict[str, "Part"]:
        """The parts that it contains, by their prefixes in `state_dict`."""
        return {name: part for name, part in self.named_children() if isinstance(part, Part)}

    @abstractmethod
    def _draw(self, generator: torch.Generator | None) -> Mapping[str, Tensor]:
        """Draw its own tensors. To draw the parts in between, it calls `self.draw_parts`."""

    @abstractmethod
    def config(self) -> dict[str, Any]:
        """The name and the options as JSON values, from which `from_config` makes an equal plan."""

    @classmethod
    def from_config(cls: type[P], config: Mapping[str, Any], vsa: VSA) -> P:
        """Make a plan (a part without codebooks) from what `config` returned."""
        return cls(vsa, **{key: value for key, value in config.items() if key != "name"})  # type: ignore[call-arg] (subclasses take more)

    def check(self) -> None:
        """Raise `ValueError` that names the tensor if one holds values that cannot have been drawn."""
        for name, (dtype, _) in self.own_layout().items():
            if dtype == self.vsa.dtype:
                self.vsa.check_codes(getattr(self, name), name)

    def derive(self) -> None:
        """Recompute tensors that follow from the codebooks. Call it after changing codebooks in place."""

    @property
    def drawn(self) -> bool:
        """Whether the codebooks are drawn."""
        return all(getattr(self, name) is not None for name in self.own_layout()) and all(
            part.drawn for part in self.parts().values()
        )

    def _require_drawn(self) -> None:
        if not self.drawn:
            raise ValueError(f"this {self.name!r} part has no codebooks yet; make it with a seed, or call draw()")

    def layout(self) -> Layout:
        """The dtypes and shapes of all tensors, by their names in `state_dict`."""
        layout = dict(self.own_layout())
        for name, part in self.parts().items():
            layout |= {f"{name}.{key}": entry for key, entry in part.layout().items()}
        return layout

    def draw(self: P, generator: torch.Generator | None = None) -> P:
        """Draw all codebooks that are not drawn yet."""
        for name, tensor in self._draw(generator).items():
            setattr(self, name, tensor)
        self.draw_parts(generator)
        self.derive()
        return self

    def draw_parts(self, generator: torch.Generator | None) -> None:
        """Draw the parts that are still plans."""
        for part in self.parts().values():
            if not part.drawn:
                part.draw(generator)

    def take(self: P, tensors: Mapping[str, Tensor]) -> P:
        """Fill a plan with tensors that have its `layout`. Raises `ValueError` as `check` does."""
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
