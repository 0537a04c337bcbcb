"""Files of tensors: safetensors, written whole or not at all, and never a pickle."""

import json
import os
import tempfile
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor


def write_atomically(path: str | Path, content: bytes) -> Path:
    """Write `content` beside `path` and move it there: readers see the old file or the new one, never half."""
    path = Path(path)
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise OSError(
            f"cannot write {path}: {error.strerror} (does the folder exist, and may you write there?)"
        ) from error
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, path)
    except BaseException as error:
        Path(temporary).unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise OSError(f"cannot write {path}: {error.strerror}") from error
        raise
    return path


def save_tensors(path: str | Path, kind: str, tensors: dict[str, Tensor], about: dict[str, Any]) -> Path:
    """Write tensors and a JSON-able description of the given kind ("bank", "demonstrations") to one file."""
    flat = {name: tensor.detach().cpu().contiguous().clone() for name, tensor in tensors.items()}
    return write_atomically(path, save(flat, {"kind": f"torchvsa.{kind}", "format": "1", "about": json.dumps(about)}))


def load_tensors(path: str | Path, kind: str) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read what `save_tensors` wrote; raises `ValueError` if the file is something else."""
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"there is no file {path}")
    try:
        with safe_open(path, framework="pt") as file:
            about = file.metadata() or {}
            if about.get("kind") != f"torchvsa.{kind}" or about.get("format") != "1":
                raise ValueError(f"{path} holds {about.get('kind', 'other tensors')}, not torchvsa.{kind} in format 1")
            return {name: file.get_tensor(name) for name in file.keys()}, json.loads(about["about"])  # noqa: SIM118 (not a mapping)
    except (SafetensorError, json.JSONDecodeError, KeyError) as error:
        raise ValueError(f"{path} is not a readable torchvsa {kind} file: {error}") from error


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
