"""The physics clients of this process."""

import pybullet


def connected() -> list[int]:
    """The clients that are connected."""
    return [client for client in range(256) if pybullet.getConnectionInfo(client)["isConnected"]]
