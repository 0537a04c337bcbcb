"""Config groups from registries: one typed option per part, its fields and defaults those of the class.

`conf/` adds presets, and options whose values differ from the defaults of a class. Parts are named, never imported:
no config says which code runs.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Literal, Optional, Union, get_args, get_origin

import torch
import yaml
from hydra.core.config_store import ConfigStore

from behaviours import POLICIES, RULES
from experiments.kit.meanings import MEANINGS
from experiments.kit.settings import written
from torchvsa import ARCHITECTURES, PROTECTIONS
from torchvsa.encoders import ENCODERS, VALUE_ENCODERS
from torchvsa.registry import Registry

CONFIGS = Path(__file__).parent / "conf"
"""Presets, and options whose values differ from the defaults of a class."""


@dataclasses.dataclass(frozen=True)
class Group:
    """A config group.

    Attributes:
        parts: what can be chosen, by name: functions, classes, or dataclass objects whose fields are the settings. The
            option's name has `_` for `-` and small letters.
        given: parameters that the run supplies, so that no setting does.
        defaults: values for parameters without a default.
        meanings: of settings, by name, beside those in `kit.meanings`.
        only: whether a part is an option; all are by default.
    """

    parts: Registry[Any] | Mapping[str, Any]
    given: frozenset[str] = frozenset()
    defaults: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    meanings: Mapping[str, str] = dataclasses.field(default_factory=dict)
    only: Callable[[Any], bool] = lambda part: True


def takes(part: Callable[..., object], *names: str) -> bool:
    """Whether a class or function has one of these parameters."""
    return not set(names).isdisjoint(inspect.signature(part).parameters)


GROUPS: dict[str, Group] = {
    "vsa": Group(ARCHITECTURES, frozenset({"variant"}), {"dim": 4000}),
    "encoder": Group(VALUE_ENCODERS, frozenset({"vsa"}), {"bins": 32}),
    "record": Group(
        ENCODERS,
        frozenset({"vsa", "values", "sensors", "edges", "kinds", "bins", "rows"}),
        # What mirrors needs to be told which sensors swap.
        only=lambda part: takes(part, "values", "vsa") and not takes(part, "pairs"),
    ),
    "protection": Group(PROTECTIONS, frozenset({"vsa", "h"})),
    "rule": Group(RULES),
    "composition": Group(POLICIES, frozenset({"bank", "chooser", "transitions", "rule"})),
}
"""The groups of all studies. A task adds its own."""


def option_name(name: str) -> str:
    """The name of a part as an option: `MAP-C` is `map_c`."""
    return name.lower().replace("-", "_")


def options(group: str) -> list[str]:
    """The names of a group's options: its parts, and the presets among the configs."""
    found = GROUPS[group]
    parts = [option_name(name) for name, part in found.parts.items() if found.only(part)]
    presets = sorted(path.stem for path in (CONFIGS / group).glob("*.yaml"))
    return list(dict.fromkeys([*parts, *presets]))


def refuse_no_names(arguments: Iterable[str]) -> None:
    """Raise `ValueError` for an override of a group that names no option; Hydra would not say which group it was."""
    for argument in arguments:
        key, _, value = argument.partition("=")
        group = key.lstrip("+").partition("@")[0]
        if group in GROUPS and re.fullmatch(r"['\"]*|null|true|false|\[.*|[-+.\d].*", value):
            raise ValueError(f"{argument}: expected an option of {group}: {', '.join(options(group))}")


def described_option(group: str, option: str) -> list[tuple[str, str, str]]:
    """The settings of an option, but for its name: name, default and meaning."""
    found, path, changed = GROUPS[group], CONFIGS / group / f"{option}.yaml", {}
    if path.is_file():
        changed = yaml.safe_load(path.read_text())
        (schema,) = changed.pop("defaults")
        option = schema.rpartition("/")[2].partition("@")[0]
    (name,) = (name for name in found.parts if option_name(name) == option)
    meanings = {**MEANINGS, **found.meanings}
    rows = []
    for field in dataclasses.fields(typed(name, found.parts[name], found)):
        if field.name != "name":
            choices = ", ".join(map(str, field.metadata.get("choices", ())))
            about = meanings.get(field.name, "") + (f"; one of {choices}" if choices else "")
            rows.append((field.name, written(changed.get(field.name, field.default)), about))
    return rows


_registered: dict[tuple[str, str], tuple[Group, Any]] = {}
"""What Hydra's store has already, by group and name."""


def register_groups() -> None:
    """Put all options into Hydra's store: under `schema/` for configs to begin with, and in their group without one."""
    store = ConfigStore.instance()
    for group, found in GROUPS.items():
        for name, part in found.parts.items():
            if found.only(part) and _registered.get((group, name)) != (found, part):
                _registered[group, name] = found, part
                node = typed(name, part, found)
                store.store(group=f"schema/{group}", name=option_name(name), node=node)
                if not (CONFIGS / group / f"{option_name(name)}.yaml").is_file():
                    store.store(group=group, name=option_name(name), node=node)


def typed(name: str, part: Any, group: Group) -> type:
    """A dataclass of the settings of a part: its parameters, but for those that are given and its own seed."""
    if dataclasses.is_dataclass(part) and not isinstance(part, type):
        hints = typing.get_type_hints(type(part))
        values = [(field.name, hints[field.name], getattr(part, field.name)) for field in dataclasses.fields(part)]
        return dataclasses.make_dataclass(f"{type(part).__name__}Options", [("name", str, name), *values])
    fields: list[tuple[str, Any, Any]] = [("name", str, dataclasses.field(default=name))]
    hints = _hints(part)
    for key, parameter in inspect.signature(part).parameters.items():
        kind, choices = _kind(hints.get(key, Any))
        default = group.defaults.get(key, parameter.default)
        if key in group.given or kind is None or (key == "seed" and default is None):
            continue
        if default is inspect.Parameter.empty:
            default = None
        if isinstance(default, torch.dtype):
            default = str(default).removeprefix("torch.")
        fields.append((key, kind, dataclasses.field(default=default, metadata={"choices": choices})))
    return dataclasses.make_dataclass(f"{part.__name__ if isinstance(part, type) else name}Options", fields)


def _hints(part: Any) -> dict[str, Any]:
    while hasattr(part, "func"):  # a partial
        part = part.func
    if dataclasses.is_dataclass(part):
        return typing.get_type_hints(part)
    return typing.get_type_hints(part.__init__ if isinstance(part, type) else part)


def _kind(hint: Any) -> tuple[Any, tuple[object, ...]]:
    """A type that Hydra can check, and the values allowed if they are listed; (None, ()) for none that it knows."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Literal:
        return type(arguments[0]), arguments
    if hint is torch.dtype:
        return str, ()
    if hint in (int, float, bool, str):
        return hint, ()
    if origin in (Union, types.UnionType):
        kinds = [_kind(one) for one in arguments if one is not type(None)]
        choices = tuple(choice for _, listed in kinds for choice in listed)
        names = {kind for kind, _ in kinds if kind is not None}
        if len(names) != 1:
            return (Any, ()) if names else (None, ())
        kind = names.pop()
        return (Optional[kind] if type(None) in arguments else kind), choices  # noqa: UP045 (`kind` is known at run time only)
    if isinstance(origin, type) and issubclass(origin, Mapping | Iterable):
        return Any, ()
    return None, ()
