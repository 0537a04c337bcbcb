"""Small sound files of banks and demonstrations, of each kind of encoder and architecture."""

import math
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import torch

from behaviours import Actuator, BehaviourBank, Demonstrations, ErrorDriven, OneShot, Schema, Sensor, Space
from behaviours.learning import no_convergence_warnings
from torchvsa import BSC, FHRR, HRR, MAP, VSA, FixedShift, Protection, SelfShift
from torchvsa.encoders import (
    Balanced,
    Circular,
    Concatenated,
    Encoder,
    FractionalPower,
    History,
    Level,
    Lookup,
    ObliqueFeatures,
    Product,
    RandomFourier,
    SubsetProduct,
    Sum,
    Thermometer,
    ThresholdFeatures,
)

_EDGES = [torch.tensor([0.2, 0.5]), torch.tensor([0.1, 0.1, 0.9])]


def _bank(make: Callable[[VSA], Encoder], vsa: VSA, protection: Protection | None = None) -> BehaviourBank:
    schema = Schema(
        [Sensor("left", 0, 1), Sensor("right", 0, 1, "m", "clip")],
        [Actuator("turn", -1, 1, levels=3), Actuator("go", 0, 1, levels=2)],
    )
    space = Space(schema, make(vsa), protection=protection, seed=1)
    readings = torch.rand(20, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    commands = torch.stack([(readings[:, 0] - readings[:, 1]).sign(), (readings[:, 0] > 0.5).double()], 1)
    bank = BehaviourBank(space)
    with no_convergence_warnings():  # how well it learns from so few dimensions is not the question
        bank.learn("steer", Demonstrations(readings[:12], commands[:12]), ErrorDriven())
    bank.learn("forward . é", Demonstrations(readings[12:], commands[12:]), OneShot())
    bank.add("both", bank["steer"] - 2 * bank["forward . é"])
    return bank


def _side_by_side(vsa: VSA) -> Encoder:
    boxes, sums = (MAP(dim, dtype=vsa.dtype) for dim in (20, vsa.dim - 20))
    rows = torch.tensor([[0.1, 0.2], [0.9, 0.4], [0.5, 0.8]])
    return Concatenated([ThresholdFeatures(boxes, 2, 9, 2, _EDGES), ObliqueFeatures(sums, 2, rows=rows)])


def _mixed() -> BehaviourBank:
    """A robot with sensors of every kind, over the default space."""
    sensors = [
        Sensor("switch", kind="binary"),
        Sensor("gear", kind="categorical", values=("low", "high", "reverse")),
        Sensor("level", kind="categorical", values=(1.5, -2.0)),
        Sensor("heading", -180, 180, kind="angle"),
    ]
    bank = BehaviourBank(Space(Schema(sensors, [Actuator("turn", -1, 1, levels=3)]), vsa=MAP(32, dtype=torch.int8)))
    readings = [[0, 0, 1.5, 170.0], [1, 2, -2.0, -90.0], [1, 1, 1.5, 0.0]]
    bank.learn("steer", Demonstrations(readings, [[-1], [0], [1]]), OneShot())
    return bank


@cache
def originals() -> list[tuple[str, bytes]]:
    """Sound files of each kind, small ones."""
    exact, floats, bits, fhrr = MAP(32, dtype=torch.int8), MAP(32), BSC(32), FHRR(32)
    kinds = [
        _bank(lambda vsa: Product(Level(vsa, 8), 2), exact),
        _bank(lambda vsa: Sum(Lookup(vsa, 6), 2), floats, SelfShift(floats)),
        _bank(lambda vsa: SubsetProduct(Lookup(vsa, 6), 2, 2), bits, FixedShift(bits, 3)),
        _bank(lambda vsa: Sum(Level(vsa, 5), 2), fhrr, SelfShift(fhrr)),
        _bank(lambda vsa: Product([Balanced(vsa, 5), Circular(vsa, 4)]), HRR(32)),
        _bank(lambda vsa: ThresholdFeatures(vsa, 2, 9, 2, _EDGES), MAP(32, "B", torch.int8)),
        _bank(lambda vsa: History(Sum(Thermometer(vsa, 4), 2), [1]), MAP(32, "I", torch.int8)),
        _bank(lambda vsa: Sum(FractionalPower(vsa), 2), fhrr),
        _bank(lambda vsa: RandomFourier(vsa, 2), floats),
        _bank(_side_by_side, exact),
        _mixed(),
    ]
    shown = Demonstrations([[0.1, math.nan], [0.2, 0.3], [0.5, 0.6]], [[0.0], [1.0], [0.5]], [0, 0, 1])
    files = []
    with tempfile.TemporaryDirectory() as folder:
        for made in (*kinds, shown):
            path = made.save(Path(folder) / "original")
            files.append(("demonstrations" if made is shown else "bank", path.read_bytes()))
    return files
