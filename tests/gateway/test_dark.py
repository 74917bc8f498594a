"""The network between a gateway and its server stops carrying bytes: its callers are told, and miss nothing."""

from collections.abc import Iterator

import pytest
from gateway_process import Events, gateway_process
from patience import wait_until
from proxy import proxy
from server_process import Server, server_process

from dynhull_client import HullClient

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]


@pytest.fixture(scope="module")
def permissive() -> Iterator[Server]:
    with server_process("--min-ping-interval", "0.001") as running:
        yield running


def test_readers_are_told_and_miss_nothing(permissive: Server, name: str) -> None:
    with HullClient(permissive.address) as client, proxy(permissive.address) as way:
        client.create_hull(name, keyed="str")
        client.put(name, ["first"], [[1, 1]])
        client.create_fence(name, area=SQUARE, subjects=name)
        with gateway_process(way.address, "--ping-interval", "400ms") as gateway:
            hull, fence = Events(gateway, f"/hulls/{name}/events"), Events(gateway, f"/fences/{name}/events?after=0")
            assert hull.next()[0] == "snapshot"
            fence.next()  # an id alone
            assert fence.next()[0] == "snapshot"
            assert gateway.get("/livez").json == {"status": "ok", "seconds_without_server": None}
            way.server = ""
            way.silence()
            client.put(name, ["second"], [[2, 3]])
            assert hull.next()[0] == "unavailable"
            assert fence.next()[0] == "unavailable"
            lost = gateway.get("/livez").json["seconds_without_server"]
            wait_until(lambda: gateway.get("/livez").json["seconds_without_server"] > lost > 0)
            assert gateway.get("/readyz").json["status"] == "unavailable"
            way.server = permissive.address
            assert {hull.next()[0] for _ in range(2)} == {"available", "change"}
            assert {fence.next()[0] for _ in range(2)} == {"available", "enter"}
            assert gateway.get("/readyz").json == {"status": "ok", "seconds_without_server": None}
            hull.close()
            fence.close()


def test_a_gateway_without_a_server_says_how_long() -> None:
    with gateway_process("127.0.0.1:1") as gateway:
        wait_until(lambda: (gateway.get("/livez").json["seconds_without_server"] or 0) > 0)
