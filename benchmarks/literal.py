"""The paper's two algorithms in torchhd's operations: one sample, one step after the other."""

from typing import Any, cast

import torch
import torchhd
from torch import Tensor

from behaviours import Space
from benchmarks.peers import hypervectors, plain
from torchvsa import SelfShift
from torchvsa.encoders import Record


class Literal:
    """Learns and recalls with the codebooks of `space`, in floats; `clip` after every addition, or never."""

    def __init__(self, space: Space, clip: bool) -> None:
        assert isinstance(space.protect, SelfShift)
        record, results = cast(Record, space.encoder), cast(Record, space.result_encoder)
        tables = (record.roles, record.codes, results.roles, results.codes, space.protect.h)
        self.sensors, self.values, self.actuators, self.commands, self.h = map(hypervectors, tables)
        self.index = torch.arange(len(self.h), device=self.h.device)
        self.clip = clip
        self.program: Any = None
        self.known: Any = None
        self.results: Any = None

    def protect(self, x: Any) -> Any:
        """Superpose with h and shift by the mean index of the elements above 0; any batch."""
        mask = plain(x) > 0
        total, count = (mask * self.index).sum(-1), mask.sum(-1)
        widths = (2 * total + count) // (2 * count).clamp(min=1)
        named: Any = torchhd.bundle(x, self.h)
        named = named.clipping(1)
        if x.dim() == 1:
            return torchhd.permute(named, shifts=int(widths))
        return torch.stack(
            [torchhd.permute(row, shifts=width) for row, width in zip(named, widths.tolist(), strict=True)]
        )

    def condition(self, bins: Tensor) -> Any:
        """The protected condition of bins `[..., n]`."""
        record: Any = torchhd.hash_table(self.sensors, self.values[bins])
        return self.protect(record.clipping(1))

    def learn(self, bins: Tensor, levels: Tensor, threshold: float) -> int:
        """Algorithm 1 over samples `[N, n]` and `[N, m]`; returns how many were added."""
        self.program = self.known = None
        results: list[Any] = []
        added = 0
        for sensors, commands in zip(bins, levels, strict=True):
            condition = self.condition(sensors)
            if self.known is not None and torchhd.cosine_similarity(self.known, condition) > threshold:
                continue
            result: Any = torchhd.hash_table(self.actuators, self.commands[commands])
            result = result.clipping(1)
            pair = torchhd.bind(condition, result)
            if self.known is None:
                self.program, self.known = pair, condition
            else:
                self.program, self.known = torchhd.bundle(self.program, pair), torchhd.bundle(self.known, condition)
                if self.clip:
                    self.program, self.known = self.program.clipping(1), self.known.clipping(1)
            if not any(torch.equal(result, other) for other in results):
                results.append(result)
            added += 1
        self.results = torch.stack(results)
        return added

    def recall(self, bins: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Algorithm 2 for bins `[..., n]`: levels `[..., m]`, similarity to the winner, and familiarity."""
        condition = self.condition(bins)
        similarity = torchhd.cosine_similarity(torchhd.bind(condition, self.program), self.results)
        best = similarity.max(-1)
        result = self.results[best.indices]
        levels = [
            torchhd.cosine_similarity(torchhd.bind(actuator, result), self.commands).argmax(-1)
            for actuator in self.actuators
        ]
        familiarity = torchhd.cosine_similarity(condition, self.known[None])[..., 0]
        return plain(torch.stack(levels, -1)), plain(best.values), plain(familiarity)
