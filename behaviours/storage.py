"""Read and write safetensors files. They are written completely or not at all, and contain no pickles.

A file has one metadata entry, `torchvsa`: JSON with the kind of the file, the version of its format, a description,
and a checksum of description and tensors. The same content gives the same bytes. All later versions read files of
format 2 (torchvsa 0.2.0).
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import safetensors.torch
import torch
from safetensors import SafetensorError
from torch import Tensor

from behaviours._atomic import write_atomically

__all__ = ["FORMAT", "Layout", "check_layout", "error_context", "load_tensors", "save_tensors", "write_atomically"]

FORMAT = 3
"""The version of the format that is written; format 2 (torchvsa 0.2.0) has no behaviours of some sensors only."""
SMOOTH = 4
"""The version that is written if it has a smooth behaviour, so that earlier releases refuse the file."""
READ = (2, FORMAT, SMOOTH)
"""The versions that are read."""

Layout = Mapping[str, tuple[torch.dtype, tuple[int, ...]]]
"""The type and shape of each tensor, by name."""


def save_tensors(
    path: str | Path, kind: str, tensors: Mapping[str, Tensor], about: Mapping[str, Any], version: int = FORMAT
) -> Path:
    """Write tensors and a JSON-able description of the given kind ("bank", "demonstrations") to one file.

    `version` is the lowest version of the format that has all that is in the description.
    """
    flat = {
        name: tensor.detach().cpu().clone(memory_format=torch.contiguous_format) for name, tensor in tensors.items()
    }
    head = {"kind": kind, "format": version, "about": about}
    # One metadata entry: safetensors writes several of them in any order.
    text = json.dumps(head | {"checksum": checksum(head, flat)})
    return write_atomically(path, safetensors.torch.save(flat, {"torchvsa": text}))


def load_tensors(path: str | Path, kind: str) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read a file that `save_tensors` wrote: its tensors, copied into memory, and its description.

    Raises `ValueError` if the file is something else, or was changed since it was written.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"there is no file {path}")
    content = path.read_bytes()
    try:
        tensors = safetensors.torch.load(content)
        # The tensors could be read, so that the header before them is valid JSON.
        head = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")]).get("__metadata__", {})
    except (SafetensorError, ValueError, LookupError, RecursionError, AssertionError, AttributeError) as error:
        raise ValueError(f"{path} is not a readable torchvsa {kind} file: {error}") from error
    if head.get("format") == "1":
        raise ValueError(f"{path} was written by torchvsa 0.1, which this version cannot read; create it again")
    if "torchvsa" not in head:
        raise ValueError(f"{path} holds other tensors, not a torchvsa {kind}")
    with error_context(str(path)):
        with error_context("description"):
            description = json.loads(head["torchvsa"])
            _check_head(description, kind)
        if description.pop("checksum", None) != checksum(description, tensors):
            raise ValueError("the checksum is wrong: the file was changed or damaged since it was written")
    return tensors, description["about"]


def _check_head(head: Any, kind: str) -> None:
    if not isinstance(head, dict) or not isinstance(head.get("about"), dict):
        raise ValueError("it must be an object with 'kind', 'format', 'about' and 'checksum'")
    if head.get("kind") != kind:
        raise ValueError(f"the file holds {head.get('kind')!r}, not {kind!r}")
    version = head.get("format")
    if version not in READ or isinstance(version, bool):
        raise ValueError(f"the file has format {version!r}; this version reads formats {', '.join(map(str, READ))}")


def checksum(head: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> str:
    """The SHA-256 of a description and of the names, types, shapes and bytes of all tensors."""
    digest = hashlib.sha256(json.dumps(head, sort_keys=True).encode())
    for name in sorted(tensors):
        tensor = tensors[name]
        digest.update(json.dumps([name, str(tensor.dtype), list(tensor.shape)]).encode())
        if tensor.numel():
            digest.update(tensor.reshape(-1).view(torch.uint8).numpy().data)
    return digest.hexdigest()


def check_layout(tensors: Mapping[str, Tensor], expected: Layout) -> None:
    """Raise `ValueError` that names a tensor that is missing, unexpected, or of another type or shape."""
    for name in sorted(expected.keys() - tensors.keys()):
        raise ValueError(f"tensor {name!r} is missing")
    for name in sorted(tensors.keys() - expected.keys()):
        raise ValueError(f"tensor {name!r} is unexpected")
    for name, (dtype, shape) in expected.items():
        found = tensors[name]
        if found.dtype != dtype or tuple(found.shape) != shape:
            raise ValueError(
                f"tensor {name!r} is {found.dtype} {list(found.shape)}; the description expects {dtype} {list(shape)}"
            )


@contextmanager
def error_context(what: str) -> Iterator[None]:
    """Convert errors about the content of a file to a `ValueError` that begins with `what`, its place in the file."""
    try:
        yield
    except KeyError as error:
        raise ValueError(f"{what}: {error.args[0]!r} is missing") from error
    except (ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError, ValueError) as error:
        raise ValueError(f"{what}: {str(error) or type(error).__name__}") from error
