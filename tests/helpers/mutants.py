"""Damaged and forged files: what becomes of them when they are loaded.

`python tests/helpers/mutants.py --count 200000` makes so many and prints what became of them, by kind of damage.
Mutants are numbered: each number gives the same file. Forged ones carry a checksum that fits, as if an adversary had
written them.
"""

import argparse
import copy
import json
import math
import random
import resource
import struct
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from behaviours import Actuator, BehaviourBank, Demonstrations, ErrorDriven, OneShot, Schema, Sensor, Space
from behaviours.learning import no_convergence_warnings
from behaviours.storage import load_tensors, save_tensors
from torchvsa import BSC, FHRR, HRR, MAP, VSA, FixedShift, Protection, SelfShift
from torchvsa.encoders import (
    Balanced,
    Circular,
    Encoder,
    FractionalPower,
    History,
    Level,
    Lookup,
    Product,
    RandomFourier,
    SubsetProduct,
    Sum,
    Thermometer,
    ThresholdFeatures,
)

ROOM = 2**28
"""Bytes that loading a mutant may take; the files are of some kilobytes."""
ASK = torch.tensor([[0.1, 0.9], [0.9, 0.1], [math.nan, 0.4], [0.0, 1.0]], dtype=torch.float64)
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
    *("self_shift", "fixed_shift", "none"),
    *({"name": "none"}, "mean", "sum", "clip", "error", "random_fourier", "circular", "uniform", "bipolar"),
]
_EDGES = [torch.tensor([0.2, 0.5]), torch.tensor([0.1, 0.1, 0.9])]
TYPES = ("F64", "F32", "F16", "BF16", "I8", "U8", "BOOL", "I32", "I64", "U64", "C64", "F8_E4M3", "F4", "X")


def _bank(make: Callable[[VSA], Encoder], vsa: VSA, protection: Protection | None = None) -> BehaviourBank:
    schema = Schema(
        [Sensor("left", 0, 1), Sensor("right", 0, 1, "m", "clip")],
        [Actuator("turn", -1, 1, levels=3), Actuator("go", 0, 1, levels=2)],
    )
    space = Space(schema, make(vsa), protection=protection, seed=1)
    readings = torch.rand(20, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    commands = torch.stack([(readings[:, 0] - readings[:, 1]).sign(), (readings[:, 0] > 0.5).double()], 1)
    bank = BehaviourBank(space)
    with no_convergence_warnings():  # how well it learns from so few dimensions is not the question
        bank.learn("steer", Demonstrations(readings[:12], commands[:12]), ErrorDriven())
    bank.learn("forward . é", Demonstrations(readings[12:], commands[12:]), OneShot())
    return bank


@cache
def originals() -> list[tuple[str, bytes]]:
    """Sound files of each kind, small ones."""
    exact, floats, bits, fhrr = MAP(32, dtype=torch.int8), MAP(32), BSC(32), FHRR(32)
    kinds = [
        _bank(lambda vsa: Product(Level(vsa, 8), 2), exact),
        _bank(lambda vsa: Sum(Lookup(vsa, 6), 2), floats, SelfShift(floats)),
        _bank(lambda vsa: SubsetProduct(Lookup(vsa, 6), 2, 2), bits, FixedShift(bits, 3)),
        _bank(lambda vsa: Sum(Level(vsa, 5), 2), fhrr, SelfShift(fhrr)),
        _bank(lambda vsa: Product([Balanced(vsa, 5), Circular(vsa, 4)]), HRR(32)),
        _bank(lambda vsa: ThresholdFeatures(vsa, 2, 9, 2, _EDGES), MAP(32, "B", torch.int8)),
        _bank(lambda vsa: History(Sum(Thermometer(vsa, 4), 2), [1]), MAP(32, "I", torch.int8)),
        _bank(lambda vsa: Sum(FractionalPower(vsa), 2), fhrr),
        _bank(lambda vsa: RandomFourier(vsa, 2), floats),
    ]
    shown = Demonstrations([[0.1, math.nan], [0.2, 0.3], [0.5, 0.6]], [[0.0], [1.0], [0.5]], [0, 0, 1])
    files = []
    with tempfile.TemporaryDirectory() as folder:
        for made in (*kinds, shown):
            path = made.save(Path(folder) / "original")
            files.append(("demonstrations" if made is shown else "bank", path.read_bytes()))
    return files


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


def verdict(number: int, folder: Path) -> tuple[str, str]:
    """The kind of damage of one mutant, and what became of it: `refused`, `loaded`, or what went wrong."""
    rng = random.Random(number)
    kind, content = rng.choice(originals())
    damage = rng.choice([*DAMAGES, *FORGED])
    mutant = DAMAGES[damage](rng, content, folder)
    path = folder / "mutant"
    path.write_bytes(mutant)
    try:
        with _little_room():
            loaded: Any = (BehaviourBank if kind == "bank" else Demonstrations).load(path)
    except (ValueError, OSError) as error:
        text = str(error)
        if "allocate" in text:  # the library's own refusals say what would be needed, before it is taken
            return damage, f"took too much memory before it was refused: {text[-80:]}"
        return damage, "refused" if str(path) in text else f"refused without naming the file: {text[:80]}"
    except BaseException as error:  # (what else comes out is the question here)
        return damage, f"{type(error).__name__} when loaded: {str(error)[:80]}"
    try:
        broken = _broken(loaded)
        # Damage that no checksum covers must have left the content as it was.
        if not broken and damage not in FORGED and loaded.save(folder / "again").read_bytes() != content:
            broken = "loaded other content, though its checksum was not forged"
    except Exception as error:
        broken = f"{type(error).__name__} when asked: {str(error)[:80]}"
    return damage, broken or "loaded"


def _broken(loaded: BehaviourBank | Demonstrations) -> str:
    """The promise that something loaded breaks; nothing if it keeps all."""
    if isinstance(loaded, Demonstrations):
        sound = bool(loaded.commands.isfinite().all()) and not loaded.sensors.isinf().any()
        return "" if sound else "demonstrations that the class forbids"
    sensors = len(loaded.space.schema.sensors)
    readings = torch.cat([ASK] * (1 + sensors // 2), 1)[:, :sensors]
    readings = torch.stack(
        [
            column.clamp(sensor.low, sensor.high)
            for column, sensor in zip(readings.T, loaded.space.schema.sensors, strict=True)
        ],
        1,
    )
    for name in loaded:
        recall, _ = loaded[name].step(readings, loaded[name].start(readings))
        for actuator, column in zip(loaded.space.schema.actuators, recall.commands.T, strict=True):
            seen = column[~readings.isnan().all(1)]
            if not ((seen >= actuator.low) & (seen <= actuator.high)).all():
                return "a command outside of its actuator's range"
        for field in ("similarity", "familiarity"):
            values = getattr(recall, field)
            if not (values.abs() <= 1.001).all():
                return f"a {field} that is no cosine"
        if recall.margin.isnan().any():
            return "a margin that is no number"
    return ""


@contextmanager
def _little_room() -> Iterator[None]:
    before = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + ROOM, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def verdicts(numbers: range) -> Counter[tuple[str, str]]:
    """What became of these mutants."""
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder:
        return Counter(verdict(number, Path(folder)) for number in numbers)


def main() -> None:
    """Print the counts; exit with status 1 if one of them ought to be 0."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200_000)
    parser.add_argument("--start", type=int, default=0, help="number of the first mutant")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    end = options.start + options.count
    blocks = [range(at, min(at + 1000, end)) for at in range(options.start, end, 1000)]
    total: Counter[tuple[str, str]] = Counter()
    with ProcessPoolExecutor(options.workers) as pool:
        for done, counts in enumerate(pool.map(verdicts, blocks), 1):
            total += counts
            print(f"\r{done * 1000:,} of {options.count:,}", end="", flush=True)
    print()
    for (damage, what), count in sorted(total.items()):
        print(f"{count:>9,}  {damage:12}  {what}")
    wrong = sum(count for (_, what), count in total.items() if what not in ("refused", "loaded"))
    print(f"{sum(total.values()):>9,}  mutants, {wrong:,} of them neither refused nor sound")
    raise SystemExit(wrong > 0)


if __name__ == "__main__":
    main()
