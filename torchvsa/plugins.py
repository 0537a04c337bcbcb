"""Parts from outside: installed packages whose modules register what they define when they are imported.

A package names such a module in its `pyproject.toml`, under the entry point group `torchvsa.plugins`:

    [project.entry-points."torchvsa.plugins"]
    robot_parts = "robot_parts"

and the module registers its parts:

    from torchvsa import ARCHITECTURES
    ARCHITECTURES.register("Mine", Mine)

Importing torchvsa imports no plugin. Registries do, once per process, at the first look-up that needs all parts: of a
name that is not there, or a listing of all names. A package that is installed later is found by the next process, or
when it is imported by hand. Files and settings name parts, never modules: only entry points of installed packages are
imported.
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
    """Import all installed plugins, unless that was done before.

    A plugin that cannot be imported leaves a `PluginWarning` that names package, entry point and error; the others
    are imported all the same. Called by a plugin that is being imported, it does nothing.
    """
    global _loaded
    if _loaded or getattr(_thread, "loading", False):
        return
    # No lock is held while modules are imported: two threads that import each other's modules would wait for ever,
    # which Python's own locks of modules know to avoid. A second thread waits there for the modules of the first.
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
    """What went wrong with each plugin that could not be imported, as the warnings said."""
    return tuple(_failures)


def _failure(point: EntryPoint) -> str | None:
    """Import the module of an entry point, and say what went wrong, if anything did."""
    try:
        if ":" in point.value:
            raise ValueError(f"an entry point of {GROUP} names a module alone; got {point.value!r}")
        import_module(point.value.strip())
    except (Exception, SystemExit) as error:  # whatever a plugin does must not take the library down
        package = "an unnamed package" if point.dist is None else f"the package {point.dist.name!r}"
        which = f"the plugin {point.name} = {point.value!r} of {package}"
        return f"{which} cannot be imported: {type(error).__name__}: {error}"
    return None
