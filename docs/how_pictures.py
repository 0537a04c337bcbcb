"""The pictures of docs/how.md: `python docs/how_pictures.py` draws all of them again, with the same bits."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import torchvsa
from behaviours import Actuator, BehaviourBank, Demonstrations, ErrorDriven, OneShot, Schema, Sensor, Space
from behaviours.storage import write_atomically
from experiments.kit.figures import BLUE, GREEN, GREY, ORANGE, VERMILION, drawn
from torchvsa.encoders import Circular, Level, Lookup, Product, Sum

HERE = Path(__file__).parent
COLOURS = (BLUE, VERMILION, GREEN, ORANGE)


def generator() -> torch.Generator:
    """The same draws for each picture."""
    return torch.Generator().manual_seed(0)


def canvas(width: float, height: float, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """A figure and its axes, side by side."""
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, list(np.atleast_1d(figure.subplots(1, columns)))


def random() -> Figure:
    """Cosines of random hypervectors, for three dimensions."""
    figure, (axes,) = canvas(6, 2.6)
    for dim, colour in zip((100, 1000, 4000), COLOURS, strict=False):
        vsa = torchvsa.MAP(dim)
        a, b = vsa.random(2, 5000, generator=generator())
        bins = np.arange(-0.41, 0.42, 0.02)  # cosines of d = 100 are multiples of .02
        axes.hist(vsa.similarity(a, b).numpy(), bins, density=True, histtype="step", color=colour, label=f"d = {dim:,}")
    axes.set(xlabel="cosine of two random hypervectors", ylabel="density")
    axes.legend()
    return figure


def operations() -> Figure:
    """The first elements of two hypervectors and of what the operations make of them, and how alike those are."""
    figure = Figure(figsize=(7, 2.8), layout="constrained")
    strips, bars = figure.subplots(1, 2, width_ratios=(3, 2))
    vsa = torchvsa.MAP(4000, "I")
    a, b = vsa.random(2, generator=generator())
    rows = {"a": a, "b": b, "a ⊗ b": vsa.bind(a, b), "a ⊕ b": vsa.bundle([a, b]), "permuted a": vsa.permute(a, 1)}
    strips.imshow(torch.stack(list(rows.values()))[:, :32].numpy(), cmap="coolwarm", vmin=-2, vmax=2, aspect="auto")
    strips.set_yticks(range(len(rows)), list(rows))
    strips.set(xlabel="the first 32 of 4,000 elements: -2, -1, 0, +1, +2", xticks=[])
    strips.grid(False)
    places = np.arange(len(rows))
    for shift, (name, other, colour) in enumerate((("a", a, BLUE), ("b", b, ORANGE))):
        cosines = [vsa.similarity(row, other).item() for row in rows.values()]
        bars.barh(places + 0.36 * shift - 0.18, cosines, 0.36, color=colour, label=f"with {name}")
    bars.set(xlabel="cosine", xlim=(-0.1, 1.1), yticks=[])
    bars.invert_yaxis()
    bars.legend(loc="lower right")
    return figure


def readings() -> Figure:
    """How alike the code of one bin is to those of all others, for three encoders."""
    figure, (axes,) = canvas(6, 2.6)
    vsa = torchvsa.MAP(4000)
    cells = torch.arange(32)
    for make, colour in zip((Level, Lookup, Circular), COLOURS, strict=False):
        codes = make(vsa, 32, seed=0).encode(cells)
        axes.plot(cells, vsa.similarity(codes, codes[10]), ".-", color=colour, label=make.__name__)
    axes.set(xlabel="bin", ylabel="cosine with the code of bin 10")
    axes.legend()
    return figure


def conditions() -> Figure:
    """How alike conditions of two sensors are to one of them, as a product and as a sum."""
    figure, both = canvas(6.5, 3, 2)
    vsa = torchvsa.MAP(4000)
    grid = torch.cartesian_prod(torch.arange(32), torch.arange(32))
    for axes, make in zip(both, (Product, Sum), strict=True):
        encode = make(Level(vsa, 32), sensors=2, seed=0)
        found = vsa.similarity(encode.encode(grid), encode.encode(torch.tensor([[10, 20]]))).reshape(32, 32)
        image = axes.imshow(found.T.numpy(), origin="lower", cmap="viridis", vmin=0, vmax=1)
        axes.plot(10, 20, "+", color="white", markersize=10)
        axes.set(title=f"a {make.__name__.lower()}", xlabel="bin of sensor 1", ylabel="bin of sensor 2")
        axes.grid(False)
    figure.colorbar(image, ax=both, label="cosine with the condition +")
    return figure


def steering() -> tuple[BehaviourBank, torch.Tensor]:
    """A behaviour that turns to the brighter side, learned from 60 readings."""
    schema = Schema([Sensor("left", 0, 1), Sensor("right", 0, 1)], [Actuator("turn", -1, 1, levels=3)])
    shown = torch.rand(60, 2, generator=generator())
    turns = torch.where((shown[:, 0] - shown[:, 1]).abs() < 0.15, 0.0, torch.sign(shown[:, 1] - shown[:, 0]))[:, None]
    bank = BehaviourBank(Space(schema, Product(Level(torchvsa.MAP(4000), 32), sensors=2)))
    bank.learn("steer", Demonstrations(shown, turns), OneShot())
    return bank, shown


def asking() -> Figure:
    """How alike the answer is to each result, for a condition that was shown, one near it, and one far from all."""
    figure, axes = canvas(8, 2.4, 3)
    bank, shown = steering()
    clear = shown[(shown[:, 0] - shown[:, 1]).argmax()]
    asked = {"shown": clear, "near it": (clear - 0.05).clamp(0, 1), "in between": torch.tensor([0.6, 0.48])}
    for one, (name, reading) in zip(axes, asked.items(), strict=True):
        recall = bank["steer"](reading[None])
        scores = bank["steer"].scores(reading[None])[0] / 4000
        order = bank["steer"].results[:, 0].argsort()  # levels 0, 1, 2
        one.bar(["-1", "0", "+1"], scores[order].numpy(), color=BLUE)
        one.set(
            title=f"{name}: {recall.commands.item():+.0f}, margin {recall.margin.item():.2f}",
            xlabel="turn",
            ylim=(-0.15, 0.15),
        )
    axes[0].set_ylabel("similarity of the answer")
    return figure


def learning() -> Figure:
    """The share of shown pairs that are recalled, against their number."""
    figure, (axes,) = canvas(6, 2.6)
    schema = Schema([Sensor("a", 0, 1), Sensor("b", 0, 1)], [Actuator("turn", -1, 1, levels=9)])
    counts = [5, 10, 20, 40, 80, 160, 320, 480]
    for rule, colour in ((OneShot(), VERMILION), (ErrorDriven(), BLUE)):
        shares = []
        for count in counts:
            places = torch.randperm(64 * 64, generator=generator())[:count]
            shown = (torch.stack([places // 64, places % 64], 1) + 0.5) / 64
            turns = torch.randint(9, (count, 1), generator=generator()) / 4 - 1.0
            bank = BehaviourBank(Space(schema, Product(Lookup(torchvsa.MAP(1000), 64), sensors=2)))
            bank.learn("random", Demonstrations(shown, turns), rule)
            shares.append((bank["random"](shown).commands == turns).double().mean().item())
        axes.plot(counts, shares, "o-", color=colour, label=type(rule).__name__)
    axes.set(xscale="log", xlabel="unrelated pairs in a program of d = 1,000", ylabel="share recalled", ylim=(0, 1.05))
    axes.axhline(1 / 9, color=GREY, linestyle=":", label="by chance")
    axes.legend()
    return figure


def combining() -> Figure:
    """What two behaviours and their sum answer to all readings."""
    figure, axes = canvas(7.5, 2.8, 3)
    schema = Schema([Sensor("light", -1, 1), Sensor("wall", 0, 2)], [Actuator("turn", -1, 1, levels=3)])
    bank = BehaviourBank(Space(schema, Product(Level(torchvsa.MAP(4000), 32), sensors=2)))
    light, wall = torch.rand(2, 400, generator=generator())
    shown = torch.stack([2 * light - 1, 2 * wall], 1)
    towards, away = (torch.sign(shown[:, :1]).where(shown[:, :1].abs() > 0.2, 0.0), torch.full((400, 1), -1.0))
    near = shown[:, 1] < 0.7
    bank.learn_apart({
        "seek": Demonstrations(shown[~near], towards[~near]), "avoid": Demonstrations(shown[near], away[near]),
    })  # fmt: skip
    both = bank["seek"] + bank["avoid"]
    asked = torch.cartesian_prod(torch.linspace(-1, 1, 60), torch.linspace(0, 2, 60))
    for one, (name, behaviour) in zip(
        axes, {"seek": bank["seek"], "avoid": bank["avoid"], "seek + avoid": both}.items(), strict=True
    ):
        turns = behaviour(asked).commands.reshape(60, 60)
        one.imshow(
            turns.T.numpy(), origin="lower", extent=(-1, 1, 0, 2), cmap="coolwarm", vmin=-1, vmax=1, aspect="auto"
        )
        one.set(title=name, xlabel="light (left to right)")
        one.grid(False)
    axes[0].set_ylabel("distance of the wall (m)")
    return figure


PICTURES: dict[str, Callable[[], Figure]] = {
    picture.__name__: picture
    for picture in (random, operations, readings, conditions, asking, learning, combining)
}  # fmt: skip

if __name__ == "__main__":
    for name, picture in PICTURES.items():
        write_atomically(HERE / f"how_{name}.png", drawn(picture))
