"""Settings that list some of several names."""

from collections.abc import Iterable


def check_chosen(setting: str, chosen: Iterable[object], choices: Iterable[object], empty: bool = False) -> None:
    """Raise `ValueError`, naming the setting, unless it lists at least one of the choices (or none, if it may be
    `empty`), and none twice."""
    chosen, listed = list(chosen), ", ".join(map(str, choices := list(choices)))
    for one in chosen:
        if one not in choices:
            raise ValueError(f"{setting}: there is no {one!r}; choose from {listed}")
    check_differ(setting, chosen)
    if not chosen and not empty:
        raise ValueError(f"{setting} is empty; choose from {listed}")


def check_differ(setting: str, chosen: Iterable[object]) -> None:
    """Raise `ValueError`, naming the setting, if it lists anything twice."""
    chosen = list(chosen)
    for one in chosen:
        if chosen.count(one) > 1:
            raise ValueError(f"{setting} names {one!r} {chosen.count(one)} times")
