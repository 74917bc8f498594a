import pytest
from client_kinds import CLIENTS

from dynhull_client import HullClient


@pytest.fixture(params=CLIENTS)
def connect(request: pytest.FixtureRequest) -> type[HullClient]:
    """HullClient, or AsyncHullClient behind the same interface."""
    return CLIENTS[request.param]
