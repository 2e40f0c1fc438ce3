"""Order: tests that look at the same run of a protocol stand next to each other, because processes share no runs."""

import pytest


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    def shared(item: pytest.Item) -> bool:
        return item.path.name == "test_routing_protocols.py" and "protocol" in item.callspec.params  # type: ignore[attr-defined]

    places = [at for at, item in enumerate(items) if hasattr(item, "callspec") and shared(item)]
    ordered = sorted((items[at] for at in places), key=lambda item: item.callspec.params["protocol"])  # type: ignore[attr-defined]
    for at, item in zip(places, ordered, strict=True):
        items[at] = item
