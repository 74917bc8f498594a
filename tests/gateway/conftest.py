from collections.abc import Iterator

import pytest
from gateway_process import Gateway, gateway_process


@pytest.fixture(scope="session")
def gateway(address: str) -> Iterator[Gateway]:
    """A gateway that tests share; each test uses hulls of its own."""
    with gateway_process(address, "--max-body", "1") as running:
        yield running


@pytest.fixture(scope="session")
def hasty(address: str) -> Iterator[Gateway]:
    """A gateway that waits a second for the server and for bodies."""
    with gateway_process(address, "--timeout", "1s", "--body-timeout", "1s") as running:
        yield running
