"""A network that stops carrying bytes without a word: who listens or writes notices, says so, and goes on."""

import asyncio
import threading
from collections.abc import Iterator
from typing import Any

import pytest
from patience import wait_until
from proxy import Proxy, proxy
from server_process import Server, server_process

from dynhull_client import AsyncHullClient, HullClient, UnavailableError

PING = 0.4  # seconds
SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with server_process("--min-ping-interval", "0.001") as running:
        yield running


@pytest.fixture
def hull(server: Server, name: str) -> Iterator[HullClient]:
    """A client beside the network, and a keyed hull with a fence around its points."""
    with HullClient(server.address) as client:
        client.create_hull(name, keyed="str")
        client.put(name, ["first"], [[1, 1]])
        client.create_fence(name, area=SQUARE, subjects=name)
        yield client


def test_watches_notice_say_so_and_go_on(
    server: Server, hull: HullClient, connect: type[HullClient], name: str
) -> None:
    with proxy(server.address) as way, connect(way.address, ping_interval=PING) as far:
        watches = [far.watch(name), far.watch_fence(name, after=0)]
        arrived: list[list[Any]] = [[], []]
        following = [
            threading.Thread(target=each.extend, args=(watch,)) for each, watch in zip(arrived, watches, strict=True)
        ]
        for each in following:
            each.start()
        wait_until(lambda: [len(each) for each in arrived] == [1, 1])
        wait_until(lambda: [watch.lost for watch in watches] == [None, None])
        way.server = ""
        way.silence()
        hull.put(name, ["second"], [[2, 3]])
        wait_until(lambda: all(isinstance(watch.lost, UnavailableError) for watch in watches))
        assert [len(each) for each in arrived] == [1, 1]
        way.server = server.address
        wait_until(lambda: [len(each) for each in arrived] == [2, 2])
        wait_until(lambda: [watch.lost for watch in watches] == [None, None])
        for watch in watches:
            watch.close()
        for each in following:
            each.join()


def test_a_writer_sends_again_what_was_swallowed(
    server: Server, hull: HullClient, connect: type[HullClient], name: str
) -> None:
    with (
        proxy(server.address) as way,
        connect(way.address, ping_interval=PING) as far,
        far.writer(name, producer="ship") as writer,
    ):
        writer.put(keys=["a"], points=[[2, 2]])
        writer.flush()
        way.silence()
        writer.put(keys=["b"], points=[[3, 3]])
        writer.flush()
    assert hull.get_hull(name).info.points == 3
    assert hull.last_sequence(name, "ship") == 2


@pytest.mark.usefixtures("hull")
def test_a_call_ends_and_the_next_one_works(server: Server, connect: type[HullClient], name: str) -> None:
    with proxy(server.address) as way, connect(way.address, ping_interval=PING) as far:
        far.get_hull(name)
        way.silence()
        with pytest.raises(UnavailableError):  # it may have been applied
            far.put(name, ["second"], [[2, 3]])
        assert far.get_hull(name).revision == 1


def test_presence_is_reported_without_any_call(server: Server) -> None:
    async def follow(way: Proxy) -> None:
        async with AsyncHullClient(way.address, ping_interval=PING) as far:
            presence = far.presence()
            assert [await anext(presence) for _ in range(2)] == [False, True]
            way.server = ""
            way.silence()
            assert not await anext(presence)
            way.server = server.address
            assert await anext(presence)
            await far.close()
            assert [each async for each in presence] == []

    with proxy(server.address) as way:
        asyncio.run(follow(way))


@pytest.mark.parametrize("interval", [0, -1, float("nan")])
def test_an_interval_is_positive(connect: type[HullClient], interval: float) -> None:
    with pytest.raises(ValueError, match="ping_interval must be more than 0"):
        connect(ping_interval=interval)
