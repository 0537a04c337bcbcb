"""Plugins: installed packages whose modules register their parts when they are imported.

A package names such a module in its `pyproject.toml`, under the entry point group `torchvsa.plugins`:

    [project.entry-points."torchvsa.plugins"]
    robot_parts = "robot_parts"

and the module registers its parts:

    from torchvsa import ARCHITECTURES
    ARCHITECTURES.register("Mine", Mine)

`import torchvsa` imports no plugin. Registries import all of them, once per process, at the first look-up of an unknown
name or the first listing of all names. A package that is installed later is found by the next process, or when it is
imported explicitly. Files and settings name parts, never modules: only entry points of installed packages are imported.
"""

import threading
import warnings
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points

GROUP = "torchvsa.plugins"
"""The entry point group."""


class PluginWarning(UserWarning):
    """An installed plugin could not be imported; its parts are missing."""


_lock = threading.Lock()
_thread = threading.local()
_loaded = False
_failures: list[str] = []


def load() -> None:
    """Import all installed plugins, once per process.

    A plugin that cannot be imported causes a `PluginWarning` that names package, entry point and error; the others are
    still imported. A call from a plugin that is being imported does nothing.
    """
    global _loaded
    if _loaded or getattr(_thread, "loading", False):
        return
    # No lock is held during imports, or two threads that import each other's modules would deadlock. Python's own
    # import locks avoid that, and make a second thread wait for the modules of the first.
    _thread.loading = True
    try:
        failed = [failure for point in entry_points(group=GROUP) if (failure := _failure(point)) is not None]
    finally:
        _thread.loading = False
    with _lock:
        first, _loaded = not _loaded, True
        if first:
            _failures.extend(failed)
    if first:
        for failure in failed:
            warnings.warn(failure, PluginWarning, stacklevel=3)


def failures() -> tuple[str, ...]:
    """The messages of the warnings, one per plugin that could not be imported."""
    return tuple(_failures)


def _failure(point: EntryPoint) -> str | None:
    """Import the module of an entry point. Returns a message if that failed."""
    try:
        if ":" in point.value:
            raise ValueError(f"an entry point of {GROUP} names only a module; got {point.value!r}")
        import_module(point.value.strip())
    except (Exception, SystemExit) as error:  # no error of a plugin may break the library
        package = "an unnamed package" if point.dist is None else f"the package {point.dist.name!r}"
        which = f"the plugin {point.name} = {point.value!r} of {package}"
        return f"{which} cannot be imported: {type(error).__name__}: {error}"
    return None
