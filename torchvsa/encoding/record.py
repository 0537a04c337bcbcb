"""Role-filler records: a row of sensor values becomes one hypervector."""

import inspect
from collections.abc import Callable
from typing import Any

import torch
from jaxtyping import Int, Shaped
from torch import Tensor, nn

from torchvsa._checks import whole_number
from torchvsa._memory_limit import require_memory
from torchvsa.architectures import VSA
from torchvsa.encoding.combine import COMBINATIONS
from torchvsa.encoding.indices import check_indices
from torchvsa.encoding.values import VALUES


class Record(nn.Module):
    """Encode rows of `n` values, each an index into `levels` codes, as hypervectors.

    Every sensor has a random role; all sensors share the codes of `values` (`"lookup"`, `"level"`, `"balanced"`). The
    role-bound values are bundled, bound, or bound over a random subset of the sensors per dimension
    (`combine="bundle" | "bind" | "subset"`). An index of -1 is *unobserved* and left out.

    The codebooks are `roles` `[n, d]`, `codes` `[levels, d]` and, where the combination draws something for each sensor
    and dimension, its `arrangement` `[n, d]`. What follows from them is a table of role-bound values of
    `n · (levels + 1) · d` elements (24 sensors, 64 levels, d = 4,000, int8: 6 MB), which no `state_dict` holds.

    Source: Neubert et al. 2016, Algorithm 1, line 3.
    """

    roles: Tensor
    codes: Tensor
    arrangement: Tensor | None
    table: Tensor

    def __init__(
        self,
        vsa: VSA,
        sensors: int,
        levels: int,
        values: str = "lookup",
        combine: str = "bundle",
        generator: torch.Generator | None = None,
        span: int | None = None,
        subset: int | None = None,
    ) -> None:
        super().__init__()
        encode, combination = _find(VALUES, values, "value encoder"), _find(COMBINATIONS, combine, "combination")
        sensors, levels = whole_number(sensors, "sensors is a number"), whole_number(levels, "levels is a number")
        if sensors < 1 or levels < 1:
            raise ValueError(f"a record needs at least one sensor and one level; got {sensors} and {levels}")
        self.vsa, self.sensors, self.levels = vsa, sensors, levels
        self.combination = combination(vsa, **_accepted(combine, combination, subset=subset))
        require_memory(
            self.combination.bytes_to_make(sensors, levels),
            f"a table of {sensors} sensors, {levels} levels and d = {vsa.dim}",
            "take fewer levels or dimensions, or thresholds, which keep no table",
        )
        self.register_buffer("roles", vsa.random(sensors, generator=generator))
        options = _accepted(values, encode, span=span)
        codes = encode(vsa, levels, generator=generator, **options)
        self.register_buffer("codes", codes)
        self.register_buffer("arrangement", self.combination.arrange(sensors, generator))
        self.register_buffer("table", None, persistent=False)
        self.derive()
        self.register_load_state_dict_post_hook(_derive_again)

    @staticmethod
    def layout(vsa: VSA, sensors: int, levels: int, combine: str = "bundle") -> dict[str, tuple[torch.dtype, tuple]]:
        """The types and shapes of the codebooks of such a record, found without making it."""
        layout = {"roles": (vsa.dtype, (sensors, vsa.dim)), "codes": (vsa.dtype, (levels, vsa.dim))}
        arranged = _find(COMBINATIONS, combine, "combination")(vsa).arranged
        return layout if arranged is None else layout | {"arrangement": (arranged, (sensors, vsa.dim))}

    def derive(self) -> None:
        """Compute the table of role-bound values from the codebooks; needed after a change of theirs in place."""
        bound = self.combination.bound(self.roles, self.codes, self.arrangement)
        absent = self.combination.unobserved(bound).expand(self.sensors, 1, self.vsa.dim)
        self.table = torch.cat([bound, absent], 1)

    def check(self) -> None:
        """Raise `ValueError` naming the codebook if one does not hold codes of the architecture."""
        for name in ("roles", "codes"):
            self.vsa.check_codes(getattr(self, name), name)
        order = self.arrangement
        whole = torch.arange(self.vsa.dim, device=self.roles.device)
        if order is not None and order.dtype == torch.int64 and not (order.sort(-1).values == whole).all():
            raise ValueError("arrangement must hold an order of all dimensions for each sensor")

    def forward(self, indices: Int[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        """Encode each row of indices in `[-1, levels)`; -1 is *unobserved*.

        Raises `ShapeError` unless the rows have one index per sensor, and `ValueError` for an index outside of that
        range or of a type other than a signed integer or uint8. Values are checked on a CPU; another device asserts
        them without being waited for, and graphs and `vmap` do not check them.
        """
        return self.combination.join(self.table, check_indices(indices, self.sensors, self.levels))


def _find(parts: dict[str, Any], name: str, kind: str) -> Any:
    if name not in parts:
        raise ValueError(f"there is no {kind} {name!r}; choose one of {', '.join(parts)}")
    return parts[name]


def _derive_again(module: nn.Module, _: Any) -> None:
    assert isinstance(module, Record)
    module.derive()


def _accepted(name: str, part: Callable[..., Any], **options: int | None) -> dict[str, int]:
    """The options that were given; raises if the part does not take one of them."""
    given = {option: value for option, value in options.items() if value is not None}
    for option, value in given.items():
        if option not in inspect.signature(part).parameters:
            raise ValueError(f"{name!r} takes no {option}; got {option}={value}")
    return given
