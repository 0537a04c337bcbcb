"""Write a file as a whole, or not at all."""

import hashlib
import os
import secrets
from contextlib import suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows has no such locks: there, leftovers of killed processes stay
    fcntl = None


def write_atomically(path: str | Path, content: bytes) -> Path:
    """Write `content` beside `path` and move it there: readers see the old file or the new one, never half.

    A file that is replaced keeps its permissions, a symbolic link keeps pointing to it (a hard link does not: it keeps
    the old content). Files that killed writers of the same `path` left behind are removed. Raises `OSError` naming
    `path`, and leaves the old file as it was.
    """
    path = Path(path)
    target = Path(os.path.realpath(path))
    # Short and of a fixed length, so that any name that the folder takes can be saved.
    prefix = f".{hashlib.sha256(os.fsencode(target.name)).hexdigest()[:12]}-"
    try:
        _remove_leftovers(target.parent, prefix)
        handle, temporary = _create(target.parent, prefix)
    except OSError as error:
        raise OSError(
            f"cannot write {path}: {error.strerror} (does the folder exist, and may you write there?)"
        ) from error
    try:
        with os.fdopen(handle, "wb", closefd=False) as file:
            file.write(content)
        os.fsync(handle)
        with suppress(FileNotFoundError):
            os.chmod(temporary, os.stat(target).st_mode & 0o7777)
        os.replace(temporary, target)
    except BaseException as error:
        temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise OSError(f"cannot write {path}: {error.strerror}") from error
        raise
    finally:
        os.close(handle)
    _sync_folder(target.parent)
    return path


def _create(folder: Path, prefix: str) -> tuple[int, Path]:
    """A new file that is locked as long as it is open: a sign to others that its writer lives."""
    while True:
        temporary = folder / f"{prefix}{secrets.token_hex(6)}.tmp"
        handle = os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY | getattr(os, "O_CLOEXEC", 0), 0o666)
        if _locked(handle) is not False and temporary.exists():
            return handle, temporary
        # Another writer took it for a leftover in the moment before it was locked.
        os.close(handle)
        temporary.unlink(missing_ok=True)


def _remove_leftovers(folder: Path, prefix: str) -> None:
    for path in folder.glob(f"{prefix}*.tmp"):
        with suppress(OSError):
            handle = os.open(path, os.O_WRONLY)
            try:
                if _locked(handle):
                    path.unlink()
            finally:
                os.close(handle)


def _locked(handle: int) -> bool | None:
    """Whether this process got the lock of a file; None where there are no locks."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def _sync_folder(folder: Path) -> None:
    """Make the move itself survive a loss of power, where the system can."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
