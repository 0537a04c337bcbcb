"""Our side of the benchmarks on a device that is not the CPU; the peer's tensors know no pretended one."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
import torch
from devices import another_device, other


@pytest.fixture(scope="module")
def there() -> Iterator[Callable[..., Any]]:
    with another_device() as run:
        yield run


# Random vectors are drawn by a generator on the device, which a pretended one does not have.
@pytest.mark.parametrize("work", ["encoding", "cleanup", "protection", "learning", "recall"])
def test_what_is_timed_runs_there(there: Callable[..., Any], work: str) -> None:
    there(check_work, work)


def check_work(work: str) -> None:
    from behaviours import Behaviour
    from benchmarks.works import WORKS

    with pytest.MonkeyPatch.context() as patch:
        for module in ("encoding", "cleanup", "protection", "literal"):
            patch.setattr(f"benchmarks.{module}.hypervectors", lambda x: x.to(torch.float32))
        patch.setattr("torchhd.bind", torch.mul)
        patch.setattr("benchmarks.literal.Literal.learn", lambda *_: 0)
        patch.setattr(torch, "compile", lambda call, **_: call)
        patch.setattr("benchmarks.floors._SIDE", {other().NAME: 8})
        count = 0
        for case in WORKS[work].cases(other().NAME, True):
            answer: Any = case.ours(0)
            other().brought_back(answer.program if isinstance(answer, Behaviour) else answer)
            if case.floor is not None:
                case.floor.call(0)
            count += 1
        assert count >= 2


def test_growth_is_measured_there(there: Callable[..., Any]) -> None:
    rows = there(grown)
    assert {row["device"] for row in rows} == {"pretended"}
    assert all(second > 0 for row in rows for second in row["seconds"])


def grown() -> list[dict[str, Any]]:
    from benchmarks import growth

    return list(growth.rows(other().NAME, threads=1, repeats=1, small=True))
