"""What all tests share."""

import pytest


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Slow tests come first, so that at the end no worker waits for another's last long one."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)
