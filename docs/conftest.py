from collections.abc import Iterator
from typing import Any

import pytest
from server_process import server_process

collect_ignore_glob = ["*.py"]  # programs that make the pages

PAGES_WITH_A_SERVER = {"client.md"}


@pytest.fixture(scope="session")
def address() -> Iterator[str]:
    with server_process() as server:
        yield server.address


@pytest.fixture(autouse=True)
def _server(request: pytest.FixtureRequest, doctest_namespace: dict[str, Any]) -> None:
    """The examples of some pages talk to a server, at `address`."""
    if request.path.name in PAGES_WITH_A_SERVER:
        doctest_namespace["address"] = request.getfixturevalue("address")
