"""Write a file completely, or not at all."""

import hashlib
import os
import secrets
from contextlib import suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows has no such locks: there, temporary files of killed processes stay
    fcntl = None


def write_atomically(path: str | Path, content: bytes) -> Path:
    """Write `content` to a temporary file in the same folder, and move it to `path`.

    Readers see the old file or the new one, never a part. A replaced file keeps its permissions, and symbolic links
    still point to it (a hard link keeps the old content). Temporary files of killed writers of the same `path` are
    removed. Raises `OSError` that names `path`; the old file is then unchanged.
    """
    path = Path(path)
    target = Path(os.path.realpath(path))
    # Short and of fixed length, so that the temporary file of any valid name has a valid name too.
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
    """Create a file that is locked while it is open, which tells other processes that its writer is alive."""
    while True:
        temporary = folder / f"{prefix}{secrets.token_hex(6)}.tmp"
        handle = os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY | getattr(os, "O_CLOEXEC", 0), 0o666)
        if _locked(handle) is not False and temporary.exists():
            return handle, temporary
        # Another writer removed it before it was locked.
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
    """Whether this process could lock the file; None where there are no locks."""
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
    """Flush the move to disk, where the system supports it."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
