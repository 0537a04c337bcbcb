"""Records whose hypervectors are mirrored by one rotation."""

from collections.abc import Sequence
from typing import Any

import torch
from jaxtyping import Bool, Int64, Shaped
from torch import Tensor

from torchvsa._checks import whole_number
from torchvsa.architectures import VSA
from torchvsa.encoders.base import ValueEncoder
from torchvsa.encoders.product import Product
from torchvsa.part import Layout


class Mirrored(Product):
    """A product of values in which exchanging the readings of paired sensors rotates the hypervector by d / 2.

    With π the rotation by d / 2 and c the encoder, for the pair of the sensors l and r and another sensor o:

        π(c(l, r, o)) = c(r, l, o)

    The code of the second sensor of a pair is π of the code of the first for the same reading. All other sensors have
    codes with π(y) = y: the first half is repeated. Since π is its own inverse and distributes over element-wise
    binding, it mirrors everything that is bound to conditions or summed, such as a program. As in `Product`, the i-th
    pair or other sensor is rotated i times, which commutes with π.

    Both sensors of a pair have the same value encoder. Readings that were not observed are left out. Conditions that
    are their own mirror image, and sensors without a partner, have d / 2 independent elements.

    Args:
        values: One value encoder for all sensors, or a list with one per sensor.
        pairs: Pairs of columns that swap, such as `[(0, 1)]`; each column at most once.
        sensors: The number of sensors, for one value encoder.
        seed: Draws the codebooks.

    Raises:
        ValueError: For pairs that are none, for pairs with different value encoders, for an odd d, and for
            architectures without element-wise binding.
    """

    name = "mirrored"

    def __init__(
        self,
        values: ValueEncoder | Sequence[ValueEncoder],
        pairs: Sequence[Sequence[int]],
        sensors: int | None = None,
        seed: int | None = None,
    ) -> None:
        self.pairs = _checked_pairs(pairs)
        shared = isinstance(values, ValueEncoder)
        super().__init__(values if shared else _paired_values(list(values), self.pairs), sensors, seed)
        last = max(max(pair) for pair in self.pairs)
        if last >= self.sensors:
            raise ValueError(
                f"pairs name column {last}; with {self.sensors} sensors the last one is {self.sensors - 1}"
            )

    def own_layout(self) -> Layout:
        """`roles`: one per pair and per sensor without a partner."""
        check_mirrored_dim(self.vsa)
        return {"roles": (self.vsa.dtype, (self.sensors - len(self.pairs), self.vsa.dim))}

    def config(self) -> dict[str, Any]:
        """The config of a record, and the pairs."""
        return super().config() | {"pairs": [list(pair) for pair in self.pairs]}

    def _bound(self, roles: Shaped[Tensor, "roles 1 d"], codes: Shaped[Tensor, "#n k d"]) -> Shaped[Tensor, "n k d"]:
        role, second, alone = (tensor.to(codes.device) for tensor in self._places())
        bound = self.vsa.bind(codes, roles[role])
        bound = torch.where(alone[:, None, None], symmetric(bound), bound)
        return self.vsa.permute(bound, (role + second * (self.vsa.dim // 2))[:, None])

    def _places(self) -> tuple[Int64[Tensor, "n"], Int64[Tensor, "n"], Bool[Tensor, "n"]]:
        """For each sensor the index of its role, whether it is the second of a pair, and whether it has no partner."""
        first = {second: first for first, second in self.pairs}
        owners = [column for column in range(self.sensors) if column not in first]
        role = [owners.index(first.get(column, column)) for column in range(self.sensors)]
        paired = {column for pair in self.pairs for column in pair}
        alone = torch.tensor([column not in paired for column in range(self.sensors)])
        return torch.tensor(role), torch.tensor([int(column in first) for column in range(self.sensors)]), alone


def mirrored(x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
    """Rotate by d / 2, the mirror image of a hypervector; its own inverse for an even d."""
    return torch.roll(x, x.shape[-1] // 2, -1)


def symmetric(x: Shaped[Tensor, "*batch d"]) -> Shaped[Tensor, "*batch d"]:
    """The first half of each hypervector, repeated: its own mirror image."""
    half = x[..., : x.shape[-1] // 2]
    return torch.cat([half, half], -1)


def check_mirrored_dim(vsa: VSA) -> None:
    """Raise `ValueError` unless the rotation by d / 2 mirrors bound hypervectors of this architecture."""
    if not vsa.elementwise:
        raise ValueError(f"mirrored hypervectors need element-wise binding, which {vsa} lacks")
    if vsa.dim % 2:
        raise ValueError(f"mirrored hypervectors have two equal halves, so that d is even; got {vsa}")


def _checked_pairs(pairs: Sequence[Sequence[int]]) -> tuple[tuple[int, int], ...]:
    what = "pairs are pairs of different columns, such as [(0, 1)], each column at most once"
    try:
        given = [tuple(whole_number(column, what) for column in pair) for pair in pairs]
    except TypeError:
        raise ValueError(f"{what}; got {pairs!r:.80}") from None
    columns = [column for pair in given for column in pair]
    if not given or any(len(pair) != 2 for pair in given) or len(set(columns)) < len(columns) or min(columns) < 0:
        raise ValueError(f"{what}; got {pairs!r:.80}")
    return tuple((first, second) for first, second in given)


def _paired_values(values: list[ValueEncoder], pairs: Sequence[tuple[int, int]]) -> list[ValueEncoder]:
    """The value encoders, with that of the first sensor of a pair for the second too."""
    for first, second in pairs:
        if max(first, second) >= len(values) or values[first] is values[second]:
            continue
        equal = values[first].config() == values[second].config()
        if not equal or values[first].drawn or values[second].drawn:
            raise ValueError(
                f"the sensors {first} and {second} are a pair, so that one value encoder encodes both: list the same "
                "object twice"
            )
        values[second] = values[first]
    return values
