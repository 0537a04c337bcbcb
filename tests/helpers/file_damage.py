"""Damage to the bytes of a file, and forged files: other content with a checksum that fits."""

import copy
import json
import math
import random
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import torch
from sound_files import originals
from torch import Tensor

from behaviours.storage import load_tensors, save_tensors

HOSTILE: list[Any] = [
    *(None, True, False, 0, -1, 1, 2, 3, 7, 8, 32, 33, 100, 256, 2**31, 2**32, 2**53, 2**63 - 1, 2**63, -(2**63)),
    *(10**7, 10**9, 10**12, 10**400, 0.5, 1.0, 8.0, -0.0, 1e308, -1e308, 5e-324, math.nan, math.inf, -math.inf),
    *(
        "",
        "x",
        "1",
        "32",
        "a.b",
        "\n",
        "\x00",
        "\ud800",
        "../../etc/passwd",
        "__class__",
        "__init__",
        [],
        {},
        [1],
        [[]],
    ),
    *("MAP-I", "HRR", "BSC", "FHRR", "int8", "float16", "bfloat16", "float64", "complex64", "bool", "load", "C", "B"),
    *("product", "sum", "subset_product", "threshold_features", "history", "level", "lookup", "balanced"),
    *("oblique_features", "concatenated"),
    *("self_shift", "fixed_shift", "none"),
    *({"name": "none"}, "mean", "sum", "clip", "error", "random_fourier", "circular", "uniform", "bipolar"),
]


TYPES = ("F64", "F32", "F16", "BF16", "I8", "U8", "BOOL", "I32", "I64", "U64", "C64", "F8_E4M3", "F4", "X")


def _bits(rng: random.Random, content: bytes, _: Path) -> bytes:
    damaged = bytearray(content)
    end = len(content) if rng.random() < 0.7 else 8 + int.from_bytes(content[:8], "little")
    for _times in range(rng.choice([1, 1, 2, 8])):
        damaged[rng.randrange(end)] ^= 1 << rng.randrange(8)
    return bytes(damaged)


def _pieces(rng: random.Random, content: bytes, _: Path) -> bytes:
    """Bytes cut out, put in, or written over; the length of the header is set right, or wrong."""
    size = int.from_bytes(content[:8], "little")
    at = rng.randrange(8, len(content) if rng.random() < 0.4 else 8 + size)
    piece = rng.choice([b"", b"{", b"}", b"[" * 3000, b'"', b"\\u0000", b"9" * 5000, b"\x00", b"-", b"e5", b",", b" "])
    cut = rng.choice([0, 0, 1, 2, 8, 50])
    damaged = content[:at] + piece + content[at + cut :]
    grown = size + len(piece) - cut if at < 8 + size else size
    length = rng.choice([size, grown, grown, size - 1, 0, len(content), 10**8, 2**63, 2**64 - 1])
    return struct.pack("<Q", max(length, 0)) + damaged[8:]


def _ends(rng: random.Random, content: bytes, _: Path) -> bytes:
    return content[: rng.randrange(len(content))] if rng.random() < 0.8 else content + rng.randbytes(rng.choice([1, 8]))


def _header(rng: random.Random, content: bytes, _: Path) -> bytes:
    """Another type, shape, place or name of a tensor, in the header alone."""
    size = int.from_bytes(content[:8], "little")
    head = json.loads(content[8 : 8 + size])
    name = rng.choice([name for name in head if name != "__metadata__"])
    entry = head[name]
    match rng.randrange(5):
        case 0:
            shapes = [[2**63], [2**32, 2**32], [0], [], [-1], [2**64 - 1, 2], [1] * 70, [10**12], [0, 10**12]]
            entry["shape"] = rng.choice(shapes)
        case 1:
            entry["dtype"] = rng.choice(TYPES)
        case 2:
            begin, end = entry["data_offsets"]
            entry["data_offsets"] = rng.choice([[0, 0], [0, 2**63], [5, 1], [-1, 4], [begin, end + 8], [end, begin]])
        case 3:
            head[rng.choice([name + "x", "", "space.", "\n"])] = dict(entry)
        case _:
            head["__metadata__"] = rng.choice([{}, {"torchvsa": "[" * 20000}, {"torchvsa": "null"}, {"format": "1"}])
    text = json.dumps(head).encode()
    return struct.pack("<Q", len(text)) + text + content[8 + size :]


def _opened(content: bytes, folder: Path) -> tuple[str, dict[str, Tensor], dict[str, Any]]:
    path = folder / "opened"
    path.write_bytes(content)
    head = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
    kind = json.loads(head["__metadata__"]["torchvsa"])["kind"]
    tensors, about = load_tensors(path, kind)
    return kind, dict(sorted(tensors.items())), about  # (they are read in any order)


def _forged(content: bytes, folder: Path, change: Callable[[dict[str, Tensor], dict[str, Any]], Any]) -> bytes:
    kind, tensors, about = _opened(content, folder)
    about = change(tensors, about) or about
    return save_tensors(folder / "forged", kind, tensors, about).read_bytes()


def _description(rng: random.Random, content: bytes, folder: Path) -> bytes:
    return _forged(content, folder, lambda _, about: _changed(rng, about))


def _tensors(rng: random.Random, content: bytes, folder: Path) -> bytes:
    return _forged(content, folder, lambda tensors, _: _change_tensors(rng, tensors))


def _both(rng: random.Random, content: bytes, folder: Path) -> bytes:
    def change(tensors: dict[str, Tensor], about: dict[str, Any]) -> dict[str, Any]:
        _change_tensors(rng, tensors)
        return _changed(rng, about)

    return _forged(content, folder, change)


def _spliced(rng: random.Random, content: bytes, folder: Path) -> bytes:
    """Parts of the description, or tensors, of another file."""
    _, others, other = _opened(rng.choice(originals())[1], folder)

    def change(tensors: dict[str, Tensor], about: dict[str, Any]) -> dict[str, Any]:
        for name in tensors:
            if name in others and rng.random() < 0.3:
                tensors[name] = others[name]
        return {key: other[key] if key in other and rng.random() < 0.4 else value for key, value in about.items()}

    return _forged(content, folder, change)


def _places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    yield path
    children = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, child in children:
        yield from _places(child, (*path, key))


def _changed(rng: random.Random, about: dict[str, Any]) -> dict[str, Any]:
    about = json.loads(json.dumps(about))
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        places = [place for place in _places(about) if place]
        if not places:
            break
        *above, key = rng.choice(places)
        parent: Any = about
        for step in above:
            parent = parent[step]
        match rng.randrange(8):
            case 0:
                parent.pop(key)
            case 1 if isinstance(parent, dict):
                name = rng.choice(["x", "", "name", "dim", "seed", "command", "variant", "levels"])
                parent[name] = copy.deepcopy(rng.choice(HOSTILE))
            case 2 if isinstance(parent, dict):
                parent[rng.choice(["x", "", "a.b", "__init__", "name"])] = parent.pop(key)
            case 3 if isinstance(parent, list):
                parent.append(copy.deepcopy(parent[key]))
            case _:
                parent[key] = copy.deepcopy(rng.choice(HOSTILE))
    return about


def _change_tensors(rng: random.Random, tensors: dict[str, Tensor]) -> None:
    for _ in range(rng.choice([1, 1, 2])):
        name = rng.choice(list(tensors))
        draw = rng.random()
        if draw < 0.75:
            tensors[name] = _change_tensor(rng, tensors[name])
        elif draw < 0.85 and len(tensors) > 1:
            tensors.pop(name)
        elif draw < 0.95:
            other = rng.choice(list(tensors))
            tensors[name], tensors[other] = tensors[other], tensors[name]
        else:
            tensors[rng.choice(["extra", "space.extra", "behaviours.0.extra", "behaviours.7.program"])] = torch.ones(3)


def _change_tensor(rng: random.Random, tensor: Tensor) -> Tensor:
    real = tensor.real.contiguous() if tensor.is_complex() else tensor
    types = [torch.float16, torch.bfloat16, torch.float32, torch.float64, torch.int8, torch.int64, torch.bool]
    match rng.randrange(10):
        case 0:
            return real.to(rng.choice([*types, torch.complex64]))
        case 1 | 2 | 3 if tensor.numel():
            changed = tensor.clone(memory_format=torch.contiguous_format)
            if tensor.is_floating_point() or tensor.is_complex():
                value = rng.choice([math.nan, math.inf, -math.inf, 1e38, 1e-40, 0.3, 0.0, -1.0])
            elif tensor.dtype == torch.bool:
                value = rng.random() < 0.5
            else:
                limits = torch.iinfo(tensor.dtype)
                value = rng.choice([limits.min, limits.max, -1, 5, -7, 127, 0])
            changed.view(-1)[rng.randrange(tensor.numel())] = value
            return changed
        case 4:
            return tensor[: rng.choice([0, 1])] if tensor.dim() else tensor[None]
        case 5:
            return torch.cat([tensor, tensor]) if tensor.dim() else tensor
        case 6:
            return tensor[None] if rng.random() < 0.5 else tensor.reshape(-1)
        case 7:
            return tensor.mT if tensor.dim() > 1 else tensor.flip(0) if tensor.dim() else tensor
        case 8:
            return torch.zeros_like(tensor)
        case _:
            return real.to(torch.float64) * rng.choice([1e-320, 1e300, -0.0, 3.0])


DAMAGES: dict[str, Callable[[random.Random, bytes, Path], bytes]] = {
    "bits": _bits,
    "pieces": _pieces,
    "ends": _ends,
    "header": _header,
    "description": _description,
    "tensors": _tensors,
    "both": _both,
    "spliced": _spliced,
}


FORGED = ("description", "tensors", "both", "spliced")
