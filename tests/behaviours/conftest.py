"""What all tests of the behaviours share."""

from collections.abc import Callable, Iterator

import pytest
import torch
from devices import another_device


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    """Workers that run side by side would otherwise fight for the cores; no result depends on it."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def there() -> Iterator[Callable[..., None]]:
    """`there(check, *arguments)` in a process with the pretended device."""
    with another_device() as run:
        yield run
