"""Combine behaviours in a sequence: contexts that are chained by transitions."""

from collections.abc import Mapping, Sequence, Sized
from typing import Any

import torch
from jaxtyping import Int64, Shaped
from torch import Tensor

from behaviours.algebra import weighted_sum
from behaviours.bank import BehaviourBank
from behaviours.composition.base import threshold_of
from behaviours.composition.choosing import naming_space, numbered, with_length
from behaviours.composition.gated import Gated
from behaviours.demonstrations import Demonstrations
from behaviours.learning import ErrorDriven, Rule, require_rule
from behaviours.recall import Recall, over_unique_rows
from torchvsa._blocks import by_blocks
from torchvsa._numerics import is_integer

Transitions = Mapping[tuple[str, str], Any]
"""Readings `[N, n]`, or demonstrations, by (name of the behaviour that has the floor, name of the next one)."""


class Sequencing(Gated):
    """Contexts chained by transitions, all in one vector: V = Σ bind(pᵢ, contextᵢ) + bind(T, tag).

    One behaviour has the floor; the first one of the bank begins. In each step T answers the name of the next behaviour
    for the pair (context, condition), that behaviour gets the floor, and is asked with its context. T is the sum of one
    program per context, T = Σ bind(Tᵢ, contextᵢ); Tᵢ is scaled to the length of the longest pᵢ, and rounded to
    integers if all pᵢ are integers.

        Sequencing(bank, {
            ("seek blue", "seek blue"): on_the_way,        # readings at which it goes on
            ("seek blue", "seek yellow"): at_the_lamp,     # readings at which it hands over
        })

    A behaviour without transitions keeps the floor. Behaviours may use different sensors; Tᵢ uses those of behaviour i.

    Without `transitions` there is no T: a behaviour keeps the floor while it knows the condition (its familiarity
    reaches its `threshold`; where that is unknown, half of 1/√k for k pairs), then hands over to the one that knows it
    best, by familiarity times √k.

    The state per robot is the past of the encoder and the index of the behaviour that has the floor. `forward` answers
    as the first step of an episode.

    Args:
        bank: The behaviours to combine.
        transitions: Readings, or demonstrations, at which to hand over, by (from, to); (name, name) are those at which
            a behaviour goes on, which one that hands over needs, such as its own demonstrations.
        rule: How T is learned; by default `ErrorDriven(margin=5)`.
        seed: Seed of contexts, tag and names.

    Raises:
        ValueError: For names that the bank does not have, and for a behaviour that hands over but is not told when to
            go on.

    Source: Levy et al. 2013, "Learning behavior hierarchies via high-dimensional sensor projection"; sequences of
    items bound to states, Osipov et al. 2017, "Associative synthesis of finite state automata model of a controlled
    object with hyperdimensional computing".
    """

    name_items: Tensor
    follows: Tensor
    _thresholds: Tensor

    def __init__(
        self, bank: BehaviourBank, transitions: Transitions | None = None, rule: Rule | None = None, seed: int = 0
    ) -> None:
        super().__init__(bank, seed)
        vsa, device, count = self.space.vsa, self.space.device, len(self.names)
        rule = ErrorDriven(margin=5) if rule is None else rule
        require_rule(rule)
        shown = _by_source(transitions or {}, self.names)
        space = naming_space(self.space, count, seed)
        follows = torch.zeros(count, count, dtype=torch.bool)
        longest, exact = self.longest(), is_integer(self.program)
        bound = []
        for source, labelled in shown.items():
            follows[source, labelled.commands[:, 0].long()] = True
            learned = rule.fit(space.using(self.parts[source].space.sensors), labelled)
            bound.append(vsa.bind(with_length(learned.program.detach(), longest, exact), self.contexts[source]))
        self.chained = bool(bound)
        """Whether there are transitions."""
        self.draw_tag(seed)
        self.register_buffer("follows", follows.to(device))
        self.register_buffer("name_items", space.items(torch.arange(count, device=device)[:, None]))
        if bound:
            self.add_tagged(weighted_sum(vsa, [1] * len(bound), bound))
        thresholds = [threshold_of(part) for part in self.parts]
        self.register_buffer("_thresholds", torch.tensor(thresholds, device=device), persistent=False)

    def start(self, episodes: Sized) -> Any:
        """The past readings, and the index of the first behaviour, for each robot."""
        return super().start(episodes), torch.zeros(len(episodes), dtype=torch.int64, device=self.space.device)

    def step(self, readings: Any, state: Any) -> tuple[Recall, Any]:
        """The answer of the behaviour that gets the floor, and the state after it."""
        past, floor = state
        cells, past = self.space.step(readings, past)
        recall = over_unique_rows(self._answer_at, torch.cat([cells, floor[:, None].to(cells.dtype)], 1))
        assert recall.speaker is not None
        blind = (cells < 0).all(-1)
        return recall.mask_unobserved(blind), (past, torch.where(blind, floor, recall.speaker))

    def _answer_at(self, rows: Shaped[Tensor, "batch w+1"]) -> Recall:
        """The answers to cells followed by the behaviour that has the floor."""
        return by_blocks(
            lambda block: self.query(self.conditions(block[:, :-1]), block[:, -1].long()),
            rows,
            row_bytes=self.space.vsa.row_bytes,
        )

    def query(
        self, conditions: Sequence[Shaped[Tensor, "batch d"]], floor: Int64[Tensor, "batch"] | None = None
    ) -> Recall:
        """See `Policy.query`; `floor` has the floor before the step, by default the first behaviour."""
        if floor is None:
            floor = torch.zeros(len(conditions[0]), dtype=torch.int64, device=self.space.device)
        answers = [self._answer_of(number, condition) for number, condition in enumerate(conditions)]
        return self.spoken(answers, self.following(conditions, answers, floor))

    def following(
        self,
        conditions: Sequence[Shaped[Tensor, "batch d"]],
        answers: Sequence[Recall],
        floor: Int64[Tensor, "batch"],
    ) -> Int64[Tensor, "batch"]:
        """The behaviour that gets the floor after `floor`."""
        if self.chained:
            named = torch.stack([self._named_by(number, condition) for number, condition in enumerate(conditions)])
            return named.gather(0, floor[None])[0]
        familiar = torch.stack([recall.familiarity for recall in answers]).gather(0, floor[None])[0]
        return torch.where(familiar >= self._thresholds[floor], floor, self.known(answers).argmax(-1))

    def _named_by(self, number: int, condition: Shaped[Tensor, "batch d"]) -> Int64[Tensor, "batch"]:
        """The behaviour that T names after behaviour `number`."""
        if not self.follows[number].any():
            return torch.full((len(condition),), number, device=condition.device)
        vsa = self.space.vsa
        program = vsa.unbind(vsa.unbind(self.program, self.tag), self.contexts[number])
        scores = vsa.readout(program, self.name_items)(condition)
        likeness, name = scores.masked_fill(~self.follows[number], -torch.inf).max(-1)
        # A condition without observed sensors is similar to nothing.
        return torch.where(likeness > 0, name, number)


def _by_source(transitions: Transitions, names: Sequence[str]) -> dict[int, Demonstrations]:
    """For each behaviour with transitions its readings, with the number of the next behaviour as the command."""
    if not isinstance(transitions, Mapping):
        raise TypeError(f"transitions map (from, to) to readings, as in {_EXAMPLE}; got {transitions!r:.80}")
    found: dict[int, list[tuple[Demonstrations, int]]] = {}
    for key, readings in transitions.items():
        if not isinstance(key, tuple) or len(key) != 2 or not set(key) <= set(names):
            raise ValueError(
                f"a transition is between two behaviours of the bank, as in {_EXAMPLE}; got {key!r}, and the bank "
                f"holds {', '.join(names)}"
            )
        source, target = map(names.index, key)
        found.setdefault(source, []).append((_demonstrations(readings), target))
    for name in dict.fromkeys(source for source, _ in transitions):
        if (name, name) not in transitions:
            raise ValueError(
                f"{name!r} hands over, but is not told when to go on; give such readings too, as in "
                f"{{({name!r}, {name!r}): its own demonstrations}}"
            )
    return {source: numbered(parts) for source, parts in found.items()}


def _demonstrations(readings: Any) -> Demonstrations:
    """Readings as demonstrations, each row as an episode of its own."""
    if isinstance(readings, Demonstrations):
        return readings
    count = len(readings)
    return Demonstrations(readings, torch.zeros(count, 1), torch.arange(count))


_EXAMPLE = "{('seek', 'dock'): readings}"
