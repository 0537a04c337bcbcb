"""Files of banks: one space and named behaviours over it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from behaviours.algebra import terms_from_dicts, terms_to_dicts
from behaviours.behaviour import Behaviour
from behaviours.memory import check_levels
from behaviours.options import as_bool, as_float
from behaviours.report import LearningReport
from behaviours.space import Space
from behaviours.storage import (
    FORMAT,
    SMOOTH,
    Layout,
    check_layout,
    error_context,
    load_tensors,
    save_tensors,
)

_PARTS, LEAST = ("program", "known", "results"), ("threshold", "least_similarity")


def save_behaviours(path: str | Path, space: Space, behaviours: Mapping[str, Behaviour]) -> Path:
    """Write a space and behaviours, see `BehaviourBank.save`."""
    config = space.config()
    tensors = {f"space.{key}": value for key, value in space.state_dict().items()}
    check_layout(tensors, _codebooks(config))
    for number, (name, behaviour) in enumerate(behaviours.items()):
        with error_context(f"behaviour {name!r}"):
            behaviour.check()
        parts = {"program": behaviour.program, "known": behaviour.known, "results": behaviour.results}
        tensors |= {f"behaviours.{number}.{key}": tensor for key, tensor in parts.items()}
    about = {"space": config, "behaviours": [_entry(name, behaviour) for name, behaviour in behaviours.items()]}
    version = SMOOTH if any(behaviour.smooth for behaviour in behaviours.values()) else FORMAT
    return save_tensors(path, "bank", tensors, about, version)


def load_behaviours(path: str | Path) -> tuple[Space, dict[str, Behaviour]]:
    """Read the space and the behaviours of a file, see `BehaviourBank.load`."""
    tensors, about = load_tensors(path, "bank")
    with error_context(f"{path} does not describe a bank of this version"):
        with error_context("behaviours"):
            entries = [(entry["name"], LearningReport(**entry["report"])) for entry in about["behaviours"]]
            terms = [entry.get("terms") for entry in about["behaviours"]]
            used = [entry.get("sensors") for entry in about["behaviours"]]
            smooth = [as_bool("smooth", entry.get("smooth", False)) for entry in about["behaviours"]]
            least = [
                {name: as_float(name, entry[name], -1) for name in LEAST if entry.get(name) is not None}
                for entry in about["behaviours"]
            ]
            for name, _ in entries:
                check_name(name)
            if len({name for name, _ in entries}) < len(entries):
                raise ValueError("two of them have the same name")
        with error_context("space"):
            codebooks = _codebooks(about["space"])
            check_layout(
                {name: tensor for name, tensor in tensors.items() if not name.startswith("behaviours.")}, codebooks
            )
        parts = {f"behaviours.{number}.{key}" for number in range(len(entries)) for key in _PARTS}
        if wrong := sorted(parts ^ (tensors.keys() - codebooks.keys())):
            raise ValueError(f"tensor {wrong[0]!r} is {'missing' if wrong[0] in parts else 'not described'}")
        with error_context("space"):
            space = Space.from_config(
                about["space"], {name.removeprefix("space."): tensors[name] for name in codebooks}
            )
            spaces = [space if sensors is None else space.using(sensors) for sensors in used]
        behaviours = {}
        for number, (name, report) in enumerate(entries):
            with error_context(f"behaviour {name!r}"):
                program, known, results = (tensors[f"behaviours.{number}.{key}"] for key in _PARTS)
                check_levels(space.schema, results)
                parsed = () if terms[number] is None else terms_from_dicts(terms[number], results)
                behaviour = Behaviour(spaces[number], program, known, results, report, parsed, smooth[number])
                vars(behaviour).update(least[number])
            behaviours[name] = behaviour
    return space, behaviours


def _codebooks(config: dict[str, Any]) -> Layout:
    return {f"space.{name}": spec for name, spec in Space.layout(config).items()}


def _entry(name: str, behaviour: Behaviour) -> dict[str, Any]:
    entry = {"name": name, "report": behaviour.report.to_dict()}
    entry |= {name: value for name in LEAST if (value := getattr(behaviour, name)) is not None}
    if len(behaviour.space.sensors) < len(behaviour.space.schema.sensors):
        entry |= {"sensors": list(behaviour.space.sensors)}
    if behaviour.smooth:
        entry |= {"smooth": True}
    # A behaviour that is no sum has no terms to write.
    return entry | ({"terms": terms_to_dicts(behaviour.terms, behaviour.results)} if behaviour.report.terms else {})


def check_name(name: object) -> None:
    """Raise `ValueError` unless `name` is a string that is not empty."""
    if not isinstance(name, str) or not name:
        raise ValueError(f"a behaviour's name is a text that is not empty; got {name!r}")
