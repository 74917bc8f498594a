from collections.abc import Iterator

import pytest
from metrics import measured
from one_gateway import Place, entries

from dynhull_client import HullClient


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    tokens = tmp_path_factory.mktemp("tokens") / "tokens.toml"
    tokens.write_text(entries("one", "two"))
    options = ("--workers", "1", "--gateways", "1", "--tokens", str(tokens), "--log-level", "error")
    with measured(*options, "--scrub-cpu", "0") as (server, metrics):
        yield Place(server.address, metrics, tokens)


@pytest.fixture
def client(place: Place) -> Iterator[HullClient]:
    place.wait_for(0)  # those of the test before have left
    with HullClient(place.address, token="one") as client:
        yield client
