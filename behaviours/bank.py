"""A collection of named behaviours over one space."""

from collections.abc import Iterator, Mapping, Sequence, Sized
from functools import partial
from pathlib import Path
from typing import Any, cast

import torch
from jaxtyping import Shaped
from torch import Tensor, nn

from behaviours.bank_files import LEAST, check_name, load_behaviours, save_behaviours
from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.learning import ErrorDriven, Gradient, Rule, require_rule
from behaviours.progress import Progress, no_progress, subrange
from behaviours.recall import Recall, over_unique_rows
from behaviours.report import LearningReport
from behaviours.space import Space, conditions_of
from torchvsa._blocks import by_blocks


class BehaviourBank(nn.Module):
    """A mapping from names to behaviours, in the order in which they were learned.

    All behaviours share the codebooks of `space`, so that their programs can be added.
    """

    def __init__(self, space: Space) -> None:
        super().__init__()
        self.space = space
        # A list, since submodules cannot have every name that a behaviour can.
        self._names: list[str] = []
        self._behaviours = nn.ModuleList()

    def learn(
        self,
        name: str,
        demonstrations: Demonstrations,
        rule: Rule | None = None,
        progress: Progress = no_progress,
        silent: Demonstrations | None = None,
        sensors: Sequence[str] | None = None,
    ) -> LearningReport:
        """Learn a behaviour and keep it under `name`, where it replaces an existing one.

        Args:
            name: Any string that is not empty.
            demonstrations: What to learn.
            rule: The learning rule; by default `Gradient()`.
            progress: Called with the completed fraction of the work, from 0 to 1.
            silent: Readings on which the behaviour is to have no opinion, see `Rule.fit_beside`.
            sensors: The names of the sensors that the behaviour uses, by default all; see `Space.using`.

        Returns:
            What the rule did with the samples.

        Raises:
            ValueError: For `silent` with a rule that cannot keep silence.
        """
        check_name(name)
        rule = Gradient() if rule is None else rule
        require_rule(rule)
        space = self.space if sensors is None else self.space.using(sensors)
        if silent is None:
            behaviour = rule.fit(space, demonstrations, progress)
        else:
            behaviour = rule.fit_beside(space, demonstrations, silent, progress)
        behaviour.calibrate(demonstrations)
        self.add(name, behaviour)
        return self[name].report

    def learn_apart(
        self,
        shown: Mapping[str, Demonstrations],
        rule: Rule | Mapping[str, Rule] | None = None,
        silence: bool = True,
        sensors: Mapping[str, Sequence[str]] | None = None,
        progress: Progress = no_progress,
    ) -> None:
        """Learn several behaviours so that their plain sum answers as if it had been learned from all of them at once.

        Each is learned from its own demonstrations. With `silence` it is also told which conditions the others know,
        but never their commands, and learns to have no opinion there; ties between behaviours that know the same
        condition are decided by `evidence` (see `ErrorDriven`), and by a louder `margin` of those that take precedence.

            rule = ErrorDriven(margin=5, evidence=1)
            bank.learn_apart(shown, {"seek": rule, "avoid": replace(rule, margin=8)})
            both = bank["seek"] + bank["avoid"]

        Args:
            shown: The demonstrations of each behaviour, by name.
            rule: One rule, or one for each name; by default `ErrorDriven(margin=5, evidence=1)`.
            silence: Whether each behaviour is silent on conditions that only others know.
            sensors: The sensors that a behaviour uses, by its name; all for those that are not named.
            progress: Called with the completed fraction of the work, from 0 to 1.
        """
        rules = rule if isinstance(rule, Mapping) else dict.fromkeys(shown, rule or ErrorDriven(margin=5, evidence=1))
        if missing := [name for name in shown if name not in rules]:
            raise ValueError(f"there is no rule for {missing[0]!r}; the rules are for {', '.join(rules)}")
        for number, (name, own) in enumerate(shown.items()):
            others = [part for other, part in shown.items() if other != name]
            silent = Demonstrations.join(others) if silence and others else None
            part = subrange(progress, number / len(shown), (number + 1) / len(shown))
            self.learn(name, own, rules[name], part, silent, None if sensors is None else sensors.get(name))

    def partial_fit(
        self, name: str, demonstrations: Demonstrations, rule: Rule, progress: Progress = no_progress
    ) -> LearningReport:
        """Learn further demonstrations with the behaviour `name`, or the first ones if there is none of that name.

        Args:
            name: The name of the behaviour.
            demonstrations: The further demonstrations.
            rule: The learning rule, which may differ from earlier ones.
            progress: Called with the completed fraction of the work, from 0 to 1.

        Returns:
            What became of the samples of all calls so far.

        Raises:
            ValueError: If the rule cannot continue from a behaviour, see `Rule.partial_fit`.
        """
        require_rule(rule)
        if name not in self:
            return self.learn(name, demonstrations, rule, progress)
        before = self[name]
        behaviour = rule.partial_fit(before, demonstrations, progress)
        behaviour.calibrate(demonstrations)
        for least in LEAST:
            values = getattr(before, least), getattr(behaviour, least)
            if None not in values:
                setattr(behaviour, least, min(values))
        self.add(name, behaviour)
        return behaviour.report

    def add(self, name: str, behaviour: Behaviour) -> None:
        """Keep a behaviour that was learned over this bank's space, or over one with equal codebooks.

        A behaviour over an equal space (a copy, or of another process) is kept as one over this bank's space. Raises
        `ValueError` for a behaviour over other codebooks.
        """
        check_name(name)
        if not self.space.same_as(behaviour.space):
            raise ValueError(
                f"behaviour {name!r} was learned over another space (other sensors, codes or seed), so "
                "that it cannot join this bank"
            )
        if behaviour.space is not self.space and behaviour.space.encoder is not self.space.encoder:
            behaviour = behaviour.over(self.space)
        behaviour.name = name
        if name in self._names:
            self._behaviours[self._names.index(name)] = behaviour
        else:
            self._names.append(name)
            self._behaviours.append(behaviour)

    def forward(self, readings: Any) -> dict[str, Recall]:
        """The answer of each behaviour to readings `[B, n]`, by name. Conditions are encoded once."""
        return self.answer(self.space.cells(readings))

    def start(self, episodes: Sized) -> Any:
        """The state before the first step of these episodes, see `Controller.start`."""
        return self.space.start(len(episodes))

    def step(self, readings: Any, state: Any) -> tuple[dict[str, Recall], Any]:
        """The answer of each behaviour by name, and the next state; see `Controller.step`."""
        cells, state = self.space.step(readings, state)
        return self.answer(cells), state

    def answer(self, cells: Shaped[Tensor, "batch w"]) -> dict[str, Recall]:
        """The answer of each behaviour, by name, to cells as `Space.cells` returns them."""
        if not len(self):
            return {}
        recall = over_unique_rows(partial(by_blocks, self._query_all, row_bytes=8 * self.space.vsa.dim), cells)
        commands, similarity, margin, familiarity, _ = recall
        # The second dimension is that of the behaviours.
        columns = zip(*(field.unbind(1) for field in (commands, similarity, margin, familiarity)), strict=True)
        return {
            name: Recall(*column).mask_unobserved((self[name].space.seen(cells) < 0).all(-1))
            for name, column in zip(self, columns, strict=True)
        }

    def _query_all(self, cells: Shaped[Tensor, "batch w"]) -> Recall:
        behaviours = [self[name] for name in self]
        conditions = conditions_of([part.space for part in behaviours], cells)
        answers = [part.query(condition) for part, condition in zip(behaviours, conditions, strict=True)]
        return Recall(*(torch.stack([getattr(answer, f) for answer in answers], 1) for f in Recall._fields[:4]))

    @property
    def names(self) -> list[str]:
        """The names of the behaviours, in the order in which they were learned."""
        return list(self._names)

    def __getitem__(self, name: str) -> Behaviour:
        if name not in self._names:
            raise KeyError(f"no behaviour {name!r} in this bank; it holds {', '.join(self.names) or 'none'}")
        return cast(Behaviour, self._behaviours[self._names.index(name)])

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        schema = self.space.schema
        head = f"d={self.space.vsa.dim}, {len(schema.sensors)} sensors, {len(schema.actuators)} actuators"
        return "\n  ".join([f"BehaviourBank({head})", *(repr(self[name]) for name in self)])

    def save(self, path: str | Path) -> Path:
        """Write codebooks and programs to one safetensors file, completely or not at all.

        The same bank gives the same bytes. Raises `ValueError` for what `load` would refuse: programs that are not
        finite, and codebooks of another type than the architecture's (as after `.half()`).
        """
        return save_behaviours(path, self.space, {name: self[name] for name in self})

    @classmethod
    def load(cls, path: str | Path) -> "BehaviourBank":
        """Read a file that `save` wrote.

        All tensors are compared with the description before any object is created. Raises `ValueError` that names the
        file and what in it is wrong.
        """
        space, behaviours = load_behaviours(path)
        bank = cls(space)
        for name, behaviour in behaviours.items():
            bank.add(name, behaviour)
        return bank
