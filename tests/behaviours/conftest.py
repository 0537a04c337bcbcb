"""What all tests of the behaviours share."""

from collections.abc import Callable, Iterator

import pytest
import torch
from devices import DEVICES, another_device


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    """Workers that run side by side would otherwise fight for the cores; no result depends on it."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="session", params=DEVICES)
def there(request: pytest.FixtureRequest) -> Iterator[Callable[..., None]]:
    """`there(check, *arguments)` in a process with another device."""
    with another_device(request.param) as run:
        yield run
