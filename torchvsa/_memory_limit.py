"""Refuse what cannot fit into memory, before any of it is taken."""

import os

_SMALL = 2**26
"""Bytes below which the system is not asked, which takes as long as drawing many small hypervectors."""


def require_memory(needed: int, what: str, advice: str) -> None:
    """Raise `ValueError` if `needed` bytes are more than the machine has available now.

    `what` says what would take them, `advice` what to do instead. Only a CPU's memory is looked at, and not at all for
    less than 64 MiB.
    """
    if needed < _SMALL:
        return
    available = _available()
    if needed > available:
        raise ValueError(f"{what} needs {_size(needed)} of memory, of which {_size(available)} are available; {advice}")


def _available() -> int:
    """Bytes that can be taken without swapping; all physical memory where the system does not say."""
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            for line in file:
                if line.startswith("MemAvailable:"):
                    return int(line.split()[1]) * 1024
    except OSError:
        pass
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return 2**63  # unknown, as on Windows: nothing is refused


def _size(count: int) -> str:
    """A number of bytes, to three digits, in the unit that suits it."""
    power = min(max((len(str(count)) - 1) // 3, 0), 4)
    return f"{count / 1000**power:,.3g} {('bytes', 'kB', 'MB', 'GB', 'TB')[power]}"
