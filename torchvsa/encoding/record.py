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

    The table of role-bound values takes `n · (levels + 1) · d` elements (24 sensors, 64 levels, d = 4,000,
    int8: 6 MB).

    Source: Neubert et al. 2016, Algorithm 1, line 3.
    """

    roles: Tensor
    codes: Tensor
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
        if values not in VALUES:
            raise ValueError(f"there is no value encoder {values!r}; choose one of {', '.join(VALUES)}")
        if combine not in COMBINATIONS:
            raise ValueError(f"there is no combination {combine!r}; choose one of {', '.join(COMBINATIONS)}")
        sensors, levels = whole_number(sensors, "sensors is a number"), whole_number(levels, "levels is a number")
        if sensors < 1 or levels < 1:
            raise ValueError(f"a record needs at least one sensor and one level; got {sensors} and {levels}")
        self.vsa, self.sensors, self.levels = vsa, sensors, levels
        self.combination = COMBINATIONS[combine](vsa, **_accepted(combine, COMBINATIONS[combine], subset=subset))
        require_memory(
            self.combination.bytes_to_make(sensors, levels),
            f"a table of {sensors} sensors, {levels} levels and d = {vsa.dim}",
            "take fewer levels or dimensions, or thresholds, which keep no table",
        )
        self.register_buffer("roles", vsa.random(sensors, generator=generator))
        options = _accepted(values, VALUES[values], span=span)
        codes = VALUES[values](vsa, levels, generator=generator, **options)
        self.register_buffer("codes", codes)
        bound = self.combination.bound(self.roles, codes, generator)
        absent = self.combination.unobserved(bound).expand(sensors, 1, vsa.dim)
        self.register_buffer("table", torch.cat([bound, absent], 1))

    def forward(self, indices: Int[Tensor, "batch n"]) -> Shaped[Tensor, "batch d"]:
        """Encode each row of indices in `[-1, levels)`; -1 is *unobserved*.

        Raises `ShapeError` unless the rows have one index per sensor, and `ValueError` for an index outside of that
        range or of a type other than a signed integer or uint8. Values are checked on a CPU; another device asserts
        them without being waited for, and graphs and `vmap` do not check them.
        """
        return self.combination.join(self.table, check_indices(indices, self.sensors, self.levels))


def _accepted(name: str, part: Callable[..., Any], **options: int | None) -> dict[str, int]:
    """The options that were given; raises if the part does not take one of them."""
    given = {option: value for option, value in options.items() if value is not None}
    for option, value in given.items():
        if option not in inspect.signature(part).parameters:
            raise ValueError(f"{name!r} takes no {option}; got {option}={value}")
    return given
