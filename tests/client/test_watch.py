"""A watch that reconnects by itself: its copy is exact after any failure of the connection or the server."""

import asyncio
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from client_kinds import loop
from metrics import measured, scrape
from patience import PATIENCE, turns, wait_until
from proxy import proxy
from server_process import server_process

from dynhull_client import (
    AsyncHullClient,
    Change,
    Deleted,
    HullClient,
    HullCopy,
    HullNotFoundError,
    Sketch,
    Snapshot,
    UnavailableError,
)

BATCHES = np.random.default_rng(6).normal(size=(200, 3, 2)) * np.linspace(1, 2, 200)[:, None, None]


class Follower:
    """A thread that follows a hull until it has a revision."""

    def __init__(self, watch, copy, revision):
        self.events = []
        self.watch = watch
        self._copy = copy
        self._revision = revision
        self._thread = threading.Thread(target=self._follow)
        self._thread.start()
        wait_until(lambda: self.events)

    def _follow(self):
        for event in self.watch:
            self.events.append(event)
            if self._copy.revision >= self._revision:
                return

    def join(self):
        self._thread.join()
        self.watch.close()

    def snapshots(self):
        return sum(isinstance(event, Snapshot) for event in self.events)


def test_it_continues_after_lost_connections(address: str, connect: type[HullClient], name: str) -> None:
    copy = HullCopy()
    with proxy(address) as way, connect(way.address) as watching, HullClient(address) as client:
        client.create_hull(name)
        follower = Follower(watching.watch(name, copy=copy), copy, len(BATCHES))
        for i, batch in enumerate(BATCHES, start=1):
            client.apply(name, insert=batch)
            if i % 40 == 0:
                way.cut()
        follower.join()
        assert copy.vertices.tolist() == client.get_hull(name).vertices.tolist()
        assert copy.points == 600
        assert follower.snapshots() == 1


def test_it_outlives_its_server(tmp_path: Path, connect: type[HullClient]) -> None:
    copy, data = HullCopy(), ("--data", str(tmp_path))
    with server_process(*data, killed=True) as first, proxy(first.address) as way, connect(way.address) as client:
        client.create_hull("a")
        follower = Follower(client.watch("a", copy=copy), copy, 2)
        client.apply("a", insert=[[1, 2]])
        wait_until(lambda: copy.revision >= 1)
        assert follower.watch.lost is None
        first.process.kill()
        wait_until(lambda: follower.watch.lost is not None)
        assert isinstance(follower.watch.lost, UnavailableError)
        with server_process(*data) as second:
            way.server = second.address
            wait_until(lambda: follower.watch.lost is None)  # though nothing has changed
            with HullClient(second.address) as writing:
                writing.apply("a", insert=[[3, 4]])
            follower.join()
    assert [event.revision for event in follower.events if not isinstance(event, Snapshot)] in ([2], [1, 2])
    assert copy.vertices.tolist() == [[1, 2], [3, 4]]


def test_it_starts_again_if_the_server_has_forgotten(connect: type[HullClient]) -> None:
    with server_process("--resume-bytes", "0") as server, connect(server.address) as client:
        client.create_hull("a")
        copy = HullCopy()
        for x, kind in ((1, Snapshot), (2, Snapshot)):
            client.apply("a", insert=[[x, x * x], [x, -x]])
            client.get_hull("a")
            with client.watch("a", copy=copy) as watch:
                assert isinstance(next(watch), kind)
        client.delete_hull("a")
        client.create_hull("a")
        with client.watch("a", copy=copy) as watch:
            assert isinstance(next(watch), Snapshot)
        assert (copy.revision, copy.points, len(copy.vertices)) == (0, 0, 0)


def test_a_sketch_continues_too(address: str, connect: type[HullClient], name: str) -> None:
    with proxy(address) as way, connect(way.address) as watching, HullClient(address) as client:
        client.create_hull(name)
        with watching.watch(name, directions=[[1, 0]]) as watch:
            assert isinstance(next(watch), Sketch)
            way.cut()
            client.apply(name, insert=[[5, 5]])
            while (event := next(watch)).revision < 1:
                pass
            assert event.vertices.tolist() == [[5, 5]]


def test_until_it_has_begun_it_is_tried_as_often_as_other_calls(
    address: str, connect: type[HullClient], name: str
) -> None:
    with proxy("") as way, connect(way.address, retries=1_000_000) as patient, HullClient(address) as client:
        client.create_hull(name)
        watch = patient.watch(name)
        events: list[object] = []
        thread = threading.Thread(target=lambda: events.append(next(watch)))
        thread.start()
        wait_until(lambda: watch.lost is not None)
        way.server = address
        thread.join()
        watch.close()
        assert isinstance(events[0], Snapshot)
        assert watch.lost is None


def test_what_it_does_not_wait_for(connect: type[HullClient], address: str, name: str) -> None:
    with connect("127.0.0.1:1") as nowhere, pytest.raises(UnavailableError):
        next(nowhere.watch("a"))
    with connect(address) as client:
        client.create_hull(name)
        watch = client.watch(name)
        assert isinstance(next(watch), Snapshot)
        client.delete_hull(name)
        with pytest.raises(HullNotFoundError):
            next(watch)
        with pytest.raises(ValueError, match="not both"):
            client.watch(name, copy=HullCopy(), resume=HullCopy())


def test_following_a_hull_that_is_deleted_and_created_again(address: str, connect: type[HullClient], name: str) -> None:
    copy = HullCopy()
    with proxy(address) as way, connect(way.address) as watching, HullClient(address) as client:
        watch = watching.watch(name, copy=copy, follow=True)
        creating = threading.Thread(target=lambda: (wait_until(lambda: watch.lost), client.create_hull(name)))
        creating.start()
        assert next(watch).revision == 0  # waited for the hull to come
        creating.join()
        client.apply(name, insert=[[1, 2], [3, 4]])
        assert isinstance(next(watch), Change)
        first = copy.uid
        client.delete_hull(name)
        assert next(watch) == Deleted(1)
        assert (copy.uid, copy.revision, copy.points, len(copy.vertices)) == ("", 0, 0, 0)
        client.create_hull(name)
        client.apply(name, insert=[[5, 6]])
        snapshot = next(watch)
        assert isinstance(snapshot, Snapshot)
        while copy.revision < 1:
            next(watch)
        assert copy.vertices.tolist() == [[5, 6]]
        assert watch.lost is None
        assert snapshot.uid not in ("", first)

        way.server = "127.0.0.1:1"
        way.cut()
        client.delete_hull(name)
        client.create_hull(name)
        way.server = address
        assert isinstance(next(watch), Deleted)
        assert isinstance(next(watch), Snapshot)
        assert (copy.revision, copy.points) == (0, 0)
        watch.close()


@pytest.mark.parametrize("shown", [{"layer": 2}, {"max_vertices": 4}, {"directions": [[1, 0]]}], ids=str)
def test_following_what_cannot_be_resumed(
    shown: dict[str, Any], address: str, connect: type[HullClient], name: str
) -> None:
    """A hull that was deleted and created again while there was no connection is another one."""
    with proxy(address) as way, connect(way.address) as watching, HullClient(address) as client:
        client.create_hull(name)
        client.apply(name, insert=[[1, 2], [3, 4]])
        with watching.watch(name, follow=True, **shown) as watch:
            assert next(watch).revision == 1
            way.server = ""
            way.cut()
            client.delete_hull(name)
            client.create_hull(name)
            way.server = address
            assert next(watch) == Deleted(1)
            assert next(watch).revision == 0


def test_following_from_a_copy_of_an_earlier_hull(address: str, connect: type[HullClient], name: str) -> None:
    copy = HullCopy()
    with connect(address) as client:
        client.create_hull(name)
        client.apply(name, insert=[[1, 2]])
        with client.watch(name, copy=copy) as watch:
            next(watch)
        client.delete_hull(name)
        client.create_hull(name)
        with client.watch(name, copy=copy, follow=True) as watch:
            assert next(watch) == Deleted(1)
            assert next(watch).revision == copy.revision == 0


def test_closing_ends_the_wait_for_a_hull(address: str, connect: type[HullClient], name: str) -> None:
    with connect(address) as client:
        watch = client.watch(name, follow=True)
        closing = threading.Thread(target=lambda: (wait_until(lambda: watch.lost), watch.close()))
        closing.start()
        assert list(watch) == []


def test_closing_ends_the_wait_for_a_server(connect: type[HullClient]) -> None:
    with server_process(killed=True) as server, connect(server.address) as client:
        client.create_hull("a")
        watch = client.watch("a")
        next(watch)
        server.process.kill()
        closing = threading.Thread(target=lambda: (wait_until(lambda: watch.lost), watch.close()))
        closing.start()
        assert list(watch) == []


def test_a_cancelled_wait_does_not_end_the_watch(address: str, name: str) -> None:
    async def follow() -> HullCopy:
        copy = HullCopy()
        async with AsyncHullClient(address) as client:
            await client.create_hull(name)
            async with client.watch(name, copy=copy) as watch:
                assert isinstance(await anext(watch), Snapshot)
                waiting = asyncio.ensure_future(anext(watch))
                await turns()
                waiting.cancel()
                with pytest.raises(asyncio.CancelledError):
                    await waiting
                await client.apply(name, insert=[[1, 2]])
                assert isinstance(await anext(watch), Change)
        return copy

    copy = asyncio.run_coroutine_threadsafe(follow(), loop()).result()
    assert copy.vertices.tolist() == [[1, 2]]


def test_waits_that_are_too_short_get_the_events_in_the_end(address: str, name: str) -> None:
    """A wait that is cancelled, even before its call is sent, neither ends the watch nor makes it begin again."""

    async def follow() -> HullCopy:
        copy = HullCopy()
        async with asyncio.timeout(PATIENCE), AsyncHullClient(address) as client:
            await client.create_hull(name)
            await client.apply(name, insert=[[1, 2]])
            async with client.watch(name, copy=copy) as watch:
                while copy.revision < 1:
                    wait = asyncio.ensure_future(anext(watch))
                    await asyncio.sleep(0)
                    wait.cancel()
                    with suppress(asyncio.CancelledError):
                        await wait
        return copy

    copy = asyncio.run_coroutine_threadsafe(follow(), loop()).result()
    assert copy.vertices.tolist() == [[1, 2]]


def test_watches_end_that_were_left_in_the_middle_of_a_wait() -> None:
    """Though their readers have not closed them."""

    async def follow(client: AsyncHullClient) -> None:
        async for _ in client.watch("a"):
            pass

    async def leave(address: str, watchers: Callable[[], float]) -> None:
        async with AsyncHullClient(address) as client:
            await client.create_hull("a")
            readers = [asyncio.create_task(follow(client)) for _ in range(3)]
            await asyncio.to_thread(wait_until, lambda: watchers() == 3)
            while readers:
                reader = readers.pop()
                reader.cancel()
                await asyncio.wait([reader])
            del reader
            await asyncio.to_thread(wait_until, lambda: watchers() == 0)
            watch = client.watch("a")
            await anext(watch)
            del watch  # between two reads
            await asyncio.to_thread(wait_until, lambda: watchers() == 0)

    with measured() as (server, metrics):
        work = leave(server.address, lambda: scrape(metrics)["dynhull_watchers"])
        asyncio.run_coroutine_threadsafe(work, loop()).result()
