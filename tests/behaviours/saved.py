"""What tests of files share: a bank, ways to save, and forged files."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from robots import random_pairs, space

from behaviours import BehaviourBank, ErrorDriven, OneShot
from behaviours.learning import no_convergence_warnings
from behaviours.storage import load_tensors, save_tensors


def bank(vsa: str = "MAP-C", protection: Any = "self_shift", dtype: str | None = None, **encoder: Any) -> BehaviourBank:
    made = BehaviourBank(space(128, vsa, dtype, protection, seed=3, **encoder))
    made.learn("seek light", random_pairs(9), OneShot("similarity", clip_each_step=True))
    with no_convergence_warnings():
        made.learn("avoid", random_pairs(30, seed=1), ErrorDriven(epochs=2))
    return made


SAVERS: list[Callable[[Path], Path]] = [
    lambda path: bank().save(path),
    lambda path: random_pairs(3).save(path),
]


def rewritten(path: Path, kind: str, change: Callable[[dict[str, Any], dict[str, torch.Tensor]], Any]) -> Path:
    """The file with another description or other tensors, and a checksum that fits."""
    tensors, about = load_tensors(path, kind)
    change(about, tensors)
    return save_tensors(path, kind, tensors, about)
