"""Parts by name, for settings and files; the parts themselves are made by their classes."""

from collections.abc import Iterator, Mapping
from typing import Generic, TypeVar

T = TypeVar("T")


class Registry(Mapping[str, T], Generic[T]):
    """Named parts of one kind. A part from outside joins by `register`, see `torchvsa.plugins`.

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
        """Add a part. Raises `ValueError` if another one has the name already."""
        if not isinstance(name, str) or not name:
            raise ValueError(f"the name of a {self.kind} is a text that is not empty; got {name!r}")
        if self._parts.get(name, part) is not part:
            raise ValueError(f"there is another {self.kind} {name!r} already: {self._parts[name]!r}")
        self._parts[name] = part

    def find(self, name: object) -> T:
        """The part of this name. Raises `ValueError` that lists the names there are."""
        if not isinstance(name, str) or name not in self._parts:
            raise ValueError(f"there is no {self.kind} {name!r}; choose one of {', '.join(self._parts)}")
        return self._parts[name]

    def __getitem__(self, name: str) -> T:
        return self._parts[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._parts)

    def __len__(self) -> int:
        return len(self._parts)

    def __repr__(self) -> str:
        return f"Registry({self.kind!r}, {list(self._parts)})"
