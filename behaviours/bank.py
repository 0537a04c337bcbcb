"""Several named behaviours over one space of codebooks."""

from collections.abc import Iterator
from pathlib import Path

from torch import nn

from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.learning import OneShot, Rule, check_rule
from behaviours.progress import Progress, silent
from behaviours.report import LearningReport
from behaviours.space import Space
from behaviours.storage import load_tensors, save_tensors


class BehaviourBank(nn.Module):
    """Behaviours by name, each learned from its own demonstrations, in the order in which they were learned.

    They share the codebooks of `space`, so that their programs can be added.
    """

    def __init__(self, space: Space) -> None:
        super().__init__()
        self.space = space
        self.behaviours = nn.ModuleDict()

    def learn(
        self, name: str, demonstrations: Demonstrations, rule: Rule | None = None, progress: Progress = silent
    ) -> LearningReport:
        """Learn a behaviour (with `OneShot()`, if no rule is given) and keep it under `name`.

        An existing behaviour of that name is replaced. Says what the rule did with the samples; `progress` is called
        with the share of the work that is done.
        """
        behaviour = (rule or OneShot()).fit(self.space, demonstrations, progress)
        self.add(name, behaviour)
        return behaviour.report

    def partial_fit(
        self, name: str, demonstrations: Demonstrations, rule: Rule, progress: Progress = silent
    ) -> LearningReport:
        """Go on learning the behaviour `name` from a further piece of demonstration, or begin it with its first.

        Says what became of all pieces so far. `progress` is called with the share of the work that is done. Raises
        `ValueError` for rules that cannot go on, see `Rule.partial_fit`.
        """
        check_rule(rule)
        if name not in self:
            return self.learn(name, demonstrations, rule, progress)
        behaviour = rule.partial_fit(self[name], demonstrations, progress)
        self.add(name, behaviour)
        return behaviour.report

    def add(self, name: str, behaviour: Behaviour) -> None:
        """Keep a behaviour that was learned over this bank's space."""
        if not name or "." in name:
            raise ValueError(f"a behaviour's name is not empty and has no dot; got {name!r}")
        if behaviour.space is not self.space:
            raise ValueError(f"behaviour {name!r} was learned over another space; its program cannot join this bank")
        self.behaviours[name] = behaviour

    @property
    def names(self) -> list[str]:
        """The names, in the order in which they were learned."""
        return list(self.behaviours)

    def __getitem__(self, name: str) -> Behaviour:
        if name not in self.behaviours:
            raise KeyError(f"no behaviour {name!r} in this bank; it holds {', '.join(self.names) or 'none'}")
        behaviour = self.behaviours[name]
        assert isinstance(behaviour, Behaviour)
        return behaviour

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.behaviours)

    def save(self, path: str | Path) -> Path:
        """Write codebooks and programs to one safetensors file, whole or not at all."""
        tensors = {f"space.{key}": value for key, value in self.space.state_dict().items()}
        for name in self:
            behaviour = self[name]
            parts = {"program": behaviour.program, "known": behaviour.known, "results": behaviour.results}
            tensors |= {f"behaviours.{name}.{key}": tensor for key, tensor in parts.items()}
        about = {
            "space": self.space.config(),
            "behaviours": {name: self[name].report.to_dict() for name in self},
        }
        return save_tensors(path, "bank", tensors, about)

    @classmethod
    def load(cls, path: str | Path) -> "BehaviourBank":
        """Read what `save` wrote."""
        tensors, about = load_tensors(path, "bank")
        try:
            space = Space.from_config(about["space"])
            space.load_state_dict({k.removeprefix("space."): v for k, v in tensors.items() if k.startswith("space.")})
            bank = cls(space)
            for name, report in about["behaviours"].items():
                parts = (tensors[f"behaviours.{name}.{key}"] for key in ("program", "known", "results"))
                bank.add(name, Behaviour(space, *parts, report=LearningReport(**report)))
        except (KeyError, TypeError, ValueError, AttributeError, RuntimeError) as error:
            raise ValueError(f"{path} does not describe a bank of this version: {error}") from error
        return bank
