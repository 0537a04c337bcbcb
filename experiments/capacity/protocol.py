"""The measurements of the protocol of Schlegel, Neubert and Protzel 2022, for one architecture and one draw."""

from __future__ import annotations

import torch

from torchvsa import ARCHITECTURES, VSA, CleanUp, architecture, architecture_near

UNIFORM = "MAP-C uniform"
"""MAP-C with atoms that are uniform in [-1, 1], which is the MAP-C of the published measurements."""


def names() -> list[str]:
    """All architectures that are registered, and MAP-C with uniform atoms."""
    return [*ARCHITECTURES, UNIFORM]


def make(name: str, dim: int) -> VSA:
    """The architecture of this name. Raises `ValueError` if it does not allow `dim`."""
    return architecture("MAP-C", dim, atoms="uniform") if name == UNIFORM else architecture(name, dim)


def nearest_allowed(name: str, dim: int) -> VSA:
    """The architecture with the number of dimensions nearest to `dim` that it allows; of two the smaller one."""
    return architecture_near("MAP-C", dim, atoms="uniform") if name == UNIFORM else architecture_near(name, dim)


def found_in_bundle(vsa: VSA, k: int, items: int, generator: torch.Generator) -> float:
    """Bundle `k` of the items: the share of them among the `k` items that are most similar to the bundle."""
    atoms = vsa.random(items, generator=generator)
    # Anywhere among the items, so that equal similarities favour none.
    members = torch.randperm(items, generator=generator)[:k]
    nearest = vsa.similarity(vsa.bundle(atoms[members]), atoms).topk(k).indices
    return torch.isin(nearest, members).double().mean().item()


def recalled_pairs(vsa: VSA, k: int, items: int, generator: torch.Generator) -> float:
    """Bundle `k` pairs of a role and an item: the share of roles that, unbound, are most similar to their item."""
    atoms, roles = vsa.random(items, generator=generator), vsa.random(k, generator=generator)
    fillers = torch.randperm(items, generator=generator)[:k]
    program = vsa.bundle(vsa.bind(atoms[fillers], roles))
    return (CleanUp(atoms)(vsa.unbind(program, roles)).index == fillers).double().mean().item()


def returned(vsa: VSA, count: int, generator: torch.Generator) -> list[float]:
    """The similarity of a hypervector to itself after binding with 1 to `count` keys and unbinding in reverse order."""
    original, keys = vsa.random(generator=generator), vsa.random(count, generator=generator)
    bound, found = original, []
    for number in range(count):
        bound = vsa.bind(bound, keys[number])
        back = bound
        for key in reversed(keys[: number + 1].unbind()):
            back = vsa.unbind(back, key)
        found.append(vsa.similarity(back, original).item())
    return found


UNBINDING = "unbinding"
TASKS = {"bundle": found_in_bundle, "pairs": recalled_pairs}
