"""How a command ends by a signal, and how a process ends with another one."""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, partial
from multiprocessing import resource_tracker


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """SIGTERM and SIGHUP end this process as an exception does, so that its workers end with it."""

    def end(number: int, frame: object) -> None:
        print(f"ended by {signal.Signals(number).name}; the same command goes on from here", file=sys.stderr)
        raise SystemExit(128 + number)

    before = {number: signal.signal(number, end) for number in (signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@cache
def end_without(process: int) -> None:
    """End this process as soon as another one has ended: any on Linux, elsewhere its parent."""
    try:
        wait = partial(select.select, [os.pidfd_open(process)], [], [])
    except ProcessLookupError:
        os._exit(1)
    except AttributeError:  # there are none
        wait = partial(_wait_for_parent, process)

    def watch() -> None:
        wait()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _wait_for_parent(process: int) -> None:
    while os.getppid() == process:
        time.sleep(0.5)


@contextmanager
def without_interrupts() -> Iterator[None]:
    """Processes that start in here never hear of Ctrl-C, of which they would print tracebacks; it reaches this one."""
    # Python's tracker of shared memory, which joblib starts with them, would allow interrupts again.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
