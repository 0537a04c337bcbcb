"""Refuse work that does not fit into memory, before any is allocated."""

import os

_SMALL = 2**26
"""Bytes below which the system is not asked: asking takes as long as drawing many small hypervectors."""


def require_memory(needed: int, what: str, advice: str) -> None:
    """Raise `ValueError` if `needed` bytes are more than the machine has available now.

    Checks only the memory of the CPU, and nothing below 64 MiB.

    Args:
        needed: Bytes.
        what: The work that needs them, for the error.
        advice: What to do instead, for the error.
    """
    if needed < _SMALL:
        return
    available = _available()
    if needed > available:
        raise ValueError(f"{what} needs {_size(needed)} of memory, of which {_size(available)} are available; {advice}")


def _available() -> int:
    """Bytes available without swapping; all physical memory if the system does not tell."""
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
    """A number of bytes with three digits and a suitable unit."""
    power = min(max((len(str(count)) - 1) // 3, 0), 4)
    return f"{count / 1000**power:,.3g} {('bytes', 'kB', 'MB', 'GB', 'TB')[power]}"
