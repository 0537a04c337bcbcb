"""Algorithms 1 and 2 of the paper, sample by sample and line by line, in plain NumPy.

Slow, literal, and to be believed. It takes only the random codebooks from the library and knows no other part
of it. Architecture: MAP-C in integers. Numbers in comments are lines of the algorithm at hand.
"""

import math
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from behaviours import Space
from torchvsa import FixedShift, SelfShift

Vector = NDArray[np.int64]


def bind(a: Vector, b: Vector) -> Vector:
    return a * b


def bundle(*vectors: Vector) -> Vector:
    return np.clip(np.sum(vectors, axis=0), -1, 1)


def shift(x: Vector, width: int) -> Vector:
    return np.roll(x, width)


def cosine(a: Vector, b: Vector) -> float:
    lengths = math.sqrt(int(a @ a)) * math.sqrt(int(b @ b))
    return int(a @ b) / lengths if lengths > 0 else 0.0


@dataclass
class Encoder:
    """Line 1 of Algorithm 1: random hypervectors for sensors, actuators and their values; encode and decode."""

    sensor: Vector
    sensor_value: Vector
    actuator: Vector
    actuator_value: Vector
    sensor_range: list[tuple[float, float]]
    actuator_range: list[tuple[float, float, int]]
    combine: str
    protection: str
    h: Vector | None = None
    fixed: int = 0

    @classmethod
    def of(cls, space: Space) -> "Encoder":
        def numbers(tensor) -> Vector:
            return tensor.numpy().astype(np.int64)

        protection, h, fixed = "none", None, 0
        if isinstance(space.protect, SelfShift):
            protection, h = space.protect.width_rule, numbers(space.protect.h)
        elif isinstance(space.protect, FixedShift):
            protection, fixed = "fixed", space.protect.shift
        return cls(
            numbers(space.encoder.roles),
            numbers(space.encoder.codes),
            numbers(space.result_encoder.roles),
            numbers(space.result_encoder.codes),
            [(s.low, s.high) for s in space.schema.sensors],
            [(a.low, a.high, a.levels) for a in space.schema.actuators],
            space.encoder.name,
            protection,
            h,
            fixed,
        )

    @property
    def dim(self) -> int:
        return self.sensor.shape[1]

    def encode_sensor(self, i: int, reading: float) -> Vector:
        low, high = self.sensor_range[i]
        bins = len(self.sensor_value)
        place = (reading - low) * bins / (high - low)
        if math.isclose(place, round(place), rel_tol=2.0**-50):  # on an edge, up to rounding
            place = round(place)
        return self.sensor_value[min(math.floor(place), bins - 1)]

    def encode_actuator(self, i: int, command: float) -> Vector:
        low, high, levels = self.actuator_range[i]
        return self.actuator_value[math.floor((command - low) / (high - low) * (levels - 1) + 0.5)]

    def decode_actuator(self, i: int, code: Vector) -> float:
        low, high, levels = self.actuator_range[i]
        level = next(index for index, value in enumerate(self.actuator_value) if np.array_equal(value, code))
        return low + (high - low) * level / (levels - 1)

    def condition(self, sensors: list[float]) -> Vector:
        parts = [
            (i, bind(self.sensor[i], self.encode_sensor(i, reading)))
            for i, reading in enumerate(sensors)
            if not math.isnan(reading)  # not observed: left out
        ]
        if self.combine == "sum":
            return bundle(*(part for _, part in parts))
        # Binding commutes: each sensor's part is rotated by its place, or nobody could tell whose it is.
        product = np.ones(self.dim, np.int64)
        for i, part in parts:
            product = bind(product, shift(part, i))
        return product

    def result(self, commands: list[float]) -> Vector:
        return bundle(*(bind(self.actuator[i], self.encode_actuator(i, a)) for i, a in enumerate(commands)))

    def protect(self, x: Vector) -> Vector:
        if self.protection == "none":
            return x
        if self.protection == "fixed":
            return shift(x, self.fixed)
        assert self.h is not None
        width = self.width(x)
        return bundle(shift(x, width), shift(self.h, width))

    def width(self, x: Vector) -> int:
        indices = [index for index, value in enumerate(x.tolist()) if value > 0]
        if not indices:
            return 0
        if self.protection == "sum":
            return sum(indices) % self.dim
        return math.floor(Fraction(sum(indices), len(indices)) + Fraction(1, 2))


def add_to_cum(memory: list[Vector], item: Vector) -> None:
    """A clean-up memory is a set in order of first insertion."""
    if not any(np.array_equal(item, other) for other in memory):
        memory.append(item)


def query_cum(memory: list[Vector], noisy: Vector) -> tuple[int, float, float]:
    """Index, similarity and margin of the most similar item; equals go to the lowest index."""
    scores = np.array([int(noisy @ item) / math.sqrt(int(item @ item)) if item.any() else 0.0 for item in memory])
    index, length = int(np.argmax(scores)), math.sqrt(int(noisy @ noisy))
    others = np.delete(scores, index)
    if length == 0:
        return index, 0.0, 0.0 if others.size else math.inf
    return index, scores[index] / length, (scores[index] - others.max()) / length if others.size else math.inf


@dataclass
class Learned:
    """What Algorithm 1 leaves behind, and how often it decided what."""

    prog_hv: Vector
    known_cond_hv: Vector
    results: list[Vector] = field(default_factory=list)
    values: list[list[Vector]] = field(default_factory=list)
    new: int = 0
    truly_known: int = 0
    falsely_known: int = 0
    re_added: int = 0
    contradicting: int = 0


def learn(
    encoder: Encoder,
    sensors: list[list[float]],
    commands: list[list[float]],
    novelty: str = "exact",
    threshold: float = math.nan,
    clip_each_step: bool = False,
) -> Learned:
    """Algorithm 1. Without the literal clip the program stays a raw sum."""
    zero = np.zeros(encoder.dim, np.int64)
    learned = Learned(zero, zero, values=[[] for _ in encoder.actuator])
    stored: list[tuple[Vector, Vector]] = []

    def append(total: Vector, term: Vector) -> Vector:
        return bundle(total, term) if clip_each_step else total + term

    for s, a in zip(sensors, commands, strict=True):  # 2
        condition_hv = encoder.condition(s)  # 3
        result_hv = encoder.result(a)  # 4
        protected = encoder.protect(condition_hv)
        if novelty == "exact":
            dissimilar = not any(np.array_equal(protected, condition) for condition, _ in stored)
        else:
            dissimilar = not stored or cosine(learned.known_cond_hv, protected) <= threshold

        before = [result for condition, result in stored if np.array_equal(protected, condition)]
        learned.new += dissimilar and not before
        learned.re_added += dissimilar and bool(before)
        learned.truly_known += not dissimilar and bool(before)
        learned.falsely_known += not dissimilar and not before
        learned.contradicting += bool(before) and not np.array_equal(before[0], result_hv)

        if dissimilar:  # 5
            learned.prog_hv = append(learned.prog_hv, bind(protected, result_hv))  # 6
            learned.known_cond_hv = append(learned.known_cond_hv, protected)  # 7
            add_to_cum(learned.results, result_hv)  # 8
            for i in range(len(encoder.actuator)):  # 9
                # 10, but for actuator_i ⊗ encode(a_i), which Algorithm 2 looks up unbound.
                add_to_cum(learned.values[i], encoder.encode_actuator(i, a[i]))
            stored.append((protected, result_hv))
    return learned


@dataclass
class Answer:
    commands: list[float]
    similarity: float
    margin: float
    familiarity: float


def query(encoder: Encoder, learned: Learned, sensors: list[float]) -> Answer:
    """Algorithm 2."""
    if all(math.isnan(reading) for reading in sensors):
        return Answer([math.nan] * len(encoder.actuator), 0.0, 0.0, 0.0)
    protected = encoder.protect(encoder.condition(sensors))  # 1
    result_hv_noisy = bind(protected, learned.prog_hv)  # 2
    index, similarity, margin = query_cum(learned.results, result_hv_noisy)
    result_hv = learned.results[index]  # 3
    commands = []
    for i, actuator in enumerate(encoder.actuator):  # 4
        command_hv_noisy = bind(actuator, result_hv)  # 5
        command_hv = learned.values[i][query_cum(learned.values[i], command_hv_noisy)[0]]  # 6
        commands.append(encoder.decode_actuator(i, command_hv))  # 7
    return Answer(commands, similarity, margin, cosine(protected, learned.known_cond_hv))
