"""Algorithm 2: many queries at once, and one control tick."""

from collections.abc import Iterator

import torch
from torch.testing import assert_close

from behaviours import Actuator, Demonstrations, OneShot, Schema, Sensor, Space
from benchmarks import corral
from benchmarks.harness import INPUTS, Case, compiled
from benchmarks.literal import Literal
from torchvsa import MAP
from torchvsa.encoders import ThresholdFeatures


def cases(device: str, small: bool = False) -> Iterator[Case]:
    """2,048 queries, and one at a time; from readings to commands, similarity and familiarity.

    What a robot reads falls into few bins, so that many rows of a batch are equal and ours asks about them once; also
    asked are rows that all differ. The peer begins with bins and leaves out the margin.
    """
    dim, count, batch = (256, 300, 8) if small else (4000, 20_000, 2048)
    shown, space = corral.samples(count), corral.space(dim, device)
    rule, literal = OneShot(novelty="similarity"), Literal(space, clip=False)
    behaviour = rule.fit(space, shown)
    literal.learn(space.cells(shown.sensors), space.schema.command_levels(shown.commands), rule.sigmas / dim**0.5)
    generator = torch.Generator().manual_seed(0)
    frozen = behaviour.freeze()
    graph = compiled(frozen, small, guard_filter_fn=torch.compiler.skip_guard_on_all_nn_modules_unsafe)
    for name, ask, rows, differ in (
        ("Algorithm 2", behaviour, batch, False),
        ("Algorithm 2, all different", behaviour, batch, True),
        ("Algorithm 2, one control tick", behaviour, 1, False),
        ("Algorithm 2, one control tick, frozen", frozen, 1, False),
        ("Algorithm 2, one control tick, compiled", graph, 1, False),
    ):
        readings = [
            corral.different(space, rows, generator)
            if differ
            else shown.sensors[torch.randint(count, (rows,), generator=generator)]
            for _ in range(INPUTS)
        ]
        bins = [space.cells(some) for some in readings]
        # The peer answers rows of bins, one without a batch dimension.
        asked = [some[0] if rows == 1 else some for some in bins]

        def check(ask=ask, readings=readings, asked=asked) -> None:
            for mine, theirs in zip(readings, asked, strict=True):
                answer, (levels, similarity, familiarity) = ask(mine), literal.recall(theirs)
                assert torch.equal(answer.commands, space.schema.command_values(torch.atleast_2d(levels)))
                assert_close(answer.similarity, torch.atleast_1d(similarity), atol=1e-5, rtol=1e-5)
                assert_close(answer.familiarity, torch.atleast_1d(familiarity), atol=1e-5, rtol=1e-5)

        yield Case(
            name,
            f"B={rows} d={dim}",
            lambda index, ask=ask, readings=readings: ask(readings[index]),
            {"literal steps on torchhd": lambda index, asked=asked: literal.recall(asked[index])}
            | ({"not frozen": lambda index, readings=readings: behaviour(readings[index])} if ask is frozen else {}),
            check,
            calls=1 if rows > 1 else (4 if small else 100),
            more={"distinct": min(len(some.unique(dim=0)) for some in bins)},
        )
    yield _threshold_features(dim, device, small)


def _threshold_features(dim: int, device: str, small: bool) -> Case:
    """One control tick of a robot with 24 sensors and the default encoder."""
    generator = torch.Generator().manual_seed(0)
    sensors = [Sensor(f"sensor {place}", 0, 1) for place in range(24)]
    schema = Schema(sensors, [Actuator("turn", -1, 1, levels=3)])
    space = Space(schema, ThresholdFeatures(MAP(dim, dtype=torch.int8), 24, bins=256, subset=2)).to(device)
    readings = torch.rand(300, 24, generator=generator, dtype=torch.float64)
    commands = torch.sign(readings[:, :1] - readings[:, 1:2])
    behaviour = OneShot().fit(space, Demonstrations(readings, commands))
    frozen, rows = behaviour.freeze(), readings[:INPUTS, None]

    def check() -> None:
        for row in rows:
            for mine, theirs in zip(frozen(row)[:4], behaviour(row)[:4], strict=True):
                assert_close(mine, theirs, rtol=0, atol=0)

    return Case(
        "Algorithm 2, 24 sensors with thresholds, one control tick, frozen",
        f"B=1 d={dim}",
        lambda index: frozen(rows[index]),
        {"not frozen": lambda index: behaviour(rows[index])},
        check,
        calls=4 if small else 100,
    )
