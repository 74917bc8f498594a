from collections.abc import Iterator

import pytest
from fence_server import fence_server


@pytest.fixture(scope="session")
def address() -> Iterator[str]:
    """A server with fences that tests share."""
    with fence_server() as server:
        yield server.address
