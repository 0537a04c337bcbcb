"""Files that are replaced as a whole: their permissions, their links, and what killed writers leave behind."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from behaviours import _atomic
from behaviours.storage import write_atomically


def test_permissions_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "secret"
    path.write_bytes(b"old")
    path.chmod(0o600)
    write_atomically(path, b"new")
    assert path.read_bytes() == b"new"
    assert path.stat().st_mode & 0o7777 == 0o600


def test_new_files_follow_the_umask(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        write_atomically(tmp_path / "new", b"x")
    finally:
        os.umask(before)
    assert (tmp_path / "new").stat().st_mode & 0o7777 == 0o640


def test_a_symbolic_link_keeps_pointing_to_the_file(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    target = tmp_path / "folder" / "bank"
    target.write_bytes(b"old")
    link = tmp_path / "link"
    link.symlink_to(target)
    assert write_atomically(link, b"new") == link
    assert link.is_symlink()
    assert target.read_bytes() == b"new"
    assert os.listdir(target.parent) == ["bank"]


@pytest.mark.parametrize("length", [1, 200, 255])
def test_names_of_any_length(length: int, tmp_path: Path) -> None:
    path = tmp_path / ("x" * length)
    assert write_atomically(path, b"new").read_bytes() == b"new"


KILLED = """
import os, runpy, sys
os.replace = lambda *_: os.kill(os.getpid(), 9)
runpy.run_path(sys.argv[1])["write_atomically"](sys.argv[2], b"never seen")
"""


def test_what_a_killed_writer_left_is_removed_by_the_next(tmp_path: Path) -> None:
    path = tmp_path / "bank"
    write_atomically(path, b"old")
    for _ in range(2):
        ran = subprocess.run([sys.executable, "-c", KILLED, _atomic.__file__, path], check=False)
        assert ran.returncode == -9
    assert path.read_bytes() == b"old"
    assert len(os.listdir(tmp_path)) == 2  # the second one removed what the first had left
    write_atomically(tmp_path / "another", b"x")
    assert len(os.listdir(tmp_path)) == 3  # whose leftovers they are is another file's business
    write_atomically(path, b"new")
    assert sorted(os.listdir(tmp_path)) == ["another", "bank"]


def test_many_threads_save_at_once(tmp_path: Path) -> None:
    """Nobody takes another's unfinished file for a leftover, and the umask of the process never changes."""
    umask = os.umask(0o022)
    errors: list[BaseException] = []
    modes: set[int] = set()

    def save(content: bytes) -> None:
        try:
            for number in range(60):
                write_atomically(tmp_path / "shared", content)
                other = write_atomically(tmp_path / f"{content[:1].hex()}-{number}", content)
                modes.add(other.stat().st_mode & 0o7777)
        except BaseException as error:
            errors.append(error)

    try:
        threads = [threading.Thread(target=save, args=(bytes([number]) * 5000,)) for number in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        left = os.umask(umask)
    assert not errors
    assert left == 0o022
    assert modes == {0o644}
    assert len(set((tmp_path / "shared").read_bytes())) == 1
    assert not list(tmp_path.glob(".*"))
