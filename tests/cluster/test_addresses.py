"""What a gateway says of an owner that it cannot reach: nobody but its callers would know otherwise."""

import asyncio
import socket

import pytest
from ports import free_port

from dynhull_cluster.frames import Frames
from dynhull_cluster.machines import addresses
from dynhull_cluster.machines.addresses import Addresses
from dynhull_cluster.machines.board import Owner, Tables
from dynhull_cluster.versions import UNSAID

PARTITION = 3


class Greeted(Frames):
    theirs = UNSAID

    async def greet(self, greeting: bytes) -> None:
        assert greeting == b"3/north-1/0/secret"

    def ping(self, seconds: float) -> None:
        assert seconds == 10.0


def owned(port: int) -> Tables:
    return Tables(
        {PARTITION: Owner(1, "north-1/0", "", f"127.0.0.1 1 {port}", "now", False, True)}, {}, {}, {}, PARTITION + 1
    )


async def reach(port: int) -> None:
    ways = Addresses("secret", None, 10.0)
    with pytest.raises(OSError, match="nobody serves partition 3"):
        await ways.connect(PARTITION, Greeted)
    ways.learn(owned(port))
    for _ in range(2):
        with pytest.raises(ConnectionRefusedError):
            await ways.connect(PARTITION, Greeted)
    with socket.create_server(("127.0.0.1", port)):
        for _ in range(2):
            (await ways.connect(PARTITION, Greeted)).abort()


def test_an_owner_that_cannot_be_reached_is_logged_once_with_the_reason(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(addresses, "NOTE_SECONDS", -1.0)
    port = free_port()
    with caplog.at_level("INFO"):
        asyncio.run(reach(port))
    refused, reached = caplog.records
    assert refused.getMessage() == "the owner of a partition cannot be reached"
    assert (refused.partition, refused.address) == (PARTITION, f"127.0.0.1:{port}")
    assert "Connection refused" in refused.reason or "Connect call failed" in refused.reason
    assert reached.getMessage() == "the owner of a partition can be reached again"
