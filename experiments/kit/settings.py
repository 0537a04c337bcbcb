"""Typed settings: each field with its meaning and what is allowed, declared once.

A study's settings are a dataclass whose fields are made with `setting` or `part`:

    @dataclass
    class Settings(kit.Settings):
        dims: list[int] = setting([500, 1000], "dimensions of the hypervectors", low=1, distinct=True)
        vsa: Part = part("vsa", "map_c", "the architecture")

Hydra checks names and types; `check` checks the rest. `--help` and the docs show what is declared here.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

MOST = 2**31 - 1
"""The largest whole number of any setting. Every library takes it, as a seed, too."""

Part = Any
"""The type of a field that holds the chosen option of a config group: a mapping with a `name` and its options."""

Choices = Iterable[object] | Callable[[], Iterable[object]]


def setting(
    default: Any,
    about: str,
    *,
    low: float | None = None,
    high: float | None = None,
    above: float | None = None,
    below: float | None = None,
    choices: Choices | None = None,
    distinct: bool = False,
    empty: bool = False,
) -> Any:
    """A field of a dataclass of settings.

    Args:
        default: its value if nobody gives another.
        about: what it means, in one line, with its unit.
        low, high: the smallest and largest number allowed; in a list, of each entry.
        above, below: numbers that are themselves too small or too large.
        choices: the values allowed, or a function that lists them; in a list, of each entry.
        distinct: whether a list may name nothing twice.
        empty: whether a list may be empty.
    """
    allowed = {"low": low, "high": high, "above": above, "below": below, "choices": choices}
    metadata = {"about": about, "allowed": allowed, "distinct": distinct, "empty": empty}
    if isinstance(default, list | dict):
        return dataclasses.field(default_factory=lambda: type(default)(default), metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def part(group: str, option: str | None, about: str) -> Any:
    """A field that holds the chosen option of a config group; `option` is the default one."""
    return dataclasses.field(default=None, metadata={"about": about, "group": group, "option": option})


def named_parts(group: str, options: Mapping[str, str]) -> type:
    """A dataclass with a field for each of these options of a config group, which map names to meanings."""
    fields = [(name, Part, part(group, name, about)) for name, about in options.items()]
    return dataclasses.make_dataclass(f"{group}_parts", fields)


def settings(cls: type, about: str) -> Any:
    """A field that holds further settings, of the dataclass `cls`."""
    return dataclasses.field(default_factory=cls, metadata={"about": about, "settings": cls})


@dataclass
class Settings:
    """What every study can be told."""

    seed: int = setting(0, "seed of everything that is drawn", low=0)
    workers: int = setting(2, "processes that work side by side; no result depends on it", low=1, high=1000)
    fresh: bool = setting(False, "begin anew, also where an earlier run of these settings can go on")


NO_MATTER = ("workers", "fresh")
"""Settings on which no result depends."""


class Described(NamedTuple):
    """One setting, for people: its name as on the command line, its default, its meaning, and what is allowed."""

    name: str
    default: str
    about: str
    allowed: str


def described(cls: type, prefix: str = "") -> Iterator[Described]:
    """All settings of a dataclass, those that it inherits last, each with the fields of nested ones after it."""
    inherited = {field.name for field in dataclasses.fields(Settings)}
    fields = sorted(dataclasses.fields(cls), key=lambda field: not prefix and field.name in inherited)
    for field in fields:
        name, metadata = prefix + field.name, field.metadata
        if "settings" in metadata:
            yield Described(name, "", metadata["about"], "")
            yield from described(metadata["settings"], f"{name}.")
        elif "group" in metadata:
            yield Described(name, str(metadata["option"]), metadata["about"], f"an option of {metadata['group']}")
        else:
            default = field.default if field.default is not dataclasses.MISSING else field.default_factory()  # pyright: ignore[reportCallIssue] (one of the two is there)
            yield Described(name, written(default), metadata["about"], _allowed(metadata["allowed"]))


def check(given: object, prefix: str = "") -> None:
    """Raise `ValueError`, naming the setting, its value and what is allowed, unless all settings are allowed."""
    for field in dataclasses.fields(given):  # pyright: ignore[reportArgumentType] (a dataclass)
        name, value, metadata = prefix + field.name, getattr(given, field.name), field.metadata
        if "settings" in metadata and value is None:
            raise ValueError(f"{name}=null: it holds settings; write {name}.setting=value")
        if "settings" in metadata:
            check(value, f"{name}.")
        elif "group" in metadata and not isinstance(value, Mapping | None):
            raise ValueError(f"{name}={value}: to choose an option, write {metadata['group']}@{name}={value}")
        elif "group" in metadata and value is None and metadata["option"] is not None:
            raise ValueError(f"{name} is missing; choose an option of {metadata['group']}")
        elif "allowed" in metadata:
            if isinstance(value, list) and "list[list" not in str(field.type) and any(map(_nested, value)):
                raise ValueError(f"{name}={written(value)}: expected a list without lists in it")
            _check(name, value, metadata)


def _check(name: str, value: object, metadata: Mapping[str, Any]) -> None:
    allowed = metadata["allowed"]
    entries = value if isinstance(value, list) else [value]
    choices = None if allowed["choices"] is None else _listed(allowed["choices"])
    for entry in entries:
        if entry is None:
            continue
        if choices is not None and entry not in choices:
            raise ValueError(f"{name}: there is no {entry!r}; choose from {', '.join(map(str, choices))}")
        if isinstance(entry, int) and entry > MOST and allowed["high"] is None:
            raise ValueError(f"{name}={written(value)}: expected at most {MOST}")
        if isinstance(entry, int | float) and not _within(entry, allowed):
            finite = "" if math.isfinite(entry) else "a finite number, "
            raise ValueError(f"{name}={written(value)}: expected {finite}{_expected(allowed)}")
    if not isinstance(value, list):
        return
    if metadata["distinct"]:
        for entry in entries:
            if entries.count(entry) > 1:
                raise ValueError(f"{name} names {entry!r} {entries.count(entry)} times")
    if not entries and not metadata["empty"]:
        what = "name at least one" if choices is None else f"choose from {', '.join(map(str, choices))}"
        raise ValueError(f"{name} is empty; {what}")


def _nested(entry: object) -> bool:
    return isinstance(entry, list | dict)


def _within(number: float, allowed: Mapping[str, Any]) -> bool:
    low, high, above, below = (allowed[end] for end in ("low", "high", "above", "below"))
    return math.isfinite(number) and (
        (low is None or number >= low)
        and (high is None or number <= high)
        and (above is None or number > above)
        and (below is None or number < below)
    )


def _expected(allowed: Mapping[str, Any]) -> str:
    """What is allowed, in words; empty if anything of the type is."""
    if allowed["choices"] is not None:
        return ", ".join(map(str, _listed(allowed["choices"])))
    low, high, above, below = (allowed[end] for end in ("low", "high", "above", "below"))
    if low is not None and high is not None:
        return f"a number from {low:.12g} to {high:.12g}"
    words = [f"{low:.12g} or more"] if low is not None else []
    words += [f"more than {above:.12g}"] if above is not None else []
    words += [f"at most {high:.12g}"] if high is not None else []
    words += [f"less than {below:.12g}"] if below is not None else []
    return " and ".join(words) or "a finite number"


def _allowed(allowed: Mapping[str, Any]) -> str:
    """What is allowed, for people; empty where the type says it all."""
    words = _expected(allowed)
    return "" if words == "a finite number" else words


def _listed(choices: Choices) -> list[object]:
    return list(choices() if callable(choices) else choices)


def written(value: object) -> str:
    """A value as one writes it on the command line."""
    if isinstance(value, list):
        return f"[{','.join(map(written, value))}]"
    if isinstance(value, dict):
        return f"{{{','.join(map(str, value))}}}"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return f"{value:g}" if isinstance(value, float) else str(value)
