"""Algorithm 2 for any architecture, one query at a time and one step after the other, with nothing folded.

Answers are compared by cosines in float64; the operations are the architecture's own.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from behaviours import Behaviour


def wide(x: Tensor) -> NDArray[np.complex128]:
    """Any hypervector as complex numbers; a set bit counts as -1."""
    numbers = x.resolve_conj().numpy()
    return np.where(numbers, -1, 1).astype(complex) if x.dtype == torch.bool else numbers.astype(complex)


def cosine(a: Tensor, b: Tensor) -> float:
    x, y = wide(a), wide(b)
    lengths = float(np.linalg.norm(x) * np.linalg.norm(y))
    return float(np.vdot(y, x).real) / lengths if lengths > 0 else 0.0


class Found(NamedTuple):
    winner: int
    similarity: float
    margin: float


def clean_up(items: Tensor, noisy: Tensor) -> Found:
    cosines = np.array([cosine(noisy, item) for item in items])
    index = int(cosines.argmax())
    others = np.delete(cosines, index)
    return Found(index, cosines[index], cosines[index] - others.max() if others.size else math.inf)


class Answer(NamedTuple):
    commands: list[float]
    similarity: float
    margin: float
    familiarity: float


def query(behaviour: Behaviour, reading: list[float]) -> Answer:
    space, vsa = behaviour.space, behaviour.space.vsa
    bins = space.cells([reading])[0].tolist()
    record: Any = space.encoder
    bound = [vsa.bind(record.codes[b], record.roles[i]) for i, b in enumerate(bins) if b >= 0]
    protected = space.protect(vsa.bundle(torch.stack(bound)))  # 1
    noisy = vsa.unbind(behaviour.program, protected)  # 2
    stored = space.items(behaviour.results)
    found = clean_up(stored, noisy)  # 3
    result = stored[found.winner]
    commands = []
    for i, actuator in enumerate(space.schema.actuators):  # 4
        levels = list(dict.fromkeys(behaviour.results[:, i].tolist()))
        noisy_value = vsa.unbind(result, space.result_encoder.roles[i])  # 5
        level = levels[clean_up(space.result_encoder.codes[levels], noisy_value).winner]  # 6
        commands.append(actuator.low + (actuator.high - actuator.low) * level / (actuator.levels - 1))  # 7
    return Answer(commands, found.similarity, found.margin, cosine(protected, behaviour.known))
