"""Run laws and report the first broken one."""

from collections.abc import Callable, Iterable
from typing import TypeVar

import torch
from jaxtyping import TypeCheckError
from torch import Tensor
from torch.testing import assert_close

from torchvsa.architectures import VSA

T = TypeVar("T")


def check(part: T, laws: Iterable[Callable[[T], None]]) -> None:
    """Run each law on the part. Raises `AssertionError` that names the first broken law."""
    for law in laws:
        try:
            law(part)
        except Exception as error:
            name = law.__name__.strip("_").replace("_", " ")
            what = " ".join(repr(part).split())
            raise AssertionError(f"{what} breaks the law: {name}. {type(error).__name__}: {error}") from error


def require(holds: Tensor | bool, message: str = "it does not hold") -> None:
    """Raise `AssertionError` with the message unless it holds, even under `python -O`."""
    if not bool(holds):
        raise AssertionError(message)


def same(a: Tensor, b: Tensor) -> None:
    """Raise `AssertionError` unless both have the same values, dtype and shape."""
    assert_close(a, b, rtol=0, atol=0, equal_nan=True)


def refuses(error: type[Exception], call: Callable[[], object]) -> None:
    """Raise `AssertionError` unless the call raises this error, or a run-time type checker its own."""
    try:
        call()
    except (error, TypeCheckError):
        return
    raise AssertionError(f"no {error.__name__} was raised")


def draw(vsa: VSA, *shape: int, seed: int = 0) -> Tensor:
    """Random hypervectors `[*shape, d]`, always the same."""
    return vsa.random(*shape, generator=seeded(seed))


def seeded(seed: int) -> torch.Generator:
    """A new generator with this seed."""
    return torch.Generator().manual_seed(seed)
