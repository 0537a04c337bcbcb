"""What of a recall does not depend on the condition, computed once for a program."""

from typing import NamedTuple

import torch
from jaxtyping import Float64, Int8, Int64, Shaped
from torch import Tensor, nn

from behaviours.recall import Recall
from torchvsa import VSA
from torchvsa.exact import dots, is_integer, norms, scaled, signed
from torchvsa.memory import best


class Products(NamedTuple):
    """What a folded program is asked of each condition; all that follows is a matter of a few numbers."""

    items: Shaped[Tensor, "batch k"]
    """`<unbind(program, c), item>`."""
    known: Shaped[Tensor, "batch"]
    """`<c, known>`."""
    noise: Float64[Tensor, "batch"]
    """The lengths of the noisy results, `|unbind(program, c)|`."""
    lengths: Float64[Tensor, "batch"]
    """The lengths of the conditions."""


class Folded(nn.Module):
    """A program folded into the items that it can answer with: `<c ⊗ p, item> = <c, p ⊗ item>`.

    A batch of conditions is then answered by one matrix product. Where architecture and program are integers and bind
    element by element, the numbers are written in base 256, digits from -128 to 127: products with the int8 conditions
    are exact, and as fast as the device's integer units. The noisy result's length is the root of `c² · p²`.
    """

    program: Tensor
    known: Tensor
    rows: Tensor
    item_lengths: Tensor
    known_length: Tensor
    linear: Tensor
    linear_weights: Tensor
    square: Tensor
    square_weights: Tensor

    def __init__(
        self,
        vsa: VSA,
        program: Shaped[Tensor, "d"],
        known: Shaped[Tensor, "d"],
        items: Shaped[Tensor, "k d"],
    ) -> None:
        super().__init__()
        self.vsa = vsa
        program, known, items = (_scaled_to_one(x) for x in (program, known, items))
        tables = {
            "program": program,
            "known": known,
            "rows": vsa.unbind(program, items),
            "item_lengths": norms(items),
            "known_length": norms(known),
        }
        # Squares of wider integers would not fit; in float64 they are as exact as its 53 bits.
        whole = vsa.integer and vsa.elementwise
        whole = whole and all(is_integer(x) and x.element_size() <= 4 for x in (program, known, items))
        # How many digits it takes depends on the values, which no graph may look at.
        self.digital = whole and not torch.compiler.is_compiling()
        if self.digital:
            votes = torch.cat([signed(tables["rows"]), signed(known)[None]])
            # One digit more than bytes, since digits are signed.
            size = max(signed(program).element_size(), votes.element_size())
            tables["linear"], tables["linear_weights"] = _digits(votes.to(torch.int64), size + 1)
            square, tables["square_weights"] = _digits(signed(program).to(torch.int64)[None] ** 2, min(2 * size + 1, 8))
            tables["square"] = torch.cat([square, torch.ones_like(square[:1])])
        for name, table in tables.items():
            self.register_buffer(name, table, persistent=False)

    def products(self, conditions: Shaped[Tensor, "batch d"]) -> Products:
        """The products with encoded and protected conditions: the only part that sees their d elements."""
        codes = signed(conditions)
        if not self.digital or codes.dtype != torch.int8 or torch.compiler.is_exporting():
            known = dots(conditions, self.known[None])[:, 0]
            noise = self.vsa.unbound_norm(self.program, conditions)
            return Products(dots(conditions, self.rows), known, noise, norms(conditions))
        products = _joined(dots(codes, self.linear), self.linear_weights)
        # Codes of one byte are -1, 0 or +1 in every architecture, so that their squares are their absolute values.
        squares = dots(codes.abs(), self.square)
        noise = _joined(squares[:, :-1], self.square_weights)[:, 0].sqrt()
        return Products(products[:, :-1], products[:, -1], noise, squares[:, -1].to(torch.float64).sqrt())

    def recall(self, products: Products, commands: Float64[Tensor, "k m"]) -> Recall:
        """Answer with the best item's row of `commands`."""
        match = best(scaled(products.items, self.item_lengths), products.noise)
        familiarity = scaled(products.known, products.lengths * self.known_length)
        return Recall(commands[match.index], match.similarity, match.margin, familiarity.to(torch.float32))


def _scaled_to_one(x: Shaped[Tensor, "*rows d"]) -> Shaped[Tensor, "*rows d"]:
    """Floats, each row in units of a power of two, so that no square is too large or too small for its type.

    Cosines do not depend on it, and a power of two changes no digit. Integers, and tensors in a graph, are returned as
    they are.
    """
    if is_integer(x) or torch.compiler.is_compiling():
        return x
    if x.dtype in (torch.float16, torch.bfloat16):
        x = x.to(torch.float32)
    largest = x.detach().abs().amax(-1, keepdim=True)
    unit = torch.where(
        (largest > 0) & largest.isfinite(), torch.ldexp(torch.ones_like(largest), largest.frexp().exponent - 1), 1.0
    )
    return x / unit


def _digits(x: Int64[Tensor, "rows d"], most: int) -> tuple[Int8[Tensor, "rows_digits d"], Float64[Tensor, "digits"]]:
    """Each row as the rows of its digits in base 256, lowest first, and the weights of the digits.

    On a CPU there are as many digits as the largest number has, elsewhere `most`: to look at numbers there would wait.
    """
    digits = []
    while len(digits) < most and (not digits or x.device.type != "cpu" or x.any()):
        low = (x + 128) % 256 - 128
        digits.append(low.to(torch.int8))
        x = (x - low) // 256
    weights = 256.0 ** torch.arange(len(digits), dtype=torch.float64, device=x.device)
    return torch.stack(digits, 1).flatten(0, 1), weights


def _joined(products: Shaped[Tensor, "batch rows_digits"], weights: Float64[Tensor, "digits"]) -> Tensor:
    """Products with digits as products with the numbers, exact below 2^53."""
    wide = products.to(torch.float64)
    return wide if len(weights) == 1 else (wide.unflatten(1, (-1, len(weights))) * weights).sum(-1)
