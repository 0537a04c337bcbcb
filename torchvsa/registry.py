"""Registries: classes by name, for settings and files."""

from collections.abc import Iterator, Mapping
from typing import Generic, TypeVar

from torchvsa import plugins

T = TypeVar("T")


class Registry(Mapping[str, T], Generic[T]):
    """A mapping of names to parts of one kind. `register` adds a part (see `torchvsa.plugins`).

    Installed plugins are imported at the first look-up of an unknown name, and at the first listing of all names.

    >>> from torchvsa.registry import Registry
    >>> rules = Registry("learning rule")
    >>> rules.register("one_shot", object())
    >>> rules.find("oneshot")
    Traceback (most recent call last):
    ValueError: there is no learning rule 'oneshot'; choose one of one_shot
    """

    def __init__(self, kind: str, parts: Mapping[str, T] | None = None) -> None:
        self.kind = kind
        self._parts: dict[str, T] = dict(parts or {})

    def register(self, name: str, part: T) -> None:
        """Add a part. Raises `ValueError` if another part has the name already, or the part gives itself another one.

        A class or function with the same module and qualified name replaces the earlier one, as when a module is
        reloaded or a notebook cell runs again.
        """
        if not isinstance(name, str) or not name:
            raise ValueError(f"the name of a {self.kind} is a text that is not empty; got {name!r}")
        other = self._parts.get(name, part)
        if other is not part and not _defined_again(other, part):
            raise ValueError(
                f"there is another {self.kind} {name!r} already: {_described(other)}; {_described(part)} needs another "
                "name"
            )
        own = getattr(part, "name", name)
        if isinstance(own, str) and own != name:
            # Files hold the part's own name, and would not find it again.
            raise ValueError(f"{_described(part)} has the name {own!r}; it cannot be registered as {name!r}")
        self._parts[name] = part

    def find(self, name: object) -> T:
        """The part of this name. Raises `ValueError` that lists all names, and the plugins that failed."""
        if isinstance(name, str) and name in self:
            return self._parts[name]
        message = f"there is no {self.kind} {name!r}; choose one of {', '.join(self)}"
        raise ValueError("; ".join([message, *plugins.failures()]))

    def __getitem__(self, name: str) -> T:
        if name not in self._parts:
            plugins.load()
        return self._parts[name]

    def __iter__(self) -> Iterator[str]:
        plugins.load()
        return iter(tuple(self._parts))

    def __len__(self) -> int:
        plugins.load()
        return len(self._parts)

    def __repr__(self) -> str:
        return f"Registry({self.kind!r}, {list(self._parts)})"


def _where(part: object) -> tuple[str, str] | None:
    """The module and the name of a class or function."""
    module, name = (getattr(part, attribute, None) for attribute in ("__module__", "__qualname__"))
    return (module, name) if isinstance(module, str) and isinstance(name, str) else None


def _defined_again(a: object, b: object) -> bool:
    where = _where(a)
    # A function can make many classes with the same name.
    return where is not None and where == _where(b) and "<locals>" not in where[1]


def _described(part: object) -> str:
    where = _where(part)
    return repr(part) if where is None else ".".join(where)
