from collections.abc import Iterator

import pybullet
import pytest


def connected() -> list[int]:
    return [client for client in range(256) if pybullet.getConnectionInfo(client)["isConnected"]]


@pytest.fixture(autouse=True)
def no_client_is_left() -> Iterator[None]:
    """Every test of this folder disconnects what it connects; each client holds about 29 MB."""
    before = connected()
    yield
    assert connected() == before
