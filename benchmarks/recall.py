"""Algorithm 2: many queries at once, and one control tick."""

from collections.abc import Iterator

import torch
from torch.testing import assert_close

from behaviours import OneShot
from benchmarks import corral
from benchmarks.harness import INPUTS, Case
from benchmarks.literal import Literal


def cases(device: str, small: bool = False) -> Iterator[Case]:
    """2,048 queries, and one at a time; from readings to commands, similarity and familiarity."""
    dim, count, batch = (256, 300, 8) if small else (4000, 20_000, 2048)
    shown, space = corral.samples(count), corral.space(dim, device)
    rule, literal = OneShot(known="similarity"), Literal(space, clip=False)
    behaviour = rule.fit(space, shown).requires_grad_(False)
    literal.learn(space.bins(shown.sensors), space.schema.command_levels(shown.commands), rule.sigmas / dim**0.5)
    generator = torch.Generator().manual_seed(0)
    for rows in (batch, 1):
        readings = [shown.sensors[torch.randint(count, (rows,), generator=generator)] for _ in range(INPUTS)]
        bins = [space.bins(some) for some in readings]
        # The peer answers rows of bins, one without a batch dimension.
        asked = [some[0] if rows == 1 else some for some in bins]

        def check(readings=readings, asked=asked) -> None:
            answer, (levels, similarity, familiarity) = behaviour(readings[0]), literal.recall(asked[0])
            commands = space.schema.command_values(torch.atleast_2d(levels))
            assert torch.equal(answer.commands, commands)
            assert_close(answer.similarity, torch.atleast_1d(similarity), atol=1e-5, rtol=1e-5)
            assert_close(answer.familiarity, torch.atleast_1d(familiarity), atol=1e-5, rtol=1e-5)

        yield Case(
            "Algorithm 2" if rows > 1 else "Algorithm 2, one control tick",
            f"B={rows} d={dim}",
            lambda index, readings=readings: behaviour(readings[index]),
            {"literal steps on torchhd": lambda index, asked=asked: literal.recall(asked[index])},
            check,
            calls=1 if rows > 1 else (4 if small else 100),
        )
