"""How a client finds its server: one that comes later, and one beside proxies."""

import pytest
from proxy import proxy

from dynhull_client import HullClient, UnavailableError

ELSEWHERE = "192.0.2.1:50051"  # an address for documentation (RFC 5737): only the proxy is asked


@pytest.fixture
def no_server(monkeypatch: pytest.MonkeyPatch) -> str:
    """A proxy in the environment that nobody serves."""
    for variable in ("no_grpc_proxy", "no_proxy", "grpc_proxy", "https_proxy"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv("http_proxy", "http://me:secret@127.0.0.1:1")
    return "127.0.0.1:1 of http_proxy"


def test_no_call_fails_by_an_attempt_to_connect_before_it(address: str, connect: type[HullClient], name: str) -> None:
    with proxy("") as way, connect(way.address) as client:
        with pytest.raises(UnavailableError):
            client.create_hull(name)
        way.server = address
        assert client.create_hull(name).revision == 0  # not repeated where it may have been sent


def test_no_watch_fails_by_an_attempt_to_connect_before_it(address: str, connect: type[HullClient], name: str) -> None:
    with HullClient(address) as client:
        client.create_hull(name, keyed="str")
        client.create_fence(name, [[0, 0], [9, 0], [0, 9]], name)
    for watch, options in (("watch", {}), ("watch_fence", {"progress_interval": 0.1})):
        with proxy("") as way, connect(way.address) as late:
            with pytest.raises(UnavailableError):
                late.create_hull(name)
            way.server = address
            next(getattr(late, watch)(name, reconnect=False, **options))


@pytest.mark.usefixtures("no_server")
def test_this_machine_is_reached_without_a_proxy(address: str, connect: type[HullClient]) -> None:
    port = address.rpartition(":")[2]
    for each in (address, f"localhost:{port}", f"ipv4:{address}", f"dns:///{address}"):
        with connect(each) as client:
            list(client.list_hulls())


def test_errors_name_the_proxy(no_server: str, connect: type[HullClient]) -> None:
    with connect(ELSEWHERE, retries=0) as client:
        with pytest.raises(UnavailableError, match=f"through the proxy {no_server}") as call:
            client.get_hull("a")
        with client.watch("a") as watch, pytest.raises(UnavailableError, match=f"through the proxy {no_server}"):
            next(watch)
    assert "secret" not in str(call.value)


def test_errors_ask_whether_the_server_runs(connect: type[HullClient]) -> None:
    with connect("127.0.0.1:1", retries=0) as client, pytest.raises(UnavailableError) as call:
        client.create_hull("a")
    assert call.value.__notes__ == ["Is a server running at 127.0.0.1:1 (dynhull serve), without TLS?"]
