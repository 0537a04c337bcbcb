"""Algorithm 1 over the corral's samples: the whole demonstration at once, with the bits of the literal loop."""

from collections.abc import Iterator

import torch

from behaviours import OneShot
from benchmarks import corral
from benchmarks.harness import Case
from benchmarks.literal import Literal
from benchmarks.peers import plain


def cases(device: str, small: bool = False) -> Iterator[Case]:
    """With the raw accumulator, and with the literal clip."""
    # On a GPU each step of the loop starts several kernels, so that it takes many times as long.
    dim, count = (256, 300) if small else (4000, 20_000 if device == "cpu" else 2_000)
    shown, space = corral.samples(count), corral.space(dim, device)
    bins, levels = space.cells(shown.sensors), space.schema.command_levels(shown.commands).to(device)
    for clip in (False, True):
        rule, literal = OneShot(novelty="similarity", clip_each_step=clip), Literal(space, clip)
        threshold = rule.sigmas / dim**0.5
        report = rule.fit(space, shown).report

        def check(rule=rule, literal=literal, report=report, threshold=threshold) -> None:
            mine, added = rule.fit(space, shown), literal.learn(bins, levels, threshold)
            assert added == report.new + report.re_added
            assert torch.equal(mine.program.float(), plain(literal.program))
            assert torch.equal(mine.known.float(), plain(literal.known))

        yield Case(
            f"Algorithm 1, {'literal clip' if clip else 'raw sum'}",
            f"N={count} d={dim}",
            lambda _, rule=rule: rule.fit(space, shown),
            {"literal loop on torchhd": lambda _, p=literal, t=threshold: p.learn(bins, levels, t)},
            check,
            more={"added": report.new, "added_again": report.re_added},
        )
