"""For which readings a behaviour gives a command: its program, taken apart into rules."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from typing import Any, Literal, NamedTuple

import torch
from jaxtyping import Bool, Float, Int64, Shaped
from torch import Tensor

from behaviours.analysis.explaining import command_text
from behaviours.behaviour import Behaviour
from behaviours.parts import Sensor
from behaviours.schema import Schema
from torchvsa import FixedShift, Resonator, Unprotected
from torchvsa._numerics import as_bipolar
from torchvsa.encoders import Product, Record

_MOST_CELLS = 2**20
"""The most cells that the plain search asks: about a minute at d = 4,000."""
_SLAB = 2**12
"""The most cells that a range grows by at once; further sensors keep the bin that was found."""
_TRIES = 8
"""Searches per round, with noise of their own; each may find another reading."""
_IDLE = 3
"""Rounds without another reading after which the search ends."""
_CHANCE = 4.0
"""The least similarity of a reading that is taken as present, in standard deviations of that of unrelated ones."""

Ask = Callable[[Int64[Tensor, "rows n"]], Bool[Tensor, "rows"]]


class Rule(NamedTuple):
    """A box of readings, in all of which the behaviour gives the command."""

    low: tuple[float, ...]
    """The lower end per sensor, in its unit; of a sensor with text values, the index. NaN for sensors not used."""
    high: tuple[float, ...]
    """The upper end."""
    strength: float
    """How often the reading that the box grew from is present in the program; NaN if the program was only asked.

    A condition that was taught once has 1; with two results whose codes are opposite, 1/2.
    """
    cells: int
    """The number of cells (combinations of bins) in the box."""


@dataclass(frozen=True, eq=False)
class Rules:
    """For which readings a behaviour gives a command; `print` it for a sentence per rule."""

    schema: Schema
    commands: tuple[float, ...]
    rules: tuple[Rule, ...]
    found: Int64[Tensor, "k n"]
    """The cells that were factored out of the program, strongest first; of the plain search, all that answer so."""
    right: Bool[Tensor, "k"]
    """Whether the behaviour, asked for these cells, gives the command; the others are in no rule."""

    def covers(self, readings: Any) -> Bool[Tensor, "batch"]:
        """Whether each row of readings is in one of the rules."""
        rows = self.schema.check_readings(readings)
        inside = [self._inside(rule, rows) for rule in self.rules]
        return torch.stack(inside).any(0) if inside else torch.zeros(len(rows), dtype=torch.bool)

    def _inside(self, rule: Rule, rows: Tensor) -> Tensor:
        low, high, top = (
            torch.tensor(values, dtype=torch.float64)
            for values in (rule.low, rule.high, [sensor.high for sensor in self.schema.sensors])
        )
        # A bin holds its lower end, and the last one both.
        below = (rows < high) | (rows == low) | ((rows == high) & (high == top))
        return ((rows >= low) & below | low.isnan()).all(1)

    def __str__(self) -> str:
        pairs = zip(self.schema.actuators, self.commands, strict=True)
        given = " and ".join(command_text(*pair) for pair in pairs)
        if not self.rules:
            return f"No reading was found that gives {given}."
        return "\n".join(f"{given} if {self._text(rule)}." for rule in self.rules)

    def _text(self, rule: Rule) -> str:
        parts = [_range(*part) for part in zip(self.schema.sensors, rule.low, rule.high, strict=True)]
        said = " and ".join(part for part in parts if part) or "anything was observed"
        return said + ("" if math.isnan(rule.strength) else f" (strength {rule.strength:.2g})")


def _range(sensor: Sensor, low: float, high: float) -> str:
    """The range in words; empty for a sensor that does not matter."""
    if math.isnan(low) or (low <= sensor.low and high >= sensor.high):
        return ""
    unit = f" {sensor.unit}" if sensor.unit else ""
    if sensor.choices:
        shown = [value for value in sensor.choices if low <= value <= high]
        names = [str(sensor.values[int(value)]) if sensor.labels else f"{value:g}" for value in shown]
        return f"{sensor.name} is {' or '.join(names)}{unit}"
    return f"{sensor.name} is {low:.3g} to {high:.3g}{unit}"


@torch.no_grad()
def explain_command(
    behaviour: Behaviour,
    commands: Any,
    method: Literal["resonator", "table"] = "resonator",
    most: int = 20,
    seed: int = 0,
) -> Rules:
    """Find the readings for which a behaviour gives a command.

        print(explain_command(seek, [-1, 1]))       # left_motor = -1 and right_motor = 1 if light_left is 0 to 3.9 m.

    Unbinding the program with the code of the commands leaves the sum of the conditions that were bound to it. A
    `Resonator` factors it into one bin per sensor; what was found is subtracted, and the search goes on with the rest
    until no reading stands out. The behaviour is then asked for each cell that was found, and grows those that it
    confirms into boxes of bins, in all of which it gives the command: a rule is never wrong, but rules can be missing.

    `method="table"` asks the behaviour for every cell instead, up to 2^20, and misses none: for records of any kind
    and architectures that have no resonator.

    Args:
        behaviour: A behaviour over a record with bins; for the resonator a `Product`.
        commands: One row of commands, as the behaviour recalls them.
        method: How readings are found.
        most: The largest number of rules.
        seed: Decides the noise of the resonator.

    Raises:
        ValueError: For an encoder or a protection that does not suit, and for commands that the behaviour does not
            recall.
    """
    space, encoder = behaviour.space, behaviour.space.encoder
    if not (isinstance(encoder, Record) and encoder.discrete):
        raise ValueError(f"only records with bins can be explained by readings; got {type(encoder).__name__}")
    label = int(behaviour.labels([list(commands)])[0])
    levels = behaviour.results[label]
    values: Any = [encoder.value] * encoder.sensors if encoder.shared else list(encoder.values)
    used = torch.tensor([sensor.name in space.sensors for sensor in space.schema.sensors])
    bins = torch.tensor([value.bins for value in values]).where(used, 1)

    def ask(cells: Tensor) -> Tensor:
        recall = behaviour.answer(cells.where(used, -1))
        return (space.schema.command_levels(recall.commands) == levels).all(1)

    if method == "table":
        strengths = None
        found, answers = _asked(ask, bins)
    elif method == "resonator":
        found, strengths = _factored(behaviour, label, bins, used, most, seed)
        answers: Ask = ask
    else:
        raise ValueError(f"method is 'resonator' or 'table'; got {method!r}")
    right = answers(found) if len(found) else torch.zeros(0, dtype=torch.bool)
    boxes: list[tuple[Tensor, Tensor]] = []
    rules: list[Rule] = []
    for row in right.nonzero()[:, 0].tolist():
        cell = found[row]
        if any(bool(((cell >= low) & (cell <= high)).all()) for low, high in boxes):
            continue
        if len(rules) == most:
            break
        low, high = _grown(answers, cell, bins)
        boxes.append((low, high))
        strength = math.nan if strengths is None else float(strengths[row])
        rules.append(Rule(*_ends(space.schema, used, bins, low, high), strength, int((high - low + 1).prod())))
    shown = space.schema.command_values(levels[None])[0].tolist()
    return Rules(space.schema, tuple(shown), tuple(rules), found.where(used, -1), right)


def _asked(ask: Ask, bins: Int64[Tensor, "n"]) -> tuple[Int64[Tensor, "k n"], Ask]:
    """All cells that answer so, in order, and a function that knows it of each."""
    count = int(bins.to(torch.float64).prod().clamp(max=2.0**62))
    if count > _MOST_CELLS:
        raise ValueError(f"the plain search asks every cell, at most {_MOST_CELLS:,}; this space has {count:,}")
    cells = torch.cartesian_prod(*(torch.arange(int(number)) for number in bins)).reshape(count, -1)
    gives = torch.cat([ask(part) for part in cells.split(_SLAB)])
    grid = gives.reshape(bins.tolist())
    return cells[gives], lambda cells: grid[cells.unbind(1)]


def _factored(
    behaviour: Behaviour, label: int, bins: Tensor, used: Tensor, most: int, seed: int
) -> tuple[Int64[Tensor, "k n"], Float[Tensor, "k"]]:
    """The cells that are present in the program for this result, and how strongly; the strongest first."""
    space, encoder, vsa = behaviour.space, behaviour.space.encoder, behaviour.space.vsa
    unmixed = isinstance(space.protect, Unprotected | FixedShift)
    if not (isinstance(encoder, Product) and unmixed and Resonator.supports(vsa) and int(used.sum()) > 1):
        raise ValueError(
            "a resonator factors products of two or more sensors in MAP, BSC or FHRR, unprotected or behind a fixed "
            "shift; method='table' asks every cell instead"
        )
    table: Any = encoder.table
    columns = used.nonzero()[:, 0].tolist()
    books = [table[column, : int(bins[column])] for column in columns]
    whole = space.protect.invert(vsa.unbind(_wide(behaviour.program.detach()), _dual(behaviour, label)))
    least = _CHANCE / vsa.dim**0.5
    network = Resonator(vsa, books, steps=60, noise=0.5, threshold=1.5, accept=least)
    generator = torch.Generator().manual_seed(seed)
    cells = torch.zeros(0, len(columns), dtype=torch.int64)
    strengths, rest = torch.zeros(0), whole
    idle = 0
    for _ in range(4 * most):
        factors = network(rest.expand(_TRIES, -1), generator)
        # Readings with other commands can be present with a negative weight; they are explained away too.
        new = factors.indices[factors.similarity.abs() >= least].unique(dim=0)
        fresh = (new[:, None] != cells).any(-1).all(1)
        idle = 0 if fresh.any() else idle + 1
        if idle == _IDLE:
            break
        if idle:
            continue
        cells = torch.cat([cells, new[fresh]])
        codes = _wide(_products(vsa.bind, books, cells))
        # Explained away together: similar readings share what is present.
        weights = torch.linalg.lstsq(codes.T, whole[:, None], driver="gelsd").solution[:, 0]
        rest, strengths = whole - weights @ codes, weights.real if weights.is_complex() else weights
    order = strengths.argsort(descending=True, stable=True)
    order = order[strengths[order] > 0]
    found = torch.zeros(len(cells), len(bins), dtype=torch.int64)
    found[:, columns] = cells
    return found[order], strengths[order].float()


def _products(bind: Callable[..., Tensor], books: list[Tensor], cells: Int64[Tensor, "k n"]) -> Shaped[Tensor, "k d"]:
    chosen = [book[index] for book, index in zip(books, cells.unbind(1), strict=True)]
    return as_bipolar(reduce(bind, chosen))


def _dual(behaviour: Behaviour, label: int) -> Shaped[Tensor, "d"]:
    """The key that unbinds one result and none of the others, which can resemble it (they may share an actuator)."""
    items = _wide(behaviour.memory.current_items())
    return torch.linalg.pinv(items).mH[label] * items.shape[1]


def _wide(x: Shaped[Tensor, "*s"]) -> Shaped[Tensor, "*s"]:
    return as_bipolar(x).to(torch.complex128 if x.is_complex() else torch.float64)


def _grown(ask: Ask, cell: Int64[Tensor, "n"], bins: Int64[Tensor, "n"]) -> tuple[Tensor, Tensor]:
    """The lowest and highest bins of a box around a cell in which every cell answers so."""
    low, high = cell.clone(), cell.clone()
    open_ = [(column, step) for column in range(len(bins)) for step in (-1, 1)]
    while open_:
        for column, step in list(open_):
            end = int((low if step < 0 else high)[column]) + step
            sides = [torch.arange(int(a), int(b) + 1) for a, b in zip(low, high, strict=True)]
            sides[column] = torch.tensor([end])
            fits = 0 <= end < int(bins[column]) and math.prod(map(len, sides)) <= _SLAB
            if fits and bool(ask(torch.cartesian_prod(*sides).reshape(-1, len(bins))).all()):
                (low if step < 0 else high)[column] = end
            else:
                # A larger box has a larger slab here, which holds this one: it would fail again.
                open_.remove((column, step))
    return low, high


def _ends(
    schema: Schema, used: Tensor, bins: Tensor, low: Tensor, high: Tensor
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The box in the sensors' units."""
    lows, highs = [], []
    for place, sensor in enumerate(schema.sensors):
        width = (sensor.high - sensor.low) / int(bins[place])
        a, b = sensor.low + width * int(low[place]), sensor.low + width * (int(high[place]) + 1)
        if sensor.choices:
            inside = [v for v in sensor.choices if a <= v < b or (v == b and b >= sensor.high)]
            a, b = min(inside), max(inside)
        lows.append(a if used[place] else math.nan)
        highs.append(min(b, sensor.high) if used[place] else math.nan)
    return tuple(lows), tuple(highs)
